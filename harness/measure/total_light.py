"""Observables of light that need more than one path's weight: all paths together, and Brewster's.

A renderer is judged by the physics that it claims, unpolarised light at every interface. How far
that is from nature, where light that met one interface is polarised at the next, is told beside it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness import expected
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.light_parts import distance_to_nature, worst_level
from harness.measure.pixel_areas import MeanLight, pixel_areas
from harness.measure.precision import Precision
from harness.measure.probe_truth import ROUNDINGS, ProbeTruth, kept
from harness.measure.ray_parts import indices
from harness.measure.statistics import Noise, binned
from harness.renderers.base import Status

# Half the width of the window of angles around Brewster's, rad.
WINDOW = np.radians(1.0)


def all_light(
    truth: ProbeTruth,
    pixels: NDArray[np.float32],
    precision: Precision,
    quantum: float,
    noise: Noise | None,
    n2: bool,
) -> Comparison:
    """The light of all paths from the probe's plane, against the sum of the tree of closed forms.

    For a slab that is (1 - R)^2 a / (1 - R^2 a^2), cut where the scene's depth cuts it. With
    `noise` a renderer samples, and means are judged; `n2`: its radiance scales with n^2.
    """
    transport = truth.scene.transport
    light = truth.all_light_n2 if n2 else truth.all_light
    used = ~truth.grazing & (truth.paths.status != Status.MISS) & (light.level.max(axis=1) > 0)
    if not used.any():
        raise Unmeasurable("no light takes any path to the plane")
    true, measured = light.level, pixels.reshape(-1, 3).astype(np.float64)
    detail: dict[str, float | int | str] = distance_to_nature(light.natural, true, used) | {
        "max_depth": transport.max_depth,
        "cut": float(light.cut[used].max()),
    }
    if noise is not None:
        mean = _mean_light(truth, n2)
        rows = np.flatnonzero(used & mean.whole)
        order = rows[np.argsort(truth.theta_i[rows], kind="stable")]
        comparison = binned(measured, mean.level, order, noise)
        comparison.detail.update(detail | truth.conditions(used))
        return comparison
    # Paths whose weight is the least to be followed may be followed by one and not by the other.
    cut = 2 * transport.min_weight * transport.max_depth
    rounding = truth.level_tolerance(precision) + ROUNDINGS * precision.arithmetic
    tolerance = quantum + cut + rounding * true.max(axis=1)
    return worst_level(truth, measured, true, tolerance, used, detail, "Light of all paths",
                       "quantum of the image + weights that may be cut + 8 eps per rounding chain "
                       "x condition of the Fresnel factors")  # fmt: skip


@kept
def _mean_light(truth: ProbeTruth, n2: bool) -> MeanLight:
    """The light of all paths, true for a renderer that samples pixels."""
    areas = pixel_areas(truth)
    level = areas.mean(lambda grid: truth.all_light_of(grid.rays, n2, natural=False).level)
    return MeanLight(level, areas.whole)


def brewster_reflectance(
    truth: ProbeTruth,
    pixels: NDArray[np.float32],
    precision: Precision,
    quantum: float,
    noise: Noise | None,
) -> Comparison:
    """Reflectance at Brewster's angle, where half the light is not reflected at all.

    The mean over a window of angles around it; what the curve's bend adds is known from the true
    curve and taken off.
    """
    ior_i, ior_t = indices(truth)
    angle = expected.brewster_angle(ior_i, ior_t)
    closed = expected.brewster_reflectance(ior_i, ior_t)
    landed = truth.landings[0].status == Status.HIT
    near = landed & ~truth.grazing & (np.abs(truth.theta_i - angle) < WINDOW)
    if near.sum() < 8:
        raise Unmeasurable(f"{int(near.sum())} rays are near Brewster's angle; it takes 8")
    true, measured = truth.level[near, 1], pixels.reshape(-1, 3)[near, 1].astype(np.float64)
    bend = float(true.mean()) - closed
    value = float(measured.mean()) - bend
    if noise is None:
        tolerance = quantum + float((truth.level_tolerance(precision)[near] * true).max())
        said = "quantum of the image + 8 eps per rounding chain x condition of the reflectance"
    else:
        from scipy.special import stdtrit

        count = int(near.sum())
        limit = -float(stdtrit(count - 1, noise.level / 2))
        tolerance = limit * float((measured - true).std(ddof=1)) / np.sqrt(count)
        said = f"{limit:.2f} standard errors of the mean of {count} pixels (Student's t)"
    return Comparison(
        value, closed, tolerance, bool(abs(value - closed) <= tolerance), said,
        detail={"brewster_angle_deg": float(np.degrees(angle)), "rays": int(near.sum()),
                "bend": bend, **truth.conditions(near)},
    )  # fmt: skip
