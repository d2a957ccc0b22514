"""The truth of light over whole pixels, for renderers that sample areas and not their centres.

Near total reflection light changes so fast that the mean over a pixel is not what its centre shows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float, lengths
from harness.measure.probe_truth import ProbeTruth, kept
from harness.measure.rays import RayMeasurement
from harness.renderers.base import Rays, Status
from harness.truth.camera import rays_through
from harness.truth.paths import ClosedForm, Landing, TruePaths

# Where rays go through a pixel along either side, from 0 to 1, and what share each of them has.
# Gauss's and Legendre's rule of three is exact for polynomials of the fifth degree. It knows
# nothing of the root with which light goes out where total reflection begins: there, the midpoints
# of eight.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
SMOOTH = (0.5 + _NODES / 2, _WEIGHTS / 2)
ROOTED = ((np.arange(8) + 0.5) / 8, np.full(8, 1 / 8))
# How much farther from the centre a pixel's border is than the outermost of three.
TO_BORDER = float(0.5 / (SMOOTH[0].max() - 0.5))


@dataclass(frozen=True)
class Grid:
    """The probe's path followed by as many rays in each of the pixels `rows` (k,) as there are
    `shares`; those of one pixel stand together.
    """

    rows: NDArray[np.intp]
    rays: Rays
    paths: TruePaths
    landing: Landing
    shares: Float

    def by_pixel(self, values: NDArray[Any]) -> NDArray[Any]:
        """(k, shares, …) of `values`, which have one for each ray."""
        return values.reshape(len(self.rows), len(self.shares), *values.shape[1:])


@dataclass(frozen=True)
class PixelAreas:
    """`all_of_them` has rays in each of the m pixels, `rooted` more where total reflection begins.

    `whole` (m,) are pixels of which all rays end alike: none lands beside the plane or goes another
    way while others land on it. Total reflection is no other way: light fades into it.
    """

    all_of_them: Grid
    rooted: Grid
    whole: NDArray[np.bool_]

    def mean(self, light: Callable[[Grid], Float]) -> Float:
        """(m, 3) means over pixels of `light`, which tells (3,) of each of a grid's rays."""
        means = np.empty((len(self.whole), 3))
        for grid in (self.all_of_them, self.rooted):
            if len(grid.rows):
                blocks = grid.by_pixel(light(grid))
                means[grid.rows] = np.einsum("ksc,s->kc", blocks, grid.shares)
        return means


@dataclass(frozen=True)
class MeanLight:
    """(m, 3) means over pixels of the true light, and which of the m pixels are `whole`."""

    level: Float
    whole: NDArray[np.bool_]


def pixel_areas(truth: ProbeTruth) -> PixelAreas:
    """Of the truth's own film."""
    m = len(truth.grazing)
    all_of_them = _grid(truth, np.arange(m), SMOOTH)
    rooted = _grid(truth, np.flatnonzero(_begins_total_reflection(truth, all_of_them)), ROOTED)
    whole = np.empty(m, bool)
    for grid in (all_of_them, rooted):
        other = (grid.landing.status != Status.HIT) & (grid.paths.status != Status.TIR)
        alike = grid.by_pixel(other)
        whole[grid.rows] = alike.all(axis=1) | ~alike.any(axis=1)
    return PixelAreas(all_of_them, rooted, whole)


def _grid(truth: ProbeTruth, rows: NDArray[np.intp], rule: tuple[Float, Float]) -> Grid:
    places, shares = rule
    form, width = ClosedForm(truth.scene), truth.scene.film.width
    down, across = (
        (corner[:, None] + inside.ravel()).ravel()
        for corner, inside in zip(
            np.divmod(rows, width), np.meshgrid(places, places, indexing="ij"), strict=True
        )
    )
    rays = rays_through(truth.scene, across, down)
    paths = form.follow(rays, truth.path)
    landing = form.land(paths, truth.planes[0])
    return Grid(rows, rays, paths, landing, np.outer(shares, shares).ravel())


def _begins_total_reflection(truth: ProbeTruth, grid: Grid) -> NDArray[np.bool_]:
    """(m,) pixels of which, or of whose neighbours, some rays are totally reflected and some not.

    A neighbour's count, since the limit may lie between a pixel's border and its outermost ray.
    """
    from scipy.ndimage import maximum_filter

    film = truth.scene.film
    total = np.any(grid.by_pixel(grid.paths.total), axis=-1).reshape(film.height, film.width, -1)
    some, others = (maximum_filter(mask.any(axis=-1), 3) for mask in (total, ~total))
    return np.asarray((some & others).ravel())


def over_areas(rays: RayMeasurement, truth: ProbeTruth) -> RayMeasurement:
    """`rays` of a renderer whose position codes are means over pixels.

    The mean of a pixel is somewhere in what its corners enclose, so it is uncertain by how far the
    farthest of them is. Where not all of a pixel's rays end alike, it tells nothing.
    """
    alike, reach = _landings_within_pixels(truth)
    direction_uncertainty = rays.direction_uncertainty
    if len(reach) == 2:
        way = lengths(truth.landings[1].point - truth.landings[0].point)
        direction_uncertainty = direction_uncertainty + (reach[0] + reach[1]) / way
    return replace(
        rays, mixed=rays.mixed | ~alike, point_uncertainty=rays.point_uncertainty + reach[0],
        direction_uncertainty=direction_uncertainty,
    )  # fmt: skip


@kept
def _landings_within_pixels(truth: ProbeTruth) -> tuple[NDArray[np.bool_], list[Float]]:
    """(m,) pixels of which all rays end alike, and for each plane (m,) how far apart they land."""
    m = len(truth.grazing)
    areas, form = _grid(truth, np.arange(m), SMOOTH), ClosedForm(truth.scene)
    alike = np.ones(m, bool)
    reach = []
    for plane, centre in zip(truth.planes, truth.landings, strict=True):
        landing = form.land(areas.paths, plane)
        for fine, own in (
            (landing.status, centre.status),
            (areas.paths.status, truth.paths.status),
        ):
            alike &= (areas.by_pixel(fine) == own[:, None]).all(axis=1)
        aside = areas.by_pixel(landing.point) - centre.point[:, None]
        reach.append(np.nan_to_num(np.linalg.norm(aside, axis=-1).max(axis=1)) * TO_BORDER)
    return alike, reach
