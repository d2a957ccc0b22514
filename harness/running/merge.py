"""The shards of a suite become one run again, or it is said why they cannot."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from harness import record
from harness.archive import Archive, folder_name
from harness.errors import InputError, Problem
from harness.judging.explain import explain_run
from harness.plan import PreparedCase
from harness.record import Counts, Effort, RendererSummary, Summary, SummaryCase, Verdict
from harness.running.shard import ShardNote, read_note, write_times


@dataclass(frozen=True)
class Part:
    """One shard as it was run."""

    folder: Path
    note: ShardNote
    summary: Summary


def merge(
    folders: Sequence[Path], out: Path, cases: Sequence[PreparedCase], command: str = ""
) -> Summary:
    """Writes the run that the shards in `folders` are parts of to `out`; returns its summary.

    `cases` are used to bring their diagnoses together; those that are no part of the suite do not
    count. Raises InputError, and writes nothing, where shards are missing, given twice, of
    different suites, interrupted, or not whole.
    """
    parts = [Part(folder, read_note(folder), _summary_in(folder)) for folder in folders]
    problems = _problems(parts)
    if problems:
        raise InputError(problems)
    parts.sort(key=lambda part: part.note.index)
    suite = parts[0].note.cases
    judged = {case.id: case for part in parts for case in part.summary.cases}
    archive = Archive(out)
    records = [_copy(part, archive, case) for part in parts for case in part.summary.cases]
    summary = _merged(parts, [judged[case] for case in suite], cases, command)
    write_times(out, records)
    record.write(summary, out / "summary.json")
    return summary


def _summary_in(folder: Path) -> Summary:
    return record.read_summary(folder / "summary.json")


def _problems(parts: Sequence[Part]) -> list[Problem]:
    """Everything that keeps `parts` from being one whole run."""
    if not parts:
        return [Problem("no shard to merge")]
    first, problems = parts[0], []
    for part in parts:
        if part.summary.interrupted:
            problems.append(Problem("this shard was interrupted", part.folder))
        if (part.note.suite, part.note.count) != (first.note.suite, first.note.count):
            why = "another suite: scenes, checks, renderers, settings or recorded times differ"
            problems.append(Problem(f"of {why} from those of {first.folder}", part.folder))
        if sorted(case.id for case in part.summary.cases) != sorted(part.note.mine):
            problems.append(
                Problem("its summary does not have the cases of its shard", part.folder)
            )
        problems += _versions(first, part)
        problems += _incomplete(part)
    return problems or _gaps(parts)


def _gaps(parts: Sequence[Part]) -> list[Problem]:
    """Shards that are missing or there twice."""
    count, problems = parts[0].note.count, []
    for index in range(1, count + 1):
        mine = [part for part in parts if part.note.index == index]
        if not mine:
            problems.append(Problem(f"shard {index}/{count} is missing"))
        said = f"shard {index}/{count} is there twice"
        problems += [Problem(said, again.folder, value=str(mine[0].folder)) for again in mine[1:]]
    covered = sorted(case for part in parts for case in part.note.mine)
    if not problems and covered != sorted(parts[0].note.cases):
        problems.append(Problem("the shards do not make up their suite"))
    return problems


def _versions(first: Part, part: Part) -> list[Problem]:
    """Renderers that are other ones here than in the first shard."""
    problems = []
    for name, known in first.summary.renderers.items():
        mine = part.summary.renderers.get(name)
        if mine is None or (mine.version, mine.status) != (known.version, known.status):
            seen = "none" if mine is None else f"{mine.version} ({mine.status})"
            expected = f"{known.version} ({known.status}) as in {first.folder}"
            problems.append(Problem(f"another {name}", part.folder, value=seen, expected=expected))
    if part.summary.snellcheck_version != first.summary.snellcheck_version:
        seen, expected = part.summary.snellcheck_version, first.summary.snellcheck_version
        problems.append(Problem("another snellcheck", part.folder, value=seen, expected=expected))
    return problems


def _incomplete(part: Part) -> list[Problem]:
    """Cases without a readable record."""
    problems = []
    for case in part.summary.cases:
        try:
            found = record.read_case(part.folder / "records" / f"{folder_name(case.id)}.json")
        except InputError as error:
            problems += error.problems
            continue
        if found.id != case.id or found.checks != case.checks:
            problems.append(Problem(f"the record of {case.id} is not of this run", part.folder))
    return problems


def _copy(part: Part, archive: Archive, case: SummaryCase) -> record.CaseRecord:
    name = folder_name(case.id)
    archive.discard(name)
    for path in Archive(part.folder).files(name):
        (archive.root / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(part.folder / path, archive.root / path)
    return record.read_case(archive.root / "records" / f"{name}.json")


def _merged(
    parts: Sequence[Part],
    judged: list[SummaryCase],
    cases: Sequence[PreparedCase],
    command: str,
) -> Summary:
    verdicts = [check.status for case in judged for check in case.checks]
    first, known = parts[0].summary, {case.id for case in judged}
    mine = [case for case in cases if case.loaded.id in known]
    efforts = [part.summary.effort.model_dump() for part in parts]
    return first.model_copy(
        update={
            "started": min(part.summary.started for part in parts),
            "wall_s": max(part.summary.wall_s for part in parts),
            "command": command,
            "exit_code": _exit_code(parts, verdicts),
            "renderers": {name: _renderer(parts, name) for name in first.renderers},
            "counts": Counts.model_validate({v.value: verdicts.count(v) for v in Verdict}),
            "cases": judged,
            "diagnoses": explain_run(
                mine, judged, {name: r.reason for name, r in first.renderers.items()}
            ),
            "effort": Effort(**{key: sum(e[key] for e in efforts) for key in efforts[0]}),
            "confinement": "; ".join(sorted({part.summary.confinement for part in parts})),
        }
    )


def _renderer(parts: Sequence[Part], name: str) -> RendererSummary:
    found = [part.summary.renderers[name] for part in parts]
    return found[0].model_copy(
        update={
            "cases": sum(one.cases for one in found),
            "render_s": sum(one.render_s for one in found),
        }
    )


def _exit_code(parts: Sequence[Part], verdicts: list[Verdict]) -> int:
    """As of a run that had not been split: see `harness.run.exit_code`."""
    if Verdict.FAIL in verdicts or not verdicts:
        return 1
    if any(part.summary.exit_code == 3 and _could_not_run(part.summary) for part in parts):
        return 3
    return 0 if {Verdict.PASS, Verdict.KNOWN} & set(verdicts) else 3


def _could_not_run(summary: Summary) -> bool:
    """Whether exit code 3 means more than that all checks of a shard were skipped."""
    statuses = {check.status for case in summary.cases for check in case.checks}
    out = any(known.status not in ("ok", "stored") for known in summary.renderers.values())
    return out or bool(statuses - {Verdict.SKIP}) or not summary.cases
