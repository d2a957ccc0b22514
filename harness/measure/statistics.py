"""Judging pixels that are noisy: means of many, the chance of a false alarm, and of a false pass.

A sampled check passes where two things are shown. No mean is off by more than chance explains: the
chance of a false alarm is `SUITE_LEVEL` over a whole suite (Šidák 1967). And every mean is within
`MARGIN` of what is expected for sure, not just "not significantly different": two one-sided tests
(Schuirmann 1987), which as an intersection-union test need no correction for their number (Berger
1982). A check whose samples cannot show that is no pass but an ERROR that says how many it needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float
from harness.measure.comparison import Comparison, Unmeasurable

# A suite of up to so many sampled checks cries wolf with this chance, over all of them. The number
# is fixed, so that a check's verdict does not depend on which others are run beside it.
SUITE_LEVEL, SUITE_CHECKS = 0.01, 1000
FALSE_ALARM = 1 - (1 - SUITE_LEVEL) ** (1 / SUITE_CHECKS)
# Means that differ by this share of the light that is sent count as the same. A mean that is a
# margin off is called the same with the chance UNSURE; one that is right is shown to be with POWER.
MARGIN, UNSURE, POWER = 0.01, 0.01, 0.99
# Pixels per bin: enough for the mean's error to be normal.
BIN = 256
MOST_MEANS = 1000


@dataclass(frozen=True)
class Noise:
    """How a renderer samples, and how it is judged: `level` is the chance of a false alarm of one
    check over all of its means.
    """

    samples: int
    level: float = FALSE_ALARM
    margin: float = MARGIN


def per_test(level: float, tests: int) -> float:
    """The level of one of `tests` tests that together have `level` (Šidák 1967)."""
    return float(-np.expm1(np.log1p(-level) / tests))


def samples_needed(pixels: int = BIN, margin: float = MARGIN, variance: float = 0.25) -> int:
    """Samples per pixel with which a mean over `pixels` is shown to be right, if it is, by POWER.

    `variance` is that of a sample: of a path that is chosen with probability p, p (1 - p) <= 1/4.
    """
    return int(np.ceil(variance / pixels * (_quantiles(MOST_MEANS) / margin) ** 2))


def _quantiles(means: int) -> float:
    """Standard errors that must fit into the margin, so that `means` means all pass by POWER."""
    normal = NormalDist()
    return -normal.inv_cdf(UNSURE) - normal.inv_cdf(per_test(1 - POWER, means))


def binned(value: Float, true: Float, order: NDArray[np.intp], noise: Noise) -> Comparison:
    """`value` against `true`, each (m, 3), in means over bins of consecutive pixels of `order`.

    Each bin's standard error comes from the scatter of its own pixels, so nothing has to be known
    of the renderer's sampling. Judged by Student's t. Raises Unmeasurable where power is lacking.
    """
    from scipy.special import stdtrit

    if len(order) < BIN:
        raise Unmeasurable(f"{len(order)} pixels are too few: a bin needs {BIN}")
    bins = np.array_split(order, len(order) // BIN)
    residual = np.array([(value[b] - true[b]).mean(axis=0) for b in bins])
    scatter = np.array([(value[b] - true[b]).std(axis=0, ddof=1) / np.sqrt(len(b)) for b in bins])
    limit = -float(stdtrit(BIN - 1, per_test(noise.level, residual.size) / 2))
    if not np.isfinite(residual).all():
        raise Unmeasurable("a measured pixel is not finite")
    # Where all samples of a bin fell alike it shows no scatter, though one more sample of its
    # pixels could have fallen otherwise.
    standard = np.maximum(scatter, 1 / (BIN * noise.samples))
    error = limit * standard + skewness(limit, BIN * noise.samples)
    within = bool(np.all(np.abs(residual) <= error))
    margin = noise.margin * float(np.max(np.abs(true[order]), initial=1.0))
    k, channel = np.unravel_index(int((np.abs(residual) / error).argmax()), residual.shape)
    if within:
        _require_power(np.abs(residual), standard, margin, BIN - 1, noise.samples)
    return Comparison(
        float(value[bins[k], channel].mean()),
        float(true[bins[k], channel].mean()),
        float(error[k, channel]),
        within,
        f"{limit:.2f} standard errors of a bin's mean: Student's t with {BIN - 1} degrees of "
        f"freedom, level {noise.level:.2g} over all {residual.size} means; all of them are within "
        f"{margin:.2g} of what is expected at a level of {UNSURE:g}",
        detail={
            "max": float(np.abs(residual).max()),
            "rms": float(np.sqrt((residual**2).mean())),
            "bins": len(bins),
            "rays": len(order),
            "samples": noise.samples,
            "margin": margin,
        },
    )


def skewness(limit: float, samples: int, largest: float = 1.0) -> float:
    """What the skewness of a mean of `samples` can add to `limit` standard errors.

    Cornish and Fisher's first term is (z^2 - 1) / 6 times the skewness; of samples between 0 and
    `largest` with variance s^2 that of their mean is at most largest / (s sqrt(samples)).
    """
    return (limit**2 - 1) / 6 * largest / samples


def _require_power(
    gap: Float, standard: Float, margin: float, freedom: float, samples: int
) -> None:
    """Raises Unmeasurable where not all means are shown to be within `margin` of theirs.

    Two one-sided tests are one: |gap| + t standard <= margin, with t for `UNSURE`.
    """
    from scipy.special import stdtrit

    if margin <= 0 or np.all(gap - stdtrit(freedom, UNSURE) * standard <= margin):
        return
    factor = (float(standard.max()) * _quantiles(gap.size) / margin) ** 2
    if factor <= 1:  # enough samples, but a mean is off by half the margin
        factor = float(
            (_quantiles(gap.size) * standard / np.maximum(margin - gap, margin / 9)).max() ** 2
        )
    needed = max(samples + 1, int(np.ceil(samples * factor)))
    raise Unmeasurable(
        f"too few samples to tell whether means are within {margin:.2g} of what is expected: it "
        f"has {samples} per pixel and needs {needed}"
    )


# --- pictures -------------------------------------------------------------------------------------

# Sides of the regions whose means are compared, in pixels; the largest must be shown to be the same
# within PICTURE_MARGIN of the brightest light. Regions find what single pixels hide, and name where
# it is, which a share of pixels that may differ does not.
REGIONS = (1, 4, 16)
PICTURE_MARGIN = 0.03


@dataclass(frozen=True)
class Moments:
    """Per pixel and channel (H, W, 3) a mean and the variance of that mean, known from `freedom`
    degrees of freedom. `slack` is a bound on its error that is no noise.
    """

    mean: Float
    variance: Float
    freedom: float
    slack: Float

    @classmethod
    def of_two(cls, first: NDArray[np.float32], second: NDArray[np.float32]) -> Moments:
        """Of two renders with independent seeds."""
        a, b = first.astype(np.float64), second.astype(np.float64)
        return cls((a + b) / 2, (a - b) ** 2 / 4, 1.0, np.zeros_like(a))


@dataclass(frozen=True)
class RegionTest:
    """The region that comes closest to its limit, or oversteps it most: `side` pixels wide, at (x,
    y) from the top left. `gap` is how far apart the means are, `limit` how far they may be.
    """

    gap: float
    limit: float
    side: int
    x: int
    y: int
    channel: int


def compare_regions(
    a: Moments, b: Moments, level: float, largest: float, samples: int
) -> RegionTest:
    """Welch's test of all regions of all sizes, at `level` over all of them together.

    `largest` is the brightest light that a sample can bring, `samples` how many a pixel has.
    """
    from scipy.special import stdtrit

    tests = sum(_blocks(a.mean, side).size for side in REGIONS)
    found = []
    for side in REGIONS:
        gap = np.abs(_blocks(a.mean - b.mean, side))
        n = side**2
        va, vb = _blocks(a.variance, side) / n, _blocks(b.variance, side) / n
        freedom = _welch(va, vb, a.freedom * n, b.freedom * n)
        z = -stdtrit(freedom, per_test(level, tests) / 2)
        limit = z * np.sqrt(va + vb) + skewness(float(z.min()), n * samples, largest)
        # Where all samples fell alike, one more of them could have fallen otherwise.
        limit = limit + _blocks(a.slack + b.slack, side) + z * largest / (n * samples)
        y, x, channel = np.unravel_index(int((gap / limit).argmax()), gap.shape)
        found.append(
            RegionTest(float(gap[y, x, channel]), float(limit[y, x, channel]), side,
                       int(x) * side, int(y) * side, int(channel))
        )  # fmt: skip
    worst = max(found, key=lambda r: r.gap / r.limit)
    if worst.gap <= worst.limit:
        side = REGIONS[-1]
        gap, n = np.abs(_blocks(a.mean - b.mean, side)), side**2
        standard = np.sqrt(_blocks(a.variance + b.variance, side) / n)
        margin = PICTURE_MARGIN * largest + float(_blocks(a.slack + b.slack, side).max())
        _require_power(gap, standard, margin, n * (a.freedom + b.freedom), samples)
    return worst


def _welch(va: Float, vb: Float, fa: float, fb: float) -> Float:
    """Welch and Satterthwaite's degrees of freedom of a difference of means."""
    with np.errstate(divide="ignore", invalid="ignore"):
        freedom = (va + vb) ** 2 / (va**2 / fa + vb**2 / fb)
    return np.asarray(np.where(np.isfinite(freedom), np.maximum(freedom, 1.0), min(fa, fb)))


def _blocks(x: Float, side: int) -> Float:
    """Means over blocks of side x side pixels; what is left over at the edges does not count."""
    h, w = x.shape[0] // side, x.shape[1] // side
    blocks = x[: h * side, : w * side].reshape(h, side, w, side, -1)
    return np.asarray(blocks.mean(axis=(1, 3)))
