"""JSON documents in files: written all or nothing, read with a message for what is wrong."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from harness.errors import InputError, printable

Document = TypeVar("Document", bound=BaseModel)

LARGEST_FILE = 256 * 2**20  # bytes
LONGEST_KEY = 200
LONGEST_MESSAGE = 300


class Model(BaseModel):
    """What is part of a document: immutable, and nothing in it that we do not know."""

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")


# What `write_bytes` calls a file before it is whole.
PARTIAL = re.compile(r"\..+\.[a-z0-9_]{8}")


def write_pieces(path: Path, pieces: Iterable[bytes | memoryview]) -> None:
    """Writes all of `pieces` or nothing: to a temporary name beside `path`, then renamed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.writelines(pieces)
        Path(name).chmod(0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_bytes(path: Path, data: bytes | memoryview) -> None:
    """Writes all of `data` or nothing, like `write_pieces`."""
    write_pieces(path, (data,))


def write_text(path: Path, text: str) -> None:
    """Writes `text` as UTF-8, all of it or nothing."""
    write_bytes(path, text.encode("utf-8"))


def read(path: Path, kind: type[Document], what: str = "record") -> Document:
    """The JSON document at `path`. Raises InputError where it is unreadable or not valid."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError.of(f"larger than {LARGEST_FILE} bytes", file=path)
        return parse(path.read_bytes(), kind, path, what)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError.of(f"cannot be read: {reason}", file=path) from error


def parse(data: bytes, kind: type[Document], path: Path, what: str = "record") -> Document:
    """The document that `data`, the content of `path`, is. Raises InputError."""
    try:
        return kind.model_validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        key = ".".join(str(part) or '""' for part in first["loc"])
        position = re.search(r"at line (\d+) column \d+", first["msg"])
        line = None if key else 1  # what is wrong with all of it is wrong from the beginning
        raise InputError.of(
            f"not a valid {what}: {printable(first['msg'])[:LONGEST_MESSAGE]}",
            file=path, key=printable(key)[:LONGEST_KEY],
            line=int(position[1]) if position else line,
        ) from error  # fmt: skip
