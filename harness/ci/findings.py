"""What a CI system has to be told: which checks are red and why. All formats say the same."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from harness.baseline.compare import FAILING
from harness.baseline.run_folder import RunFolder
from harness.record import Check, Summary, Verdict
from harness.report.links import page_name

RED = (Verdict.FAIL, Verdict.ERROR)


@dataclass(frozen=True)
class Finding:
    """One red check. `headline` fits a line; `text` adds figures, diagnosis and the page's path."""

    case: str
    scene: str  # path of the scene file, empty where unknown
    check: Check
    headline: str
    text: str


def is_red(check: Check) -> bool:
    """Whether a check fails: against its baseline where it has one, else by its verdict.

    A failure that was approved with a reason is not red until it grows.
    """
    if check.baseline is not None:
        return check.baseline.state in FAILING
    return check.status in RED


def findings(run: RunFolder) -> Iterator[Finding]:
    """The red checks of a run in the order of its summary."""
    for case in run.summary.cases:
        record, _ = run.records[case.id]
        for check in case.checks:
            if is_red(check):
                diagnosis = next(
                    (d.sentence for d in case.diagnoses if d.renderer == check.renderer), ""
                )
                page = f"page: {path}" if (path := page_of(run, record.id)).is_file() else ""
                text = "\n".join(filter(None, (*_figures(check), diagnosis, page)))
                scene = record.scene_path
                yield Finding(case.id, scene, check, headline(check), text)


def headline(check: Check) -> str:
    """What is wrong, in a line."""
    state = check.baseline
    if state is not None and state.state in FAILING:
        return f"{state.state.value}: {state.reason or check.reason}"
    return f"{check.status.value}: {check.reason or 'no reason given'}"


def _figures(check: Check) -> Iterator[str]:
    against = "" if check.against == "truth" else f" against {check.against}"
    yield f"{check.renderer}: {check.observable}{against}: {headline(check)}"
    if check.value is not None and check.expected is not None:
        yield (
            f"value {check.value:.9g}, expected {check.expected:.9g} "
            f"within {check.tolerance:.3g} {check.unit}".rstrip()
        )
    if check.attribution is not None:
        yield check.attribution.sentence
    if check.baseline is not None and check.baseline.value is not None:
        yield f"approved: {check.baseline.value:.9g} ({check.baseline.approved})"


def page_of(run: RunFolder, case: str) -> Path:
    """Where the report has the page of a case, once it is written."""
    return run.folder / "cases" / page_name(case)


def lost(summary: Summary) -> Iterator[tuple[str, str, str]]:
    """Case, check and reason of what was approved and is not in the run."""
    if summary.baseline is not None:
        for one in summary.baseline.lost:
            yield one.case, one.check or one.renderer, f"{one.state.value}: {one.reason}"
