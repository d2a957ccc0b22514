"""Closed forms of whole systems against a catalogue computed with other software.

A tolerance is 8 eps times a condition number, as in `test_expected`.
"""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness import expected, expected_systems
from tests.catalogue import EPS, Row, numbers, rounding_bound, rows


def check(value: float, truth: str, bound: float) -> None:
    # The catalogue's own last digit is rounded: half a unit of the 16th.
    assert abs(value - float(truth)) <= bound + 5e-16 * abs(float(truth)), (value, truth)


@pytest.mark.parametrize("row", rows("ball_paraxial"), ids=str)
def test_ball_focal_length(row: Row) -> None:
    radius, n = numbers(row.p)
    bound = rounding_bound(expected_systems.ball_focal_length, radius, n)
    check(expected_systems.ball_focal_length(radius, n), row.v[0], bound)
    # The back focal length is that less the radius.
    check(expected_systems.ball_focal_length(radius, n) - radius, row.v[1], bound + EPS * radius)


@pytest.mark.parametrize("row", rows("ball_real"), ids=str)
def test_where_real_rays_cross_the_axis(row: Row) -> None:
    def formula(height: float, radius: float, n: float) -> float:
        return float(expected_systems.ball_crossing(np.asarray(height), radius, n))

    arguments = numbers(row.p)
    check(formula(*arguments), row.v[0], rounding_bound(formula, *arguments))


@pytest.mark.parametrize("row", rows("rainbow"), ids=str)
def test_rainbows(row: Row) -> None:
    n, reflections = float(row.p[0]), int(row.p[1])

    def formula(ior: float) -> float:
        return math.degrees(expected_systems.rainbow_least_deviation(ior, reflections))

    check(formula(n), row.v[1], rounding_bound(formula, n))
    bow = abs(180 - formula(n))
    # The difference of two numbers of like size keeps their absolute errors.
    check(bow, row.v[2], rounding_bound(formula, n) + 8 * EPS * 180 * reflections)


@pytest.mark.parametrize("reflections", [1, 2, 3])
def test_a_bow_stands_where_the_turn_is_stationary(reflections: int) -> None:
    sin_i = np.linspace(0.3, 0.9999, 20001)
    turn = expected_systems.rainbow_deviation(sin_i, 1.0, 1.333, reflections)
    least = expected_systems.rainbow_least_deviation(1.333, reflections)
    # Near a minimum the curve rises by half its second derivative, below 20, times a step squared.
    assert -8 * EPS * 10 <= turn.min() - least <= 20 * (sin_i[1] - sin_i[0]) ** 2


@pytest.mark.parametrize("row", rows("aplanatic"), ids=str)
def test_aplanatic_points(row: Row) -> None:
    radius, n = numbers(row.p)
    check(expected_systems.aplanatic_object(radius, n), row.v[0], 8 * EPS * radius / n)
    check(expected_systems.aplanatic_image(radius, n), row.v[1], 8 * EPS * radius * n)


@pytest.mark.parametrize("row", rows("thick_lens"), ids=str)
def test_thick_lenses(row: Row) -> None:
    r1, r2, n, thickness = numbers(row.p)

    def focal(ior: float, d: float) -> float:
        return 1 / expected_systems.lens_power(r1, r2, ior, d)

    def back(ior: float, d: float) -> float:
        return expected_systems.lens_back_focal_length(r1, r2, ior, d)

    check(focal(n, thickness), row.v[0], rounding_bound(focal, n, thickness))
    check(back(n, thickness), row.v[1], rounding_bound(back, n, thickness))


@pytest.mark.parametrize("row", rows("cartesian"), ids=str)
def test_cartesian_surfaces(row: Row) -> None:
    radius, n = float(str(row.p[0]).removeprefix("R=")), float(row.p[1])
    focus = {
        "ellip": expected_systems.cartesian_ellipsoid_focus,
        "hyperb": expected_systems.cartesian_hyperboloid_focus,
    }[row.p[2]]
    check(focus(radius, n), row.v, 16 * EPS * float(row.v))


@pytest.mark.parametrize("row", rows("apparent_depth"), ids=str)
def test_apparent_depth(row: Row) -> None:
    depth, degrees, n = numbers(row.p)

    def sagittal(theta: float, ior: float) -> float:
        return float(expected_systems.sagittal_depth(np.asarray(theta), depth, ior))

    def tangential(theta: float, ior: float) -> float:
        return float(expected_systems.tangential_depth(np.asarray(theta), depth, ior))

    theta = math.radians(degrees)
    check(tangential(theta, n), row.v[1], rounding_bound(tangential, theta, n))
    check(sagittal(theta, n), row.v[2], rounding_bound(sagittal, theta, n))


@pytest.mark.parametrize("row", rows("sellmeier"), ids=str)
def test_abbe_numbers(row: Row) -> None:
    ior_f, ior_d, ior_c, abbe = numbers(row.v)
    formula = expected_systems.abbe_number
    bound = rounding_bound(formula, ior_f, ior_d, ior_c)
    assert abs(formula(ior_f, ior_d, ior_c) - abbe) <= bound


@pytest.mark.parametrize("row", rows("stack_offset"), ids=str)
def test_stack_offset(row: Row) -> None:
    degrees = row.p[0]
    layers = [(float(t), float(n)) for t, n in row.p[1]]

    def formula(theta: float) -> float:
        return float(expected.stack_offset(np.asarray(theta), layers))

    theta = math.radians(float(degrees))
    # The index of each layer is rounded too; its shift moves by less than twice its thickness.
    own = 8 * EPS * 2 * sum(t for t, _ in layers)
    check(formula(theta), row.v, rounding_bound(formula, theta) + own)


@pytest.mark.parametrize("row", rows("brewster"), ids=str)
def test_brewsters_angle(row: Row) -> None:
    def formula(ior_i: float, ior_t: float) -> float:
        return math.degrees(expected.brewster_angle(ior_i, ior_t))

    arguments = numbers(row.p)
    check(formula(*arguments), row.v, rounding_bound(formula, *arguments))


@given(st.floats(1.01, 4))
def test_half_the_light_is_not_reflected_at_brewsters_angle(n: float) -> None:
    angle = expected.brewster_angle(1.0, n)
    reflectance = expected.fresnel(np.cos(np.array([angle])), np.array([1.0]), np.array([n]))[0]
    assert abs(reflectance - expected.brewster_reflectance(1.0, n)) <= 64 * EPS


@pytest.mark.parametrize("row", rows("slab_RT"), ids=str)
def test_a_slab_in_nature(row: Row) -> None:
    """Once for each polarisation, then the mean."""
    degrees, n, alpha, thickness = numbers(row.p)
    theta = math.radians(degrees)
    cos_i, cos_t = math.cos(theta), math.sqrt(1 - (math.sin(theta) / n) ** 2)
    left = np.asarray(math.exp(-alpha * thickness / cos_t))
    r = [(cos_i - n * cos_t) / (cos_i + n * cos_t), (n * cos_i - cos_t) / (n * cos_i + cos_t)]
    both = [expected_systems.parallel_slab_light(np.asarray(x * x), left) for x in r]
    for value, truth in zip((x for pair in both for x in pair), row.v[:4], strict=True):
        # Fresnel coefficients near grazing incidence are ill-conditioned: 1 / cos.
        assert abs(float(value) - float(truth)) <= 64 * EPS / cos_i


def corner_cube(n: float, e: float) -> tuple[np.ndarray, ...]:
    """Front and mirrors of a cube whose first two faces meet at pi / 2 + e, towards the inside."""
    first, second = np.array([1.0, 0, 0]), np.array([math.sin(e), math.cos(e), 0])
    edges = np.array([[math.cos(e), -math.sin(e), 0], [0, 1, 0], [0, 0, 1]])
    front = np.cross(edges[1] - edges[0], edges[2] - edges[0])
    return front / np.linalg.norm(front), first, second, np.array([0, 0, 1.0])


@pytest.mark.parametrize("n", [1.0, 1.5168, 1.7847])
@pytest.mark.parametrize("e", [1e-6, 1e-3])
def test_a_corner_cube_sends_back_what_yoder_says(n: float, e: float) -> None:
    """2 sqrt(2 / 3) n e, seen at right angles to the front; what is left is of second order."""
    front, first, second, _ = (v[None] for v in corner_cube(n, e))
    back = expected_systems.corner_cube_return(-front, front, first, second, np.array([n]))
    error = math.atan2(np.linalg.norm(np.cross(back, front)), float((back * front).sum()))
    assert abs(error - 2 * math.sqrt(2 / 3) * n * e) <= 4 * n * e**2 + 8 * EPS


@pytest.mark.parametrize("order", list(permutations(range(3))))
@pytest.mark.parametrize("e", [0.0, 0.01, -0.2])
def test_three_mirrors_one_after_another_send_back_the_same(
    order: tuple[int, ...], e: float
) -> None:
    n, (front, *mirrors) = 1.5168, corner_cube(1.5168, e)
    d = np.array([-0.4, -0.7, -0.5])
    d /= np.linalg.norm(d)
    one, glass = np.array([1.0]), np.array([n])
    ray, _ = expected.refract(d[None], front[None], one, glass)
    for k in order:
        ray = expected.reflect(ray, mirrors[k][None])
    out, _ = expected.refract(ray, -front[None], glass, one)
    first, second = (mirrors[k][None] for k in order if k != 2)
    closed = expected_systems.corner_cube_return(d[None], front[None], first, second, glass)
    # Twelve steps of a few roundings each.
    np.testing.assert_allclose(closed, out, rtol=0, atol=64 * EPS)


@given(st.floats(0.01, 3.1), st.floats(-0.9, 0.9), st.floats(1.01, 2.5))
def test_no_surface_that_is_round_about_an_axis_changes_skewness(
    turn: float, slope: float, n: float
) -> None:
    """The normal is any that meets the axis z or is parallel to it: here, of a cone."""
    axis, point = np.array([0, 0, 1.0]), np.array([[math.cos(turn), math.sin(turn), 0.3]])
    normal = np.column_stack([point[:, :2], [slope]]) / math.hypot(1, slope)
    d = np.array([[-0.6, 0.64, 0.48]])
    facing = normal if (d * normal).sum() < 0 else -normal
    bent, total = expected.refract(d, facing, np.array([1.0]), np.array([n]))
    assert not total.any()
    before, behind = (
        expected_systems.skewness(point, ray, axis, ior) for ray, ior in ((d, 1.0), (bent, n))
    )
    assert abs(before - behind) <= 32 * EPS * n
