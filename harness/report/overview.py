"""The run as a whole: its verdict in a sentence, its counts, and a line for each renderer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import groupby

from harness.record import RendererSummary, Summary, Verdict
from harness.report.checks import FIRST_TO_LOOK_AT, CheckView, in_turns, who_is_off
from harness.report.digest import Digest
from harness.report.links import clean
from harness.report.quantity import count, number
from harness.report.view import Line

EXIT_CODES = {
    0: "all passed",
    1: "a check failed",
    2: "bad usage or bad input",
    3: "something asked for could not run",
    130: "interrupted",
}


@dataclass(frozen=True)
class Headline:
    """The run in one sentence. `state` is a verdict's name, for its colour and icon.

    `worst` is the check that failed by most, or else the one that came closest to its limit;
    `lead` says which, and `off` who is off there.
    """

    state: str
    text: str
    also: list[str]
    lead: str = ""
    worst: CheckView | None = None
    worst_case: str = ""
    off: str = ""


def headline(summary: Summary, digest: Digest) -> Headline:
    state, text = _sentence(summary, digest.counts)
    also = _also(summary, digest.counts)
    found, lead = digest.worst, "Worst:"
    if found is None:
        found, lead = digest.closest, "Closest to its limit:"
    if found is None:
        return Headline(state, text, also)
    off = clean(who_is_off(found.view.check))
    return Headline(state, text, also, lead, found.view, found.case, off)


MOST_FAILURES = 6


@dataclass(frozen=True)
class Failure:
    """A check that fails, who is off there, where it stands and how many more like it there are."""

    case: str
    view: CheckView
    off: str
    more: int


def failures(digest: Digest) -> tuple[list[Failure], int]:
    """The worst check of each kind of failure, and how many kinds are left out.

    One fault of a renderer fails many checks: each of its observables that fail is one kind, and so
    is each reason for which it has no figures. Every renderer's first kind stands before any
    renderer's second, lest what fails most hide who fails at all.
    """
    kinds = sorted(digest.kinds.items(), key=lambda item: item[1].worst.view.rank)
    found = in_turns(
        (who, Failure(clean(kind.worst.case), kind.worst.view, clean(who), kind.count - 1))
        for (who, _), kind in kinds
    )
    shown = found[:MOST_FAILURES]
    return shown, max(0, len(kinds) - MOST_FAILURES)


def _sentence(summary: Summary, counts: Mapping[Verdict, int]) -> tuple[str, str]:
    total = sum(counts.values())
    fail, error, skip = counts[Verdict.FAIL], counts[Verdict.ERROR], counts[Verdict.SKIP]
    if not total:
        return "error", "No checks were made"
    checks = count(total, "check")
    if fail:
        return "fail", f"{fail} of {checks} {'fails' if fail == 1 else 'fail'}"
    if error:
        return "error", f"{error} of {checks} ended in an error"
    if skip:
        return "skip", f"No check fails; {skip} of {total} were skipped"
    if summary.exit_code:
        return "error", f"{checks} passed, but not all ran"
    return "pass", "The only check passes" if total == 1 else f"All {checks} pass"


_NOTHING = "A run without checks shows nothing, so it does not pass."


def _also(summary: Summary, counts: Mapping[Verdict, int]) -> list[str]:
    notes = [] if sum(counts.values()) else [_NOTHING]
    if counts[Verdict.FAIL] and counts[Verdict.ERROR]:
        notes.append(f"{counts[Verdict.ERROR]} more ended in an error")
    if counts[Verdict.SKIP] and (counts[Verdict.FAIL] or counts[Verdict.ERROR]):
        notes.append(f"{counts[Verdict.SKIP]} skipped")
    if counts[Verdict.KNOWN]:
        notes.append(
            f"{count(counts[Verdict.KNOWN], 'known deviation')} at the size the scenes document"
        )
    stated = summary.counts.model_dump(by_alias=True)
    if any(stated[verdict.value] != counts[verdict] for verdict in Verdict):
        notes.append("summary.json states other counts than its cases show")
    return notes


# --- counts ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tally:
    """Checks by verdict; `shares` are (verdict, start, width) in thousandths of all, bad first."""

    total: Mapping[str, int]
    shares: list[tuple[str, float, float]]


def tally(counts: Mapping[Verdict, int]) -> Tally:
    everything = sum(counts.values())
    shares, start = [], 0.0
    for verdict in FIRST_TO_LOOK_AT:
        if counts[verdict]:
            width = 1000 * counts[verdict] / everything
            shares.append((verdict.value, round(start, 2), round(width, 2)))
            start += width
    return Tally({verdict.value: counts[verdict] for verdict in Verdict}, shares)


def started(summary: Summary) -> str:
    """The start in UTC as people write it; what is no date is shown as it is."""
    try:
        moment = datetime.fromisoformat(summary.started)
    except ValueError:
        return clean(summary.started)
    zone = moment.strftime("%Z") or "UTC"
    return f"{moment:%Y-%m-%d %H:%M:%S} {zone}"


# --- renderers ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mark:
    """A case in a renderer's strip; what is wrong stands taller, so that colour is not needed.

    In long strips a mark stands for `span` cases of one verdict, from the `start`th on. It is low
    where the renderer fails only in comparison with another that is off.
    """

    status: Verdict | None
    excused: bool
    start: int
    span: int
    title: str
    page: str | None

    @property
    def height(self) -> int:
        return EXCUSED if self.excused else HEIGHTS[self.status]


HEIGHTS = {
    Verdict.PASS: 5,
    Verdict.KNOWN: 8,
    Verdict.SKIP: 2,
    Verdict.FAIL: 18,
    Verdict.ERROR: 18,
    None: 1,
}
EXCUSED = 8


@dataclass(frozen=True)
class RendererLine:
    name: str
    version: str
    ok: bool
    state: str
    reason: str
    remedy: str
    facts: list[tuple[str, str]]
    strip: list[Mark]
    tally: str
    checks: int
    passed: int
    render_s: float


def renderer_lines(
    summary: Summary, digest: Digest, names: Sequence[str], rows: Sequence[Line]
) -> list[RendererLine]:
    return [
        _line(name, column, summary.renderers.get(name), digest.by_renderer.get(name), rows)
        for column, name in enumerate(names)
    ]


def _line(
    name: str,
    column: int,
    known: RendererSummary | None,
    counts: Counter[Verdict] | None,
    rows: Sequence[Line],
) -> RendererLine:
    verdicts = counts or Counter()
    failed = sum(row.verdicts[column] is Verdict.ERROR for row in rows)
    facts = known.facts if known else {}
    return RendererLine(
        name=name,
        version=clean(known.version) if known else "",
        ok=known is not None and known.status == "ok" and not failed,
        state=_state(known, failed, sum(row.verdicts[column] is not None for row in rows)),
        reason=clean(_unless_repeated(known.reason, known.remedy)) if known else "",
        remedy=clean(known.remedy) if known else "",
        facts=[
            (
                clean(key).replace("_", " "),
                clean(value) if isinstance(value, str) else number(value),
            )
            for key, value in facts.items()
        ],
        strip=_strip(rows, column),
        tally=", ".join(f"{n} {verdict.value}" for verdict, n in verdicts.items()),
        checks=verdicts.total(),
        passed=verdicts[Verdict.PASS] + verdicts[Verdict.KNOWN],
        render_s=known.render_s if known else 0.0,
    )


def _unless_repeated(reason: str, remedy: str) -> str:
    """The reason without the command that stands below it anyway."""
    return reason.removesuffix(remedy).rstrip(" :;") if remedy else reason


def _state(known: RendererSummary | None, failed: int, asked: int) -> str:
    """One word; of a renderer that works by itself also in how many of its cases it did not."""
    if known is None:
        return "not in summary"
    if known.status != "ok" or not failed:
        return clean(known.status)
    return f"error in {failed} of {count(asked, 'case')}"


MOST_MARKS = 150  # that can still be told apart, and clicked


def _strip(rows: Sequence[Line], column: int) -> list[Mark]:
    if len(rows) <= MOST_MARKS:
        return [_mark(row, column, k) for k, row in enumerate(rows)]
    found, start = [], 0
    for (status, excused), group in groupby((r.verdicts[column], r.excused[column]) for r in rows):
        span = len(list(group))
        title = f"{count(span, 'case')}: {_word(status, excused)}"
        found.append(Mark(status, excused, start, span, title, None))
        start += span
    return found


def _mark(row: Line, column: int, start: int) -> Mark:
    status, excused = row.verdicts[column], row.excused[column]
    return Mark(status, excused, start, 1, f"{row.id}: {_word(status, excused)}", row.page)


def _word(status: Verdict | None, excused: bool) -> str:
    if excused:
        return f"{status}, but another is off"
    return status.value if status else "no checks of its own"
