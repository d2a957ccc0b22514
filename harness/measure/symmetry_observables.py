"""Observables that a symmetry fixes: skewness about an axis, the way back out of a corner cube."""

from __future__ import annotations

import numpy as np

from harness import expected_systems
from harness.expected import Float, lengths
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.curves import curve_of_rows
from harness.measure.precision import Precision
from harness.measure.probe_truth import ProbeTruth
from harness.measure.ray_parts import (
    angle_between,
    compare_rays,
    derivation,
    direction_of,
    usable,
)
from harness.measure.rays import RayMeasurement
from harness.scene.resolved import Cone, Cylinder, Lens


def skewness(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Skewness of a ray behind solids that are round about one axis, units, against that of the ray
    which the camera sent: no such solid changes it (`expected_systems.skewness`).

    By the landing point and the direction of each ray, with the index of the medium it is in. It
    moves by n |d x a| with the point, and by n times the distance from the axis with the direction.
    """
    direction = direction_of(rays)
    used, fault, detail = usable(truth, rays)
    origin, axis = _axis(truth)
    ior = np.array([medium.ior for medium in truth.scene.media])
    before, behind = ior[truth.scene.camera.medium], ior[truth.paths.medium]
    start, aside = truth.rays.origins - origin, rays.point - origin
    true = expected_systems.skewness(start, truth.rays.directions, axis, before)
    value = expected_systems.skewness(aside, direction, axis, behind)
    by_point = lengths(np.cross(truth.paths.direction, axis))
    by_direction = lengths(np.cross(truth.landings[0].point - origin, axis))
    tolerance = behind * (
        by_point * (rays.point_uncertainty + truth.point_tolerance(precision))
        + by_direction * (rays.direction_uncertainty + truth.direction_tolerance(precision))
    )
    detail |= {"largest_skewness": float(np.abs(true[used]).max())}
    return compare_rays(
        truth, value, true, tolerance, used, fault, detail,
        derivation(rays, "those of the point x n |d x a| and of the direction x n x its distance"),
        curve_of_rows(truth, used, "Skewness", "skewness (units)", value, true, tolerance),
    )  # fmt: skip


def _axis(truth: ProbeTruth) -> tuple[Float, Float]:
    """A point of the axis about which all solids are round, and its direction."""
    shapes = [solid.shape for solid in truth.scene.solids]
    frames = [s.frame for s in shapes if isinstance(s, Cylinder | Cone | Lens)]
    if not frames or len(frames) < len(shapes):
        raise Unmeasurable("skewness takes cylinders, cones and lenses")
    origin, axis = np.array(frames[0].origin), np.array(frames[0].z)
    for frame in frames[1:]:
        turned = np.abs(np.cross(frame.z, axis)).max()
        aside = np.abs(np.cross(np.array(frame.origin) - origin, axis)).max()
        if max(turned, aside) > 1e-12:
            raise Unmeasurable("the solids are not round about one axis")
    return origin, axis


def return_error(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Angle between a ray out of a corner cube and the way that it came, µrad, where one of the
    cube's three right angles is none (`expected_systems.corner_cube_return`).
    """
    direction = direction_of(rays)
    used, fault, detail = usable(truth, rays)
    if truth.path != "TRRRT":
        raise Unmeasurable("a corner cube sends light back by the path TRRRT")
    first, second, off = _faces_off_square(truth.paths.n[:, 1:4])
    closed = expected_systems.corner_cube_return(
        truth.rays.directions,
        truth.paths.n[:, 0],
        first,
        second,
        1 / truth.paths.eta_i_over_t[:, 0],
    )
    if angle_between(closed, truth.paths.direction)[used].max() > 1e-9:
        raise Unmeasurable("more than one angle between the faces is off a right one")
    back = -truth.rays.directions
    value, true = angle_between(direction, back) * 1e6, angle_between(closed, back) * 1e6
    tolerance = (rays.direction_uncertainty + truth.direction_tolerance(precision)) * 1e6
    detail |= {"angle_off_deg": float(np.degrees(off[used]).max())}
    return compare_rays(
        truth, value, true, tolerance, used, fault, detail,
        derivation(rays, "8 eps per rounding chain x condition of the direction"),
        curve_of_rows(truth, used, "Return error", "angle (µrad)", value, true, tolerance),
    )  # fmt: skip


def _faces_off_square(n: Float) -> tuple[Float, Float, Float]:
    """Of three normals (m, 3, 3) in the order of the ray the two that are farthest from square,
    each (m, 3), and by how much, rad (m,).
    """
    pairs = ((0, 1), (0, 2), (1, 2))
    sines = np.abs(np.stack([np.einsum("ij,ij->i", n[:, a], n[:, b]) for a, b in pairs], axis=1))
    chosen = np.nan_to_num(sines).argmax(axis=1)
    rows, which = np.arange(len(n)), np.array(pairs)[chosen]
    return n[rows, which[:, 0]], n[rows, which[:, 1]], np.arcsin(sines[rows, chosen])
