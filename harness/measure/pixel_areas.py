"""The truth of light over whole pixels, for renderers that sample areas and not their centres.

Near total reflection light changes so fast that the mean over a pixel is not what its centre shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float
from harness.measure.probe_truth import ProbeTruth
from harness.measure.rays import RayMeasurement
from harness.renderers.base import Rays, Status
from harness.scene.resolved import Film
from harness.truth.camera import primary_rays
from harness.truth.paths import ClosedForm, Landing, TruePaths

# Rays a side of a pixel. The midpoint rule then misses a sixteenth of what the centre alone does.
FINER = 4


@dataclass(frozen=True)
class PixelAreas:
    """The probe's path followed by `FINER` squared rays in each of the m pixels.

    `whole` (m,) are pixels of which all rays end alike: none lands beside the plane or goes another
    way while others land on it. Total reflection is no other way: light fades into it.
    """

    rays: Rays
    paths: TruePaths
    landing: Landing
    whole: NDArray[np.bool_]
    film: Film

    def mean(self, values: Float) -> Float:
        """(m, 3) means over pixels of `values`, one (3,) for each ray."""
        film = self.film
        blocks = values.reshape(film.height, FINER, film.width, FINER, 3)
        return np.asarray(blocks.mean(axis=(1, 3)).reshape(-1, 3))


def pixel_areas(truth: ProbeTruth) -> PixelAreas:
    """Of the truth's own film."""
    film, form = truth.scene.film, ClosedForm(truth.scene)
    finer = Film(width=film.width * FINER, height=film.height * FINER)
    rays = primary_rays(truth.scene.model_copy(update={"film": finer}))
    paths = form.follow(rays, truth.path)
    landing = form.land(paths, truth.planes[0])
    other = (landing.status != Status.HIT) & (paths.status != Status.TIR)
    share = other.reshape(film.height, FINER, film.width, FINER).mean(axis=(1, 3)).ravel()
    return PixelAreas(rays, paths, landing, (share == 0) | (share == 1), film)


def over_areas(rays: RayMeasurement, truth: ProbeTruth) -> RayMeasurement:
    """`rays` of a renderer whose position codes are means over pixels.

    The mean of a pixel is somewhere in what its corners enclose, so it is uncertain by how far the
    farthest of them is. Where not all of a pixel's rays end alike, it tells nothing.
    """
    areas, form, film = pixel_areas(truth), ClosedForm(truth.scene), truth.scene.film
    shape, one = (film.height, FINER, film.width, FINER), (film.height, 1, film.width, 1)
    alike = np.ones(len(rays.seen), bool)
    reach = []
    for plane, centre in zip(truth.planes, truth.landings, strict=True):
        landing = form.land(areas.paths, plane)
        for fine, own in (
            (landing.status, centre.status),
            (areas.paths.status, truth.paths.status),
        ):
            alike &= (fine.reshape(shape) == own.reshape(one)).all(axis=(1, 3)).ravel()
        aside = landing.point.reshape(*shape, 3) - centre.point.reshape(*one, 3)
        farthest = np.linalg.norm(aside, axis=-1).max(axis=(1, 3)).ravel()
        # The outermost rays are half of their distance from a pixel's border.
        reach.append(np.nan_to_num(farthest) * FINER / (FINER - 1))
    direction_uncertainty = rays.direction_uncertainty
    if len(reach) == 2:
        way = np.linalg.norm(truth.landings[1].point - truth.landings[0].point, axis=1)
        direction_uncertainty = direction_uncertainty + (reach[0] + reach[1]) / way
    return replace(
        rays, mixed=rays.mixed | ~alike, point_uncertainty=rays.point_uncertainty + reach[0],
        direction_uncertainty=direction_uncertainty,
    )  # fmt: skip
