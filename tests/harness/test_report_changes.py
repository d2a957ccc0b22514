"""Diagnoses, attributions, baselines and stored results in the pages."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from harness.record import (
    AgainstBaseline,
    Attribution,
    BaselineState,
    BaselineSummary,
    CaseRecord,
    Cause,
    Diagnosis,
    LostCheck,
    Stored,
    Trend,
    Verdict,
)
from harness.report import changes, write_report
from tests.harness.report_fixture import Draft, check, run_of, summary_of, write_run

SENTENCE = "mytracer refracts as if n = 1.4873 ± 0.0002 <b>"


def diagnosis() -> Diagnosis:
    cause = Cause(
        id="index", sentence=SENTENCE, parameter="n", value=1.4873, uncertainty=2e-4,
        residual=0.9, explains=0.997,
    )  # fmt: skip
    return Diagnosis(renderer="mytracer", sentence=SENTENCE, cause=cause, cases=["slab"], rays=96)


def against(state: BaselineState, shift: float | None = None) -> AgainstBaseline:
    return AgainstBaseline(state=state, value=1e-7, shift=shift, reason="as approved")


def case(state: BaselineState | None = None, shift: float | None = None) -> CaseRecord:
    draft = Draft("slab", "A slab", "slab")
    judged = check("exit_point", "mytracer", 3e-6, 0.0, 2e-6, "units")
    off = Attribution(off=["mytracer"], how="agreement", confidence=0.98, sentence="two say so")
    baseline = against(state, shift) if state else None
    draft.checks.append(judged.model_copy(update={"attribution": off, "baseline": baseline}))
    stored = Stored(
        version="3.7", approved="2026-01-01", by="Ada", reason="first", sha256="0" * 64, file="x"
    )
    draft.runs.append(run_of("mytracer", Verdict.FAIL, stored=stored))
    return draft.finished().model_copy(update={"diagnoses": [diagnosis()]})


def pages(root: Path, *records: CaseRecord, **of_summary: object) -> tuple[str, str]:
    """The index and the first case's page."""
    summary = summary_of(list(records))
    cases = [
        known.model_copy(update={"diagnoses": record.diagnoses})
        for known, record in zip(summary.cases, records, strict=True)
    ]
    changed = summary.model_copy(update={"cases": cases, **of_summary})
    index = write_report(write_run(root, list(records), changed))
    return index.read_text("utf-8"), (root / "cases" / "slab.html").read_text("utf-8")


def test_diagnoses_stand_in_the_row_on_the_page_and_on_top(tmp_path: Path) -> None:
    index, page = pages(tmp_path, case(), diagnoses=[diagnosis()])
    # The name stands before it, as the renderer's is written everywhere.
    said = SENTENCE.removeprefix("mytracer ").replace("<b>", "&lt;b&gt;")
    assert index.count(said) == 2
    assert said in page
    assert "1.4873 ± 0.0002" in page
    assert "± 0.0002 <b>" not in page


def test_who_is_off_is_said_beside_the_check(tmp_path: Path) -> None:
    _, page = pages(tmp_path, case())
    assert "off: mytracer" in page
    assert "two say so" in page
    assert "confidence" in page


def test_the_banner_names_who_is_off_not_who_is_compared_with_it(tmp_path: Path) -> None:
    off = Attribution(off=["mytracer"], how="truth", confidence=1.0, sentence="truth says so")
    draft = Draft("slab", "A slab", "slab")
    judged = check("ssim", "povray", 0.5, 1.0, 1e-4, "", against="mytracer")
    draft.checks.append(judged.model_copy(update={"attribution": off}))
    draft.runs += [run_of("povray", Verdict.FAIL), run_of("mytracer", Verdict.PASS)]
    index, _ = pages(tmp_path, draft.finished())
    banner = index[index.index('class="worst"') : index.index('class="counts"')]
    words = " ".join(re.sub("<[^>]*>", " ", banner).split())
    assert "slab mytracer ssim povray vs mytracer 0.5" in words


def test_stored_results_are_marked(tmp_path: Path) -> None:
    index, page = pages(tmp_path, case())
    assert "stored, version 3.7" in page
    assert ">stored<" in index


def test_without_a_baseline_the_index_says_so(tmp_path: Path) -> None:
    index, page = pages(tmp_path, case())
    assert "not compared" in index
    assert "data-change" not in index
    assert "regressed" not in page


def test_what_changed_is_in_row_panel_and_checks(tmp_path: Path) -> None:
    lost = LostCheck(case="ball", renderer="povray", state=BaselineState.MISSING, reason="gone")
    summary = BaselineSummary(
        source="references", failed=True, counts={"regressed": 1, "same": 3}, lost=[lost],
        trends=[Trend(case="slab", check="x", runs=9, slope=0.1, p_value=1e-4, reason="slides")],
    )  # fmt: skip
    index, page = pages(tmp_path, case(BaselineState.REGRESSED, 0.75), baseline=summary)
    assert 'data-change="regressed"' in index
    assert "Since the baseline" in index
    assert "gone" in index
    assert "slides" in index
    assert "+75 % of tolerance" in page
    assert "as approved" in page


def test_an_interrupted_run_says_so(tmp_path: Path) -> None:
    index, _ = pages(tmp_path, case(), interrupted=True)
    assert "The run was interrupted" in index


@pytest.mark.parametrize("state", BaselineState)
def test_every_state_has_its_place_and_its_tone(state: BaselineState) -> None:
    assert state in changes.ORDER
    assert changes.TONE[state]


def test_the_worst_state_speaks_for_a_case() -> None:
    checks = [
        check("exit_point", "tracer", 0.0, 0.0, 1.0, "").model_copy(update={"baseline": b})
        for b in (against(BaselineState.SAME), against(BaselineState.DRIFTED, 0.2), None)
    ]
    found = changes.change(checks)
    assert found is not None
    assert (found.state, found.shift) == ("drifted", "+20 % of tolerance")
    assert changes.change([]) is None
