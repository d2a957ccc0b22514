"""From samples to pixels: how the samples in and around a pixel are weighed.

A film of W x H pixels with `side` samples a side is one of (side W) x (side H) samples, each at the
middle of its stratum. `side` 1 is the pixel's centre, and nothing is averaged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracer.errors import SceneError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Box:
    """The mean over the pixel's own area."""

    reach = 0.5  # pixels from the centre

    def weight(self, distance: Floats) -> Floats:
        return np.ones_like(distance)


@dataclass(frozen=True)
class Gaussian:
    """``exp(-d^2 / 2 sigma^2)``, cut at four `sigma` and lowered there to 0; `sigma` in pixels.

    Separable, and what Mitsuba and pbrt call a Gaussian filter.
    """

    sigma: float = 0.5

    def __post_init__(self) -> None:
        if not 0.0 < self.sigma <= 16.0:
            raise SceneError(f"a Gaussian filter needs 0 < sigma <= 16 pixels, not {self.sigma}")

    @property
    def reach(self) -> float:
        return 4.0 * self.sigma

    def weight(self, distance: Floats) -> Floats:
        at_edge = math.exp(-0.5 * (self.reach / self.sigma) ** 2)
        return np.maximum(0.0, np.exp(-0.5 * (distance / self.sigma) ** 2) - at_edge)


Filter = Box | Gaussian


@dataclass(frozen=True)
class Sampling:
    """`side` x `side` samples per pixel, weighed by `filter`. The default is the pixel's centre."""

    side: int = 1
    filter: Filter = Box()

    def __post_init__(self) -> None:
        if not 1 <= self.side <= 64:
            raise SceneError(f"a pixel has 1 to 64 samples a side, not {self.side}")


def reach(sampling: Sampling) -> int:
    """How many samples beyond a pixel's own, on each side, count in it."""
    return max(0, math.ceil((sampling.filter.reach - 0.5) * sampling.side - 0.5))


def weights(
    sampling: Sampling, begin: int, end: int, pixels: int
) -> tuple[Floats, NDArray[np.int64]]:
    """What samples count in pixels [begin, end) of `pixels` along one axis: (n, k), and which (n,).

    The k-th column is for the sample that many behind the named one. Rows sum to 1: at the film's
    border, where samples are missing, the others count more.
    """
    side, beyond = sampling.side, reach(sampling)
    offsets = np.arange(-beyond, side + beyond)
    first = np.arange(begin, end) * side - beyond
    where = first[:, None] + np.arange(len(offsets))
    there = (where >= 0) & (where < pixels * side)
    distance = np.abs((offsets + 0.5) / side - 0.5)
    table = np.where(there, sampling.filter.weight(distance), 0.0)
    return table / table.sum(axis=1, keepdims=True), first


def developed(
    samples: Floats, sampling: Sampling, first: int, begin: int, end: int, height: int
) -> Floats:
    """Rows [begin, end) of the pixels (H, W, ...); row 0 of the samples is row `first` of all."""
    table, start = weights(sampling, begin, end, height)
    rows = _weighed(samples, table, start - first)
    width = samples.shape[1] // sampling.side
    table, start = weights(sampling, 0, width, width)
    return np.swapaxes(_weighed(np.swapaxes(rows, 0, 1), table, start), 0, 1)


def _weighed(samples: Floats, table: Floats, start: NDArray[np.int64]) -> Floats:
    result = np.zeros((len(table), *samples.shape[1:]))
    for k in range(table.shape[1]):
        at = np.clip(start + k, 0, len(samples) - 1)  # those outside weigh nothing
        result += table[:, k].reshape(-1, *[1] * (samples.ndim - 1)) * samples[at]
    return result
