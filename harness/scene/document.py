"""Scene files as TOML documents, before anything in them has a meaning."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from harness.errors import InputError
from harness.scene.findings import KeyPath

LARGEST_FILE = 4 * 2**20  # bytes; a mesh written out has some 100 per triangle
MOST_VALUES = 200_000  # numbers, texts, arrays and tables together
DEEPEST = 32  # tables and arrays in each other
TOO_DEEP = "nested too deeply"

QUOTED = re.compile(rb'"(?:[^"\\\n]|\\.){0,200}"|' rb"'[^'\n]{0,200}'")
LONG_NUMBER = re.compile(rb"[0-9_]{4301}")
BARE_KEY = re.compile(rb"[ \t]*[A-Za-z0-9_-]+[ \t]*")


def read_source(path: Path) -> bytes:
    """The bytes of a scene file. Raises InputError where it is unreadable or too large."""
    try:
        with path.open("rb") as file:
            source = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError.of(f"cannot be read: {reason}", file=path) from error
    if len(source) > LARGEST_FILE:
        raise InputError.of(f"larger than {LARGEST_FILE} bytes", file=path)
    return source


def parse_document(source: bytes, path: Path) -> dict[str, object]:
    """The TOML data of `source`; raises InputError with the line of what is not valid TOML."""
    try:
        text = source.decode("utf-8")
        _limit_keys(source)
        document = tomllib.loads(text)
    except UnicodeDecodeError as error:
        line = source.count(b"\n", 0, error.start) + 1
        raise InputError.of("not UTF-8 text", file=path, line=line) from error
    except RecursionError as error:
        raise InputError.of(TOO_DEEP, file=path) from error
    except ValueError as error:  # TOMLDecodeError, or an integer of thousands of digits
        message, line = str(error), None
        if position := re.search(r" \(at line (\d+), column (\d+)\)$", message):
            line = int(position[1])
            message = f"{message[: position.start()]} in column {position[2]}"
        elif message.endswith(" (at end of document)"):
            line = source.count(b"\n") + 1
        elif digits := LONG_NUMBER.search(source):  # Python converts none of more digits
            message = "a number of thousands of digits"
            line = source.count(b"\n", 0, digits.start()) + 1
        raise InputError.of(f"not valid TOML: {message}", file=path, line=line) from error
    try:
        count = count_values(document)
    except RecursionError as error:
        raise InputError.of(TOO_DEEP, file=path) from error
    if count > MOST_VALUES:
        raise InputError.of(f"more than {MOST_VALUES} values", file=path)
    return document


def _limit_keys(source: bytes) -> None:
    """Raises RecursionError for keys of very many parts, on which tomllib takes minutes."""
    for line in source.splitlines():
        if line.count(b".") > DEEPEST:
            run = 0
            for part in QUOTED.sub(b"q", line).split(b"."):
                run = run + 1 if BARE_KEY.fullmatch(part) else 0
                if run > DEEPEST:
                    raise RecursionError


def count_values(document: object) -> int:
    """Values in a document, arrays and tables counted too.

    Raises RecursionError where it is nested deeper than DEEPEST, long before Python's limit.
    """
    level: list[object] = [document]
    count = 0
    for _ in range(DEEPEST):
        if not level:
            return count
        count += len(level)
        below: list[object] = []
        for node in level:
            if isinstance(node, dict):
                below += node.values()
            elif isinstance(node, list):
                below += node
        level = below
    raise RecursionError


def value_at(document: object, path: KeyPath) -> object:
    """The value at a path of a document; None where there is none."""
    for part in path:
        try:
            document = document[part]  # type: ignore[index]
        except (KeyError, IndexError, TypeError):
            return None
    return document
