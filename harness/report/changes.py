"""What changed since results were approved, as a case's word and as a panel of the run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from harness.record import BaselineState, BaselineSummary, Check
from harness.report.links import clean
from harness.report.quantity import count, number

# Which state speaks for a case whose checks are in several, first the one to look at first.
ORDER = (
    BaselineState.REGRESSED,
    BaselineState.MISSING,
    BaselineState.STALE,
    BaselineState.DRIFTED,
    BaselineState.IMPROVED,
    BaselineState.RENDERER_CHANGED,
    BaselineState.NEW,
    BaselineState.SAME,
)
HARMFUL = (BaselineState.REGRESSED, BaselineState.MISSING, BaselineState.STALE)
# States are drawn as the verdicts that they come nearest to.
TONE = {
    BaselineState.REGRESSED: "fail",
    BaselineState.MISSING: "error",
    BaselineState.STALE: "error",
    BaselineState.DRIFTED: "known",
    BaselineState.IMPROVED: "pass",
    BaselineState.RENDERER_CHANGED: "known",
    BaselineState.NEW: "skip",
    BaselineState.SAME: "skip",
}
MOST = 12


def word(state: BaselineState) -> str:
    """A state for people."""
    return state.value.replace("-", " ")


@dataclass(frozen=True)
class Change:
    """The state of a case, or of one of its renderers, against what was approved."""

    state: str
    tone: str
    text: str
    shift: str  # of the deviation, in tolerances, where it says more than the word

    @property
    def worth_saying(self) -> bool:
        return self.state not in (BaselineState.SAME, BaselineState.NEW)


def change(checks: Iterable[Check]) -> Change | None:
    """The state that speaks for `checks`; None where they were never compared."""
    compared = [check.baseline for check in checks if check.baseline is not None]
    if not compared:
        return None
    first = min(compared, key=lambda b: (ORDER.index(b.state), -abs(b.shift or 0.0)))
    shift = ""
    if first.shift is not None and first.state != BaselineState.SAME:
        sign = "+" if first.shift > 0 else ""
        shift = f"{sign}{number(100 * first.shift, digits=2)} % of tolerance"
    return Change(first.state.value, TONE[first.state], word(first.state), shift)


@dataclass(frozen=True)
class Item:
    """A line of the panel: something lost, or something that moves slowly."""

    tone: str
    word: str
    case: str
    what: str
    reason: str


@dataclass(frozen=True)
class ChangePanel:
    source: str
    failed: bool
    counts: list[tuple[str, str, int]]  # (tone, word, how many)
    items: list[Item]
    more: str


def panel(summary: BaselineSummary | None) -> ChangePanel | None:
    """The panel of the run; None where it was never compared."""
    if summary is None:
        return None
    items = [
        Item(
            TONE[lost.state], word(lost.state), clean(lost.case),
            clean(f"{lost.renderer} {lost.check}".strip()), clean(lost.reason),
        )
        for lost in summary.lost
    ]  # fmt: skip
    items += [
        Item("known", "trend", clean(trend.case), clean(trend.check), clean(trend.reason))
        for trend in summary.trends
    ]
    rest = len(items) - MOST
    counts = [
        (TONE[state], word(state), summary.counts.get(state.value, 0))
        for state in ORDER
        if summary.counts.get(state.value, 0)
    ]
    return ChangePanel(
        clean(summary.source),
        summary.failed,
        counts,
        items[:MOST],
        f"and {count(rest, 'more', 'more')}" if rest > 0 else "",
    )
