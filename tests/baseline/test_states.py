"""What a check's state is, from numbers that can be followed by head."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.baseline.compare import STEP, against
from harness.baseline.document import Kept
from harness.baseline.means import mean_shift
from harness.baseline.trend import LEVEL, REPEATED, Key, chance, deviations, slope, trends
from harness.record import AgainstBaseline, BaselineState, Verdict
from tests.baseline.documents import baseline, check, image, kept, record, stored_image

SAME, DRIFTED, IMPROVED = BaselineState.SAME, BaselineState.DRIFTED, BaselineState.IMPROVED
REGRESSED, STALE, NEW = BaselineState.REGRESSED, BaselineState.STALE, BaselineState.NEW


def state_of(
    before: float, after: float, approved: Verdict = Verdict.PASS, now: Verdict = Verdict.PASS,
    **more: Any,
) -> AgainstBaseline:  # fmt: skip
    """The state of a check that was off by `before` tolerances and is off by `after`."""
    then = check(off=before, status=approved)
    new = check(off=after, status=now)
    found = against(new, then, record([new]), record([new], **more).runs[0], kept(checks=[then]))
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("before", "after", "state"),
    [
        (0.3, 0.3, SAME),
        (0.3, 0.3 + 0.9 * STEP, SAME),
        (0.3, 0.4, DRIFTED),
        (-0.3, 0.3, DRIFTED),  # as large, but the other way
        (0.3, 0.2, IMPROVED),
        (0.3, -0.1, IMPROVED),
    ],
)
def test_steps_within_tolerance(before: float, after: float, state: BaselineState) -> None:
    assert state_of(before, after).state is state


@pytest.mark.parametrize(
    ("approved", "now", "state"),
    [
        (Verdict.PASS, Verdict.FAIL, REGRESSED),
        (Verdict.KNOWN, Verdict.FAIL, REGRESSED),
        (Verdict.FAIL, Verdict.PASS, IMPROVED),
        (Verdict.FAIL, Verdict.KNOWN, IMPROVED),
        (Verdict.PASS, Verdict.ERROR, REGRESSED),
        (Verdict.PASS, Verdict.SKIP, BaselineState.MISSING),
    ],
)
def test_verdicts_decide_first(approved: Verdict, now: Verdict, state: BaselineState) -> None:
    assert state_of(0.3, 0.3, approved, now).state is state


def test_an_approved_failure_may_stay_but_not_grow() -> None:
    fail = Verdict.FAIL
    assert state_of(40.0, 40.5, fail, fail).state is SAME
    assert state_of(40.0, 44.0, fail, fail).state is REGRESSED
    assert state_of(40.0, 20.0, fail, fail).state is IMPROVED


def test_another_version_with_the_same_numbers_is_said_so() -> None:
    found = state_of(0.3, 0.3, version="2.0")
    assert found.state is BaselineState.RENDERER_CHANGED
    assert "was 1.0 and is 2.0" in found.reason


def test_another_version_does_not_excuse_a_failure() -> None:
    found = state_of(0.3, 3.0, now=Verdict.FAIL, version="2.0")
    assert found.state is REGRESSED
    assert "was 1.0 and is 2.0" in found.reason


def test_what_was_approved_for_another_scene_is_stale() -> None:
    new = check(off=0.3)
    other = kept(checks=[new], scene_fingerprint="f" * 64)
    found = against(new, new, record([new]), record([new]).runs[0], other)
    assert found is not None
    assert found.state is STALE


def test_other_samples_make_a_sampled_baseline_stale_and_no_other() -> None:
    new = check(off=0.3)
    for noisy, state in ((True, STALE), (False, SAME)):
        there = kept(
            checks=[new], settings={"samples": 64, "seed": 0},
            capabilities=["image"] if noisy else ["image", "pixel-centres"],
        )  # fmt: skip
        run = record([new], settings={"samples": 16, "seed": 0}).runs[0]
        found = against(new, new, record([new]), run, there)
        assert found is not None
        assert found.state is state


def test_what_nobody_approved_is_new_unless_it_fails() -> None:
    for status, state in (
        (Verdict.PASS, NEW),
        (Verdict.FAIL, REGRESSED),
        (Verdict.ERROR, REGRESSED),
    ):
        new = check(status=status)
        found = against(new, None, record([new]), record([new]).runs[0], None)
        assert found is not None
        assert found.state is state
    skipped = check(status=Verdict.SKIP)
    assert against(skipped, None, record([skipped]), record([skipped]).runs[0], None) is None


@given(st.floats(-0.99, 0.99), st.floats(-0.99, 0.99))
def test_whatever_stays_within_tolerance_never_fails(before: float, after: float) -> None:
    assert state_of(before, after).state in {SAME, DRIFTED, IMPROVED}


@given(st.floats(-0.99, 0.99), st.floats(-0.99, 0.99))
def test_drift_and_improvement_are_each_others_way_back(before: float, after: float) -> None:
    there, back = state_of(before, after).state, state_of(after, before).state
    assert (there is SAME) == (back is SAME)
    assert not (there is IMPROVED and back is IMPROVED)


def test_a_baseline_holds_no_value_that_is_not_finite() -> None:
    for value in (math.nan, math.inf):
        with pytest.raises(ValueError, match="not finite"):
            baseline(checks=[check(off=value)])


# --- noise or change ------------------------------------------------------------------------------


def test_means_within_their_errors_are_noise() -> None:
    said = mean_shift(stored_image(mean=0.5, error=0.01), image(mean=0.52, error=0.01))
    assert said == "noise: its mean has moved by 1.4 standard errors"  # 0.02 / (0.01 √2)


def test_means_beyond_their_errors_are_none() -> None:
    said = mean_shift(stored_image(mean=0.5, error=0.01), image(mean=0.6, error=0.01))
    assert said.startswith("no noise")


def test_the_same_pixels_say_nothing() -> None:
    assert mean_shift(stored_image(pixels="a"), image(pixels="a", mean=0.7)) == ""


# --- drift ----------------------------------------------------------------------------------------


def runs_of(series: Mapping[Key, Sequence[float]]) -> list[dict[Key, float]]:
    """The deviations of checks run by run; the shorter series are of the first runs."""
    longest = max(map(len, series.values()))
    return [{key: d[k] for key, d in series.items() if k < len(d)} for k in range(longest)]


def test_a_slow_slide_within_tolerance_is_found() -> None:
    slide = [0.01 * k for k in range(10)]
    flat = [0.3] * 10
    (found,) = trends(runs_of({("case", "slides"): slide, ("case", "stays"): flat}))
    assert (found.check, found.runs) == ("slides", 10)
    assert found.slope == pytest.approx(0.01)
    assert "in some 91 runs" in found.reason  # (1 - 0.09) / 0.01


def test_what_hides_in_steps_that_are_the_same_is_named_before_it_matters() -> None:
    """For as many checks as the catalogue has, from the edge of the inner half of a tolerance."""
    checks, step = 2300, 0.999 * STEP
    others = {("c", str(k)): [0.1 * ((7 * j + k) % 10) for j in range(10)] for k in range(checks)}
    slide = [0.5 + step * k for k in range(10)]
    assert {state_of(a, b).state for a, b in itertools.pairwise(slide)} == {SAME}
    for runs, named in ((9, []), (10, ["slides"])):
        series = others | {("c", "slides"): slide[:runs]}
        assert [trend.check for trend in trends(runs_of(series))] == named
    assert slide[-1] < 1 < slide[-1] + 2 * step  # so a step could not be much larger


def test_the_chance_of_a_perfect_order_is_that_of_two_permutations() -> None:
    for n in (5, 8, 10):
        assert chance([k * k for k in range(n)]) == pytest.approx(2 / math.factorial(n))


def test_the_chance_is_what_counting_all_orders_says() -> None:
    """Of the 120 orders of five runs, as many are as monotone as the chance says."""

    def score(order: tuple[int, ...]) -> int:
        return sum(1 if order[j] > order[i] else -1 for i in range(5) for j in range(i + 1, 5))

    orders = list(itertools.permutations(range(5)))
    for order in orders[::17]:
        extreme = sum(abs(score(other)) >= abs(score(order)) for other in orders)
        assert chance(order) == pytest.approx(extreme / 120)


def test_one_step_is_no_drift_and_neither_is_noise_nor_a_speck() -> None:
    step = [0.1] * 9 + [0.4]
    noise = [0.31, 0.12, 0.27, 0.35, 0.11, 0.22, 0.36, 0.14, 0.29, 0.2]
    speck = [1e-12 * k for k in range(10)]
    series = {("c", "step"): step, ("c", "noise"): noise, ("c", "speck"): speck}
    assert trends(runs_of(series)) == []


@pytest.mark.parametrize("rounding", [0.0, 1e-6])
def test_runs_that_repeat_the_one_before_are_no_evidence(rounding: float) -> None:
    """A renderer that changed once, and was run fifteen times before and after, does not slide."""
    once = [0.1 + rounding * (k % 3) for k in range(15)] + [
        0.4 - rounding * (k % 4) for k in range(15)
    ]
    assert trends(runs_of({("c", "once"): once})) == []
    slide = [0.01 * (k // 6) for k in range(60)]  # each step is run six times
    (found,) = trends(runs_of({("c", "once"): once, ("c", "slides"): slide}))
    assert (found.check, found.runs) == ("slides", 10)


def test_steps_too_small_to_count_add_up() -> None:
    slide = [REPEATED / 4 * k for k in range(60)]
    (found,) = trends(runs_of({("c", "slides"): slide}))
    assert found.runs == 15


def test_false_alarms_are_as_rare_as_stated() -> None:
    """200 suites of 20 checks of noise; at the level of 1% more than 8 alarms have a chance of
    3e-4 (binomial).
    """
    import numpy as np

    random = np.random.default_rng(20261125)
    alarms = 0
    for _ in range(200):
        series = {("c", str(k)): list(random.normal(0, 0.2, 12)) for k in range(20)}
        alarms += bool(trends(runs_of(series)))
    assert alarms <= 8
    assert LEVEL == 0.01


def test_slopes_do_not_mind_a_single_odd_run() -> None:
    d = [0.01 * k for k in range(11)]
    d[4] = 0.9
    assert slope(d) == pytest.approx(0.01, rel=0.2)


def test_what_was_not_measured_is_no_part_of_a_series() -> None:
    from harness.record import Summary, SummaryCase

    checks = [check(off=0.5), check(status=Verdict.SKIP), check(status=Verdict.ERROR)]
    summaries = [
        Summary.model_construct(
            cases=[SummaryCase(id="c", family="f", status=Verdict.PASS, checks=[one])]
        )
        for one in checks
    ]
    assert list(map(deviations, summaries)) == [{("c", checks[0].id): 0.5}, {}, {}]


def test_kept_results_are_marked_with_their_hash() -> None:
    there: Kept = kept(checks=[check()])
    assert there.stored().sha256 == there.sha256
    assert there.stored().by == "A. Person"
