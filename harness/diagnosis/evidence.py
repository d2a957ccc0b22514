"""What is known of one renderer from one probe: a few hundred numbers, each with its tolerance.

A diagnosis needs no more rays than tell its hypotheses apart: some spread over all angles of
incidence, and the worst.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float
from harness.measure.light_observables import expected_level
from harness.measure.precision import Precision
from harness.measure.probe_truth import ProbeTruth
from harness.measure.rays import RayMeasurement
from harness.renderers.base import Rays, Status
from harness.scene.resolved import Rectangle, ResolvedScene

SPREAD, WORST = 72, 24


@dataclass(frozen=True)
class Setting:
    """The question that a probe asked: the scene, m of its rays and their `pixel` (m,), the path.

    `n2` says that the renderer claims to scale radiance with the square of the index, `thin` that
    slabs of the scene were thin faces to it.
    """

    scene: ResolvedScene
    rays: Rays
    pixel: NDArray[np.intp]
    path: str
    planes: tuple[Rectangle, ...]
    n2: bool = False
    thin: bool = False


@dataclass(frozen=True)
class Landings:
    """Where m rays landed: `point` (m, 3) on the first plane, `direction` (m, 3) where two tell it.

    `seen` (m,) says whether the ray landed at all. The tolerances (m,) are units and radians.
    """

    setting: Setting
    point: Float
    direction: Float | None
    seen: NDArray[np.bool_]
    point_tolerance: Float
    direction_tolerance: Float


@dataclass(frozen=True)
class Levels:
    """How much light m rays brought: `level` (m, 3) relative to the plane's, NaN where it was NaN.

    `tolerance` is (m, 3).
    """

    setting: Setting
    level: Float
    tolerance: Float


Evidence = Landings | Levels


def landings(
    truth: ProbeTruth, rays: RayMeasurement, precision: Precision, thin: bool
) -> Landings | None:
    """None where no ray says anything."""
    point_tolerance = _usual(rays.point_uncertainty) + truth.point_tolerance(precision)
    direction_tolerance = _usual(rays.direction_uncertainty) + truth.direction_tolerance(precision)
    usable = ~truth.grazing & ~rays.undecided & ~rays.faint & ~rays.mixed & _known(truth)
    error = np.linalg.norm(rays.point - truth.landings[0].point, axis=1) / point_tolerance
    if rays.direction is not None:
        turned = np.linalg.norm(rays.direction - truth.paths.direction, axis=1)
        error = np.fmax(error, turned / direction_tolerance)
    lost = usable & ~rays.seen & (truth.paths.status == Status.HIT)
    rows = _chosen(truth, usable, np.where(lost, np.inf, np.nan_to_num(error, nan=-1.0)))
    exact = np.isfinite(point_tolerance[rows]) & np.isfinite(direction_tolerance[rows])
    rows = rows[exact]
    if not len(rows):
        return None
    return Landings(
        _setting(truth, rows, thin=thin),
        rays.point[rows],
        None if rays.direction is None else rays.direction[rows],
        rays.seen[rows],
        point_tolerance[rows],
        direction_tolerance[rows],
    )


def _usual(uncertainty: Float) -> Float:
    """The uncertainties, and for rays that are not seen the usual one of those that are."""
    known = uncertainty[np.isfinite(uncertainty)]
    usual = float(np.median(known)) if len(known) else 1e-7
    return np.asarray(np.where(np.isfinite(uncertainty), uncertainty, usual))


def levels(
    truth: ProbeTruth,
    pixels: NDArray[np.float32],
    precision: Precision,
    quantum: float,
    samples: int | None,
    n2: bool,
    thin: bool,
) -> Levels | None:
    """From an image of a bright plane; `samples` per pixel where the renderer samples.

    Raises Unmeasurable where no ray takes the path alone.
    """
    level = pixels.reshape(-1, 3).astype(np.float64)
    true, used = expected_level(truth, n2)
    tolerance = np.tile(
        (quantum + truth.level_tolerance(precision) * true.max(axis=1, initial=1))[:, None], 3
    )
    if samples is not None:  # a pixel counts how often its path was chosen
        p = np.clip(true, 1 / samples, 1 - 1 / samples)
        tolerance = tolerance + 2 * np.sqrt(p * (1 - p) / samples)
    error = np.where(np.isfinite(level), np.abs(level - true) / tolerance, np.inf).max(axis=1)
    rows = _chosen(truth, used & _known(truth), error)
    if not len(rows):
        return None
    return Levels(_setting(truth, rows, n2, thin), level[rows], tolerance[rows])


def _known(truth: ProbeTruth) -> NDArray[np.bool_]:
    """Rays that take the path to the planes, or are totally reflected where they should pass."""
    landed = np.all([landing.status == Status.HIT for landing in truth.landings], axis=0)
    return np.asarray(landed | (truth.paths.status == Status.TIR))


def _chosen(truth: ProbeTruth, usable: NDArray[np.bool_], error: Float) -> NDArray[np.intp]:
    """Rows of rays spread over the angles of incidence, and of the worst."""
    rows = np.flatnonzero(usable)
    if len(rows) <= SPREAD + WORST:
        return rows
    order = rows[np.argsort(truth.theta_i[rows], kind="stable")]
    spread = order[np.linspace(0, len(order) - 1, SPREAD).astype(int)]
    worst = rows[np.argsort(-error[rows], kind="stable")[:WORST]]
    return np.unique(np.concatenate([spread, worst]))


def _setting(
    truth: ProbeTruth, rows: NDArray[np.intp], n2: bool = False, thin: bool = False
) -> Setting:
    rays = Rays(truth.rays.origins[rows], truth.rays.directions[rows])
    return Setting(truth.scene, rays, rows, truth.path, truth.planes, n2, thin)
