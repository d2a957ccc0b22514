"""The truth of light over whole pixels, for renderers that sample areas and not their centres.

Near total reflection light changes so fast that the mean over a pixel is not what its centre shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float
from harness.measure.probe_truth import ProbeTruth
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
