"""Observables of light: what part of it takes a path, and where it stops doing so.

The probe shows radiance 1 on its plane and black elsewhere, so a pixel is the weight of the path:
the product of its Fresnel factors and what absorption leaves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness import expected
from harness.expected import Float
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.light_parts import nature, worst_level
from harness.measure.pixel_areas import Grid, MeanLight, pixel_areas
from harness.measure.precision import Precision
from harness.measure.probe_truth import STEP, ProbeTruth, kept
from harness.measure.statistics import Noise, binned
from harness.probe.decode import lit_threshold
from harness.renderers.base import Status
from harness.scene.resolved import ResolvedScene
from harness.truth.paths import TruePaths


def path_weight(
    truth: ProbeTruth, pixels: NDArray[np.float32], precision: Precision, quantum: float, n2: bool
) -> Comparison:
    """Reflectance or transmittance of the path, per pixel, of a renderer without noise.

    `n2` says that the renderer's radiance scales with the square of the index: then light that was
    emitted in one medium and seen in another carries the ratio of the two.
    """
    measured = pixels.reshape(-1, 3).astype(np.float64)
    true, used = expected_level(truth, n2)
    tolerance = quantum + truth.level_tolerance(precision) * true.max(axis=1, initial=1)
    return worst_level(
        truth, measured, true, tolerance, used, nature(truth, used), "Weight of the path",
        "quantum of the image + 8 eps per rounding chain x condition of the Fresnel factors",
    )  # fmt: skip


def sampled_path_weight(
    truth: ProbeTruth, pixels: NDArray[np.float32], noise: Noise, n2: bool
) -> Comparison:
    """The same for a renderer that samples lobes and pixels: means over bins of like angle."""
    _, used = expected_level(truth, n2)
    true = _mean_level(truth, n2)
    used = used & true.whole
    if not used.any():
        raise Unmeasurable("every pixel of this path holds an edge")
    rows = np.flatnonzero(used)
    order = rows[np.argsort(truth.theta_i[rows], kind="stable")]
    comparison = binned(pixels.reshape(-1, 3).astype(np.float64), true.level, order, noise)
    comparison.detail.update(nature(truth, used) | truth.conditions(used))
    return comparison


@kept
def _mean_level(truth: ProbeTruth, n2: bool) -> MeanLight:
    """True pixel values of a renderer that samples pixels."""

    def light(grid: Grid) -> Float:
        level = grid.paths.weight[:, None] * grid.landing.transmission
        level = np.nan_to_num(level) * _brightening(truth.scene, grid.paths, n2)[:, None]
        return np.where((grid.landing.status == Status.HIT)[:, None], level, 0.0)

    areas = pixel_areas(truth)
    return MeanLight(areas.mean(light), areas.whole)


def critical_angle(
    truth: ProbeTruth, pixels: NDArray[np.float32], quantum: float, over_area: bool
) -> Comparison:
    """Angle of incidence at which light stops passing, degrees, between lit and dark pixels."""
    ior = [medium.ior for medium in truth.scene.media]
    solid = truth.scene.solids[0]
    inside, outside = ior[solid.medium], ior[solid.exterior]
    closed = expected.critical_angle(inside, outside)
    # d asin(1 / n) / d ln n
    condition = float(np.tan(closed))
    return _boundary(truth, pixels, quantum, over_area, closed, condition, lit_below=True)


def first_transmitting_angle(
    truth: ProbeTruth, pixels: NDArray[np.float32], quantum: float, over_area: bool
) -> Comparison:
    """Smallest angle of incidence at which a prism transmits, degrees, in its principal plane."""
    from harness.measure.ray_observables import apex_angle, principal

    used = principal(truth) & (truth.paths.status == Status.HIT)
    if not used.any():
        raise Unmeasurable("no ray of the middle row lies in the prism's principal plane")
    ior = [medium.ior for medium in truth.scene.media]
    solid = truth.scene.solids[0]
    apex, n = apex_angle(truth, used), ior[solid.medium] / ior[solid.exterior]
    closed = expected.prism_first_transmitting_angle(apex, n)
    denser = expected.prism_first_transmitting_angle(apex, n * (1 + STEP))
    condition = abs(denser - closed) / STEP
    return _boundary(truth, pixels, quantum, over_area, closed, condition, lit_below=False)


def _boundary(
    truth: ProbeTruth,
    pixels: NDArray[np.float32],
    quantum: float,
    over_area: bool,
    closed: float,
    condition: float,
    lit_below: bool,
) -> Comparison:
    """Where the middle row turns from lit to dark, against the closed form.

    The angle is known to half the distance between the last lit and the first dark ray. A ray so
    near the limit that it carries less light than the image can show looks dark, so the true curve
    is put through the same threshold. A renderer that samples `over_area` lights a pixel of which
    any part is lit, half a pixel further out.
    """
    if not np.isfinite(pixels).all():
        raise Unmeasurable("a measured pixel is not finite")
    light = pixels.reshape(-1, 3).min(axis=1).astype(np.float64)
    threshold = lit_threshold(quantum)
    known = np.isin(truth.paths.status, (Status.HIT, Status.TIR))
    rows = np.flatnonzero(truth.central_row & known)
    theta = truth.theta_i[rows]
    rows, theta = rows[np.argsort(theta)], np.sort(theta)
    near = np.abs(theta - closed) < np.radians(10)
    rows, theta = rows[near], theta[near]
    lit = light[rows] > threshold
    if not lit.any() or lit.all():
        raise Unmeasurable("the middle row is not lit on one side of the limit only")
    below, above = (lit, ~lit) if lit_below else (~lit, lit)
    low, high = theta[below].max(), theta[above].min()
    value = (low + high) / 2
    level = truth.paths.weight[rows]
    shown = np.where(np.isfinite(level), level, 0) > threshold
    faint = (truth.paths.status[rows] == Status.HIT) & ~shown
    tolerance = (high - low) / 2 + (np.ptp(theta[faint]) if faint.sum() > 1 else 0)
    spacing = float(np.abs(np.diff(theta)).max())
    tolerance = max(float(tolerance), spacing / 2) + (spacing if faint.any() else 0)
    tolerance += spacing / 2 if over_area else 0
    ordered = bool(low < high)
    within = ordered and abs(value - closed) <= tolerance
    return Comparison(
        float(np.degrees(value)), float(np.degrees(closed)), float(np.degrees(tolerance)), within,
        "half the distance between the rays on both sides of the limit, and the width of the band "
        "in which the true light is below 4 quanta",
        "" if ordered else "lit and dark rays alternate around the limit",
        {"last_below_deg": float(np.degrees(low)), "first_above_deg": float(np.degrees(high)),
         "rays": len(rows), "faint": int(faint.sum()), "condition_angle": condition},
    )  # fmt: skip


def expected_level(truth: ProbeTruth, n2: bool) -> tuple[Float, NDArray[np.bool_]]:
    """(m, 3) true pixel values and the rays that count, dark ones among them."""
    landed = truth.landings[0].status == Status.HIT
    # A ray that meets fewer interfaces than the path has goes another way, and may well be lit.
    used = ~truth.grazing & (truth.paths.status != Status.MISS)
    # Paths no longer than this one that also reach the plane would add to its light.
    used = used & ~truth.ambiguous
    if not (used & landed).any():
        raise Unmeasurable("no ray takes this path alone to the plane")
    level = np.nan_to_num(truth.level) * _brightening(truth.scene, truth.paths, n2)[:, None]
    return np.where(landed[:, None], level, 0.0), used


def _brightening(scene: ResolvedScene, paths: TruePaths, n2: bool) -> Float:
    """(m,) what radiance is multiplied by from where the path ends to the camera."""
    if not n2:
        return np.ones(len(paths.medium))
    ior = np.array([medium.ior for medium in scene.media])
    return np.asarray((ior[scene.camera.medium] / ior[paths.medium]) ** 2)
