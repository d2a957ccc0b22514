"""`summary.json` read case by case, so that memory does not grow with the number of cases.

The file is valid where `harness.record.read_summary` finds it so, and means what that returns.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from harness.documents import LARGEST_FILE, parse
from harness.errors import InputError
from harness.record import Summary, SummaryCase, read_summary

PIECE = 1 << 16  # bytes that are read at once


@dataclass(frozen=True, slots=True)
class Span:
    """Where a JSON value stands in a file, in bytes."""

    start: int
    end: int


class SummaryFile:
    """The summary of a run as it lies on the disk.

    `head` is the summary without its cases; `spans` are where these are, in their order.
    """

    def __init__(self, path: Path) -> None:
        """Raises InputError where the file is missing, unreadable or not valid but for cases."""
        self.path = path
        try:
            if path.stat().st_size > LARGEST_FILE:
                raise ValueError
            with path.open("rb") as file:
                self.spans, array = _case_spans(file)
            self.head = self._head(array)
        except (OSError, ValueError, InputError):
            read_summary(path)  # which says better what is wrong
            raise InputError.of("not a valid summary", file=path) from None

    def _head(self, array: Span) -> Summary:
        with self.path.open("rb") as file:
            before = file.read(array.start)
            file.seek(array.end)
            return parse(before + b"[]" + file.read(), Summary, self.path)

    def cases(self) -> Iterator[SummaryCase]:
        """One after the other. Raises InputError at the first that is not valid."""
        return map(self.case, self.spans)

    def case(self, span: Span) -> SummaryCase:
        """The case at `span`. Raises InputError where it is not valid."""
        with self.path.open("rb") as file:
            file.seek(span.start)
            data = file.read(span.end - span.start)
        try:
            return parse(data, SummaryCase, self.path)
        except InputError:
            read_summary(self.path)  # which names the case
            raise


def _case_spans(file: BinaryIO) -> tuple[list[Span], Span]:
    """Where each of the cases stands, and where their list does.

    Raises ValueError where the file is not a JSON object with a list of cases.
    """
    scan = _Scan(file)
    found: tuple[list[Span], Span] | None = None
    scan.take("{")
    while not scan.sees("}"):
        key, _ = scan.value()
        scan.take(":")
        if key == "cases":
            found = _list(scan)
        else:
            scan.value()
        if not scan.sees("}"):
            scan.take(",")
    if found is None:
        raise ValueError("no cases")
    return found


def _list(scan: _Scan) -> tuple[list[Span], Span]:
    start = scan.take("[")
    spans: list[Span] = []
    while not scan.sees("]"):
        spans.append(scan.value()[1])
        if not scan.sees("]"):
            scan.take(",")
    return spans, Span(start, scan.take("]") + 1)


class _Scan:
    """Goes through JSON text value by value and keeps no more of it than the value at hand.

    Each byte is read as one character: what JSON is built of is ASCII, which bytes of UTF-8 beyond
    it never look like, and places in the text are places in the file.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._text, self._start, self._at = file, "", 0, 0
        self._ended = False
        self._decoder = json.JSONDecoder(strict=False)

    def sees(self, mark: str) -> bool:
        """Whether `mark` comes next, spaces aside."""
        while True:
            while self._at < len(self._text) and self._text[self._at] in " \t\r\n":
                self._at += 1
            if self._at < len(self._text) or self._ended:
                return self._text[self._at : self._at + 1] == mark
            self._read_on()

    def take(self, mark: str) -> int:
        """Passes `mark`, and returns where it stood. Raises ValueError where it does not."""
        if not self.sees(mark):
            raise ValueError(f"no {mark}")
        self._at += 1
        return self._start + self._at - 1

    def value(self) -> tuple[object, Span]:
        """Passes the value that comes next, and returns it and where it stood.

        Raises ValueError where there is none.
        """
        self.sees("")
        while True:
            try:
                found, end = self._decoder.raw_decode(self._text, self._at)
            except ValueError:
                if self._ended:
                    raise
            except RecursionError as error:
                raise ValueError("too deep") from error
            else:
                if end < len(self._text) or self._ended:  # else a number might go on
                    span = Span(self._start + self._at, self._start + end)
                    self._at = end
                    return found, span
            self._read_on()

    def _read_on(self) -> None:
        """Reads as much again as is at hand: what is longer than that is tried anew."""
        more = self._file.read(max(PIECE, len(self._text) - self._at))
        self._ended = not more
        self._start += self._at
        self._text, self._at = self._text[self._at :] + more.decode("latin-1"), 0
