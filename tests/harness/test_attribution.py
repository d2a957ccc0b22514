"""Who is off: by truth, by agreement, or nobody can tell."""

from __future__ import annotations

import pytest

from harness.judging.attribution import ALIKE, WRONG, attributed, most_likely_right
from harness.record import Attribution, Check, Verdict


def check(renderer: str, against: str, status: Verdict, observable: str = "ssim") -> Check:
    return Check(
        id=f"{observable}/{renderer}/{against}", renderer=renderer, against=against,
        observable=observable, value=0.0, expected=1.0, tolerance=0.1, unit="", status=status,
        reason="",
    )  # fmt: skip


def pairs(agree: set[frozenset[str]], names: str) -> list[Check]:
    """All pairs of one-letter renderers; those in `agree` pass."""
    return [
        check(a, b, Verdict.PASS if frozenset({a, b}) in agree else Verdict.FAIL)
        for k, a in enumerate(names)
        for b in names[k + 1 :]
    ]


def of(checks: list[Check], check_id: str) -> Attribution:
    found = next(c.attribution for c in attributed(checks) if c.id == check_id)
    assert found is not None
    return found


def test_what_passes_needs_nobody_to_blame() -> None:
    (passed,) = attributed([check("a", "b", Verdict.PASS)])
    assert passed.attribution is None


def test_whoever_differs_from_the_truth_is_off() -> None:
    found = of([check("a", "truth", Verdict.FAIL, "exit_point")], "exit_point/a/truth")
    assert (found.off, found.how, found.confidence) == (["a"], "truth", 1.0)


@pytest.mark.parametrize("status", [Verdict.FAIL, Verdict.KNOWN])
def test_the_truth_decides_between_two_renderers(status: Verdict) -> None:
    checks = [
        check("a", "truth", Verdict.PASS, "exit_point"),
        check("b", "truth", status, "exit_point"),
        check("a", "b", Verdict.FAIL),
    ]
    found = of(checks, "ssim/a/b")
    assert (found.off, found.how) == (["b"], "truth")
    assert "exit_point" in found.sentence


def test_both_can_be_off() -> None:
    checks = [check(n, "truth", Verdict.FAIL, "exit_point") for n in "ab"]
    found = of([*checks, check("a", "b", Verdict.FAIL)], "ssim/a/b")
    assert found.off == ["a", "b"]


def test_two_alone_cannot_tell() -> None:
    found = of([check("a", "b", Verdict.FAIL)], "ssim/a/b")
    assert (found.off, found.how) == ([], "undecided")
    assert "cannot tell" in found.sentence


def test_a_truth_that_one_of_two_was_not_held_against_decides_nothing() -> None:
    checks = [check("a", "truth", Verdict.PASS, "exit_point"), check("a", "b", Verdict.FAIL)]
    assert of(checks, "ssim/a/b").how == "undecided"


def test_two_who_agree_outvote_a_third() -> None:
    found = of(pairs({frozenset("ab")}, "abc"), "ssim/b/c")
    assert (found.off, found.how) == (["c"], "agreement")
    # Bayes, by hand: {a, b} right; c right; nobody right.
    right = 0.9 * 0.9 * 0.1
    rest = 0.1 * 0.1 * ALIKE * 0.9 + 0.1 * 0.1 * ALIKE * 0.1
    assert WRONG == 0.1
    assert found.confidence == pytest.approx(right / (right + rest))


def test_two_against_two_cannot_tell() -> None:
    found = of(pairs({frozenset("ab"), frozenset("cd")}, "abcd"), "ssim/a/c")
    assert found.how == "undecided"


def test_three_who_all_differ_cannot_tell() -> None:
    assert of(pairs(set(), "abc"), "ssim/a/b").how == "undecided"


def test_two_outsiders_are_both_off_where_the_rest_agrees() -> None:
    agree = {frozenset("ab"), frozenset("ac"), frozenset("bc")}
    found = of(pairs(agree, "abcde"), "ssim/d/e")
    assert (found.off, found.how) == (["d", "e"], "agreement")


def test_probabilities_add_up_to_one() -> None:
    groups = [frozenset("abc"), frozenset("de"), frozenset("f")]
    _, probability = most_likely_right(groups)
    assert 0.99 < probability < 1
