"""What observables of single rays share: which rays count, and one comparison from many of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float, cross, lengths
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.probe_truth import ROUNDINGS, ProbeTruth
from harness.measure.rays import RayMeasurement
from harness.record import Curve
from harness.renderers.base import Status

Detail = dict[str, float | int | str]


def usable(
    truth: ProbeTruth, rays: RayMeasurement
) -> tuple[NDArray[np.bool_], str, dict[str, float | int | str]]:
    """The rays that count, what is wrong with the others, and how many there are of each."""
    landed = np.all([landing.status == Status.HIT for landing in truth.landings], axis=0)
    # A ray that meets fewer interfaces than the path has goes another way, and may well be seen.
    elsewhere = truth.paths.status == Status.MISS
    nowhere = ~elsewhere & np.all([x.status != Status.HIT for x in truth.landings], axis=0)
    clear = ~truth.grazing & ~rays.mixed
    owed = landed & clear & ~rays.faint
    lost = owed & ~rays.seen
    ghosts = nowhere & clear & (rays.seen | rays.undecided)
    faults = []
    if lost.any():
        faults.append(f"{int(lost.sum())} of {int(owed.sum())} rays did not arrive")
    if ghosts.any():
        faults.append(f"{int(ghosts.sum())} pixels are lit that no ray should reach")
    used = landed & clear & rays.seen
    if not used.any():
        raise Unmeasurable(
            "no ray could be measured: " + ("; ".join(faults) or f"pixels: {rays.reasons}")
        )
    counts: dict[str, float | int | str] = {
        "rays": int(used.sum()),
        "lost": int(lost.sum()),
        "ghosts": int(ghosts.sum()),
        "excluded_grazing": int((landed & truth.grazing).sum()),
        "excluded_mixed": int((landed & rays.mixed).sum()),
        "excluded_faint": int((landed & rays.faint & ~rays.seen).sum()),
        "method": rays.method,
        **truth.conditions(used),
    }
    return used, "; ".join(faults), counts


def direction_of(rays: RayMeasurement) -> Float:
    """The measured directions (m, 3). Raises Unmeasurable where the probe has one plane only."""
    if rays.direction is None:
        raise Unmeasurable("one plane does not tell a direction; the probe needs two")
    return rays.direction


def indices(truth: ProbeTruth) -> tuple[float, float]:
    """Indices before and after the first interface."""
    media, scene = truth.scene.media, truth.scene
    solid = scene.solids[0]
    inside = scene.camera.medium == solid.medium
    beyond = solid.exterior if inside else solid.medium
    return media[scene.camera.medium].ior, media[beyond].ior


def angle_between(a: Float, b: Float) -> Float:
    """atan2(|a x b|, a . b): exact for small angles, where acos is not."""
    return np.asarray(np.arctan2(lengths(cross(a, b)), np.einsum("ij,ij->i", a, b)))


def worst_ray(error: Float, tolerance: Float, used: NDArray[np.bool_]) -> int:
    """The ray nearest to, or furthest beyond, its limit."""
    ratio = np.where(used, error / tolerance, -np.inf)
    return int(np.argmax(ratio))


def lowest_of_parabola(x: Float, y: Float) -> float:
    """Minimum of the parabola fitted to the seven lowest samples."""
    low = np.argsort(y)[:7]
    center = x[low].mean()
    a, b, c = np.polyfit(x[low] - center, y[low], 2)
    return float(c - b * b / (4 * a))


def derivation(rays: RayMeasurement, arithmetic: str) -> str:
    return f"quantum of the image through the {rays.method} + {arithmetic} ({ROUNDINGS} roundings)"


def compare_rays(
    truth: ProbeTruth,
    value: Float,
    true: Float | float,
    tolerance: Float,
    used: NDArray[np.bool_],
    fault: str,
    detail: dict[str, float | int | str],
    derivation: str,
    curve: Curve,
) -> Comparison:
    wanted = np.broadcast_to(true, value.shape)
    error = np.abs(value - wanted)
    if not np.isfinite(error[used]).all() or not np.isfinite(tolerance[used]).all():
        raise Unmeasurable("a measured ray or its tolerance is not finite")
    k = worst_ray(error, tolerance, used)
    width = truth.scene.film.width
    detail = {
        "max": float(error[used].max()),
        "rms": float(np.sqrt(np.mean(error[used] ** 2))),
        "p999": float(np.quantile(error[used], 0.999)),
        "worst_pixel_x": int(k % width),
        "worst_pixel_y": int(k // width),
        "worst_theta_i_deg": float(np.degrees(truth.theta_i[k])),
        **detail,
    }
    within = bool(np.all(error[used] <= tolerance[used])) and not fault
    return Comparison(
        float(value[k]), float(wanted[k]), float(tolerance[k]), within, derivation, fault,
        detail, curve,
    )  # fmt: skip
