"""Findings: the documented deviations of renderers as a page for their developers, from records.

One section for each renderer and cause: where it shows, how large it is, and the smallest scene
that shows it, in the renderer's own language.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from harness.record import CaseRecord, Check, Verdict

# A line per observable; of many cases the three in which it is largest.
MOST_ROWS = 3


@dataclass(frozen=True)
class Sample:
    """A scene that shows a finding: the file's text, its language, and the command that runs it."""

    case: str
    language: str
    text: str
    command: str


@dataclass(frozen=True)
class Finding:
    """One renderer and cause, with the checks that show it, (case, check)."""

    renderer: str
    version: str
    cause: str
    shown: tuple[tuple[CaseRecord, Check], ...]

    @property
    def cases(self) -> list[CaseRecord]:
        """The cases that show it, each once."""
        return list({record.id: record for record, _ in self.shown}.values())


def findings(records: Sequence[CaseRecord]) -> list[Finding]:
    """Everything that is KNOWN in `records`, by renderer, then by cause."""
    shown: dict[tuple[str, str], list[tuple[CaseRecord, Check]]] = {}
    for record in sorted(records, key=lambda r: r.id):
        for check in record.checks:
            if check.status is Verdict.KNOWN:
                shown.setdefault((check.renderer, check.cause), []).append((record, check))
    return [
        Finding(renderer, _version(items[0][0], renderer), cause, tuple(items))
        for (renderer, cause), items in sorted(shown.items())
    ]


def markdown(
    found: Sequence[Finding],
    units: Mapping[str, str],
    sample: Callable[[Finding], Sample | None],
) -> str:
    """The page. `units` are those of observables; `sample` gives the scene that shows a finding."""
    lines = [
        "# Findings",
        "",
        "What the catalogue found out about renderers as they are. Each deviation is documented in",
        "a scene with its size and cause; the check is green only while it stays like that, and",
        "says so when it changes or is gone. Where a scene shows positions, red is the coordinate",
        "across the plane, 0 to 1, blue is constant, and red / blue is where the ray landed.",
        "Made by `make findings` from the records of a run; nothing here is written by hand.",
        "",
    ]
    for finding in found:
        lines += _section(finding, units, sample(finding))
    return "\n".join(lines).rstrip() + "\n"


def heading(renderer: str, cause: str) -> str:
    """The title of a finding's section."""
    return f"{renderer}: {cause}"


def _section(finding: Finding, units: Mapping[str, str], sample: Sample | None) -> Iterator[str]:
    yield f"## {heading(finding.renderer, finding.cause)}"
    yield ""
    cases = len(finding.cases)
    plural = "case" if cases == 1 else "cases"
    checks = "check" if len(finding.shown) == 1 else "checks"
    yield (
        f"{finding.renderer} {finding.version}, in {len(finding.shown)} {checks} of "
        f"{cases} {plural}."
    )
    yield ""
    yield "| observable | case | shows | right is | off by |"
    yield "|--|--|--|--|--|"
    for record, check in _largest(finding):
        unit = units.get(check.observable, "")
        assert check.value is not None
        assert check.expected is not None
        yield (
            f"| `{check.observable}` | `{record.id}` | {check.value:.6g} | {check.expected:.6g} "
            f"| {abs(check.value - check.expected):.3g} {unit} |".replace("  |", " |")
        )
    yield ""
    if sample is not None:
        yield f"The smallest scene that shows it, `{sample.case}`; {sample.command}"
        yield ""
        yield "<details><summary>The scene</summary>"
        yield ""
        yield f"```{sample.language}"
        yield sample.text.rstrip()
        yield "```"
        yield ""
        yield "</details>"
        yield ""


def _largest(finding: Finding) -> list[tuple[CaseRecord, Check]]:
    """Of each observable the cases in which it is most off, in the order of observables."""
    by_observable: dict[str, list[tuple[CaseRecord, Check]]] = {}
    for record, check in finding.shown:
        if check.value is not None and check.expected is not None:
            by_observable.setdefault(check.observable, []).append((record, check))
    rows = []
    for _, items in sorted(by_observable.items()):
        items.sort(key=_size)
        # Of a case the row of the form, itself or a variant, in which it is largest.
        largest = {record.id: (record, check) for record, check in items}
        rows += sorted(largest.values(), key=_size, reverse=True)[:MOST_ROWS]
    return rows


def _size(item: tuple[CaseRecord, Check]) -> float:
    _, check = item
    assert check.value is not None
    assert check.expected is not None
    return abs(check.value - check.expected)


def _version(record: CaseRecord, renderer: str) -> str:
    return next((run.version for run in record.runs if run.name == renderer), "")
