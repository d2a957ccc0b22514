"""From scene files to cases: reads, expands, validates, and says all that is wrong at once."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, get_args

from harness.errors import InputError, Problem, nearest
from harness.scene.crosscheck import cross_findings
from harness.scene.document import parse_document, read_source, value_at
from harness.scene.expand import PROSE, Permutation, expand
from harness.scene.explain import validate
from harness.scene.expressions import Value, is_expression
from harness.scene.findings import Finding, KeyPath, problems, quoted
from harness.scene.model import Case

Quality = Literal["draft", "normal", "high"]
QUALITIES: tuple[str, ...] = get_args(Quality)
SCALE = {"draft": 0.5, "normal": 1.0, "high": 2.0}  # of the film's width and height

MOST_PROBLEMS = 100  # of one file; more would help nobody


@dataclass(frozen=True)
class LoadedCase:
    """One permutation of a scene file.

    `id` is unique in a suite, such as ``slab-offset[thickness=0.25,ior=1.5]``; `case` is its part
    without the axes. `parameters` has the values of axes, then of parameters.
    """

    id: str
    case: str
    file: Path
    parameters: dict[str, Value]
    model: Case = field(repr=False)


def load_cases(
    path: Path, quality: str = "normal", renderers: Collection[str] = ()
) -> list[LoadedCase]:
    """All permutations of the scene file `path`, with its film scaled to `quality`.

    `renderers` are names that checks may use beside those of the registered renderers. Raises
    InputError with every problem of the file.
    """
    scale = scale_of(quality)
    source = read_source(path)
    document = parse_document(source, path)
    expansion = expand(document)
    findings = list(expansion.findings)
    reported = {finding.path for finding in findings}
    models: list[Case] = []
    for permutation in expansion.permutations:
        model, found = _validate(permutation, document, renderers)
        if model is not None:
            models.append(_scaled(model, scale))
        # What is wrong with a key was said already where an earlier permutation showed it.
        new = [finding for finding in found if finding.path not in reported]
        findings += new
        reported |= {finding.path for finding in new}
    if findings:
        raise InputError(problems(findings, path, source)[:MOST_PROBLEMS])
    case = case_name(path)
    return [
        LoadedCase(case + p.suffix, case, path, {**p.axes, **p.parameters}, model)
        for p, model in zip(expansion.permutations, models, strict=True)
    ]


def scale_of(quality: str) -> float:
    """By how much a quality scales films. Raises InputError for an unknown one."""
    if quality not in QUALITIES:
        raise InputError.of(
            "unknown quality",
            value=quoted(quality),
            expected=", ".join(QUALITIES),
            suggestion=nearest(quality, QUALITIES),
        )
    return SCALE[quality]


def case_name(path: Path) -> str:
    """``scenes/slab/offset.toml`` is the case ``slab-offset``."""
    parts = (path.absolute().parent.name, path.stem)
    words = (re.sub(r"[^A-Za-z0-9_]+", "-", part).strip("-") for part in parts)
    return "-".join(word for word in words if word) or "case"


def _validate(
    permutation: Permutation, document: dict[str, object], renderers: Collection[str]
) -> tuple[Case | None, list[Finding]]:
    """The model of one permutation, None where it is not valid, and all that is wrong."""
    data = permutation.data
    model, found = validate(data)
    found += cross_findings(data, renderers)
    # An expression without a value is still in its place, and has been reported.
    return model, [
        _shown_with_origin(finding, permutation, document)
        for finding in found
        if not _stands_for_a_value(finding.path, data)
    ]


def _stands_for_a_value(path: KeyPath, document: dict[str, object]) -> bool:
    return is_expression(value_at(document, path)) and PROSE.isdisjoint(path)


def _shown_with_origin(
    finding: Finding, permutation: Permutation, document: dict[str, object]
) -> Finding:
    """Where a wrong value came from an expression, the message shows both."""
    written = value_at(document, finding.path)
    if finding.value is None or not is_expression(written):
        return finding
    return replace(finding, value=f"{quoted(written)} = {finding.value}{permutation.where}")


def _scaled(model: Case, scale: float) -> Case:
    film = model.film
    if not film.scalable or scale == 1.0:
        return model
    scaled = film.model_copy(
        update={
            "width": max(1, round(film.width * scale)),
            "height": max(1, round(film.height * scale)),
        }
    )
    return model.model_copy(update={"film": scaled})


# --- selection ------------------------------------------------------------------------------------


@dataclass
class _Suite:
    """The cases below a folder, and what is wrong with the files that could not be loaded."""

    cases: list[LoadedCase] = field(default_factory=list)
    broken: dict[Path, InputError] = field(default_factory=dict)


def scene_files(folder: Path) -> list[Path]:
    """All scene files below a folder, in an order that does not depend on the machine."""
    return sorted(path for path in folder.rglob("*.toml") if path.is_file())


def find(
    selections: Sequence[str],
    root: Path,
    quality: str = "normal",
    renderers: Collection[str] = (),
) -> list[LoadedCase]:
    """The cases that `selections` name, without repetitions, in the order of ids per file.

    A selection is a scene file, a folder of them, a family, a tag, or a case's id in which ``*``
    and ``?`` stand for any characters; a case's name without axes means all of its permutations.
    Files and folders are found from the working folder, everything else below `root`. Without
    selections, all cases below `root`.

    Raises InputError for a selection that matches nothing and for each selected file with
    problems; what is wrong in files that are not selected does not matter.
    """
    scale_of(quality)
    files = [Path(selection) for selection in selections if _is_path(selection)]
    globs = [selection for selection in selections if not _is_path(selection)]
    found: dict[str, LoadedCase] = {}
    problems: list[Problem] = []
    for path in files:
        suite = _load(scene_files(path) if path.is_dir() else [path], quality, renderers)
        _add(suite.cases, found, problems)
        for error in suite.broken.values():
            problems += error.problems
        if not suite.cases and not suite.broken:
            problems.append(Problem("holds no scene files (*.toml)", file=path))
    if globs or not selections:
        _select(globs, _load(scene_files(root), quality, renderers), root, found, problems)
    if problems:
        raise InputError(list(dict.fromkeys(problems)))
    return list(found.values())


def _is_path(selection: str) -> bool:
    """Paths are told by how they look: "slab" is a family, even beside a folder of that name."""
    return selection in (".", "..") or selection.endswith(".toml") or "/" in selection


def _load(files: Sequence[Path], quality: str, renderers: Collection[str]) -> _Suite:
    suite = _Suite()
    for path in files:
        try:
            suite.cases += load_cases(path, quality, renderers)
        except InputError as error:
            suite.broken[path] = error
    return suite


def _add(
    cases: Sequence[LoadedCase], found: dict[str, LoadedCase], problems: list[Problem]
) -> None:
    for case in cases:
        other = found.setdefault(case.id, case)
        if other.file.absolute() != case.file.absolute():
            problems.append(
                Problem(f"its case {case.case} is also in {other.file}", file=case.file)
            )


def _select(
    globs: Sequence[str],
    suite: _Suite,
    root: Path,
    found: dict[str, LoadedCase],
    problems: list[Problem],
) -> None:
    if not suite.cases and not suite.broken:
        problems.append(Problem("holds no scene files (*.toml)", file=root))
    for glob in globs or ["*"]:
        wanted = pattern(glob)
        chosen = [c for c in suite.cases if _matches(wanted, c) or glob in c.model.tags]
        broken = [path for path in suite.broken if _may_match(wanted, glob, path)]
        _add(chosen, found, problems)
        for path in broken:
            problems += suite.broken[path].problems
        if not chosen and not broken and globs:
            problems.append(_no_match(glob, suite))
            for error in suite.broken.values():  # where what was meant may be
                problems += error.problems


def pattern(glob: str) -> re.Pattern[str]:
    """A selection as a regular expression: ``*`` and ``?`` stand for any characters."""
    # Brackets are not wildcards: they belong to ids.
    text = re.escape(glob).replace(r"\*", ".*").replace(r"\?", ".")
    return re.compile(text, re.DOTALL)


def _matches(wanted: re.Pattern[str], case: LoadedCase) -> bool:
    return any(wanted.fullmatch(name) for name in (case.id, case.case, case.model.family))


def _may_match(wanted: re.Pattern[str], glob: str, path: Path) -> bool:
    """Whether a file that could not be loaded might have the case that is asked for."""
    name = case_name(path)
    names = (name, path.absolute().parent.name)
    return any(map(wanted.fullmatch, names)) or glob.startswith(f"{name}[")


def _no_match(glob: str, suite: _Suite) -> Problem:
    broken = {case_name(path) for path in suite.broken}
    names = {c.case for c in suite.cases} | {c.model.family for c in suite.cases} | broken
    close = nearest(glob, {c.id for c in suite.cases}) if "[" in glob else None
    wildcards = glob.replace("*", "").replace("?", "").rstrip("-")
    return Problem(
        f"no case matches {glob!r}",
        expected="a case, a family or a scene file; `snellcheck list` shows them",
        suggestion=close or nearest(glob, names) or nearest(wildcards, names),
    )
