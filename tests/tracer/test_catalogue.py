"""Traced rays against the catalogue of closed forms, whose values are exact to 16 digits.

The tolerance is 8 eps times the condition number of the closed form (`rounding_bound`), plus
8 eps of the largest coordinate where a length is measured: points are known no better. A path
with k interfaces rounds k times.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.catalogue import DATA, EPS, Row, numbers, rounding_bound, rows
from tests.tracer.scenes import angles, axis_crossing, down, glass, one, prism, slab, wall
from tracer import optics
from tracer.camera import Orthographic
from tracer.image import render
from tracer.path import HIT, TIR
from tracer.scene import Medium, Scene, Solid, ThinSlab, Transport
from tracer.shapes import Plane, Sphere
from tracer.solids import Cell, cylinder, lens, polyhedron
from tracer.spectrum import GLASSES, LINE_C, LINE_D, LINE_F, abbe_number, from_abbe
from tracer.vector import Vec, dot, normalise, sub


def each(name: str) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("row", rows(name), ids=str)


def sind(x: float) -> float:
    return math.sin(math.radians(x))


def cosd(x: float) -> float:
    return math.cos(math.radians(x))


def test_every_entry_is_a_test() -> None:
    """All that the catalogue holds are asked for in this file."""
    entries = set(json.loads(DATA.read_text("utf-8"))) - {"about"}
    source = Path(__file__).read_text("utf-8")
    assert set(re.findall(r'(?:each|rows)\("(\w+)"\)', source)) == entries


# --- one interface --------------------------------------------------------------------------------


@each("snell")
def test_snell(row: Row) -> None:
    theta, ior_i, ior_t = numbers(row.p)
    allowed = rounding_bound(lambda t, i, o: math.asin(i / o * sind(t)), theta, ior_i, ior_t)
    transmits, theta_t = optics.snell(math.radians(theta), ior_i, ior_t)
    assert transmits
    assert theta_t == pytest.approx(math.radians(float(row.v)), abs=allowed)
    wi = (-sind(theta), 0.0, cosd(theta))
    transmits, wt = optics.refract(wi, (0.0, 0.0, 1.0), ior_i, ior_t)
    assert transmits
    assert math.atan2(wt[0], -wt[2]) == pytest.approx(math.radians(float(row.v)), abs=allowed)


@each("vector")
@pytest.mark.parametrize(
    "refract",
    [optics.refract, optics.refract_with_trigonometry, optics.refract_without_trigonometry],
)
def test_refracted_vector(refract, row: Row) -> None:  # type: ignore[no-untyped-def]
    direction, normal, mu = row.p[1], row.p[3], row.p[5]
    ior_i, ior_t = numbers(mu.split("/"))
    wi = normalise((-float(direction[0]), -float(direction[1]), -float(direction[2])))
    n = normalise((float(normal[0]), float(normal[1]), float(normal[2])))
    transmits, wt = refract(wi, n, ior_i, ior_t)
    assert transmits
    error = sub(wt, (float(row.v[0]), float(row.v[1]), float(row.v[2])))
    # Both normalisations round, and d theta_t / d theta_i < 2 for these rows.
    assert math.sqrt(dot(error, error)) <= 8 * EPS * 2


@each("critical")
def test_critical_angle(row: Row) -> None:
    ior_i, ior_t = numbers(row.p)
    allowed = rounding_bound(lambda i, t: math.asin(t / i), ior_i, ior_t)
    assert optics.critical_angle(ior_i, ior_t) == pytest.approx(
        math.radians(float(row.v)), abs=allowed
    )


@each("fresnel")
def test_fresnel(row: Row) -> None:
    theta, ior_i, ior_t = numbers(row.p)

    def reflectances(theta: float, ior_i: float, ior_t: float) -> tuple[float, float, float]:
        c = cosd(theta)
        _, ct = optics.cos_transmitted(c, ior_i, ior_t)
        return (
            optics.fresnel_s(c, ct, ior_i, ior_t),
            optics.fresnel_p(c, ct, ior_i, ior_t),
            optics.fresnel_unpolarised(c, ct, ior_i, ior_t),
        )

    for k, expected in enumerate(numbers(row.v)):
        allowed = rounding_bound(lambda *x, k=k: reflectances(*x)[k], theta, ior_i, ior_t)
        assert reflectances(theta, ior_i, ior_t)[k] == pytest.approx(
            expected, abs=allowed + 8 * EPS
        )


@each("brewster")
def test_brewster(row: Row) -> None:
    ior_i, ior_t = numbers(row.p)
    theta = optics.brewster_angle(ior_i, ior_t)
    assert theta == pytest.approx(math.radians(float(row.v)), abs=8 * EPS)
    _, ct = optics.cos_transmitted(math.cos(theta), ior_i, ior_t)
    assert optics.fresnel_p(math.cos(theta), ct, ior_i, ior_t) <= (8 * EPS) ** 2


@each("cond_snell")
def test_condition_of_refraction(row: Row) -> None:
    """D theta_t / d theta_i, by central differences small against the distance to critical."""
    theta, ior_i, ior_t = numbers(row.p)
    to_critical = optics.critical_angle(ior_i, ior_t) - math.radians(theta)
    h = 1e-4 * to_critical
    _, above = optics.snell(math.radians(theta) + h, ior_i, ior_t)
    _, below = optics.snell(math.radians(theta) - h, ior_i, ior_t)
    # Next to critical theta_t = pi/2 - sqrt(2 k delta): the third derivative leaves (h/delta)^2 / 8
    # = 1.3e-9, the printed angle's distance to critical 1e-8, and rounding of theta_i eps / h.
    allowed = 2e-8 + EPS / h
    assert (above - below) / (2 * h) == pytest.approx(float(row.v), rel=allowed)


@each("n2_radiance")
def test_diffuse_reflectance(row: Row) -> None:
    """Reflectance averaged over a hemisphere of equal radiance, by Gauss's quadrature."""
    (ior,) = numbers(row.p)
    expected = numbers(row.v)
    x, w = np.polynomial.legendre.leggauss(200)
    c = 0.5 * (x + 1.0)
    outside = sum(
        wk * ck * optics.reflectance(float(ck), 1.0, ior) for ck, wk in zip(c, w, strict=True)
    )
    assert outside == pytest.approx(expected[1], rel=1e-10)  # of the quadrature, with 200 nodes
    # From inside, the average has a kink at the critical angle; the law of energy gives it.
    assert 1 - (1 - outside) / ior**2 == pytest.approx(expected[2], rel=1e-10)
    camera = Orthographic((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0), 1e-9)
    ball = Solid(Sphere((0.0, 0.0, 0.0), 1.0), Medium(ior))
    scene = Scene(
        camera,
        (ball,),
        background=(1.0, 1.0, 1.0),
        transport=Transport(2, 0.0, radiance_n2=True),
    )
    R = ((ior - 1) / (ior + 1)) ** 2
    assert render(scene, 1, 1).pixels[0, 0, 0] == pytest.approx((1 - R) * expected[0], rel=8 * EPS)


# --- slabs ----------------------------------------------------------------------------------------


@each("slab_offset")
@pytest.mark.parametrize("thin", [False, True])
def test_slab_offset(row: Row, thin: bool) -> None:
    t, theta, ior = numbers(row.p)

    def closed_form(t: float, theta: float, ior: float) -> float:
        return t * sind(theta) * (1 - cosd(theta) / math.sqrt(ior**2 - sind(theta) ** 2))

    scene = glass(slab(t), ior, ends_at=-t - 1.0)
    if thin:
        face = replace(wall(0.0), material=ThinSlab(Medium(ior), t))
        scene = replace(scene, solids=(), surfaces=(scene.surfaces[0], face))
    d = down(theta)
    found = one(scene, (0.0, 0.0, 1.0), d, "TT")
    assert found.status[0] == HIT
    assert found.surface[0] == 0
    condition = math.sqrt(ior**2 - sind(theta) ** 2) / cosd(theta)  # of the second refraction
    assert angles(found.direction, np.array([d]))[0] <= 8 * EPS * max(1.0, condition)
    unshifted = (t + 2.0) * math.tan(math.radians(theta))
    allowed = rounding_bound(closed_form, t, theta, ior) + 8 * EPS * unshifted
    offset = (unshifted - found.point[0, 0]) * cosd(theta)
    assert offset == pytest.approx(float(row.v[0]), abs=allowed)
    transmits, formula = optics.thin_slab_offset(math.radians(theta), t, ior)
    assert transmits
    assert formula == pytest.approx(float(row.v[0]), abs=rounding_bound(closed_form, t, theta, ior))


@each("stack_offset")
def test_stack_offset(row: Row) -> None:
    """Three slabs with gaps between them, which change nothing."""
    theta, layers = float(row.p[0]), row.p[1]
    solids, z = [], 0.0
    for thickness, ior in layers:
        solids.append(Solid(slab(float(thickness), z), Medium(float(ior))))
        z -= float(thickness) + 0.5
    scene = Scene(glass(slab(1.0), 1.5).camera, tuple(solids), (wall(z),))
    found = one(scene, (0.0, 0.0, 1.0), down(theta), "TTTTTT")
    assert found.status[0] == HIT
    unshifted = (1.0 - z) * math.tan(math.radians(theta))
    offset = (unshifted - found.point[0, 0]) * cosd(theta)
    # Tangents of the angle's rounding, theta eps (1 + tan^2), act over the whole height; six
    # interfaces round.
    spread = (1.0 - z) * (1 + math.tan(math.radians(theta)) ** 2) * math.radians(theta)
    assert offset == pytest.approx(float(row.v), abs=8 * EPS * (unshifted + spread))


@each("slab_RT")
def test_slab_reflectance_and_transmittance(row: Row) -> None:
    theta, ior, absorption, t = numbers(row.p)
    expected = numbers(row.v)

    def one_polarisation(R: float, a: float) -> tuple[float, float]:
        return optics.slab_reflectance(R, a), optics.slab_transmittance(R, a)

    c = cosd(theta)
    _, ct = optics.cos_transmitted(c, 1.0, ior)
    a = math.exp(-absorption * t / ct)
    s = one_polarisation(optics.fresnel_s(c, ct, 1.0, ior), a)
    p = one_polarisation(optics.fresnel_p(c, ct, 1.0, ior), a)
    mean = ((s[0] + p[0]) / 2, (s[1] + p[1]) / 2)
    # theta is rounded; near 85 degrees R changes by less than 8 per radian.
    assert (*s, *p, *mean) == pytest.approx(expected, abs=8 * EPS * 8)


@each("slab_T_scalar")
def test_slab_with_unpolarised_interfaces(row: Row) -> None:
    """The tracer's model: unpolarised at each interface, which is not nature's."""
    (theta, ior), scalar = numbers(row.p), float(row.v)
    R = optics.reflectance(cosd(theta), 1.0, ior)
    assert optics.slab_transmittance(R, 1.0) == pytest.approx(scalar, rel=8 * EPS * 4)
    n = (sind(theta), 0.0, cosd(theta))
    camera = Orthographic(n, (0.0, 1.0, 0.0), (-n[2], 0.0, n[0]), (-n[0], 0.0, -n[2]), 1e-9)
    scene = Scene(
        camera,
        (Solid(slab(0.1), Medium(ior)),),
        (wall(-1.0),),
        transport=Transport(300, 0.0),
    )
    assert render(scene, 1, 1).pixels[0, 0, 0] == pytest.approx(scalar, rel=1e-13)


# --- prisms ---------------------------------------------------------------------------------------


def through_prism(i: float, apex: float, ior: float) -> tuple[int, float]:
    """(status, deviation in radians) of the ray that enters at `i` degrees, 1 from the apex."""
    beta = math.radians(apex / 2 - i)
    d = (-math.sin(beta), 0.0, -math.cos(beta))
    x, z = -1.0, math.tan(math.radians(apex / 2))
    found = one(glass(prism(apex), ior, ends_at=-50.0), (x - d[0], 0.0, z - d[2]), d, "TT")
    return int(found.status[0]), float(angles(found.direction, np.array([d]))[0])


def prism_deviation(i: float, apex: float, ior: float) -> float:
    argument = sind(apex) * math.sqrt(ior**2 - sind(i) ** 2) - cosd(apex) * sind(i)
    return math.radians(i) + math.asin(argument) - math.radians(apex)


@each("prism_dev")
def test_prism_deviation(row: Row) -> None:
    i, apex, ior = numbers(row.p)
    status, deviation = through_prism(i, apex, ior)
    assert status == HIT
    allowed = rounding_bound(prism_deviation, i, apex, ior)
    assert deviation == pytest.approx(math.radians(float(row.v)), abs=allowed)


@each("prism_mindev")
def test_minimum_deviation(row: Row) -> None:
    apex, ior = numbers(row.p)
    least, at = numbers(row.v)
    _, deviation = through_prism(at, apex, ior)
    allowed = rounding_bound(prism_deviation, at, apex, ior)
    assert deviation == pytest.approx(math.radians(least), abs=allowed)
    for aside in (-0.1, 0.1):
        assert through_prism(at + aside, apex, ior)[1] > deviation + 1e-7


@each("prism_imin")
def test_first_transmitting_angle(row: Row) -> None:
    apex, ior = numbers(row.p)
    first = float(row.v)
    assert through_prism(first - 1e-12, apex, ior)[0] == TIR
    assert through_prism(first + 1e-12, apex, ior)[0] == HIT


@each("wedge")
def test_wedge(row: Row) -> None:
    apex, ior = numbers(row.p)
    _, deviation = through_prism(0.0, apex, ior)
    allowed = rounding_bound(lambda A, n: math.asin(n * sind(A)) - math.radians(A), apex, ior)
    # The prism is turned by half its angle, which rounds once more.
    assert deviation == pytest.approx(math.radians(float(row.v[0])), abs=allowed + 8 * EPS)


# --- balls and lenses -----------------------------------------------------------------------------


def ball_focus(h: float, radius: float, ior: float) -> float:
    return h / math.sin(2 * (math.asin(h / radius) - math.asin(h / (ior * radius))))


def traced_focus(h: float, radius: float, ior: float) -> float:
    """How far behind the centre a ray at height `h` crosses the axis."""
    scene = glass(Sphere((0.0, 0.0, 0.0), radius), ior, ends_at=-3 * radius)
    found = one(scene, (h, 0.0, 2 * radius), (0.0, 0.0, -1.0), "TT")
    return -axis_crossing(found.vertices[0, 2], found.direction[0])


@each("ball_real")
def test_real_focus_of_a_ball(row: Row) -> None:
    h, radius, ior = numbers(row.p)
    allowed = rounding_bound(ball_focus, h, radius, ior)
    focus = traced_focus(h, radius, ior)
    assert focus == pytest.approx(float(row.v[0]), abs=allowed)
    assert focus - radius == pytest.approx(float(row.v[1]), abs=allowed)


@each("ball_paraxial")
def test_paraxial_focus_of_a_ball(row: Row) -> None:
    radius, ior = numbers(row.p)
    h = 1e-4 * radius
    # The aberration at h is below (h / R)^2 of the focal length for these indices.
    assert traced_focus(h, radius, ior) == pytest.approx(float(row.v[0]), rel=1e-8)


@each("ball_mag")
def test_image_of_a_ball(row: Row) -> None:
    """Two rays from a point beside the axis meet again in its image, which may be a virtual one."""
    distance, radius, ior = numbers(row.p)
    image_distance, magnification = numbers(row.v)
    h = 1e-4 * radius
    lines = []
    for aim in (-h, h):
        d = normalise((aim - h, 0.0, -distance))
        scene = glass(Sphere((0.0, 0.0, 0.0), radius), ior, ends_at=-3 * radius)
        found = one(scene, (h, 0.0, distance), d, "TT")
        p, d = found.vertices[0, 2], found.direction[0]
        lines.append((p[0] - d[0] / d[2] * p[2], d[0] / d[2]))
    (x0, slope0), (x1, slope1) = lines
    z = (x0 - x1) / (slope1 - slope0)
    # Rays are up to 2 h from the axis; aberration moves 1 / f by no more than (2 h / R)^2 of it,
    # and the image by |s2| / f times that.
    focal = ior * radius / (2 * (ior - 1))
    allowed = 4e-8 * max(1.0, abs(image_distance) / focal)
    assert -z == pytest.approx(image_distance, rel=allowed)
    assert (x0 + slope0 * z) / h == pytest.approx(magnification, rel=allowed)


@each("ball_view")
def test_view_through_a_ball(row: Row) -> None:
    phi, a, b, radius, ior = numbers(row.p)

    def closed_form(phi: float, a: float, b: float, radius: float, ior: float) -> float:
        h = a * sind(phi)
        turn = 2 * (math.asin(h / radius) - math.asin(h / (ior * radius)))
        out = math.radians(phi) - turn
        return (h + b * math.sin(out)) / math.cos(out)

    scene = glass(Sphere((0.0, 0.0, 0.0), radius), ior, ends_at=-b)
    found = one(scene, (0.0, 0.0, a), down(phi), "TT")
    allowed = rounding_bound(closed_form, phi, a, b, radius, ior) + 8 * EPS * b
    assert found.point[0, 0] == pytest.approx(float(row.v), abs=allowed)


@each("rainbow")
def test_rainbow(row: Row) -> None:
    """Rays of the bow turn by D, and their neighbours turn by more: k internal reflections."""
    ior, k = float(row.p[0]), int(row.p[1])
    incidence, turn, _ = numbers(row.v)
    scene = glass(Sphere((0.0, 0.0, 0.0), 1.0), ior)

    def turned(i: float) -> float:
        d = np.array([[0.0, 0.0, -1.0]])
        found = one(scene, (sind(i), 0.0, 2.0), (0.0, 0.0, -1.0), "T" + "R" * k + "T")
        angle = float(angles(found.direction, d)[0])
        return angle if k == 1 else 2 * math.pi - angle

    def closed_form(i: float, ior: float) -> float:
        return k * math.pi + 2 * math.radians(i) - 2 * (k + 1) * math.asin(sind(i) / ior)

    allowed = rounding_bound(closed_form, incidence, ior)
    assert turned(incidence) == pytest.approx(math.radians(turn), abs=allowed)
    for aside in (-0.1, 0.1):
        assert turned(incidence + aside) > turned(incidence) + 1e-7


@each("thick_lens")
def test_thick_lens(row: Row) -> None:
    r1, r2, ior, thickness = numbers(row.p)
    focal, back_focal, front_focal = numbers(row.v)
    h = 1e-4 * min(abs(r1), abs(r2))

    def foci(r1: float, r2: float) -> tuple[float, float]:
        """(effective, back) focal length for light along -z onto the side of curvature r1."""
        solid = lens((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (r1, r2), thickness, 10.0)
        found = one(glass(solid, ior), (h, 0.0, 5.0), (0.0, 0.0, -1.0), "TT")
        d, vertices = found.direction[0], found.vertices
        assert vertices is not None
        # A meridional ray crosses the axis at the focus; the principal plane is at height h.
        return -h * d[2] / -d[0], -thickness - axis_crossing(vertices[0, 2], d)

    # The aberration at h is below 10 (h / R)^2.
    assert foci(r1, r2) == pytest.approx((focal, back_focal), rel=1e-7)
    if math.isfinite(r2):  # the same light from the other side meets the lens turned round
        assert -foci(-r2, -r1)[1] == pytest.approx(front_focal, rel=1e-7)


@each("cartesian")
def test_stigmatic_surfaces(row: Row) -> None:
    """Ellipsoid and hyperboloid bring collimated light to one point at all heights."""
    radius, ior = float(row.p[0].removeprefix("R=")), float(row.p[1])
    focus, down_axis = float(row.v), (0.0, 0.0, -1.0)
    for h in (0.1, 1.0, 3.0, 6.0):
        if row.p[2] == "ellip":
            solid = lens(
                (0.0, 0.0, 0.0), down_axis, (radius, math.inf), 40.0, 7.0, (-1 / ior**2, 0.0)
            )
            found = one(glass(solid, ior), (h, 0.0, 5.0), down_axis, "T")
            vertex, start = 0.0, found.vertices[0, 1]
        else:
            solid = lens(
                (0.0, 0.0, 0.0), down_axis, (math.inf, -radius), 8.0, 7.0, (0.0, -(ior**2))
            )
            found = one(glass(solid, ior), (h, 0.0, 5.0), down_axis, "TT")
            vertex, start = -8.0, found.vertices[0, 2]
        crossing = axis_crossing(start, found.direction[0])
        # A direction's rounding, eps, acts over the lever focus / h on the crossing.
        allowed = 8 * EPS * focus * focus / h
        assert vertex - crossing == pytest.approx(focus, abs=allowed)


@each("aplanatic")
def test_aplanatic_points(row: Row) -> None:
    """All light from R/n inside a ball seems to come from nR."""
    radius, ior = numbers(row.p)
    inner, virtual = numbers(row.v)
    scene = glass(Sphere((0.0, 0.0, 0.0), radius), ior)
    for theta in (1.0, 20.0, 60.0, 85.0):
        found = one(scene, (0.0, 0.0, -inner), (sind(theta), 0.0, cosd(theta)), "T")
        crossing = axis_crossing(found.vertices[0, 1], found.direction[0])
        slope = abs(float(found.direction[0, 0]))
        assert crossing == pytest.approx(-virtual, abs=16 * EPS * virtual / slope)


# --- mirrors of glass, paths ----------------------------------------------------------------------


def corner_of_glass() -> Cell:
    """The corner of a cube at the origin, cut off so that its face looks towards (1, 1, 1)."""
    k = 1 / math.sqrt(3.0)
    planes = [
        Plane((-1.0, 0.0, 0.0), 0.0),
        Plane((0.0, -1.0, 0.0), 0.0),
        Plane((0.0, 0.0, -1.0), 0.0),
        Plane((k, k, k), k),
    ]
    corners: list[Vec] = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    return polyhedron(planes, corners)


@pytest.mark.parametrize("ior", [1.3, 1.5, 2.417])
def test_corner_cube_sends_light_back(ior: float) -> None:
    d = normalise((-1.0, -1.05, -0.93))
    found = one(glass(corner_of_glass(), ior), (0.55, 0.6, 0.5), d, "TRRRT")
    assert found.status[0] != TIR
    assert np.isfinite(found.vertices[0, 5]).all()  # all five interfaces were met
    # Two refractions and three reflections, each within 8 eps.
    assert np.abs(found.direction[0] + np.array(d)).max() <= 5 * 8 * EPS


def test_corner_cube_reflects_totally_above_its_index() -> None:
    """At normal entry the faces are met at 54.7356 degrees: critical for n = sqrt(3/2)."""
    by_name = {str(row.p[0]): float(row.v) for row in rows("corner_cube")}
    least = by_name["n_min cube"]
    c = 1 / math.sqrt(3.0)
    assert math.degrees(math.acos(c)) == pytest.approx(by_name["face angle deg"], rel=4 * EPS)
    assert optics.reflectance(c, least * (1 + 8 * EPS), 1.0) == 1.0
    assert optics.reflectance(c, least * (1 - 8 * EPS), 1.0) < 1.0
    porro = by_name["n_min porro"]
    assert optics.reflectance(math.sqrt(0.5), porro * (1 + 8 * EPS), 1.0) == 1.0
    assert optics.reflectance(math.sqrt(0.5), porro * (1 - 8 * EPS), 1.0) < 1.0


@each("fermat")
def test_light_takes_the_shortest_time(row: Row) -> None:
    ior = float(row.p[0])
    x, optical = numbers(row.v)
    d = normalise((x, 0.0, -1.0))
    found = one(glass(slab(9.0), ior, ends_at=-1.0), (0.0, 0.0, 1.0), d, "T")
    # x minimises a length, so it is known to sqrt(eps) of nothing: its 16 digits are a root's.
    assert found.point[0] == pytest.approx((2.0, 0.0, -1.0), abs=16 * EPS)
    assert found.optical_length[0] == pytest.approx(optical, rel=8 * EPS)


@each("apparent_depth")
def test_apparent_depth(row: Row) -> None:
    """Where neighbouring rays from the bottom of a pool seem to meet, in and across the plane."""
    depth, theta, ior = numbers(row.p)
    paraxial, tangential, sagittal = numbers(row.v)
    scene = glass(slab(50.0), ior)
    inside = math.asin(sind(theta) / ior)
    h = 1e-5

    def leaving(tilt: float) -> tuple[float, float]:
        """(x on the surface, angle in air) of the ray up at `inside` + `tilt`."""
        a = inside + tilt
        found = one(scene, (0.0, 0.0, -depth), (math.sin(a), 0.0, math.cos(a)), "T")
        d = found.direction[0]
        return float(found.vertices[0, 1, 0]), math.atan2(d[0], d[2])

    (x0, a0), (x1, a1) = leaving(-h), leaving(h)
    along_ray = (x1 - x0) / (a1 - a0) * math.cos((a0 + a1) / 2)  # distance to the caustic
    # Central differences of step h err by h^2 and by eps / h.
    assert along_ray * cosd(theta) == pytest.approx(tangential, rel=1e-9)
    x, a = leaving(0.0)
    if theta > 0:
        assert x / math.tan(a) == pytest.approx(sagittal, rel=16 * EPS / math.sin(a))
    else:
        assert tangential == paraxial == sagittal


# --- glasses --------------------------------------------------------------------------------------


@each("sellmeier")
def test_glasses(row: Row) -> None:
    glass = GLASSES[row.p[0].split(" (")[0].removesuffix(" 20C")]
    n_f, n_d, n_c, abbe = numbers(row.v)
    found = (glass.ior(LINE_F), glass.ior(LINE_D), glass.ior(LINE_C))
    assert found == pytest.approx((n_f, n_d, n_c), rel=8 * EPS)
    # n_F - n_C is a small difference.
    assert abbe_number(glass) == pytest.approx(abbe, rel=8 * EPS * n_d / (n_f - n_c) * 4)
    twin = from_abbe(n_d, abbe)
    assert twin.ior(LINE_D) == pytest.approx(n_d, rel=8 * EPS)
    assert abbe_number(twin) == pytest.approx(abbe, rel=1e-12)


def test_a_cylinder_is_a_lens_across_its_axis() -> None:
    """Within a plane across its axis a rod refracts as a ball does."""
    rod = cylinder((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 1.0, 4.0)
    a = one(glass(rod, 1.5, ends_at=-3.0), (0.4, 0.3, 3.0), (0.0, 0.0, -1.0), "TT")
    ball = Sphere((0.0, 0.3, 0.0), 1.0)
    b = one(glass(ball, 1.5, ends_at=-3.0), (0.4, 0.3, 3.0), (0.0, 0.0, -1.0), "TT")
    assert a.point[0] == pytest.approx(b.point[0], abs=8 * EPS)
    assert a.weight == pytest.approx(b.weight, rel=8 * EPS)
