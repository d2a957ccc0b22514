"""The closed forms against a catalogue computed with other software, and against their own laws.

A tolerance is 8 eps times a condition number: eight roundings in sequence, each of which acts like
a relative error eps of an argument or of the value (`tests.catalogue.rounding_bound`).
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from harness import expected
from harness.expected import Float
from tests.catalogue import EPS, Row, numbers, rounding_bound, rows

INDICES = st.floats(1.0, 4.0)
COMPONENTS = st.floats(-1.0, 1.0)
VECTORS = st.tuples(COMPONENTS, COMPONENTS, COMPONENTS).filter(lambda v: math.hypot(*v) > 0.1)


def one(x: float) -> Float:
    return np.array([x])


def check(value: float, truth: str, bound: float) -> None:
    # The catalogue's own last digit is rounded: half a unit of the 16th.
    assert abs(value - float(truth)) <= bound + 5e-16 * abs(float(truth)), (value, truth)


# --- against the catalogue ------------------------------------------------------------------------


@pytest.mark.parametrize("row", rows("snell"), ids=str)
def test_snell(row: Row) -> None:
    def formula(degrees: float, ior_i: float, ior_t: float) -> float:
        return math.degrees(expected.snell_angle(one(math.radians(degrees)), ior_i, ior_t)[0])

    arguments = numbers(row.p)
    check(formula(*arguments), row.v, rounding_bound(formula, *arguments))


@pytest.mark.parametrize("row", rows("cond_snell"), ids=str)
def test_the_bounds_of_these_tests_know_the_condition_of_snells_law(row: Row) -> None:
    """Towards the critical angle it grows without limit; a bound must follow, and not beyond."""
    degrees, ior_i, ior_t = numbers(row.p)

    def formula(theta: float) -> float:
        return float(expected.snell_angle(one(theta), ior_i, ior_t)[0])

    theta = math.radians(degrees)
    condition = rounding_bound(formula, theta) / (8 * EPS) - formula(theta)
    # Its differences step over a fifth of the way to the critical angle in the last row.
    assert condition == pytest.approx(theta * float(row.v), rel=1e-2)


@pytest.mark.parametrize("row", rows("vector"), ids=str)
def test_refraction_of_vectors(row: Row) -> None:
    _, d, _, n, _, ratio = row.p
    direction, normal = np.array([d], float), np.array([n], float)
    direction /= np.linalg.norm(direction)
    normal /= np.linalg.norm(normal)
    ior_i, ior_t = numbers(ratio.split("/"))
    bent, total = expected.refract(direction, normal, one(ior_i), one(ior_t))
    assert not total[0]
    cos_i = -float(direction[0] @ normal[0])
    cos_t = -float(np.array(numbers(row.v)) @ normal[0])
    # Derivative of theta_t by theta_i; the two vectors bring their own rounding of 4 operations.
    condition = max(1.0, ior_i * cos_i / (ior_t * cos_t))
    for value, truth in zip(bent[0], row.v, strict=True):
        check(value, truth, 8 * EPS * condition)


@pytest.mark.parametrize("row", rows("critical"), ids=str)
def test_critical_angle(row: Row) -> None:
    def formula(ior_i: float, ior_t: float) -> float:
        return math.degrees(expected.critical_angle(ior_i, ior_t))

    arguments = numbers(row.p)
    check(formula(*arguments), row.v, rounding_bound(formula, *arguments))


def unpolarised(degrees: float, ior_i: float, ior_t: float) -> float:
    cos_theta_i = one(math.cos(math.radians(degrees)))
    return float(expected.fresnel(cos_theta_i, one(ior_i), one(ior_t))[0])


@pytest.mark.parametrize("row", rows("fresnel"), ids=str)
def test_fresnel(row: Row) -> None:
    arguments = numbers(row.p)
    check(unpolarised(*arguments), row.v[2], rounding_bound(unpolarised, *arguments))


@pytest.mark.parametrize("row", rows("brewster"), ids=str)
def test_at_brewsters_angle_only_half_the_light_is_reflected_at_all(row: Row) -> None:
    """R_p = 0 there, and R_s = ((1 - t^2) / (1 + t^2))^2 with t = tan(theta_B) = ior_t / ior_i."""
    ior_i, ior_t = numbers(row.p)
    t2 = (ior_t / ior_i) ** 2
    truth = 0.5 * ((1 - t2) / (1 + t2)) ** 2
    value = unpolarised(float(row.v), ior_i, ior_t)
    assert abs(value - truth) <= rounding_bound(unpolarised, float(row.v), ior_i, ior_t)


@pytest.mark.parametrize("row", rows("slab_offset"), ids=str)
def test_slab_offset(row: Row) -> None:
    def formula(thickness: float, degrees: float, ior: float) -> float:
        return float(expected.slab_offset(one(math.radians(degrees)), thickness, ior)[0])

    arguments = numbers(row.p)
    check(formula(*arguments), row.v[0], rounding_bound(formula, *arguments))


@pytest.mark.parametrize("row", rows("stack_offset"), ids=str)
def test_a_stack_shifts_as_its_slabs_do_one_by_one(row: Row) -> None:
    """The angle in a layer depends on its own index only, wherever in the stack it lies."""
    degrees, layers = float(row.p[0]), [numbers(layer) for layer in row.p[1]]

    def formula(theta: float, thickness: float, ior: float) -> float:
        return float(expected.slab_offset(one(math.radians(theta)), thickness, ior)[0])

    total = sum(formula(degrees, *layer) for layer in layers)
    check(total, row.v, sum(rounding_bound(formula, degrees, *layer) for layer in layers))


def deviation(degrees: float, apex: float, ior: float) -> float:
    found = expected.prism_deviation(one(math.radians(degrees)), math.radians(apex), ior)
    return math.degrees(found[0])


@pytest.mark.parametrize("row", rows("prism_dev"), ids=str)
def test_prism_deviation(row: Row) -> None:
    arguments = numbers(row.p)
    check(deviation(*arguments), row.v, rounding_bound(deviation, *arguments))


@pytest.mark.parametrize("row", rows("wedge"), ids=str)
def test_a_wedge_is_a_prism_entered_at_right_angles(row: Row) -> None:
    apex, ior = numbers(row.p)
    # The deviation is a small difference of angles as large as the apex: its rounding counts.
    bound = rounding_bound(deviation, 0.0, apex, ior) + 8 * EPS * apex
    check(deviation(0.0, apex, ior), row.v[0], bound)


@pytest.mark.parametrize("row", rows("prism_mindev"), ids=str)
def test_minimum_deviation(row: Row) -> None:
    def formula(apex: float, ior: float) -> float:
        return math.degrees(expected.prism_minimum_deviation(math.radians(apex), ior))

    arguments = numbers(row.p)
    check(formula(*arguments), row.v[0], rounding_bound(formula, *arguments))
    # It is the deviation at the catalogue's angle of incidence, and less than on either side.
    at = [deviation(float(row.v[1]) + step, *arguments) for step in (-1e-3, 0, 1e-3)]
    check(at[1], row.v[0], rounding_bound(deviation, float(row.v[1]), *arguments))
    assert at[0] > at[1] < at[2]


@pytest.mark.parametrize("row", rows("prism_imin"), ids=str)
def test_first_transmitting_angle(row: Row) -> None:
    def formula(apex: float, ior: float) -> float:
        return math.degrees(expected.prism_first_transmitting_angle(math.radians(apex), ior))

    apex, ior = numbers(row.p)
    check(formula(apex, ior), row.v, rounding_bound(formula, apex, ior))
    assert math.isnan(deviation(float(row.v) - 1e-9, apex, ior))
    assert math.isfinite(deviation(float(row.v) + 1e-9, apex, ior))


def test_what_has_no_angle_is_nan_and_never_a_number() -> None:
    beyond = np.radians([42.0, 60.0, 89.0])
    assert np.isnan(expected.snell_angle(beyond, 1.5, 1.0)).all()


def test_the_lectures_table_is_not_snells_law() -> None:
    """The lecture prints 60 degrees for grazing incidence; mu = 0.67 gives 42.07."""
    theta = np.radians([90.0])
    table = np.degrees(expected.lecture_table_angle(theta))[0]
    law = np.degrees(expected.snell_angle(theta, 0.67, 1.0))[0]
    assert table == pytest.approx(60.0, rel=1e-15)
    assert table - law == pytest.approx(17.93, abs=0.005)


# --- laws -----------------------------------------------------------------------------------------


def facing(d: tuple[float, float, float], n: tuple[float, float, float]) -> tuple[Float, Float]:
    """Unit direction and unit normal, (1, 3) each, the normal against the direction."""
    direction, normal = np.array([d]) / math.hypot(*d), np.array([n]) / math.hypot(*n)
    cosine = float(direction[0] @ normal[0])
    assume(abs(cosine) > 1e-3)
    return direction, normal if cosine < 0 else -normal


@given(VECTORS, VECTORS, INDICES, INDICES)
def test_refract_obeys_the_law(
    d: tuple[float, float, float], n: tuple[float, float, float], ior_i: float, ior_t: float
) -> None:
    """Unit length, in the plane of incidence, and the same tangential n d on both sides."""
    direction, normal = facing(d, n)
    bent, total = expected.refract(direction, normal, one(ior_i), one(ior_t))
    tangential_i = np.cross(normal, direction)[0]
    if total[0]:
        assert ior_i * np.linalg.norm(tangential_i) >= ior_t * (1 - 8 * EPS)
        return
    assert abs(np.linalg.norm(bent[0]) - 1) <= 4 * EPS
    tangential_t = np.cross(normal, bent)[0]
    # Of vectors of length 1 nothing is lost to cancellation: errors are absolute. The index
    # multiplies them.
    assert np.abs(ior_i * tangential_i - ior_t * tangential_t).max() <= 8 * EPS * (ior_i + ior_t)
    assert float(bent[0] @ normal[0]) <= 0  # it goes on, not back


@given(VECTORS, VECTORS, INDICES, INDICES)
def test_refraction_can_be_reversed(
    d: tuple[float, float, float], n: tuple[float, float, float], ior_i: float, ior_t: float
) -> None:
    direction, normal = facing(d, n)
    bent, total = expected.refract(direction, normal, one(ior_i), one(ior_t))
    assume(not total[0])
    cos_t = -float(bent[0] @ normal[0])
    cos_i = -float(direction[0] @ normal[0])
    assume(cos_t > 1e-3)
    back, total = expected.refract(-bent, -normal, one(ior_t), one(ior_i))
    assert not total[0]
    # The way there errs by its own condition, which the way back multiplies by its inverse.
    there = max(1.0, ior_i * cos_i / (ior_t * cos_t))
    again = max(1.0, ior_t * cos_t / (ior_i * cos_i))
    assert np.abs(back + direction).max() <= 8 * EPS * (there * again + again)


@given(VECTORS, VECTORS)
def test_a_mirror_turns_the_normal_part_round(
    d: tuple[float, float, float], n: tuple[float, float, float]
) -> None:
    direction, normal = facing(d, n)
    mirrored = expected.reflect(direction, normal)
    assert np.abs(np.cross(normal, mirrored - direction)).max() <= 8 * EPS
    assert abs(float((mirrored + direction)[0] @ normal[0])) <= 8 * EPS


@given(st.floats(0, 1), INDICES, INDICES)
def test_reflectance_is_a_share_and_the_same_from_both_sides(
    cos_theta_i: float, ior_i: float, ior_t: float
) -> None:
    """Stokes: the reflectance of an interface does not ask from where the ray comes."""
    R = float(expected.fresnel(one(cos_theta_i), one(ior_i), one(ior_t))[0])
    assert 0 <= R <= 1
    sin_t = ior_i / ior_t * math.sqrt(1 - cos_theta_i**2)
    if R == 1 or sin_t >= 1:
        return
    cos_theta_t = math.sqrt((1 - sin_t) * (1 + sin_t))
    assume(cos_theta_t > 1e-3 and cos_theta_i > 1e-3)
    back = float(expected.fresnel(one(cos_theta_t), one(ior_t), one(ior_i))[0])
    # cos_theta_t errs by eps / cos_theta_t here, and by it cos_theta_i, found again on the way
    # back, by (ior_t / ior_i)^2 eps / cos_theta_i. An amplitude (a - b) / (a + b) has the slope
    # 2 / (a + b) at most in a and b, its square twice that; a and b are cosines times an index,
    # which is 1 at least and 4 at most.
    slope = 2 * 2 * 4 / (cos_theta_i + cos_theta_t)
    errs = 1 / cos_theta_t + 16 / cos_theta_i
    assert abs(back - R) <= 8 * EPS * (1 + slope * errs)


@given(st.floats(1e-9, 1), INDICES)
def test_no_interface_reflects_nothing(cos_theta_i: float, ior: float) -> None:
    assert expected.fresnel(one(cos_theta_i), one(ior), one(ior))[0] <= EPS**2


@given(st.floats(0.01, 0.999), st.floats(1.001, 3.0))
def test_beyond_the_critical_angle_everything_is_reflected(share: float, ior: float) -> None:
    critical = expected.critical_angle(ior, 1.0)
    theta = one(critical + share * (math.pi / 2 - critical))
    direction = np.array([[math.sin(theta[0]), 0.0, -math.cos(theta[0])]])
    _, total = expected.refract(direction, np.array([[0.0, 0.0, 1.0]]), one(ior), one(1.0))
    assert total[0]
    assert expected.fresnel(np.cos(theta), one(ior), one(1.0))[0] == 1
    below = one(critical * (1 - share / 10))
    assert expected.fresnel(np.cos(below), one(ior), one(1.0))[0] < 1


@given(
    st.floats(0, 1.5), st.floats(1.0, 3.0), st.lists(st.floats(0.01, 10), min_size=1, max_size=6)
)
def test_slabs_add_up(theta: float, ior: float, parts: list[float]) -> None:
    whole = expected.slab_offset(one(theta), sum(parts), ior)[0]
    pieces = sum(expected.slab_offset(one(theta), part, ior)[0] for part in parts)
    # Each part is the same factor times its thickness, so only products and sums are rounded.
    assert abs(whole - pieces) <= (len(parts) + 8) * EPS * sum(parts)


@given(st.floats(0.02, 1.5), st.floats(1.0, 3.0))
def test_a_slab_shifts_by_less_than_its_thickness_and_glass_towards_the_normal(
    theta: float, ior: float
) -> None:
    offset = float(expected.slab_offset(one(theta), 1.0, ior)[0])
    # n^2 - sin^2 cancels where n is near 1 and the ray grazes: to cos^2, with an error of eps.
    bound = 8 * EPS / math.cos(theta) ** 2
    assert -bound <= offset <= math.sin(theta) + bound


@given(st.floats(0.1, 1.3), st.floats(1.05, 1.5))
def test_prism_deviation_is_least_where_the_ray_passes_symmetrically(
    apex: float, ior: float
) -> None:
    least = expected.prism_minimum_deviation(apex, ior)
    symmetric = math.asin(ior * math.sin(apex / 2))
    theta = np.clip(symmetric + np.linspace(-0.2, 0.2, 41), -1.5, 1.5)
    found = expected.prism_deviation(theta, apex, ior)
    # The same angle by another formula; near grazing exit asin is steep.
    steep = 1 / math.sqrt(1 - (ior * math.sin(apex / 2)) ** 2)
    assert np.nanmin(found) >= least - 16 * EPS * steep
    assert abs(found[20] - least) <= 16 * EPS * steep


def test_cross_is_numpys_product_bit_for_bit() -> None:
    a, b = np.random.default_rng(12).normal(size=(2, 500, 3)) * [1e-9, 1, 1e9]
    assert np.array_equal(expected.cross(a, b), np.cross(a, b))
