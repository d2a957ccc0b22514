"""Where every ray of a probe went, and by how much it is off: for people to look at.

Verdicts come from the observables, which know their tolerances; nothing is judged on these.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from harness.expected import Float, cross, lengths
from harness.measure.probe_truth import ProbeTruth
from harness.measure.rays import RayMeasurement
from harness.renderers.base import Status


@dataclass(frozen=True)
class ProbeRays:
    """The truth of a probe's rays and what each renderer, by name, made of them."""

    name: str
    truth: ProbeTruth
    measured: Mapping[str, RayMeasurement]


def measured_direction(truth: ProbeTruth, rays: RayMeasurement) -> Float:
    """(m, 3) unit directions after the last interface; NaN where they are not known.

    One plane alone tells the way from the true point of the last interface.
    """
    if rays.direction is not None:
        return rays.direction
    if not truth.path:
        return np.full_like(rays.point, np.nan)
    way = rays.point - truth.paths.interface[:, -1]
    return np.asarray(way / lengths(way)[:, None])


def ray_error(truth: ProbeTruth, rays: RayMeasurement) -> Float:
    """(m,) angle between measured and true direction in microradians; NaN where there is none."""
    a, b = measured_direction(truth, rays), truth.paths.direction
    sine, cosine = lengths(cross(a, b)), np.einsum("ij,ij->i", a, b)
    known = rays.seen & (truth.landings[0].status == Status.HIT)
    return np.asarray(np.where(known, np.arctan2(sine, cosine) * 1e6, np.nan))


def angles(truth: ProbeTruth) -> tuple[Float, Float]:
    """(m, letters) angles of incidence and of refraction (or reflection) in degrees."""
    cos_i = truth.paths.cos_theta_i
    sine = truth.paths.eta_i_over_t * np.sqrt(np.clip(1 - cos_i**2, 0, None))
    with np.errstate(invalid="ignore"):  # beyond the critical angle there is none
        return np.degrees(np.arccos(np.clip(cos_i, -1, 1))), np.degrees(np.arcsin(sine))
