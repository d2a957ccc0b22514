"""What a page says of checks: which comes first, who is off, and nothing twice."""

from __future__ import annotations

import pytest

from harness.record import Attribution, Cause, Check, Diagnosis, SummaryCase, Verdict
from harness.report import overview
from harness.report.checks import (
    check_view,
    elsewhere,
    failing,
    grouped,
    meaning,
    ranked,
    sorted_views,
    told,
)
from harness.report.digest import Digest
from harness.summary_file import Span


def check(
    renderer: str = "mytracer",
    status: Verdict = Verdict.FAIL,
    value: float | None = 3.0,
    *,
    observable: str = "exit_point",
    against: str = "truth",
    off: str = "",
    reason: str = "",
    tolerance: float | None = 1.0,
) -> Check:
    said = Attribution(off=[off], how="truth", confidence=1.0, sentence="") if off else None
    return Check(
        id=f"{observable}(through)/{renderer}/{against}", renderer=renderer, against=against,
        observable=observable, value=value, expected=None if value is None else 0.0,
        tolerance=None if value is None else tolerance, status=status, reason=reason,
        unit="units", attribution=said,
    )  # fmt: skip


def crash(renderer: str = "crashing", observable: str = "exit_point") -> Check:
    return check(renderer, Verdict.ERROR, None, observable=observable, reason="exit code 1")


OFF = "off by 3 units"
LOST = "4 of 9 rays did not arrive"


@pytest.mark.parametrize(
    ("figures", "said"),
    [
        (f"{OFF}, 3 times the tolerance", ""),
        ("off by 8.45e+03", ""),
        (f"{OFF}, 3 times the tolerance; ", LOST),
        (f"{OFF}: ", "starts beside the ray"),
        (f"{OFF}, ", "outside the documented 1 to 2 units: x"),
        ("", f"within tolerance where measured; {LOST}"),
    ],
)
def test_reasons_do_not_repeat_the_figures_beside_them(figures: str, said: str) -> None:
    assert check_view(check(reason=figures + said)).said == said


def test_without_figures_the_whole_reason_is_said() -> None:
    reason = "off by one, said the log"
    assert check_view(check(status=Verdict.ERROR, value=None, reason=reason)).said == reason


def test_a_wrong_number_comes_before_a_missing_one_and_worse_before_bad() -> None:
    views = sorted_views([crash(), check(value=2.0), check("povray", Verdict.PASS, 0.5), check()])
    assert [(v.check.status.value, v.check.value) for v in views] == [
        ("fail", 3.0), ("fail", 2.0), ("error", None), ("pass", 0.5),
    ]  # fmt: skip


def test_what_may_not_happen_at_all_does_not_outrank_everything() -> None:
    counted = check(observable="tir", value=5.0, tolerance=0.0)
    assert sorted_views([counted, check(value=9.0)])[0].check.value == 9.0
    assert sorted_views([counted, check(value=3.0)])[0].check.value == 5.0
    view = check_view(counted)
    assert (view.limit, view.used, view.over) == ("none allowed", "", True)


def test_checks_without_a_value_for_one_reason_share_a_row() -> None:
    views = [check_view(c) for c in (check(), crash(), crash(observable="tir"), crash("other"))]
    rows = grouped(views)
    assert [(first.check.renderer, len(others)) for first, others in rows] == [
        ("mytracer", 0), ("crashing", 1), ("other", 0),
    ]  # fmt: skip


def test_who_is_compared_with_one_that_is_off_is_told_from_it() -> None:
    pair = check("tracer", observable="rmse", against="mytracer", off="mytracer")
    assert elsewhere("tracer", [pair, check(off="mytracer")]) == "mytracer"
    assert elsewhere("mytracer", [pair, check(off="mytracer")]) == ""
    assert elsewhere("tracer", [pair, check("tracer", off="tracer")]) == ""
    assert elsewhere("tracer", [pair, crash("tracer")]) == ""  # nobody else's doing
    assert elsewhere("tracer", [check("tracer", Verdict.PASS)]) == ""


def test_every_renderer_that_fails_is_among_the_first_failures() -> None:
    names = ("exit_point", "exit_direction", "slab_offset", "deviation", "focus", "tir", "rmse")
    many = [check(value=10.0 + k, observable=name) for k, name in enumerate(names)]
    pair = check("tracer", observable="ssim", against="mytracer", off="mytracer")
    made = [*many, pair, *(crash(observable=name) for name in names)]
    case = SummaryCase(id="slab", family="slab", status=Verdict.ERROR, checks=made)
    digest = Digest()
    digest.add(case, Span(0, 0))
    shown, left_out = overview.failures(digest)
    assert [(f.off, f.more) for f in shown[:3]] == [
        ("mytracer", 0), ("crashing", 6), ("mytracer", 0),
    ]  # fmt: skip
    assert all(f.off != "tracer" for f in shown)
    assert len(shown) + left_out == 9  # eight observables of mytracer's, one crash


def test_diagnoses_are_red_only_of_who_is_off_and_is_not_documented() -> None:
    pair = check("tracer", observable="rmse", against="mytracer", off="mytracer")
    assert failing([pair, check("povray", Verdict.PASS)]) == {"mytracer"}
    documented = Cause(id="documented", sentence="", residual=0.0, explains=1.0)
    diagnoses = [
        Diagnosis(renderer="mytracer", sentence="as documented", cause=documented),
        Diagnosis(renderer="tracer", sentence="is off"),
        Diagnosis(renderer="mytracer", sentence="is off"),
    ]
    found = [(tone, d.sentence) for tone, d in ranked(diagnoses, {"mytracer"})]
    assert found == [("fail", "is off"), ("known", "as documented"), ("known", "is off")]


def test_a_name_that_stands_before_a_sentence_is_not_repeated() -> None:
    assert told("mytracer", "mytracer refracts too much") == "refracts too much"
    assert told("my", "mytracer refracts too much") == "mytracer refracts too much"


def test_what_an_observable_means_is_known_or_left_out() -> None:
    assert "lands" in meaning("exit_point")
    assert meaning("<script>") == ""
