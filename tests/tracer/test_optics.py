"""The lecture's functions against published closed forms, 16-digit values and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracer import optics
from tracer.vector import cross, dot

EPS = float(np.finfo(float).eps)


def angle_between(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    """atan2 keeps the digits that acos loses."""
    c = cross(a, b)
    return math.atan2(math.sqrt(dot(c, c)), dot(a, b))


def tolerance(cos_theta_i: float, cos_theta_t: float, ior_i: float, ior_t: float) -> float:
    """8 eps times the derivative of theta_t by theta_i: the condition of refraction."""
    return 8 * EPS * max(1.0, ior_i * cos_theta_i / (ior_t * cos_theta_t))


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
    # The power that passes is the same both ways. Either cosine follows from the other within some
    # roundings, times the tangent of its angle.
    R = optics.reflectance(wi[2], ior_i, ior_t)
    within = 1e-12 / min(wi[2], -wt[2])
    assert optics.reflectance(-wt[2], ior_t, ior_i) == pytest.approx(R, abs=within)


def test_thin_slab_offset() -> None:
    """T sin i (1 - cos i / sqrt(n^2 - sin^2 i)), by mpmath at 1 degree, t = 10, n = 1.5."""
    transmits, d = optics.thin_slab_offset(math.radians(1), 10.0, 1.5)
    assert transmits
    assert d == pytest.approx(0.05818453388702909, rel=8 * EPS)
    assert optics.thin_slab_offset(math.radians(10), 1.0, 1.0) == (True, 0.0)
    assert optics.thin_slab_offset(math.radians(60), 1.0, 0.5) == (False, 0.0)
