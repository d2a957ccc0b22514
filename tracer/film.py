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


def weights(pixels: int, sampling: Sampling) -> tuple[Floats, NDArray[np.int64]]:
    """Along one axis: what each sample counts in a pixel, and where they begin; (P, n) and (P,).

    Rows sum to 1. At the film's border, where samples are missing, the others count more.
    """
    side = sampling.side
    reach = math.ceil(sampling.filter.reach * side - 0.5)
    offsets = np.arange(-reach, side + reach)
    if isinstance(sampling.filter, Box):
        offsets = np.arange(side)
    distance = np.abs((offsets + 0.5) / side - 0.5)
    first = np.arange(pixels) * side + offsets[0]
    where = first[:, None] + np.arange(len(offsets))
    inside = (where >= 0) & (where < pixels * side)
    table = np.where(inside, sampling.filter.weight(distance), 0.0)
    return table / table.sum(axis=1, keepdims=True), first


def developed(samples: Floats, sampling: Sampling) -> Floats:
    """The pixels (H, W, ...) of samples (side H, side W, ...)."""
    if sampling.side == 1 and isinstance(sampling.filter, Box):
        return samples
    for axis in (0, 1):
        samples = _along(samples, axis, sampling)
    return samples


def _along(samples: Floats, axis: int, sampling: Sampling) -> Floats:
    moved = np.moveaxis(samples, axis, 0)
    table, first = weights(len(moved) // sampling.side, sampling)
    result = np.zeros((len(table), *moved.shape[1:]))
    for k in range(table.shape[1]):
        at = np.clip(first + k, 0, len(moved) - 1)  # those outside weigh nothing
        result += table[:, k].reshape(-1, *[1] * (moved.ndim - 1)) * moved[at]
    return np.moveaxis(result, 0, axis)
