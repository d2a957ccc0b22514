"""A comparison becomes a verdict, and whatever is odd about it never a PASS."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.measure.comparison import Comparison
from harness.record import SEVERITY, Check, Verdict, worst
from harness.scene.model import CheckSpec, Known
from harness.verdict import check_id, judge, unmeasured

CAUSE = "its next segment starts off the surface"


def compared(error: float = 0.0, tolerance: float = 1.0, **more: Any) -> Comparison:
    """A value of 10 + error where 10 is expected."""
    given_ = {"within": abs(error) <= tolerance, "derivation": "derived"} | more
    return Comparison(10.0 + error, 10.0, tolerance, **given_)


def spec(**more: Any) -> CheckSpec:
    return CheckSpec(observable="exit_point", probe="through", **more)


def known(at_least: float, at_most: float, renderer: str = "fake") -> Known:
    return Known(renderer=renderer, at_least=at_least, at_most=at_most, cause=CAUSE)


def verdict(comparison: Comparison, **more: Any) -> Check:
    return judge(spec(**more), "fake", "truth", comparison)


def test_within_tolerance_passes() -> None:
    check = verdict(compared(0.5))
    assert check.status is Verdict.PASS
    assert check.reason == ""
    assert (check.value, check.expected, check.tolerance) == (10.5, 10.0, 1.0)
    assert (check.unit, check.derivation) == ("units", "derived")


def test_beyond_tolerance_fails_and_says_by_how_much() -> None:
    check = verdict(compared(-2.5))
    assert check.status is Verdict.FAIL
    assert check.reason == "off by 2.5 units, 2.5 times the tolerance"


def test_the_verdict_is_that_on_all_rays_and_not_on_the_one_shown() -> None:
    check = verdict(compared(0.5, within=False))
    assert check.status is Verdict.FAIL
    assert check.reason == "within tolerance where measured"


def test_a_fault_fails_though_all_values_are_within_tolerance() -> None:
    check = verdict(compared(0.0, fault="3 of 7 rays did not arrive"))
    assert check.status is Verdict.FAIL
    assert check.reason == "within tolerance where measured; 3 of 7 rays did not arrive"


def test_a_count_without_tolerance_passes_only_at_zero() -> None:
    tir = CheckSpec(observable="tir")
    assert judge(tir, "a", "truth", Comparison(0, 0, 0, True, "")).status is Verdict.PASS
    check = judge(tir, "a", "truth", Comparison(1, 0, 0, False, ""))
    assert (check.status, check.reason) == (Verdict.FAIL, "off by 1")


# --- a tolerance that the scene states ------------------------------------------------------------


def test_a_stated_tolerance_replaces_the_derived_one() -> None:
    stated = {"tolerance": 3.0, "derivation": "the lecture says so"}
    check = verdict(compared(2.5), **stated)
    assert check.status is Verdict.PASS
    assert (check.tolerance, check.derivation) == (3.0, "the lecture says so")
    assert verdict(compared(0.5), tolerance=0.1).status is Verdict.FAIL


def test_a_stated_tolerance_is_held_against_the_worst_of_all() -> None:
    """The ray that comes nearest to its own limit need not be the one that is furthest off."""
    check = verdict(compared(0.5, detail={"max": 4.0}), tolerance=3.0)
    assert check.status is Verdict.FAIL
    assert check.reason.startswith("off by 4 units")


def test_a_stated_tolerance_excuses_no_fault() -> None:
    assert verdict(compared(0.0, fault="ghosts"), tolerance=99.0).status is Verdict.FAIL


# --- what is not a number -------------------------------------------------------------------------

NOT_FINITE = st.sampled_from([math.nan, math.inf, -math.inf])
ODD = st.one_of(NOT_FINITE, st.floats(-2, 2))


@given(ODD, ODD, ODD, ODD, st.booleans(), st.booleans())
def test_nothing_that_is_not_finite_passes(
    value: float, expected: float, tolerance: float, largest: float, within: bool, stated: bool
) -> None:
    comparison = Comparison(value, expected, tolerance, within, "", detail={"max": largest})
    asked = spec(tolerance=1.0) if stated else spec()
    check = judge(asked, "fake", "truth", comparison)
    numbers = (value, expected, largest, *(() if stated else (tolerance,)))
    if not all(map(math.isfinite, numbers)):
        assert check.status is Verdict.ERROR
        assert check.reason == "the measurement is not finite"
        assert check.value is check.expected is check.tolerance is None
    elif check.status is Verdict.PASS:
        assert not stated or max(abs(value - expected), largest) <= 1.0
        assert stated or within


# --- documented deviations ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (0.5, Verdict.FAIL, "the documented deviation of 2 to 4 units is gone"),
        (1.5, Verdict.FAIL, "off by 1.5 units, outside the documented 2 to 4 units"),
        (2.0, Verdict.KNOWN, "off by 2 units"),
        (-3.0, Verdict.KNOWN, "off by 3 units"),
        (4.0, Verdict.KNOWN, "off by 4 units"),
        (4.1, Verdict.FAIL, "off by 4.1 units, outside the documented 2 to 4 units"),
    ],
)
def test_a_documented_deviation_must_be_as_documented(
    error: float, status: Verdict, said: str
) -> None:
    check = verdict(compared(error), known=(known(2, 4),))
    assert check.status is status
    assert said in check.reason
    assert CAUSE in check.reason


def test_a_deviation_that_may_be_nothing_need_not_be_there() -> None:
    assert verdict(compared(0.5), known=(known(0, 4),)).status is Verdict.PASS
    assert verdict(compared(2.0), known=(known(0, 4),)).status is Verdict.KNOWN


def test_a_deviation_of_another_renderer_excuses_nobody() -> None:
    assert verdict(compared(3.0), known=(known(2, 4, "other"),)).status is Verdict.FAIL


def test_a_deviation_of_either_renderer_of_a_pair_counts() -> None:
    check = judge(spec(known=(known(2, 4, "b"),)), "a", "b", compared(3.0))
    assert check.status is Verdict.KNOWN


def test_a_documented_deviation_excuses_no_fault() -> None:
    """Rays that are lost are not part of a deviation of so many units."""
    check = verdict(compared(3.0, fault="3 of 7 rays did not arrive"), known=(known(2, 4),))
    assert check.status is Verdict.FAIL
    assert "3 of 7 rays did not arrive" in check.reason


# --- what could not be measured, and wholes -------------------------------------------------------


@pytest.mark.parametrize("status", [Verdict.SKIP, Verdict.ERROR])
def test_what_could_not_be_measured_has_no_value(status: Verdict) -> None:
    check = unmeasured(spec(), "fake", "truth", status, "it crashed")
    assert (check.status, check.reason) == (status, "it crashed")
    assert check.value is check.expected is check.tolerance is None


def test_ids_tell_checks_apart() -> None:
    ids = {
        check_id(CheckSpec(observable=o, probe=p), r, a)
        for o in ("exit_point", "exit_direction")
        for p in (None, "in", "out")
        for r in ("a", "b")
        for a in ("truth", "c")
    }
    assert len(ids) == 24
    assert check_id(spec(), "fake", "truth") == "exit_point(through)/fake/truth"


def test_the_worst_part_decides_and_nothing_at_all_is_an_error() -> None:
    assert worst([]) is Verdict.ERROR
    assert worst([Verdict.PASS]) is Verdict.PASS
    for index, verdict_ in enumerate(SEVERITY):
        assert worst(list(SEVERITY[index:])) is verdict_
    assert set(SEVERITY) == set(Verdict)
