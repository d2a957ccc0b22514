"""What a renderer may use while it runs, looked at from outside as often as it could be passed.

A look wakes us, lists the machine's processes and walks through a folder: half of all our work for
a process of POV-Ray, were it done every 50 ms. So after a look we rest for as long as what is left
lasts at full speed, and those 50 ms.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from harness.renderers.process_tree import ProcessTree

# Between two looks. Nobody overshoots a limit by more than what can be used up in the least; some
# things are to be seen however much is left, such as how many processes there are.
LEAST_S, MOST_S = 0.05, 0.2
# What two cores were seen to fill at full speed: 9.6 GB/s of memory, 4.0 GB/s of files.
MEMORY_MB_S, FILES_MB_S = 10_000, 5_000
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
    _rest: float = LEAST_S
    _next: float = field(default_factory=lambda: time.monotonic() + LEAST_S)

    def rest_s(self, deadline: float) -> float:
        """How long one may rest until it is time to look again, or until `deadline`."""
        return max(0.0, min(self._next, deadline) - time.monotonic())

    def passed(self) -> str:
        """Which limit was passed, "" where none was or where it is too soon to look again."""
        if time.monotonic() < self._next:
            return ""
        # All that watch share a list of processes. Who is not yet in it may have filled memory.
        listed_s = self._rest / 2
        memory_left = self.memory_mb - self.tree.resident_mb(listed_s)
        if memory_left < 0:
            return f"used more than {self.memory_mb} MB of memory"
        if self.tree.more_than(MOST_PROCESSES):
            return f"started more than {MOST_PROCESSES} processes"
        files_left = self.output_mb - self._files_mb()
        if files_left < 0:
            return f"wrote more than {self.output_mb} MB of files"
        lasts_s = min(max(0.0, memory_left / MEMORY_MB_S - listed_s), files_left / FILES_MB_S)
        self._rest = min(LEAST_S + lasts_s, MOST_S)
        self._next = time.monotonic() + self._rest
        return ""

    def _files_mb(self) -> float:
        """MiB of files in the private folder; where it is more than allowed, not all of them."""
        total = 0.0
        if self.private is not None:
            for size in _sizes(self.private):
                total += size / 2**20
                if total > self.output_mb:
                    break
        return total


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
