"""GitHub's workflow commands: what is red, at the line of the scene file that asks for it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from harness.baseline.run_folder import RunFolder
from harness.ci.findings import Finding, findings, lost
from harness.errors import InputError
from harness.record import Check
from harness.scene.document import parse_document, read_source
from harness.scene.findings import lines_of_keys

# GitHub shows ten errors of a step and drops the rest without a word.
MOST = 10


def workflow_commands(run: RunFolder) -> Iterator[str]:
    """A command a line, one for each check that a scene file asks for, renderers put together."""
    grouped: dict[tuple[str, int | None, str], list[Finding]] = {}
    for finding in findings(run):
        key = (finding.scene, line_of(finding.scene, finding.check), finding.check.observable)
        grouped.setdefault(key, []).append(finding)
    commands = [_command(scene, line, found) for (scene, line, _), found in grouped.items()]
    commands += [
        _error(f"{reason} ({case} {name})", title="snellcheck: missing")
        for case, name, reason in lost(run.summary)
    ]
    yield from commands[:MOST]
    if len(commands) > MOST:
        yield f"::notice title=snellcheck::{len(commands) - MOST} more; the report has them all"


def line_of(scene: str, check: Check) -> int | None:
    """The line of the [[checks]] table that asks for `check`; None where that cannot be told."""
    path = Path(scene)
    if not scene or not path.is_file():
        return None
    try:
        source = read_source(path)
        document = parse_document(source, path)
    except InputError:
        return None
    tables = document.get("checks")
    for index, table in enumerate(tables if isinstance(tables, list) else []):
        if isinstance(table, dict) and table.get("observable") == check.observable:
            probe = table.get("probe")
            if probe is None or f"({probe})" in check.id:
                return lines_of_keys(source).get(("checks", index))
    return None


def _command(scene: str, line: int | None, found: list[Finding]) -> str:
    first = found[0]
    more = f"\n… and {len(found) - 1} more like it" if len(found) > 1 else ""
    title = f"{first.case}: {first.check.renderer}: {first.check.observable}"
    place = {"file": scene, "line": str(line)} if line is not None else {}
    return _error(first.text + more, **place, title=title)


def _error(message: str, **properties: str) -> str:
    said = ",".join(f"{key}={_property(value)}" for key, value in properties.items())
    return f"::error {said}::{_data(message)}"


def _data(text: str) -> str:
    """Escaped as the runner unescapes it: a line break or a second command cannot be slipped in."""
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
