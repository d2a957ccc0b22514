"""Observables of flat faces: stacks, folded prisms, pools, Brewster's angle, reversed rays."""

from __future__ import annotations

import numpy as np

from harness import expected, expected_systems
from harness.expected import Float
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.curves import curve_of_rows
from harness.measure.precision import Precision
from harness.measure.probe_truth import ProbeTruth
from harness.measure.ray_observables import apex_angle, principal, sideways, signed_incidence
from harness.measure.ray_parts import (
    angle_between,
    compare_rays,
    derivation,
    direction_of,
    indices,
    usable,
)
from harness.measure.rays import RayMeasurement


def stack_offset(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Sideways shift of a ray by parallel layers, units, positive as glass shifts it."""
    used, fault, detail = usable(truth, rays)
    if set(truth.path) != {"T"}:
        raise Unmeasurable("a ray goes through a stack by a path of T alone")
    n = truth.paths.n[:, 0]
    if np.abs(np.cross(truth.paths.n, n[:, None]))[used].max() > 1e-12:
        raise Unmeasurable("the faces of the stack are not parallel")
    depth = np.abs(np.einsum("ikj,ij->ik", np.diff(truth.paths.interface, axis=1), n))
    thickness = np.median(depth[used], axis=0)
    # Index of each layer relative to the first medium, from the ratios at the faces before it.
    ior = 1 / np.cumprod(truth.paths.eta_i_over_t[used][0])[:-1]
    true = expected.stack_offset(truth.theta_i, list(zip(thickness, ior, strict=True)))
    offset = sideways(truth, rays)
    tolerance = rays.point_uncertainty + truth.point_tolerance(precision)
    detail |= {"layers": len(ior), "thickness": float(thickness.sum())}
    return compare_rays(
        truth, offset, true, tolerance, used, fault, detail,
        derivation(rays, "the offset moves no more than the landing point"),
        curve_of_rows(truth, used, "Stack offset", "offset (units)", offset, true, tolerance),
    )  # fmt: skip


def folded_direction(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Direction of a ray that leaves a reflecting prism, µrad off the incident one mirrored in the
    faces that reflect it.

    A corner cube, a right-angle prism, a rod: unfolded along the reflecting faces each is a plate
    with parallel faces, which keeps directions, whatever its index (W. J. Smith, Modern Optical
    Engineering, 4th ed., chapter 7: tunnel diagrams).
    """
    direction = direction_of(rays)
    used, fault, detail = usable(truth, rays)
    folded = truth.rays.directions
    for k, letter in enumerate(truth.path):
        if letter == "R":
            folded = expected.reflect(folded, truth.paths.n[:, k])
    if angle_between(folded, truth.paths.direction)[used].max() > 1e-9:
        raise Unmeasurable("unfolded, this prism is no plate with parallel faces")
    error = angle_between(direction, folded) * 1e6
    tolerance = (rays.direction_uncertainty + truth.direction_tolerance(precision)) * 1e6
    return compare_rays(
        truth, error, 0.0, tolerance, used, fault, detail,
        derivation(rays, "8 eps per rounding chain x condition of the direction"),
        curve_of_rows(truth, used, "Folded direction", "error (µrad)", error,
                      np.zeros_like(error), tolerance),
    )  # fmt: skip


def sagittal_depth(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Apparent depth across the plane of incidence, units: from each landing point alone.

    A camera h above the water sees a point that lies x aside under tan(theta) = x / (h + depth).
    """
    used, fault, detail = usable(truth, rays)
    height, depth, tangent = _pool(truth)
    used = used & (tangent > 0.02)  # straight down, a point says nothing of its depth
    if not used.any():
        raise Unmeasurable("all rays fall straight down")
    aside = _aside(truth, rays.point)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = aside / tangent - height
        tolerance = (rays.point_uncertainty + truth.point_tolerance(precision)) / tangent
    ior_i, ior_t = indices(truth)
    true = expected_systems.sagittal_depth(truth.theta_i, depth, ior_t / ior_i)
    return compare_rays(
        truth, value, true, tolerance, used, fault, detail,
        derivation(rays, "tolerance of the landing point / tangent of the angle of incidence"),
        curve_of_rows(truth, used, "Apparent depth, sagittal", "apparent depth (units)", value,
                      true, tolerance),
    )  # fmt: skip


def tangential_depth(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Apparent depth in the plane of incidence, units: from neighbouring pixels of the middle row.

    Between them, x runs by (h + depth) times what tan(theta) does. The same differences of the true
    rays tell what a difference misses of the derivative, which is taken off.
    """
    used, fault, detail = usable(truth, rays)
    height, depth, tangent = _pool(truth)
    rows = np.flatnonzero(used & truth.central_row)
    rows = rows[np.argsort(tangent[rows], kind="stable")]
    rows = rows[np.concatenate([[True], np.diff(tangent[rows]) > 1e-6])]
    if len(rows) < 3:
        raise Unmeasurable("fewer than 3 rays of the middle row reach the bottom")
    step = np.diff(tangent[rows])
    ior_i, ior_t = indices(truth)
    middle = np.arctan((tangent[rows][1:] + tangent[rows][:-1]) / 2)
    closed = expected_systems.tangential_depth(middle, depth, ior_t / ior_i)

    def differences(points: Float) -> Float:
        return np.asarray(np.diff(_aside(truth, points)[rows]) / step - height)

    missed = differences(truth.landings[0].point) - closed
    bound = rays.point_uncertainty + truth.point_tolerance(precision)
    pairs = rows[1:]
    m = len(truth.theta_i)
    value, true, tolerance = np.full(m, np.nan), np.full(m, np.nan), np.full(m, np.nan)
    value[pairs], true[pairs] = differences(rays.point) - missed, closed
    tolerance[pairs] = (bound[rows][1:] + bound[rows][:-1]) / step
    chosen = np.zeros(m, bool)
    chosen[pairs] = True
    detail |= {"rays": len(pairs), "largest_difference_error": float(np.abs(missed).max())}
    return compare_rays(
        truth, value, true, tolerance, chosen, fault, detail,
        derivation(rays, "tolerances of two landing points / step of the tangent between them"),
        curve_of_rows(truth, chosen, "Apparent depth, tangential", "apparent depth (units)", value,
                      true, tolerance),
    )  # fmt: skip


def brewster_angle(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Angle of incidence, degrees, at which the refracted ray is perpendicular to the reflected.

    By the middle row's rays, whose way inside is measured; between two of them, linearly. The same
    on the true rays tells what that misses, which is taken off.
    """
    used, fault, detail = usable(truth, rays)
    rows = np.flatnonzero(used & truth.central_row)
    rows = rows[np.argsort(truth.theta_i[rows], kind="stable")]
    n = truth.paths.n[:, 0]

    def crossing(points: Float) -> float:
        way = points - truth.paths.interface[:, 0]
        total = truth.theta_i + angle_between(way, -n) - np.pi / 2
        after = int(np.argmax(total[rows] > 0))
        if not total[rows][after] > 0 or not after:
            raise Unmeasurable("the rays do not pass through Brewster's angle")
        a, b = rows[after - 1], rows[after]
        part = total[a] / (total[a] - total[b])
        return float(truth.theta_i[a] + part * (truth.theta_i[b] - truth.theta_i[a]))

    closed = expected.brewster_angle(*indices(truth))
    missed = crossing(truth.landings[0].point) - closed
    value = crossing(rays.point) - missed
    way = np.linalg.norm(truth.landings[0].point - truth.paths.interface[:, 0], axis=1)
    bound = (rays.point_uncertainty + truth.point_tolerance(precision)) / way
    near = rows[np.argsort(np.abs(truth.theta_i[rows] - closed))[:4]]
    # theta_i + theta_t grows at least as fast as theta_i.
    tolerance = float(np.degrees(bound[near].max()))
    value, closed = float(np.degrees(value)), float(np.degrees(closed))
    return Comparison(
        value, closed, tolerance, bool(abs(value - closed) <= tolerance) and not fault,
        "tolerance of the landing point / length of the way inside, which the sum of the angles "
        "passes on at most undiminished", fault,
        detail | {"interpolation_error_deg": float(np.degrees(missed))},
    )  # fmt: skip


def reversibility(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Light that goes back along a ray takes the same way: by a prism that looks alike from behind.

    A ray that enters at i leaves at e; one that enters at e must leave at i. µrad between i and
    what the measured curve, read between its rays, makes of e; what the reading itself misses is
    known from the true curve and taken off.
    """
    direction = direction_of(rays)
    used, fault, detail = usable(truth, rays)
    used = used & principal(truth)
    if used.sum() < 16:
        raise Unmeasurable("fewer than 16 rays lie in the prism's principal plane")
    apex = apex_angle(truth, used)
    enters = signed_incidence(truth)
    rows = np.flatnonzero(used)
    rows = rows[np.argsort(enters[rows], kind="stable")]
    i = enters[rows]
    ior_i, ior_t = indices(truth)
    true_exit = expected.prism_deviation(i, apex, ior_t / ior_i) + apex - i
    # The turn's sign is that of the prism's base; all rays of a prism turn towards it.
    exits = angle_between(direction, truth.rays.directions)[rows] + apex - i
    bound = (rays.direction_uncertainty + truth.direction_tolerance(precision))[rows]
    order = np.argsort(i)
    inner = (true_exit > i[2]) & (true_exit < i[-3])
    if inner.sum() < 4:
        raise Unmeasurable("no ray enters at the angle at which another one leaves")
    slope = np.abs(np.gradient(true_exit, i))
    back = np.interp(exits, i[order], exits[order])
    true_back = np.interp(true_exit, i[order], true_exit[order])
    error = (back - i) - (true_back - i)
    # The neighbours' bounds, and the ray's own through the curve's slope where it is read.
    steep = np.interp(true_exit, i[order], slope[order])
    near = np.interp(
        true_exit,
        i[order],
        np.maximum.reduce([bound, np.roll(bound, 1), np.roll(bound, -1)])[order],
    )
    tolerance = near + 2 * steep * bound
    m = len(truth.theta_i)
    values, limits, chosen = np.zeros(m), np.ones(m), np.zeros(m, bool)
    values[rows], limits[rows], chosen[rows[inner]] = error * 1e6, tolerance * 1e6, True
    return compare_rays(
        truth, values, 0.0, limits, chosen, fault, detail | {"rays": int(inner.sum())},
        derivation(rays, "tolerance of the neighbours' directions + the ray's own x slope"),
        curve_of_rows(truth, chosen, "Reversed rays", "error (µrad)", values, np.zeros(m), limits),
    )  # fmt: skip


# --- a pool ---------------------------------------------------------------------------------------


def _pool(truth: ProbeTruth) -> tuple[float, float, Float]:
    """Height of the camera above the water, depth of the bottom, and tan(theta) of the rays."""
    landed = np.isfinite(truth.landings[0].point[:, 0])
    n = truth.paths.n[landed][0, 0]
    surface = truth.paths.interface[landed][0, 0]
    height = float((np.array(truth.scene.camera.origin) - surface) @ n)
    depth = float((surface - truth.landings[0].point[landed][0]) @ n)
    if height <= 0 or depth <= 0 or truth.path != "T":
        raise Unmeasurable("a pool is seen from above, by the path T, to its bottom")
    return height, depth, np.tan(truth.theta_i)


def _aside(truth: ProbeTruth, points: Float) -> Float:
    """How far from the foot of the camera, along the surface, in the direction of the ray."""
    landed = np.isfinite(truth.landings[0].point[:, 0])
    n = truth.paths.n[landed][0, 0]
    way = points - np.array(truth.scene.camera.origin)
    way = way - (way @ n)[:, None] * n
    d = truth.rays.directions
    level = d - (d @ n)[:, None] * n
    with np.errstate(divide="ignore", invalid="ignore"):
        level = level / np.linalg.norm(level, axis=1, keepdims=True)
    return np.asarray(np.einsum("ij,ij->i", way, level))
