"""Two pictures of the same scene: how far apart they are, and how far apart they may be.

A pixel tells little where a tiny shift of its ray changes everything, as at the edge of a checker
cell seen through a ball. So a reference picture is rendered again with its camera shifted by the
renderers' own geometric error: what changes by more than `GRAZING` grazes an edge, and may show
anything that is seen around it, but nothing else. What changes by less adds to the tolerance of its
pixel.
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
# Somewhere in each square of so many pixels a side, the scale at which sampled pictures are
# compared next to that of pixels, one must graze no edge: then no fault of that size can hide
# behind edges. They are found on the helper's pictures alone, so this judges the scene, and no
# renderer can hide by being wrong. The largest square of the catalogue, at a ball's rim, has 2
# (decision 0022).
SQUARE = REGIONS[1]
SSIM_FLOOR = 1e-4


def geometric_error(extent: float, interfaces: int, epsilon: float) -> float:
    """How far the ray of a renderer of relative precision `epsilon` may stray, units."""
    return ROUNDINGS * (interfaces + 1) * epsilon * extent


def sensitivity(picture: Pixels, shifted: Sequence[Pixels]) -> Float:
    """(H, W) the largest change of any channel over the shifted pictures."""
    return np.asarray(np.max([images.difference(picture, other) for other in shifted], axis=0))


def contrast(pictures: Sequence[Pixels]) -> Float:
    """(H, W, 3) how far apart the values of a pixel and its eight neighbours are in `pictures`."""
    from scipy.ndimage import maximum_filter, minimum_filter

    near = (3, 3, 1)
    highest = np.max([maximum_filter(p, near) for p in pictures], axis=0).astype(np.float64)
    return np.asarray(highest - np.min([minimum_filter(p, near) for p in pictures], axis=0))


def largest_square(mask: Mask) -> int:
    """The side of the largest square of pixels that are all in `mask` (H, W)."""
    from scipy.ndimage import binary_erosion

    side = 0
    while side < min(mask.shape) and binary_erosion(mask, np.ones((side + 1,) * 2)).any():
        side += 1
    return side


def area_error(center: Pixels, samples_a_side: int) -> Float:
    """(H, W, 3) how far the mean of n x n regular samples may be from the mean over a pixel's area.

    An edge through a pixel parts it into two levels, which differ by at most the contrast of the
    neighbourhood; regular samples find its place to within half their distance.
    """
    return np.asarray(contrast([center]) / (2 * samples_a_side))


@dataclass(frozen=True)
class PicturePair:
    """Two pictures without noise.

    `tolerance` (H, W) bounds their difference, pixel by pixel, but for those that are `grazing` an
    edge: `around` (H, W) bounds theirs, the contrast of what is seen there.
    """

    a: Pixels
    b: Pixels
    tolerance: Float
    grazing: Mask
    around: Float

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
        keep, fault = ~self.grazing, self._fault()
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
                    fault, detail,
                )  # fmt: skip
            case Observable.RMSE:
                value = images.rmse(self.a, self.b, keep)
                limit = float(np.sqrt(np.mean(self.tolerance[keep] ** 2)))
                detail = self._counts()
                psnr = images.psnr(self.a, self.b, keep, self.data_range)
                detail["psnr_db"] = psnr if np.isfinite(psnr) else "infinite"
                return Comparison(
                    value, 0.0, limit, value <= limit, "root mean square of the pixels' tolerances",
                    fault, detail,
                )  # fmt: skip
            case Observable.MAX_DIFFERENCE:
                return self._largest(
                    self.difference, self.tolerance, fault,
                    "quanta of both pictures + light cut by weight + roundings of weights + change "
                    "of the pixel when the camera moves by the renderers' geometric error",
                )  # fmt: skip
            case Observable.P999_DIFFERENCE:
                value = float(np.quantile(self.difference[keep], 0.999))
                limit = float(np.quantile(self.tolerance[keep], 0.999))
                return Comparison(
                    value, 0.0, limit, value <= limit, "the same percentile of the tolerances",
                    fault, self._counts(),
                )  # fmt: skip
            case Observable.DELTA_E:
                return self._largest(
                    images.delta_e(self.a, self.b), images.LAB_SLOPE * self.tolerance, fault,
                    "pixel's tolerance x steepest slope of CIE Lab",
                )  # fmt: skip
        raise Unmeasurable(f"{observable} is not an observable of two pictures")

    def _largest(
        self, difference: Float, tolerance: Float, fault: str, derivation: str
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
            derivation, fault, detail,
        )  # fmt: skip

    def _fault(self) -> str:
        """What no tolerance excuses: a pixel at an edge that shows nothing of what is there, or
        edges that leave a whole square without a pixel to be sure of.
        """
        side = largest_square(self.grazing)
        if side >= SQUARE:
            return f"a square of {side} x {side} pixels is all edges: a fault could hide in it"
        excess = np.where(self.grazing, self.difference - self.around - self.tolerance, -np.inf)
        y, x = np.unravel_index(int(excess.argmax()), excess.shape)
        if excess[y, x] <= 0:
            return ""
        return (
            f"at ({x}, {y}), which grazes an edge, they differ by {self.difference[y, x]:.3g}, and "
            f"what is seen around it by no more than {self.around[y, x]:.3g}"
        )

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
                # As of two pictures without noise: two seeds of one that has none are the same.
                left = float(np.mean(area_error(self.center, self.samples_a_side) ** 2))
                limit = max(1 - own, SSIM_FLOOR) + left / (0.03 * data_range) ** 2
                return Comparison(
                    value, 1.0, limit, value >= 1 - limit,
                    "its own sampling error: two seeds of it agree no better; at least 1e-4, and "
                    "what the error of the area means costs in flat windows",
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
