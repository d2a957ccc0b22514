"""Where in a scene file something is wrong: key paths, their lines, and the final messages.

Values are read by tomllib, which forgets positions. Only when something must be reported is the
file parsed a second time, by tree-sitter, for the line of every key.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from harness.errors import InputError, Problem, printable, shown

if TYPE_CHECKING:
    from tree_sitter import Node

KeyPath = tuple[str | int, ...]
Result = TypeVar("Result")

LONGEST_VALUE = 80  # characters of a value that a message quotes
LONGEST_KEY = 200


@dataclass(frozen=True)
class Finding:
    """Something wrong at a key path, before file and line are known."""

    path: KeyPath
    message: str
    value: str | None = None
    expected: str | None = None
    suggestion: str | None = None

    def below(self, path: KeyPath) -> Finding:
        """The same finding, its path relative to `path`."""
        return replace(self, path=(*path, *self.path))


class SceneInvalid(Exception):
    """Raised inside the scene package; `load` and `resolve` turn it into an InputError."""

    def __init__(self, *findings: Finding) -> None:
        super().__init__("; ".join(f.message for f in findings))
        self.findings = findings


class Attempts:
    """Collects what is wrong in all parts of a scene, so that it is reported at once."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []

    def attempt(self, path: KeyPath, build: Callable[..., Result], *args: object) -> Result | None:
        """The result of `build(*args)`, or None; what it finds is relative to `path`."""
        try:
            return build(*args)
        except SceneInvalid as error:
            self.findings += [finding.below(path) for finding in error.findings]
            return None

    def raise_any(self) -> None:
        if self.findings:
            raise SceneInvalid(*self.findings)


def dotted(path: KeyPath) -> str:
    """("solids", 0, "shape") as ``solids[0].shape``; keys that need quotes are quoted."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            bare = re.fullmatch(r"[A-Za-z0-9_-]+", part)
            text += ("." if text else "") + (part if bare else quoted(part))
    return text


def quoted(value: object) -> str:
    """A value as a message shows it: on one line, escaped, and no longer than LONGEST_VALUE."""
    if isinstance(value, str):
        value = value[: LONGEST_VALUE + 1]  # before escaping, which may be slow for a huge one
    try:
        text = json.dumps(value, ensure_ascii=False, default=str)
    except (ValueError, RecursionError):  # integers of thousands of digits; deep nesting
        text = f"a {type(value).__name__}"
    text = printable(text)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 1] + "…"


def lines_of_keys(source: bytes) -> dict[KeyPath, int]:
    """The line, counted from 1, of every key, table and array element of a TOML document."""
    import tree_sitter_toml
    from tree_sitter import Language, Parser

    tree = Parser(Language(tree_sitter_toml.language())).parse(source)
    lines: dict[KeyPath, int] = {}
    lengths: dict[KeyPath, int] = {}  # of arrays of tables, which grow header by header
    for child in tree.root_node.named_children:
        if child.type == "pair":
            _add_pair(child, (), lines)
        elif child.type in ("table", "table_array_element"):
            _add_table(child, lines, lengths)
    return lines


def _add_table(node: Node, lines: dict[KeyPath, int], lengths: dict[KeyPath, int]) -> None:
    header, *members = node.named_children
    parts = _key_parts(header)
    path: KeyPath = ()
    for depth, part in enumerate(parts):
        path = (*path, part)
        lines.setdefault(path, _line(header))
        if node.type == "table_array_element" and depth == len(parts) - 1:
            lengths[path] = lengths.get(path, 0) + 1
        if path in lengths:  # a header inside an array of tables means its newest element
            path = (*path, lengths[path] - 1)
            lines.setdefault(path, _line(header))
    for member in members:
        if member.type == "pair":
            _add_pair(member, path, lines)


def _add_pair(node: Node, base: KeyPath, lines: dict[KeyPath, int]) -> None:
    if len(node.named_children) < 2:
        return
    key, value = node.named_children[0], node.named_children[-1]
    path = base
    for part in _key_parts(key):
        path = (*path, part)
        lines.setdefault(path, _line(key))
    _add_value(value, path, lines)


def _add_value(node: Node, path: KeyPath, lines: dict[KeyPath, int]) -> None:
    if node.type == "inline_table":
        for child in node.named_children:
            if child.type == "pair":
                _add_pair(child, path, lines)
    elif node.type == "array":
        elements = [child for child in node.named_children if child.type != "comment"]
        for index, element in enumerate(elements):
            lines.setdefault((*path, index), _line(element))
            _add_value(element, (*path, index), lines)


def _line(node: Node) -> int:
    return int(node.start_point[0]) + 1


def _key_parts(node: Node) -> list[str]:
    if node.type == "dotted_key":
        return [part for child in node.named_children for part in _key_parts(child)]
    text = (node.text or b"").decode("utf-8", "replace")
    if node.type == "quoted_key":
        return [str(tomllib.loads(f"key = {text}")["key"])]
    return [text]


def problems(findings: Iterable[Finding], file: Path, source: bytes | None) -> list[Problem]:
    """Findings as problems of `file`, in the order of its lines.

    A key that is not in the file (because it is missing, or was made by expansion) is located
    at the nearest key around it.
    """
    lines = lines_of_keys(source) if source is not None else {}
    located = [
        Problem(
            shown(finding.message),
            file=file,
            line=_nearest_line(finding.path, lines),
            key=dotted(finding.path)[:LONGEST_KEY],
            value=finding.value,
            expected=finding.expected,
            suggestion=finding.suggestion,
        )
        for finding in findings
    ]
    return sorted(located, key=lambda problem: problem.line or 0)


def _nearest_line(path: KeyPath, lines: dict[KeyPath, int]) -> int | None:
    for length in range(len(path), 0, -1):
        if path[:length] in lines:
            return lines[path[:length]]
    return 1 if lines else None


def input_error(findings: Iterable[Finding], file: Path) -> InputError:
    """The error to raise for what was found in `file`, read again for its positions."""
    try:
        source = file.read_bytes()
    except OSError:
        source = None
    return InputError(problems(findings, file, source))
