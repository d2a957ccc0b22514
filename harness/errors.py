"""Errors that carry evidence. Every one of them is a message for a person, never a traceback.

The command line turns them into exit codes: `InputError` is 2, the renderer errors are 3.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LONGEST_TEXT = 600


def printable(text: str) -> str:
    """The text with whatever could act on a terminal or break a line escaped."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in text)


def utf8(text: str) -> str:
    """The text as a document can hold it; names of files may be of bytes that are no text."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def shown(text: str) -> str:
    """The text as a message shows it; names in it may be of any length."""
    text = printable(text)
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 1] + "…"


class SnellcheckError(Exception):
    """Base of all errors that a user can cause or cure."""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong in one place of one input file.

    `line` counts from 1 and is None where the position is unknown; `key` is the dotted path of
    the value, such as ``solids[0].shape.radius``.
    """

    message: str
    file: Path | None = None
    line: int | None = None
    key: str = ""
    value: str | None = None
    expected: str | None = None
    suggestion: str | None = None

    def __str__(self) -> str:
        place = str(self.file) if self.file else "<input>"
        if self.line is not None:
            place += f":{self.line}"
        return f"{place}: {self.said}"

    @property
    def said(self) -> str:
        """The message without the file, for where that is told beside it."""
        text = f"{shown(self.key)}: {self.message}" if self.key else self.message
        # What is quoted here came from outside.
        if self.value is not None:
            text += f"; got {shown(self.value)}"
        if self.expected is not None:
            text += f"; expected {shown(self.expected)}"
        if self.suggestion is not None:
            text += f"; did you mean {shown(self.suggestion)}?"
        return text


@dataclass
class InputError(SnellcheckError):
    """All problems found in what the user gave, reported at once."""

    problems: list[Problem] = field(default_factory=list)

    @classmethod
    def of(cls, message: str, **where: object) -> InputError:
        """An error with a single problem; `where` are the fields of `Problem`."""
        return cls([Problem(message, **where)])  # type: ignore[arg-type]

    def __str__(self) -> str:
        return "\n".join(str(p) for p in self.problems)


class RendererError(SnellcheckError):
    """A renderer did not deliver. `log` is the tail of what it said, `remedy` a command that
    mends it.
    """

    def __init__(self, message: str, *, log: str = "", remedy: str = "") -> None:
        super().__init__(message)
        self.log, self.remedy = log, remedy


class RendererMissing(RendererError):
    """The renderer is not installed. The message names the command that installs it: SKIP."""


class RendererUnsupported(RendererError):
    """The renderer says that it cannot do what the scene asks: SKIP."""


class RendererFailed(RendererError):
    """The renderer crashed, hung, ran out of memory or wrote something unreadable: ERROR."""


class ImageNotFinite(RendererFailed):
    """An image holds NaN or infinity: ERROR. `pixels` are where, row by row from the top left.

    `image` (height, width, 3) is all of it, where it is at hand: nothing is measured in it, but it
    can be looked at.
    """

    def __init__(
        self,
        pixels: Iterable[int],
        *,
        width: int,
        log: str = "",
        image: NDArray[np.floating] | None = None,
    ) -> None:
        self.pixels, self.width, self.image = tuple(pixels), width, image
        y, x = divmod(self.pixels[0], width)
        message = f"wrote NaN or infinity in {len(self.pixels)} pixels, first at ({x}, {y})"
        super().__init__(message, log=log)


class ConnectionLost(SnellcheckError):
    """The machines that do the work cannot be reached any more: nothing can go on."""


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name closest to `name`, or None where nothing is close."""
    matches = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    return matches[0] if matches else None
