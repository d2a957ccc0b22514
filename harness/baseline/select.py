"""Which cases and renderers a comparison is about, on the run's side and on the baselines'."""

from __future__ import annotations

import re
from collections.abc import Sequence

from harness.baseline.compare import Wanted
from harness.baseline.run_folder import RunFolder
from harness.baseline.source import Baselines
from harness.errors import InputError, Problem, nearest
from harness.scene.load import pattern


def selector(
    globs: Sequence[str], renderers: Sequence[str], run: RunFolder, baselines: Baselines
) -> Wanted:
    """Selects by globs over ids, cases and families, and by names; all where there are none.

    Raises InputError where a glob or a name selects nothing on either side.
    """
    wanted = [pattern(glob) for glob in globs]
    names = names_of_cases(run, baselines)
    problems = [
        Problem(f"no case of the run or the baseline matches {glob!r}", key="CASE",
                suggestion=nearest(glob, names))
        for glob, one in zip(globs, wanted, strict=True)
        if not any(_matches(one, name, names) for name in names)
    ]  # fmt: skip
    known = {*run.summary.renderers, *(name for _, name in baselines.kept)}
    problems += [
        Problem("no renderer of the run or the baseline", key="--renderer", value=name[:80],
                suggestion=nearest(name, known))
        for name in renderers
        if name not in known
    ]  # fmt: skip
    if problems:
        raise InputError(problems)

    def select(case: str, renderer: str) -> bool:
        fits = not wanted or any(_matches(one, case, names) for one in wanted)
        return fits and (not renderers or renderer in renderers)

    return select


def of_run(run: RunFolder, wanted: Wanted) -> Wanted:
    """`wanted`, but of cases that the run set out to do alone."""
    cases = {case.id for case in run.summary.cases}
    return lambda case, renderer: case in cases and wanted(case, renderer)


def names_of_cases(run: RunFolder, baselines: Baselines) -> dict[str, set[str]]:
    """By id: the names by which a case can be meant."""
    names: dict[str, set[str]] = {}
    for kept in baselines.kept.values():
        case, family = kept.baseline.case, kept.baseline.scene_file.partition("/")[0]
        names[case] = {case, case.partition("[")[0], family}
    for case, (record, _) in run.records.items():
        names[case] = {case, record.case, record.family}
    return names


def _matches(wanted: re.Pattern[str], case: str, names: dict[str, set[str]]) -> bool:
    return any(map(wanted.fullmatch, names[case]))
