"""Observables of what images: where rays that came in parallel cross the axis, and bows.

The axis is the camera's line of sight. Rays are meridional: balls and lenses of revolution stand on
the axis. Distances along it are counted in the direction of view.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness import expected_systems
from harness.expected import Float
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.curves import curve_of_rows
from harness.measure.precision import Precision
from harness.measure.probe_truth import ProbeTruth
from harness.measure.ray_parts import (
    Detail,
    angle_between,
    compare_rays,
    derivation,
    direction_of,
    indices,
    lowest_of_parabola,
    usable,
)
from harness.measure.rays import RayMeasurement
from harness.scene.resolved import Lens, Sphere

# A ray that leaves flatter than this, rad, crosses the axis too far away to say where.
FLATTEST = 2e-3
# The paraxial limit is extrapolated from rays up to this part of the largest height, as a
# polynomial of this degree in the square of the height.
NEAR_AXIS, DEGREE = 0.6, 3


@dataclass(frozen=True)
class _Meridional:
    """Rays in terms of the axis: `height` (m,) of the incident ray; slope and crossing outside.

    `slope` is the tangent of the angle to the axis after the last interface, positive where the ray
    comes down to it, `crossing` where it crosses, from the ball's centre or the lens's last vertex;
    `tolerance` (m,) of the crossing and `slope_tolerance` of the slope.
    """

    used: NDArray[np.bool_]
    fault: str
    detail: Detail
    height: Float
    slope: Float
    crossing: Float
    true_slope: Float
    true_crossing: Float
    tolerance: Float
    slope_tolerance: Float


def _meridional(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> _Meridional:
    direction = direction_of(rays)
    used, fault, detail = usable(truth, rays)
    camera = truth.scene.camera
    axis, origin = np.array(camera.forward), np.array(camera.origin)
    start = truth.rays.origins - origin
    height = np.linalg.norm(start - (start @ axis)[:, None] * axis, axis=1)
    middle = float((_reference(truth) - origin) @ axis)
    slope, crossing, reach = _cross(rays.point - origin, direction, axis)
    true_slope, true_crossing, _ = _cross(
        truth.landings[0].point - origin, truth.paths.direction, axis
    )
    tilt = rays.direction_uncertainty + truth.direction_tolerance(precision)
    shift = rays.point_uncertainty + truth.point_tolerance(precision)
    steep = np.abs(true_slope) / np.sqrt(1 + true_slope**2)
    used = used & (steep > FLATTEST)
    if not used.any():
        raise Unmeasurable("all rays leave along the axis: they do not cross it")
    with np.errstate(divide="ignore", invalid="ignore"):
        tolerance = (shift + np.abs(reach) * tilt) / steep
    return _Meridional(
        used, fault, detail, height, slope, crossing - middle, true_slope, true_crossing - middle,
        tolerance, tilt * (1 + true_slope**2),
    )  # fmt: skip


def _cross(point: Float, direction: Float, axis: Float) -> tuple[Float, Float, Float]:
    """Slope towards the axis, where it is crossed, and how far along the ray from `point`."""
    along = direction @ axis
    away = direction - along[:, None] * axis
    off = point - (point @ axis)[:, None] * axis
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.linalg.norm(away, axis=1)
        reach = -np.einsum("ij,ij->i", off, away) / size**2
        slope = np.sign(reach) * size / np.abs(along)
        crossing = (point + reach[:, None] * direction) @ axis
    return slope, crossing, reach


def focus(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Where each ray crosses the axis, units from the ball's centre or the lens's last vertex.

    For a ball the truth is h / sin 2 (i - r); for other shapes, the chain of Snell's laws.
    """
    seen = _meridional(truth, rays, precision)
    true = seen.true_crossing
    if _whole_ball(truth):
        ior_i, ior_t = indices(truth)
        radius = _ball(truth).radius
        inside = seen.height < radius
        true = expected_systems.ball_crossing(
            np.where(inside, seen.height, np.nan), radius, ior_t / ior_i
        )
    return compare_rays(
        truth, seen.crossing, true, seen.tolerance, seen.used, seen.fault, seen.detail,
        derivation(rays, "tolerances of point and direction / sine of the angle to the axis"),
        curve_of_rows(truth, seen.used, "Focus", "crosses the axis at (units)", seen.crossing,
                      true, seen.tolerance),
    )  # fmt: skip


def focal_length(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Effective focal length: height / slope, extrapolated to the axis, units."""
    seen = _meridional(truth, rays, precision)
    with np.errstate(divide="ignore", invalid="ignore"):
        value, true = seen.height / seen.slope, seen.height / seen.true_slope
        bound = np.abs(true / seen.true_slope) * seen.slope_tolerance
    return _paraxial(seen, value, true, bound, _closed_focal_length(truth))


def back_focal_length(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """From the last vertex to the focus of rays near the axis, units."""
    seen = _meridional(truth, rays, precision)
    shape = truth.scene.solids[0].shape
    past = shape.radius if isinstance(shape, Sphere) else 0.0
    value, true = seen.crossing - past, seen.true_crossing - past
    return _paraxial(seen, value, true, seen.tolerance, _closed_focus(truth) - past)


def spherical_aberration(
    truth: ProbeTruth, rays: RayMeasurement, precision: Precision
) -> Comparison:
    """How far before the paraxial focus the highest ray crosses the axis, units; negative: before.

    For a ball the truth is the closed form for that ray's height less the focal length; for lenses
    the ray's own chain of Snell's laws takes the place of the former.
    """
    seen = _meridional(truth, rays, precision)
    near = _paraxial(seen, seen.crossing, seen.true_crossing, seen.tolerance, _closed_focus(truth))
    top = int(np.argmax(np.where(seen.used, seen.height, -np.inf)))
    height, crossing = float(seen.height[top]), float(seen.true_crossing[top])
    if _whole_ball(truth):
        ior_i, ior_t = indices(truth)
        ball = _ball(truth)
        crossing = float(
            expected_systems.ball_crossing(np.asarray(height), ball.radius, ior_t / ior_i)
        )
    value, true = float(seen.crossing[top]) - near.value, crossing - near.expected
    tolerance = float(seen.tolerance[top]) + near.tolerance
    return Comparison(
        value, true, tolerance, bool(abs(value - true) <= tolerance) and not seen.fault,
        "tolerance of the highest ray's crossing + that of the paraxial focus", seen.fault,
        seen.detail | {"height": height},
    )  # fmt: skip


def aplanatic_image(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Distance of the point from which all rays seem to come, from the centre, against n R.

    The camera stands at an aplanatic point inside a sphere and looks through its centre.
    """
    seen = _meridional(truth, rays, precision)
    ball, camera = _ball(truth), truth.scene.camera
    outside, inside = indices(truth)[::-1]
    n = inside / outside
    away = float(np.linalg.norm(np.array(ball.center) - np.array(camera.origin)))
    if abs(away - expected_systems.aplanatic_object(ball.radius, n)) > 1e-9 * ball.radius:
        raise Unmeasurable("the camera does not stand at the sphere's aplanatic point")
    true = np.full(len(seen.crossing), expected_systems.aplanatic_image(ball.radius, n))
    return compare_rays(
        truth, -seen.crossing, true, seen.tolerance, seen.used, seen.fault, seen.detail,
        derivation(rays, "tolerances of point and direction / sine of the angle to the axis"),
        curve_of_rows(truth, seen.used, "Aplanatic image", "distance of the image (units)",
                      -seen.crossing, true, seen.tolerance),
    )  # fmt: skip


def cartesian_focus(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Where rays of any height cross the axis behind a Cartesian surface: in one point.

    By path T, inside the glass, behind an ellipsoid of conic constant -1 / n^2, from its vertex; by
    path TT behind a flat face and a hyperboloid of -n^2, from its own.
    """
    seen = _meridional(truth, rays, precision)
    shape = truth.scene.solids[0].shape
    ior_i, ior_t = indices(truth)
    n = ior_t / ior_i
    if not isinstance(shape, Lens):
        raise Unmeasurable("the first solid is no lens")
    front, back = shape.radii
    if truth.path == "T" and front and _near(shape.conics[0], -1 / n**2):
        place = expected_systems.cartesian_ellipsoid_focus(front, n) - shape.thickness
    elif truth.path == "TT" and front is None and back and _near(shape.conics[1], -(n**2)):
        place = expected_systems.cartesian_hyperboloid_focus(-back, n)
    else:
        raise Unmeasurable("this lens has no Cartesian surface on this path")
    true = np.full(len(seen.crossing), place)
    return compare_rays(
        truth, seen.crossing, true, seen.tolerance, seen.used, seen.fault, seen.detail,
        derivation(rays, "tolerances of point and direction / sine of the angle to the axis"),
        curve_of_rows(truth, seen.used, "Cartesian focus", "crosses the axis at (units)",
                      seen.crossing, true, seen.tolerance),
    )  # fmt: skip


def _near(a: float, b: float) -> bool:
    return abs(a - b) <= 1e-9 * abs(b)


def rainbow_angle(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Angle of the bow from the point opposite to the sun, degrees, by the stationary ray.

    As the camera's rays run backwards along the light's, a bow of k reflections stands where their
    turn is least. By a parabola through the seven rays nearest to it; the same fit to the closed
    form of the same rays tells the fit's own error, which is taken off.
    """
    direction = direction_of(rays)
    used, fault, detail = usable(truth, rays)
    reflections = truth.path.count("R")
    if truth.path != "T" + "R" * reflections + "T" or not reflections or not _whole_ball(truth):
        raise Unmeasurable("a bow is seen by a path TRT or TRRT through a ball")
    ior_i, ior_t = indices(truth)
    n, ball = ior_t / ior_i, _ball(truth)
    axis, start = np.array(truth.scene.camera.forward), truth.rays.origins - np.array(ball.center)
    height = np.linalg.norm(start - (start @ axis)[:, None] * axis, axis=1)
    least = expected_systems.rainbow_least_deviation(n, reflections)
    turn = expected_systems.rainbow_deviation(
        np.minimum(height, ball.radius), ball.radius, n, reflections
    )
    # An angle between directions is the turn folded into half a circle.
    measured = angle_between(direction, truth.rays.directions)
    measured = np.where(reflections % 2 == 1, measured, 2 * np.pi - measured)
    rows = np.flatnonzero(used & truth.central_row & (start @ np.array(truth.scene.camera.right)
                                                      > 0))  # fmt: skip
    if len(rows) < 7:
        raise Unmeasurable("fewer than 7 rays of the middle row show the bow")
    near = rows[np.argsort(turn[rows])[:7]]
    bias = lowest_of_parabola(height[near], turn[near]) - least
    value = lowest_of_parabola(height[near], measured[near]) - bias
    bound = (rays.direction_uncertainty + truth.direction_tolerance(precision))[near]
    tolerance = float(np.degrees(3 * bound.max()))
    bow, true = (abs(180.0 - float(np.degrees(x))) for x in (value, least))
    return Comparison(
        bow, true, tolerance, bool(abs(bow - true) <= tolerance) and not fault,
        "tolerance of the direction x 3, the norm of the parabola's vertex over seven samples; "
        f"the fit's own error {np.degrees(bias):.1e} deg is taken off", fault,
        detail | {"reflections": reflections, "fit_error_deg": float(np.degrees(bias))},
    )  # fmt: skip


# --- shared ---------------------------------------------------------------------------------------


def _reference(truth: ProbeTruth) -> Float:
    """The point from which places on the axis are counted."""
    shape = truth.scene.solids[0].shape
    if isinstance(shape, Lens):
        return np.array(shape.frame.origin) + shape.thickness * np.array(shape.frame.z)
    return np.array(_ball(truth).center)


def _alone(truth: ProbeTruth) -> bool:
    """Whether one solid is seen by parallel rays from outside, so that closed forms hold."""
    camera = truth.scene.camera
    return len(truth.scene.solids) == 1 and camera.medium == 0 and camera.type == "orthographic"


def _whole_ball(truth: ProbeTruth) -> bool:
    """Whether the scene is one ball, seen by parallel rays, so that its closed forms hold."""
    return isinstance(truth.scene.solids[0].shape, Sphere) and _alone(truth)


def _ball(truth: ProbeTruth) -> Sphere:
    shape = truth.scene.solids[0].shape
    if not isinstance(shape, Sphere):
        raise Unmeasurable("the first solid is no ball")
    return shape


def _closed_focal_length(truth: ProbeTruth) -> float:
    ior_i, ior_t = indices(truth)
    shape, n = truth.scene.solids[0].shape, ior_t / ior_i
    if isinstance(shape, Lens) and _alone(truth):
        return 1 / expected_systems.lens_power(*_radii(shape), n, shape.thickness)
    if _whole_ball(truth):
        return expected_systems.ball_focal_length(_ball(truth).radius, n)
    raise Unmeasurable("the focal length of this shape has no closed form here")


def _closed_focus(truth: ProbeTruth) -> float:
    """Of rays near the axis, from where `_reference` is."""
    ior_i, ior_t = indices(truth)
    shape = truth.scene.solids[0].shape
    if isinstance(shape, Lens) and _alone(truth):
        radii = _radii(shape)
        return expected_systems.lens_back_focal_length(*radii, ior_t / ior_i, shape.thickness)
    return _closed_focal_length(truth)


def _radii(lens: Lens) -> tuple[float, float]:
    front, back = (np.inf if radius is None else radius for radius in lens.radii)
    return front, back


def _paraxial(
    seen: _Meridional, value: Float, true: Float, bound: Float, closed: float
) -> Comparison:
    """`value` extrapolated to height 0: a polynomial in its square, by least squares.

    The estimate is linear in the values, so its tolerance is the sum of the rays' own, each times
    the size of its coefficient; the same estimate of the truth tells what extrapolation misses.
    """
    top = float(seen.height[seen.used].max())
    rows = np.flatnonzero(seen.used & (seen.height <= NEAR_AXIS * top))
    if len(rows) < 4 * (DEGREE + 1):
        raise Unmeasurable(f"{len(rows)} rays near the axis are too few to extrapolate from")
    squares = (seen.height[rows] / top) ** 2
    coefficients = np.linalg.pinv(np.vander(squares, DEGREE + 1, increasing=True))[0]
    missed = float(coefficients @ true[rows]) - closed
    estimate = float(coefficients @ value[rows]) - missed
    tolerance = float(np.abs(coefficients) @ bound[rows])
    return Comparison(
        estimate, closed, tolerance, bool(abs(estimate - closed) <= tolerance) and not seen.fault,
        "sum of the rays' tolerances, each times the size of its coefficient in the extrapolation; "
        f"what that misses on the true rays, {missed:.1e}, is taken off", seen.fault,
        seen.detail | {"rays": len(rows), "extrapolation_error": missed},
    )  # fmt: skip
