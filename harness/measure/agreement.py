"""Two measurements of one thing: by a ray API and by images, of a case and of its variants."""

from __future__ import annotations

import numpy as np

from harness.expected import Float, lengths
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.curves import curve_of_rows
from harness.measure.precision import Precision
from harness.measure.probe_truth import ROUNDINGS, ProbeTruth
from harness.measure.ray_parts import compare_rays, usable
from harness.measure.rays import RayMeasurement

Measured = tuple[ProbeTruth, RayMeasurement, Precision]


def ray_agreement(
    truth: ProbeTruth, traced: RayMeasurement, coded: RayMeasurement, precision: Precision
) -> Comparison:
    """Distance between the landing points that a renderer's ray API tells and its images show."""
    used, fault, _ = usable(truth, traced)
    seen, more, detail = usable(truth, coded)
    error = lengths(traced.point - coded.point)
    tolerance = coded.point_uncertainty + 2 * truth.point_tolerance(precision)
    return compare_rays(
        truth, error, 0.0, tolerance, used & seen, "; ".join(filter(None, (fault, more))), detail,
        "quantum of the image through the position code + twice the renderer's own arithmetic",
        curve_of_rows(truth, used & seen, "Ray API against images", "difference (units)", error,
                      np.zeros_like(error), tolerance),
    )  # fmt: skip


def variant_agreement(scale: float, base: Measured, other: Measured) -> Comparison:
    """Distance between landing points of the same pixel in a case and its variant, units.

    Both in the camera's frame, which moves with a variant, and in the case's own units. A renderer
    may be off in both: what is asked is that it is off alike.
    """
    (truth, rays, precision), (truth_b, rays_b, precision_b) = base, other
    used, fault, _ = usable(truth, rays)
    used_b, fault_b, detail = usable(truth_b, rays_b)
    both = used & used_b
    if not both.any():
        raise Unmeasurable("no ray was measured in both forms")
    error = np.linalg.norm(
        _in_camera(truth, rays.point) - _in_camera(truth_b, rays_b.point) / scale, axis=1
    )
    tolerance = rays.point_uncertainty + truth.point_tolerance(precision)
    tolerance_b = rays_b.point_uncertainty + truth_b.point_tolerance(precision_b)
    tolerance = tolerance + tolerance_b / scale
    return compare_rays(
        truth, error, 0.0, tolerance, both, "; ".join(filter(None, (fault, fault_b))),
        detail | {"rays": int(both.sum()), "scale": scale},
        "sum of the tolerances of both landing points",
        curve_of_rows(truth, both, "Variant", "difference (units)", error, np.zeros_like(error),
                      tolerance),
    )  # fmt: skip


def optical_length(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Sum of index times way, from the camera to the landing point, units: Fermat's quantity."""
    if rays.optical_length is None:
        raise Unmeasurable("images do not tell the length of a path")
    used, fault, detail = usable(truth, rays)
    true, largest = _true_length(truth)
    # The length moves no more than its end does, times the index there, and is itself rounded.
    own = ROUNDINGS * precision.arithmetic / 2 * true + precision.data / 2 * true
    tolerance = largest * truth.point_tolerance(precision) + own
    return compare_rays(
        truth, rays.optical_length, true, tolerance, used, fault, detail,
        "tolerance of the landing point x index + 8 eps of the length",
        curve_of_rows(truth, used, "Optical length", "optical length (units)", rays.optical_length,
                      true, tolerance),
    )  # fmt: skip


def _true_length(truth: ProbeTruth) -> tuple[Float, float]:
    """(m,) true optical length, and the largest index on the way."""
    stations = np.concatenate(
        [truth.rays.origins[:, None], truth.paths.interface, truth.landings[0].point[:, None]],
        axis=1,
    )
    way = np.linalg.norm(np.diff(stations, axis=1), axis=2)
    first = truth.scene.media[truth.scene.camera.medium].ior
    ior = first / np.cumprod(truth.paths.eta_i_over_t, axis=1)
    ior = np.concatenate([np.full((len(way), 1), first), ior], axis=1)
    return np.asarray((ior * way).sum(axis=1)), float(np.nanmax(ior))


def _in_camera(truth: ProbeTruth, points: Float) -> Float:
    camera = truth.scene.camera
    axes = np.array([camera.right, camera.up, camera.forward])
    return np.asarray((points - np.array(camera.origin)) @ axes.T)
