"""A summary in Markdown, for the page of a CI job or a comment on a change."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from harness.baseline.run_folder import RunFolder
from harness.ci.findings import Finding, findings, lost
from harness.record import Summary, Verdict

MOST = 20  # red checks that are told one by one
SIGN = {"pass": "✅", "known": "🟡", "skip": "⚪", "fail": "❌", "error": "💥"}
# What Markdown and HTML would take for their own.
SPECIAL = re.compile(r"([\\`*_{}\[\]<>()#+!|~&@-])")


def markdown(run: RunFolder) -> str:
    """The run in a page: what is red, why, and the verdicts by renderer."""
    summary, red, gone = run.summary, list(findings(run)), list(lost(run.summary))
    return "\n".join((*_head(summary, red, gone), *_causes(summary), *_red(red), *_lost(gone),
                      *_table(summary), "")) + "\n"  # fmt: skip


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
    for name, renderer in summary.renderers.items():
        if renderer.status != "ok":
            yield f"- {plain(name)} is {renderer.status}: {plain(renderer.reason)}"
    yield ""


def _causes(summary: Summary) -> Iterator[str]:
    for diagnosis in summary.diagnoses:
        yield f"**{plain(diagnosis.renderer)}:** {plain(diagnosis.sentence)}"
        yield ""


def _red(red: list[Finding]) -> Iterator[str]:
    if not red:
        return
    yield "| case | renderer | check | what is wrong |"
    yield "|--|--|--|--|"
    for finding in red[:MOST]:
        check = finding.check
        yield (
            f"| {plain(finding.case)} | {plain(check.renderer)} | {plain(check.observable)} | "
            f"{plain(finding.headline)} |"
        )
    if len(red) > MOST:
        yield f"| … and {len(red) - MOST} more | | | |"
    yield ""


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
