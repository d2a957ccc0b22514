"""Two pictures of the same scene: how far apart they are, and how far apart they may be.

A pixel tells little where a tiny shift of its ray changes everything, as at the edge of a checker
cell seen through a ball. So a reference picture is rendered again with its camera shifted by the
renderers' own geometric error: what changes by more than `GRAZING` grazes an edge and is counted
apart, and what changes by less adds to the tolerance of its pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from harness.expected import Float
from harness.measure import images
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.images import Mask, Pixels
from harness.measure.observables import Observable
from harness.measure.probe_truth import ROUNDINGS
from harness.measure.statistics import (
    FALSE_ALARM,
    PICTURE_MARGIN,
    REGIONS,
    UNSURE,
    Moments,
    compare_regions,
)

GRAZING = 1e-3
# More grazing pixels than this share would hide a wrong picture behind them. They are found on the
# helper's pictures alone, so this judges the scene: no renderer can hide by being wrong. The most
# crowded rim of a ball has 2.8%; docs/decisions/0009 derives what a share can hide.
MOST_GRAZING = 0.05
SSIM_FLOOR = 1e-4


def geometric_error(extent: float, interfaces: int, epsilon: float) -> float:
    """How far the ray of a renderer of relative precision `epsilon` may stray, units."""
    return ROUNDINGS * (interfaces + 1) * epsilon * extent


def sensitivity(picture: Pixels, shifted: Sequence[Pixels]) -> Float:
    """(H, W) the largest change of any channel over the shifted pictures."""
    return np.asarray(np.max([images.difference(picture, other) for other in shifted], axis=0))


def area_error(center: Pixels, samples_a_side: int) -> Float:
    """(H, W, 3) how far the mean of n x n regular samples may be from the mean over a pixel's area.

    An edge through a pixel parts it into two levels, which differ by at most the contrast of the
    neighbourhood; regular samples find its place to within half their distance.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    near = (3, 3, 1)
    contrast = maximum_filter(center, near).astype(np.float64) - minimum_filter(center, near)
    return np.asarray(contrast / (2 * samples_a_side))


@dataclass(frozen=True)
class PicturePair:
    """Two pictures without noise. `tolerance` (H, W) bounds their difference, pixel by pixel."""

    a: Pixels
    b: Pixels
    tolerance: Float
    grazing: Mask

    def __post_init__(self) -> None:
        if self.a.shape != self.b.shape:
            raise Unmeasurable(f"pictures differ in size: {self.a.shape} and {self.b.shape}")
        if not (np.isfinite(self.a).all() and np.isfinite(self.b).all()):
            raise Unmeasurable("a picture holds values that are not finite")
        if self.data_range <= 0:
            raise Unmeasurable("both pictures are black")

    @cached_property
    def difference(self) -> Float:
        """(H, W)."""
        return images.difference(self.a, self.b)

    @property
    def data_range(self) -> float:
        """The brightest value of either picture; SSIM and PSNR are relative to it."""
        return float(max(self.a.max(), self.b.max()))

    def compare(self, observable: Observable) -> Comparison:
        """Raises Unmeasurable for observables that are none of pictures."""
        keep = ~self.grazing
        crowded = ""
        if self.grazing.mean() > MOST_GRAZING:
            crowded = (
                f"{self.grazing.mean():.1%} of the pixels graze an edge, too many to leave out"
            )
        match observable:
            case Observable.SSIM:
                value = images.ssim(self.a, self.b, self.data_range)
                # In a flat window rounding noise of variance v costs v / (v + C2), where SSIM's
                # C2 is (0.03 range)^2 (Wang et al. 2004).
                noise = float(np.mean(self.tolerance[keep] ** 2)) / (0.03 * self.data_range) ** 2
                limit = SSIM_FLOOR + noise
                detail = self._counts() | {"data_range": self.data_range}
                return Comparison(
                    value, 1.0, limit, value >= 1 - limit,
                    "1e-4, which pictures without noise of analytic scenes must reach, and what "
                    "the pixels' tolerances cost in flat windows",
                    crowded, detail,
                )  # fmt: skip
            case Observable.RMSE:
                value = images.rmse(self.a, self.b, keep)
                limit = float(np.sqrt(np.mean(self.tolerance[keep] ** 2)))
                detail = self._counts()
                psnr = images.psnr(self.a, self.b, keep, self.data_range)
                detail["psnr_db"] = psnr if np.isfinite(psnr) else "infinite"
                return Comparison(
                    value, 0.0, limit, value <= limit, "root mean square of the pixels' tolerances",
                    crowded, detail,
                )  # fmt: skip
            case Observable.MAX_DIFFERENCE:
                return self._largest(
                    self.difference, self.tolerance, crowded,
                    "quanta of both pictures + light cut by weight + roundings of weights + change "
                    "of the pixel when the camera moves by the renderers' geometric error",
                )  # fmt: skip
            case Observable.P999_DIFFERENCE:
                value = float(np.quantile(self.difference[keep], 0.999))
                limit = float(np.quantile(self.tolerance[keep], 0.999))
                return Comparison(
                    value, 0.0, limit, value <= limit, "the same percentile of the tolerances",
                    crowded, self._counts(),
                )  # fmt: skip
            case Observable.DELTA_E:
                return self._largest(
                    images.delta_e(self.a, self.b), images.LAB_SLOPE * self.tolerance, crowded,
                    "pixel's tolerance x steepest slope of CIE Lab",
                )  # fmt: skip
        raise Unmeasurable(f"{observable} is not an observable of two pictures")

    def _largest(
        self, difference: Float, tolerance: Float, crowded: str, derivation: str
    ) -> Comparison:
        """The pixel that comes closest to its limit, of those that graze no edge."""
        ratio = np.where(self.grazing, -np.inf, difference / tolerance)
        y, x = np.unravel_index(int(ratio.argmax()), ratio.shape)
        detail = self._counts() | {
            "max": float(difference[~self.grazing].max()),
            "worst_pixel_x": int(x),
            "worst_pixel_y": int(y),
        }
        return Comparison(
            float(difference[y, x]), 0.0, float(tolerance[y, x]), bool(ratio[y, x] <= 1),
            derivation, crowded, detail,
        )  # fmt: skip

    def _counts(self) -> dict[str, float | int | str]:
        grazing = self.difference[self.grazing]
        return {
            "grazing_pixels": int(self.grazing.sum()),
            "grazing_share": float(self.grazing.mean()),
            "max_at_grazing": float(grazing.max()) if grazing.size else 0.0,
            "max_difference": float(self.difference[~self.grazing].max()),
        }


@dataclass(frozen=True)
class SampledPicture:
    """A picture by a renderer that samples, twice with independent seeds, and what it estimates.

    `reference` is the mean over each pixel's area of a picture without noise, of `samples_a_side`
    squared samples, and `center` the same picture at pixel centres. `samples` is how many of its
    own a pixel of one seed has.
    """

    first: Pixels
    second: Pixels
    reference: Pixels
    center: Pixels
    samples_a_side: int
    samples: int

    def compare(self, observable: Observable) -> Comparison | None:
        """None for observables that noise leaves without a bound."""
        if not all(np.isfinite(p).all() for p in (self.first, self.second)):
            raise Unmeasurable("a picture holds values that are not finite")
        everything = np.ones(self.first.shape[:2], bool)
        data_range = float(max(self.first.max(), self.reference.max()))
        match observable:
            case Observable.SSIM:
                value = images.ssim(self.first, self.reference, data_range)
                own = images.ssim(self.first, self.second, data_range)
                return Comparison(
                    value, 1.0, 1 - own, value >= own,
                    "its own sampling error: two seeds of it agree no better",
                    detail={"ssim_of_two_seeds": own},
                )  # fmt: skip
            case Observable.RMSE:
                value = images.rmse(self.first, self.reference, everything)
                own = images.rmse(self.first, self.second, everything) / np.sqrt(2)
                left = float(np.sqrt(np.mean(area_error(self.center, self.samples_a_side) ** 2)))
                # The variance of N pixels is known to sqrt(2 / N) of itself, times the kurtosis
                # of a lobe-sampled pixel, of order 10; five standard errors of that.
                spread = 1 + 5 * np.sqrt(2 * 10 / self.first.size) / 2
                limit = float(np.hypot(own * spread, left))
                return Comparison(
                    value, 0.0, limit, value <= limit,
                    "its own sampling error, from two seeds, and the error of the area means",
                    detail={"own_sampling_rmse": float(own), "reference_rmse": float(left)},
                )  # fmt: skip
            case Observable.MAX_DIFFERENCE:
                return self._regions(data_range)
        return None

    def _regions(self, data_range: float) -> Comparison:
        """The largest difference of the means of regions of any size, by Welch's test."""
        slack = area_error(self.center, self.samples_a_side)
        exact = Moments(self.reference.astype(np.float64), np.zeros_like(slack), 1.0, slack)
        sampled = Moments.of_two(self.first, self.second)
        found = compare_regions(sampled, exact, FALSE_ALARM, data_range, 2 * self.samples)
        return Comparison(
            found.gap, 0.0, found.limit, found.gap <= found.limit,
            f"Welch's t of the means of regions of {', '.join(map(str, REGIONS))} pixels a side, "
            f"level {FALSE_ALARM:.2g} over all of them, and the error of the area means; regions "
            f"of {REGIONS[-1]} pixels are within {PICTURE_MARGIN:g} of the brightest light at a "
            f"level of {UNSURE:g}",
            detail={"region": found.side, "worst_pixel_x": found.x, "worst_pixel_y": found.y,
                    "channel": "rgb"[found.channel], "samples": 2 * self.samples},
        )  # fmt: skip
