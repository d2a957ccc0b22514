"""The outcome of a comparison: what the run's files say of it afterwards, and whether it fails."""

from __future__ import annotations

from collections.abc import Sequence

from harness import record
from harness.baseline.compare import FAILING, Comparison
from harness.baseline.run_folder import RunFolder, record_file
from harness.record import BaselineState, BaselineSummary, Check, Summary, Trend


def outcome(
    comparison: Comparison, source: str, trends: Sequence[Trend], runs: int = 1
) -> BaselineSummary:
    """Fails for what regressed, is missing or stale, and where nothing was compared at all.

    `trends` were found in `runs` runs.
    """
    counts = comparison.counts()
    compared = sum(counts.values()) - counts[BaselineState.NEW]
    return BaselineSummary(
        source=source,
        failed=bool(FAILING & set(counts)) or not compared,
        counts={state.value: counts[state] for state in BaselineState if counts[state]},
        lost=comparison.lost,
        trends=list(trends),
        runs=runs,
    )


def write_outcome(run: RunFolder, comparison: Comparison, found: BaselineSummary) -> Summary:
    """Writes each check's state into the run's records and summary; returns the summary."""

    def marked(case: str, checks: list[Check]) -> list[Check]:
        return [
            check.model_copy(update={"baseline": comparison.states.get((case, check.id))})
            for check in checks
        ]

    for case, (written, _) in run.records.items():
        checks = marked(case, written.checks)
        if checks != written.checks:
            changed = written.model_copy(update={"checks": checks})
            record.write(changed, record_file(run.folder, case))
    cases = [
        case.model_copy(update={"checks": marked(case.id, case.checks)})
        for case in run.summary.cases
    ]
    summary = run.summary.model_copy(update={"cases": cases, "baseline": found})
    record.write(summary, run.folder / "summary.json")
    return summary
