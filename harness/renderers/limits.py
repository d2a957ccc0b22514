"""What a renderer may use while it runs, looked at from outside every 50 ms."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from harness.renderers.process_tree import ProcessTree

POLL_S = 0.05
OUTPUT_MB = 512  # of files
LOG_MB = 64  # of stdout and stderr together: nobody reads more
MOST_PROCESSES = 256


@dataclass
class Watch:
    """Limits of `memory_mb` resident, `MOST_PROCESSES`, and `output_mb` of files in `private`.

    Memory and processes are those of the program and all that it started; `private` is the folder
    that it was given to write to.
    """

    tree: ProcessTree
    memory_mb: int
    output_mb: int = OUTPUT_MB
    private: Path | None = None
    _next: float = field(default_factory=lambda: time.monotonic() + POLL_S)

    def passed(self) -> str:
        """Which limit was passed, "" where none was or where it is too soon to look again."""
        if time.monotonic() < self._next:
            return ""
        found = self._look()
        self._next = time.monotonic() + POLL_S
        return found

    def _look(self) -> str:
        if self.tree.resident_mb() > self.memory_mb:
            return f"used more than {self.memory_mb} MB of memory"
        if self.tree.more_than(MOST_PROCESSES):
            return f"started more than {MOST_PROCESSES} processes"
        if self.private is not None and larger(self.private, self.output_mb * 2**20):
            return f"wrote more than {self.output_mb} MB of files"
        return ""


def larger(folder: Path, limit: int) -> bool:
    """Whether the files in a folder take more than `limit` bytes; it may change meanwhile."""
    total = 0
    for size in _sizes(folder):
        total += size
        if total > limit:
            return True
    return False


def _sizes(folder: Path | str) -> Iterator[int]:
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                try:
                    if entry.is_dir(follow_symlinks=False):
                        yield from _sizes(entry.path)
                    else:
                        yield entry.stat(follow_symlinks=False).st_blocks * 512
                except OSError:  # gone already
                    continue
    except OSError:
        return
