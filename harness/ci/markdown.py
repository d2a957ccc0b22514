"""A summary in Markdown, for the page of a CI job or a comment on a change.

It is short however many checks are red: of failures that are alike it tells the worst.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from harness.baseline.run_folder import RunFolder
from harness.ci.findings import Finding, findings, is_red, lost
from harness.record import Check, Summary, SummaryCase, Verdict
from harness.report.checks import check_view, failing, in_turns, kind_of, ranked, who_is_off
from harness.report.quantity import count

MOST = 20  # lines of each table
PICTURE = {
    "max_difference": "largest difference", "p999_difference": "99.9th percentile",
    "rmse": "RMSE", "ssim": "SSIM", "delta_e": "ΔE",
}  # fmt: skip
SIGN = {"pass": "✅", "known": "🟡", "skip": "⚪", "fail": "❌", "error": "💥"}
# What Markdown and HTML would take for their own.
SPECIAL = re.compile(r"([\\`*_{}\[\]<>()#+!|~&@-])")


def markdown(run: RunFolder) -> str:
    """The run in a page: what is red, why, and the verdicts by renderer."""
    summary, red, gone = run.summary, list(findings(run)), list(lost(run.summary))
    return "\n".join((*_head(summary, red, gone), *_causes(summary), *_red(red), *_lost(gone),
                      *_pictures(summary), *_table(summary), "")) + "\n"  # fmt: skip


def _head(summary: Summary, red: list[Finding], gone: list[tuple[str, str, str]]) -> Iterator[str]:
    checks = sum(len(case.checks) for case in summary.cases)
    good = not red and not gone and summary.exit_code in (0, 1)
    said = "nothing is off" if good else f"{len(red)} of {checks} checks are red"
    yield f"## {'✅' if good else '❌'} Refraction: {said}"
    yield ""
    yield f"{checks} checks of {len(summary.cases)} cases in {summary.wall_s:.0f} s."
    if summary.baseline is not None:
        states = ", ".join(f"{n} {state}" for state, n in summary.baseline.counts.items())
        yield f"Against {plain(summary.baseline.source)}: {states}."
        for trend in summary.baseline.trends:
            yield f"- 📈 {plain(trend.case)} {plain(trend.check)} drifts: {plain(trend.reason)}"
    diagnosed = {diagnosis.renderer for diagnosis in summary.diagnoses}
    for name, renderer in summary.renderers.items():
        if renderer.status != "ok" and name not in diagnosed:
            yield f"- {plain(name)}, {renderer.status}: {plain(renderer.reason)}"
    yield ""


def _causes(summary: Summary) -> Iterator[str]:
    off = failing(check for case in summary.cases for check in case.checks)
    for _, diagnosis in ranked(summary.diagnoses, off):
        said = diagnosis.sentence.removeprefix(f"{diagnosis.renderer} ")
        yield f"**{plain(diagnosis.renderer)}** {plain(said)}"
        yield ""


def _red(red: list[Finding]) -> Iterator[str]:
    """The worst of each kind of failure, whoever is off."""
    if not red:
        return
    kinds: dict[tuple[str, str], list[Finding]] = {}
    for finding in sorted(red, key=lambda finding: check_view(finding.check).rank):
        kinds.setdefault(kind_of(finding.check), []).append(finding)
    lines = in_turns((who, (who, alike)) for (who, _), alike in kinds.items())
    yield "| who is off | check | what is wrong, at its worst | where | more like it |"
    yield "|--|--|--|--|--:|"
    for who, (worst, *more) in lines[:MOST]:
        told = (who, worst.check.observable, worst.headline, worst.case, str(len(more) or ""))
        yield "| " + " | ".join(plain(text) for text in told) + " |"
    if len(lines) > MOST:
        yield f"| … and {count(len(lines) - MOST, 'more kind')} | | | | |"
    yield ""


@dataclass(frozen=True)
class _Pair:
    """Two pictures of a case that differ, and all that was measured of their difference."""

    case: str
    off: str
    title: str
    checks: Mapping[str, Check]

    @property
    def rank(self) -> tuple[int, float]:
        return min(check_view(check).rank for check in self.checks.values())


def _pairs_of(case: SummaryCase) -> Iterator[_Pair]:
    pairs: dict[tuple[str, str], dict[str, Check]] = {}
    for check in case.checks:
        if check.observable in PICTURE and check.value is not None:
            pairs.setdefault((check.renderer, check.against), {})[check.observable] = check
    for (renderer, against), checks in pairs.items():
        red = [check for check in checks.values() if is_red(check)]
        if red:
            yield _Pair(case.id, who_is_off(red[0]), f"{renderer} − {against}", checks)


def _pictures(summary: Summary) -> Iterator[str]:
    """The pictures that differ most: of each case one pair for everybody who is off in it."""
    pairs = sorted((p for case in summary.cases for p in _pairs_of(case)), key=lambda p: p.rank)
    worst = list({(pair.case, pair.off): pair for pair in reversed(pairs)}.values())[::-1]
    if not worst:
        return
    yield "### Pictures that differ most"
    yield ""
    yield "| case | pictures | " + " | ".join(PICTURE.values()) + " |"
    yield "|--|--|" + "--:|" * len(PICTURE)
    for pair in worst[:MOST]:
        figures = " | ".join(_figure(pair.checks.get(name)) for name in PICTURE)
        yield f"| {plain(pair.case)} | {plain(pair.title)} | {figures} |"
    if len(worst) > MOST:
        yield f"| … and {len(worst) - MOST} more | |" + " |" * len(PICTURE)
    yield ""
    yield "In bold what exceeds the limit beside it."
    yield ""


def _figure(check: Check | None) -> str:
    if check is None:
        return "–"
    view = check_view(check)
    value = f"**{plain(view.main)}**" if is_red(check) else plain(view.main)
    return f"{value} {plain(view.limit)}"


def _lost(gone: list[tuple[str, str, str]]) -> Iterator[str]:
    for case, name, reason in gone[:MOST]:
        yield f"- {plain(case)} {plain(name)}: {plain(reason)}"
    if len(gone) > MOST:
        yield f"- … and {len(gone) - MOST} more"
    if gone:
        yield ""


def _table(summary: Summary) -> Iterator[str]:
    yield "<details><summary>Verdicts by renderer</summary>"
    yield ""
    yield "| renderer | version | " + " | ".join(f"{SIGN[v]} {v.value}" for v in Verdict) + " |"
    yield "|--|--|" + "--:|" * len(Verdict)
    for name, renderer in summary.renderers.items():
        counts = Counter(
            check.status for case in summary.cases for check in case.checks
            if check.renderer == name
        )  # fmt: skip
        row = " | ".join(str(counts[v]) for v in Verdict)
        yield f"| {plain(name)} | {plain(renderer.version)} | {row} |"
    yield ""
    yield "</details>"


def plain(text: str) -> str:
    """Text as text: on one line, and nothing in it is markup, a link or a mention."""
    return SPECIAL.sub(r"\\\1", " ".join(text.split()))
