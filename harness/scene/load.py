"""From scene files to cases: reads, expands, validates, and says all that is wrong at once."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, get_args

from pydantic import ValidationError

from harness.errors import InputError, Problem, nearest
from harness.scene.crosscheck import cross_findings
from harness.scene.expand import Permutation, Value, expand, is_expression
from harness.scene.explain import findings_of
from harness.scene.findings import Finding, KeyPath, problems
from harness.scene.model import Case, Film

Quality = Literal["draft", "normal", "high"]
QUALITIES: tuple[str, ...] = get_args(Quality)
SCALE = {"draft": 0.5, "normal": 1.0, "high": 2.0}  # of the film's width and height

LARGEST_FILE = 8 * 2**20  # bytes; a scene with a written-out mesh has some 100 per triangle


@dataclass(frozen=True)
class LoadedCase:
    """One permutation of a scene file.

    `id` is unique in a suite, such as ``slab-offset[thickness=0.25,ior=1.5]``; `case` is its part
    without the axes. `parameters` has the values of axes and parameters.
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
    if quality not in QUALITIES:
        raise InputError.of(
            f"unknown quality {quality!r}",
            expected=", ".join(QUALITIES),
            suggestion=nearest(quality, QUALITIES),
        )
    source = _read(path)
    expansion = expand(_parse(source, path))
    findings = dict.fromkeys(expansion.findings)
    seen = {finding.path for finding in findings}
    models: list[tuple[Permutation, Case]] = []
    for permutation in expansion.permutations:
        model, found = _validate(permutation, renderers)
        # A later permutation's problem with the same key would repeat the first one's.
        findings.update(dict.fromkeys(f for f in found if f.path not in seen))
        if model is not None:
            models.append((permutation, _scaled(model, SCALE[quality])))
        seen.update(f.path for f in found)
    if findings:
        raise InputError(problems(findings, path, source))
    case = case_name(path)
    return [
        LoadedCase(case + p.suffix, case, path, {**p.axes, **p.parameters}, model)
        for p, model in models
    ]


def case_name(path: Path) -> str:
    """``scenes/slab/offset.toml`` is the case ``slab-offset``."""
    parts = (path.resolve().parent.name, path.stem)
    words = (re.sub(r"[^A-Za-z0-9_]+", "-", part).strip("-") for part in parts)
    return "-".join(word for word in words if word) or "case"


def _read(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            source = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError.of(f"cannot be read: {reason}", file=path) from error
    if len(source) > LARGEST_FILE:
        raise InputError.of(f"file of more than {LARGEST_FILE} bytes", file=path)
    return source


def _parse(source: bytes, path: Path) -> dict[str, object]:
    try:
        return tomllib.loads(source.decode("utf-8"))
    except UnicodeDecodeError as error:
        line = source.count(b"\n", 0, error.start) + 1
        raise InputError.of("not UTF-8 text", file=path, line=line) from error
    except RecursionError as error:
        raise InputError.of("nested too deeply", file=path) from error
    except ValueError as error:  # TOMLDecodeError, or an integer of thousands of digits
        message, line = str(error), None
        if position := re.search(r" \(at line (\d+), column (\d+)\)$", message):
            line = int(position[1])
            message = f"{message[: position.start()]} in column {position[2]}"
        elif message.endswith(" (at end of document)"):
            line = source.count(b"\n") + 1
        raise InputError.of(f"not valid TOML: {message}", file=path, line=line) from error


def _validate(
    permutation: Permutation, renderers: Collection[str]
) -> tuple[Case | None, list[Finding]]:
    try:
        model = Case.model_validate(permutation.data)
    except ValidationError as error:
        found = findings_of(error, permutation.data)
        found = [f for f in found if not is_expression(_at(permutation.data, f.path))]
        return None, [_with_origin(f, permutation) for f in found]
    return model, cross_findings(model, renderers)


def _with_origin(finding: Finding, permutation: Permutation) -> Finding:
    return finding


def _at(document: object, path: KeyPath) -> object:
    """The value at a path; None where there is none."""
    for part in path:
        try:
            document = document[part]  # type: ignore[index]
        except (KeyError, IndexError, TypeError):
            return None
    return document


def _scaled(model: Case, scale: float) -> Case:
    film = model.film
    if not film.scalable or scale == 1.0:
        return model
    film = Film(
        width=max(1, round(film.width * scale)),
        height=max(1, round(film.height * scale)),
    )
    return model.model_copy(update={"film": film})
