"""The lecture's functions against published closed forms, 16-digit values and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracer import optics
from tracer.vector import cross, dot, normalise, sub

EPS = float(np.finfo(float).eps)


def angle_between(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    """atan2 keeps the digits that acos loses."""
    c = cross(a, b)
    return math.atan2(math.sqrt(dot(c, c)), dot(a, b))


def tolerance(cos_theta_i: float, cos_theta_t: float, ior_i: float, ior_t: float) -> float:
    """8 eps times the derivative of theta_t by theta_i: the condition of refraction."""
    return 8 * EPS * max(1.0, ior_i * cos_theta_i / (ior_t * cos_theta_t))


# Values computed with mpmath to 30 digits from theta_t = asin(ior_i sin(theta_i) / ior_t).
@pytest.mark.parametrize(
    ("degrees", "ior_i", "ior_t", "expected"),
    [
        (10, 1.0, 1.5, 6.647777092828615),
        (30, 1.0, 1.5, 19.47122063449069),
        (45, 1.0, 1.5168, 27.78682804593797),
        (60, 1.0, 1.333, 40.51759062233142),
        (89.9, 1.0, 1.5, 41.81023684234895),
        (40, 1.5, 1.0, 74.61856830802032),
    ],
)
def test_snell(degrees: float, ior_i: float, ior_t: float, expected: float) -> None:
    theta_i = math.radians(degrees)
    transmits, theta_t = optics.snell(theta_i, ior_i, ior_t)
    assert transmits
    # One rounding of the angle's radians adds eps * theta_i to what the condition allows.
    allowed = tolerance(math.cos(theta_i), math.cos(theta_t), ior_i, ior_t)
    assert theta_t == pytest.approx(math.radians(expected), abs=allowed)


# mpmath: T = mu D + (mu c - sqrt(1 - mu^2 (1 - c^2))) N with c = -D.N, D and N normalised.
@pytest.mark.parametrize(
    ("direction", "normal", "ior_i", "ior_t", "expected"),
    [
        (
            (1.0, 2.0, -3.0),
            (0.0, 0.0, 1.0),
            1.0,
            1.5,
            (0.1781741612749496, 0.3563483225498992, -0.9172076325837249),
        ),
        (
            (1.0, 2.0, -3.0),
            (2.0, -1.0, 10.0),
            1.0,
            1.5,
            (0.1024208751966723, 0.3942249655890378, -0.9132889142162351),
        ),
        (
            (3.0, -4.0, -12.0),
            (0.0, 0.0, 1.0),
            1.5,
            1.33,
            (0.2602660497397339, -0.3470213996529786, -0.9010203835295637),
        ),
        (
            (5.0, 1.0, -2.0),
            (-1.0, 2.0, 7.0),
            1.0,
            2.417,
            (0.4800582457654292, -0.1292037715533618, -0.8676695604255145),
        ),
    ],
)
@pytest.mark.parametrize(
    "refract",
    [
        optics.refract,
        optics.refract_with_trigonometry,
        optics.refract_without_trigonometry,
    ],
)
def test_refracted_vector(refract, direction, normal, ior_i, ior_t, expected) -> None:  # type: ignore[no-untyped-def]
    d, n = normalise(direction), normalise(normal)
    transmits, wt = refract((-d[0], -d[1], -d[2]), n, ior_i, ior_t)
    assert transmits
    # 16 printed digits, and both angles far from critical: condition below 2.
    assert angle_between(wt, expected) <= 16 * EPS
    assert math.sqrt(dot(sub(wt, expected), sub(wt, expected))) <= 16 * EPS


unit_angles = st.floats(0.0, math.pi / 2 * 0.9999)
indices = st.floats(1.0, 4.0)


@settings(deadline=None)  # the first call compiles
@given(unit_angles, st.floats(0, 2 * math.pi), indices, indices)
def test_both_derivations_of_the_lecture_agree(
    theta: float, phi: float, ior_i: float, ior_t: float
) -> None:
    wi = (math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta))
    n = (0.0, 0.0, 1.0)
    transmits, wt = optics.refract(wi, n, ior_i, ior_t)
    if not transmits or -wt[2] < 0.05:
        return  # next to critical the lecture's own forms lose digits, see the next test
    # sqrt(eps)-free region: all three forms are within eps times the condition number, where the
    # trigonometric one also pays for acos near normal incidence, sqrt(eps).
    for other, allowed in (
        (optics.refract_without_trigonometry, 1e-13),
        (optics.refract_with_trigonometry, 1e-7),
    ):
        same, w = other(wi, n, ior_i, ior_t)
        assert same
        assert angle_between(wt, w) <= allowed


def test_factored_form_is_exact_where_the_usual_ones_are_not() -> None:
    """Mpmath at 50 digits gives cos theta_t; n - 1 = 1e-9 at cos theta_i = 1e-5."""
    cos_theta_i, ior_t = 1e-5, 1.0 + 1e-9
    _, cos_theta_t = optics.cos_transmitted(cos_theta_i, 1.0, ior_t)
    from fractions import Fraction

    n, c = Fraction(ior_t), Fraction(cos_theta_i)
    exact = 1 - (1 - c * c) / (n * n)
    assert abs(Fraction(cos_theta_t) ** 2 / exact - 1) <= Fraction(8 * EPS)
    usual = 1.0 - (1.0 / ior_t) ** 2 * (1.0 - cos_theta_i**2)
    assert abs(Fraction(usual) / exact - 1) > Fraction(1e-9)


@settings(deadline=None)  # the first call compiles
@given(unit_angles, indices, indices)
def test_total_internal_reflection_is_said_exactly_beyond_the_critical_angle(
    theta: float, ior_i: float, ior_t: float
) -> None:
    from fractions import Fraction

    cos_theta_i = math.cos(theta)
    c, ni, nt = Fraction(cos_theta_i), Fraction(ior_i), Fraction(ior_t)
    exact = nt * nt - ni * ni * (1 - c * c)
    if abs(exact) <= nt * nt * Fraction(4 * EPS):
        return  # within rounding of critical both answers are right
    transmits, cos_theta_t = optics.cos_transmitted(cos_theta_i, ior_i, ior_t)
    assert transmits == (exact > 0)
    assert math.isfinite(cos_theta_t)
    R = optics.reflectance(cos_theta_i, ior_i, ior_t)
    assert 0.0 <= R <= 1.0
    assert transmits or R == 1.0


@settings(deadline=None)  # the first call compiles
@given(unit_angles, indices, indices)
def test_light_goes_back_the_way_it_came(theta: float, ior_i: float, ior_t: float) -> None:
    n = (0.0, 0.0, 1.0)
    wi = (math.sin(theta), 0.0, math.cos(theta))
    transmits, wt = optics.refract(wi, n, ior_i, ior_t)
    if not transmits or -wt[2] < 1e-3:
        return
    back, w = optics.refract(wt, (0.0, 0.0, -1.0), ior_t, ior_i)
    assert back
    there = tolerance(wi[2], -wt[2], ior_i, ior_t)
    assert angle_between(w, wi) <= 2 * there * max(1.0, ior_t * -wt[2] / (ior_i * wi[2]))
    # The power that passes is the same both ways.
    R = optics.reflectance(wi[2], ior_i, ior_t)
    assert optics.reflectance(-wt[2], ior_t, ior_i) == pytest.approx(R, abs=1e-12 / -wt[2])


# mpmath: Rs, Rp and their mean.
@pytest.mark.parametrize(
    ("degrees", "expected"),
    [
        (0, (0.04, 0.04, 0.04)),
        (30, (0.05779610540321309, 0.02524914654842999, 0.04152262597582154)),
        (45, (0.0920133630455244, 0.008466458978947476, 0.05023991101223594)),
        (60, (0.1765714880828405, 0.001801937521585036, 0.08918671280221278)),
    ],
)
def test_fresnel(degrees: float, expected: tuple[float, float, float]) -> None:
    c = math.cos(math.radians(degrees))
    _, ct = optics.cos_transmitted(c, 1.0, 1.5)
    found = (
        optics.fresnel_s(c, ct, 1.0, 1.5),
        optics.fresnel_p(c, ct, 1.0, 1.5),
        optics.fresnel_unpolarised(c, ct, 1.0, 1.5),
    )
    # dR/dtheta < 1 here, the angle is known to eps, and a few operations are rounded.
    assert found == pytest.approx(expected, abs=8 * EPS)


def test_brewster_reflects_no_p_light() -> None:
    theta = optics.brewster_angle(1.0, 1.5)
    assert math.degrees(theta) == pytest.approx(56.30993247402021, abs=1e-13)
    _, ct = optics.cos_transmitted(math.cos(theta), 1.0, 1.5)
    assert optics.fresnel_p(math.cos(theta), ct, 1.0, 1.5) <= (8 * EPS) ** 2


@pytest.mark.parametrize(("ior", "expected"), [(1.5, 41.8103148957786), (2.417, 24.43974386545186)])
def test_critical_angle(ior: float, expected: float) -> None:
    assert math.degrees(optics.critical_angle(ior, 1.0)) == pytest.approx(expected, abs=1e-13)
    assert optics.critical_angle(1.0, ior) == math.pi / 2


def test_thin_slab_offset() -> None:
    """T sin i (1 - cos i / sqrt(n^2 - sin^2 i)), by mpmath at 1 degree, t = 10, n = 1.5."""
    transmits, d = optics.thin_slab_offset(math.radians(1), 10.0, 1.5)
    assert transmits
    assert d == pytest.approx(0.05818453388702909, rel=8 * EPS)
    assert optics.thin_slab_offset(math.radians(10), 1.0, 1.0) == (True, 0.0)
    assert optics.thin_slab_offset(math.radians(60), 1.0, 0.5) == (False, 0.0)


@settings(deadline=None)  # the first call compiles
@given(unit_angles, st.floats(0.01, 10), st.floats(1.001, 4.0))
def test_crossing_a_slab_shifts_by_the_closed_form(
    theta: float, thickness: float, ior: float
) -> None:
    wi = (math.sin(theta), 0.0, math.cos(theta))
    transmits, way, length = optics.cross_slab(wi, (0.0, 0.0, 1.0), thickness, 1.0, ior)
    assert transmits
    assert way[2] == pytest.approx(-thickness, rel=8 * EPS)
    assert math.sqrt(dot(way, way)) == pytest.approx(length, rel=8 * EPS)
    # Distance of the exit point from the straight line through the origin along -wi.
    off = cross(way, wi)
    _, d = optics.thin_slab_offset(theta, thickness, ior)
    assert math.copysign(math.sqrt(dot(off, off)), -off[1]) == pytest.approx(
        d, abs=16 * EPS * length
    )
