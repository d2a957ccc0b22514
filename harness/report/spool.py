"""Markup that waits on the disk until its place in a page comes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import IO


@dataclass(frozen=True, slots=True)
class Piece:
    """Markup in a spool. A template shows it like any other: it is read when it is asked for."""

    spool: Spool
    start: int
    size: int

    def __html__(self) -> str:
        return self.spool.read(self)


class Spool:
    """Keeps pieces in `file`, which is open as long as they are wanted."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._size = 0

    def keep(self, markup: str) -> Piece:
        data = markup.encode("utf-8")
        self._file.seek(self._size)
        self._file.write(data)
        piece = Piece(self, self._size, len(data))
        self._size += len(data)
        return piece

    def read(self, piece: Piece) -> str:
        self._file.seek(piece.start)
        return self._file.read(piece.size).decode("utf-8")
