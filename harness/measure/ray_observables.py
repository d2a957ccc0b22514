"""Observables of single rays: each compares one renderer's rays with their truth.

Every function takes the truth and the measurement of the same rays, the `precision`
of the renderer's numbers, and returns a `Comparison`. Rays that graze an edge are left
out and counted; a ray that should arrive and does not, or the other way round, is a fault.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness import expected
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
    indices,
    lowest_of_parabola,
    usable,
    worst_ray,
)
from harness.measure.rays import RayMeasurement
from harness.renderers.base import Status
from harness.scene.resolved import Mesh, Solid, Sphere
from harness.truth.paths import ClosedForm


def exit_point(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Distance between measured and true landing point on the first plane, scene units."""
    used, fault, counts = usable(truth, rays)
    error = lengths(rays.point - truth.landings[0].point)
    tolerance = rays.point_uncertainty + truth.point_tolerance(precision)
    vector = (rays.point - truth.landings[0].point)[worst_ray(error, tolerance, used)]
    detail = counts | {f"worst_d{axis}": float(x) for axis, x in zip("xyz", vector, strict=True)}
    return compare_rays(
        truth, error, 0.0, tolerance, used, fault, detail,
        derivation(rays, "8 eps per rounding chain x condition of the landing point"),
        curve_of_rows(
            truth, used, "Exit point", "error (units)", error, np.zeros_like(error), tolerance
        ),
    )  # fmt: skip


def exit_direction(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Angle between measured and true direction after the last interface, microradians."""
    direction = direction_of(rays)
    used, fault, counts = usable(truth, rays)
    error = angle_between(direction, truth.paths.direction) * 1e6
    tolerance = (rays.direction_uncertainty + truth.direction_tolerance(precision)) * 1e6
    return compare_rays(
        truth, error, 0.0, tolerance, used, fault, counts,
        derivation(rays, "8 eps per rounding chain x condition of the direction"),
        curve_of_rows(
            truth, used, "Exit direction", "error (µrad)", error, np.zeros_like(error), tolerance
        ),
    )  # fmt: skip


def internal_angle(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Angle of refraction inside the medium, degrees, against asin(ior_i sin(theta_i) / ior_t).

    The plane must be immersed: the ray's way from the true point of entry to its landing point is
    the way inside, which every black box shows.
    """
    used, fault, counts = usable(truth, rays)
    n = truth.paths.n[:, 0]
    way = rays.point - truth.paths.interface[:, 0]
    length = lengths(way)
    measured = angle_between(way / length[:, None], -n)
    ior_i, ior_t = indices(truth)
    true = expected.snell_angle(truth.theta_i, ior_i, ior_t)
    shift = rays.point_uncertainty + truth.point_tolerance(precision)
    tolerance = np.degrees(shift / length)
    return compare_rays(
        truth, np.degrees(measured), np.degrees(true), tolerance, used, fault, counts,
        derivation(rays, "tolerance of the landing point / length of the way inside"),
        curve_of_rows(
            truth, used, "Angle of refraction", "angle of refraction (°)",
            np.degrees(measured), np.degrees(true), tolerance,
        ),
    )  # fmt: skip


def slab_offset(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Sideways shift of the ray by a parallel slab, scene units, positive as glass shifts it.

    Measured against the line of the incident ray; the truth is the closed form for the slab's
    thickness, read from the distance between its faces along the normal.
    """
    used, fault, counts = usable(truth, rays)
    n, offset = truth.paths.n[:, 0], sideways(truth, rays)
    inside = truth.paths.interface[:, 1] - truth.paths.interface[:, 0]
    thickness = float(np.median(np.abs(np.einsum("ij,ij->i", inside, n))[used]))
    ior_i, ior_t = indices(truth)
    true = expected.slab_offset(truth.theta_i, thickness, ior_t / ior_i)
    tolerance = rays.point_uncertainty + truth.point_tolerance(precision)
    worst = np.abs(offset - true)[used].max()
    counts |= {"thickness": thickness, "max_relative_to_thickness": float(worst / thickness)}
    return compare_rays(
        truth, offset, true, tolerance, used, fault, counts,
        derivation(rays, "the offset moves no more than the landing point"),
        curve_of_rows(truth, used, "Slab offset", "offset (units)", offset, true, tolerance),
    )  # fmt: skip


def deviation(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Deviation by a prism in its principal plane, degrees; the image's middle row lies in it."""
    direction = direction_of(rays)
    used, fault, counts = usable(truth, rays)
    used = used & principal(truth)
    if not used.any():
        raise Unmeasurable("no ray of the middle row lies in the prism's principal plane")
    apex = apex_angle(truth, used)
    ior_i, ior_t = indices(truth)
    measured = angle_between(direction, truth.rays.directions)
    true = np.abs(expected.prism_deviation(signed_incidence(truth), apex, ior_t / ior_i))
    tolerance = np.degrees(rays.direction_uncertainty + truth.direction_tolerance(precision))
    counts |= {"apex_deg": float(np.degrees(apex))}
    return compare_rays(
        truth, np.degrees(measured), np.degrees(true), tolerance, used, fault, counts,
        derivation(rays, "tolerance of the exit direction"),
        curve_of_rows(
            truth, used, "Deviation", "deviation (°)",
            np.degrees(measured), np.degrees(true), tolerance,
        ),
    )  # fmt: skip


def minimum_deviation(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Smallest deviation of the curve, degrees, by a parabola through its lowest samples.

    The same estimate on the true curve at the same angles tells the estimate's own error, which is
    taken off.
    """
    direction = direction_of(rays)
    used, fault, counts = usable(truth, rays)
    used = used & principal(truth)
    if used.sum() < 7:
        raise Unmeasurable("fewer than 7 rays lie in the prism's principal plane")
    apex = apex_angle(truth, used)
    ior_i, ior_t = indices(truth)
    theta = signed_incidence(truth)[used]
    true_curve = expected.prism_deviation(theta, apex, ior_t / ior_i)
    closed = np.degrees(expected.prism_minimum_deviation(apex, ior_t / ior_i))
    bias = lowest_of_parabola(theta, np.degrees(true_curve)) - closed
    value = (
        lowest_of_parabola(theta, np.degrees(angle_between(direction, truth.rays.directions)[used]))
        - bias
    )
    bound = np.degrees(rays.direction_uncertainty + truth.direction_tolerance(precision))[used]
    tolerance = 3 * float(bound[np.argsort(np.abs(true_curve - true_curve.min()))[:7]].max())
    return Comparison(
        value, float(closed), tolerance, bool(abs(value - closed) <= tolerance) and not fault,
        "tolerance of the deviation x 3, the norm of the parabola's vertex over seven samples; "
        f"the estimate's own error {bias:.1e} deg is taken off", fault,
        counts | {"estimator_bias_deg": float(bias)},
    )  # fmt: skip


def tir(truth: ProbeTruth, rays: RayMeasurement, _precision: Precision) -> Comparison:
    """Rays lit where there is total internal reflection, or dark where light must pass.

    A ray API must call it by its name: a ray that is sent along the surface is dark, too.
    """
    fate = truth.paths.status
    clear = ~truth.grazing & ~rays.faint & ~rays.mixed & np.isin(fate, (Status.HIT, Status.TIR))
    if not (clear & (fate == Status.TIR)).any() or not (clear & (fate == Status.HIT)).any():
        raise Unmeasurable("the probe does not hold both transmitted and totally reflected rays")
    on_plane = np.all([landing.status == Status.HIT for landing in truth.landings], axis=0)
    lit = rays.seen | rays.undecided
    leaked = clear & (fate == Status.TIR) & lit
    lost = clear & (fate == Status.HIT) & on_plane & ~lit
    if rays.reflected is not None:
        leaked |= clear & (fate == Status.TIR) & ~rays.reflected
        lost |= clear & (fate == Status.HIT) & rays.reflected
    wrong = int(leaked.sum() + lost.sum())
    detail: dict[str, float | int | str] = {
        "rays": int(clear.sum()), "lit_beyond_critical": int(leaked.sum()),
        "dark_below_critical": int(lost.sum()), "excluded_near_critical": int((~clear).sum()),
        "method": rays.method, **truth.conditions(clear),
    }  # fmt: skip
    return Comparison(
        wrong, 0, 0, wrong == 0,
        "a count: rays within the probe's resolution of the critical angle are left out",
        detail=detail,
    )  # fmt: skip


def inversion(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """Magnification of the view through a lens; negative is upside down.

    How fast the landing point climbs with the pixel in the middle of the image, relative to the
    view without glass. The truth is the closed form of the same rays, put through the same fit.
    """
    used, fault, counts = usable(truth, rays)
    film = truth.scene.film
    column = np.arange(film.width * film.height) % film.width == film.width // 2
    row = np.arange(film.width * film.height) // film.width
    near = used & column & (np.abs(row - (film.height - 1) / 2) <= 4)
    if near.sum() < 4:
        raise Unmeasurable("the middle of the image does not see the plane through the glass")
    up, frame = np.array(truth.scene.camera.up), truth.planes[0].frame
    d, o = truth.rays.directions, truth.rays.origins
    t = ((np.array(frame.origin) - o) @ np.array(frame.z)) / (d @ np.array(frame.z))
    straight = ((o + t[:, None] * d) @ up)[near]

    def slope(points: Float) -> float:
        return float(np.polyfit(straight, (points @ up)[near], 1)[0])

    value, true = slope(rays.point), slope(truth.landings[0].point)
    bound = rays.point_uncertainty + truth.point_tolerance(precision)
    tolerance = 2 * float(bound[near].max()) / float(np.ptp(straight))
    upright = "upright" if true > 0 else "inverted"
    return Comparison(
        value, true, tolerance, bool(abs(value - true) <= tolerance) and not fault,
        "tolerance of the landing point at both ends / height of the fitted view", fault,
        counts | {"view": upright, "rays": int(near.sum())},
    )  # fmt: skip


def tessellation_error(truth: ProbeTruth, rays: RayMeasurement, precision: Precision) -> Comparison:
    """RMS angle between rays through a polygon ball and through its sphere, microradians.

    The truth of the polygons themselves is in closed form too, so the value to expect is known.
    """
    direction = direction_of(rays)
    used, fault, counts = usable(truth, rays)
    sphere = _circumscribed(truth.scene.solids[0])
    ball = ClosedForm(truth.scene.model_copy(update={"solids": (sphere,)}))
    smooth = ball.follow(truth.rays, truth.path)
    used = used & (smooth.status == Status.HIT)

    def rms(d: Float) -> float:
        return float(np.sqrt(np.mean(angle_between(d[used], smooth.direction[used]) ** 2)) * 1e6)

    value, true = rms(direction), rms(truth.paths.direction)
    bound = (rays.direction_uncertainty + truth.direction_tolerance(precision))[used]
    tolerance = float(np.sqrt(np.mean(bound**2)) * 1e6)
    solid = truth.scene.solids[0].shape
    counts |= {"triangles": len(solid.triangles) if isinstance(solid, Mesh) else 0}
    return Comparison(
        value, true, tolerance, bool(abs(value - true) <= tolerance) and not fault,
        "root mean square of the tolerances of the exit directions", fault, counts,
    )  # fmt: skip


def _circumscribed(solid: Solid) -> Solid:
    """The sphere on which all vertices of a polygon ball lie."""
    if not isinstance(solid.shape, Mesh):
        raise Unmeasurable("only a ball of polygons has a tessellation error")
    vertices = np.array(solid.shape.vertices)
    center = vertices.mean(axis=0)
    radius = np.linalg.norm(vertices - center, axis=1)
    if np.ptp(radius) > 1e-9 * radius.mean():
        raise Unmeasurable("the vertices do not lie on a sphere")
    x, y, z = (float(c) for c in center)
    sphere = Sphere(center=(x, y, z), radius=float(radius.mean()))
    return solid.model_copy(update={"shape": sphere})


def sideways(truth: ProbeTruth, rays: RayMeasurement) -> Float:
    """(m,) how far rays run beside their undeviated line, positive as glass shifts them."""
    d, n = truth.rays.directions, truth.paths.n[:, 0]
    shift = rays.point - truth.paths.interface[:, 0]
    shift = shift - np.einsum("ij,ij->i", shift, d)[:, None] * d
    # The shift is towards the normal's side of the undeviated ray: along -(n - (n.d) d).
    side = -(n - np.einsum("ij,ij->i", n, d)[:, None] * d)
    length = np.linalg.norm(side, axis=1)
    upright = length < 1e-9
    side = side / np.where(upright, 1.0, length)[:, None]
    along = np.einsum("ij,ij->i", shift, side)
    return np.asarray(np.where(upright, np.linalg.norm(shift, axis=1), along))


# --- geometry of a prism --------------------------------------------------------------------------


def principal(truth: ProbeTruth) -> NDArray[np.bool_]:
    """Rays whose direction is perpendicular to the prism's apex edge, to rounding."""
    n1, n2 = truth.paths.n[:, 0], truth.paths.n[:, -1]
    edge = np.cross(n1, n2)
    length = np.linalg.norm(edge, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        along = np.abs(np.einsum("ij,ij->i", edge, truth.rays.directions)) / length
    return np.asarray(np.nan_to_num(along, nan=1.0) < 1e-12)


def apex_angle(truth: ProbeTruth, used: NDArray[np.bool_]) -> float:
    """Angle between the faces where the rays enter and leave, radians."""
    n1, n2 = truth.paths.n[used, 0], truth.paths.n[used, -1]
    return float(np.median(angle_between(n1, n2)))


def signed_incidence(truth: ProbeTruth) -> Float:
    """Angle of incidence, positive where the ray comes from the base's side of the normal."""
    n1, n2 = truth.paths.n[:, 0], truth.paths.n[:, -1]
    edge = np.cross(n1, n2)
    sense = np.einsum("ij,ij->i", np.cross(truth.rays.directions, n1), edge)
    return np.asarray(np.where(sense > 0, 1.0, -1.0) * truth.theta_i)
