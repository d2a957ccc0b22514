"""How much memory a run takes at most, its own and that of all that it started."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator

import psutil

PERIOD_S = 2.0  # a look that walks through all pages takes 10 to 30 ms
ALIKE = 0.01  # of what a process holds


class Look:
    """Looks at the MiB that this process and all below it take now.

    On Linux the sum of proportional sizes (PSS): pages that several share count once. Elsewhere,
    and of what may not be looked into, the resident size, which counts them for each. That is never
    less and cheap to ask for, while for the other the kernel walks through every page. So who is
    resident with about as much as before is taken to share as much as before, too.
    """

    def __init__(self) -> None:
        # How much was resident when pages were walked through, and how much of it others count.
        self._known: dict[psutil.Process, tuple[int, int]] = {}

    def __call__(self) -> float:
        me = psutil.Process()
        ours, before = _command(me), self._known
        everyone = [me, *me.children(recursive=True)]
        self._known = {p: before.get(p, (0, 0)) for p in everyone}
        # Who is about to become another program holds, for a moment, all that we do.
        copies = {p for p in everyone if p != me and p not in before and _command(p) == ours}
        return sum(self._proportional(p) for p in everyone if p not in copies) / 2**20

    def _proportional(self, process: psutil.Process) -> int:
        resident = _resident(process)
        before, shared = self._known[process]
        if abs(resident - before) > ALIKE * before:
            before, shared = resident, resident - _walked(process, resident)
            self._known[process] = before, shared
        return resident - shared


def _command(process: psutil.Process) -> list[str]:
    with contextlib.suppress(psutil.Error):
        return list(process.cmdline())
    return []


def _resident(process: psutil.Process) -> int:
    with contextlib.suppress(psutil.Error):
        return int(process.memory_info().rss)
    return 0  # it has ended


def _walked(process: psutil.Process, resident: int) -> int:
    """Its proportional size; `resident` where nobody tells."""
    with contextlib.suppress(psutil.Error):
        return int(getattr(process.memory_full_info(), "pss", resident))
    return resident


class Peak:
    """`mb` is the largest that was seen so far."""

    def __init__(self) -> None:
        self.mb = 0.0


@contextlib.contextmanager
def watched(look: Callable[[], float] | None = None, period_s: float = PERIOD_S) -> Iterator[Peak]:
    """Looks every `period_s` from a thread, at the beginning and at the end."""
    peak, over = Peak(), threading.Event()
    look = look or Look()

    def watch() -> None:
        while True:
            peak.mb = max(peak.mb, look())
            if over.wait(period_s):
                break
        peak.mb = max(peak.mb, look())

    thread = threading.Thread(target=watch, name="memory", daemon=True)
    thread.start()
    try:
        yield peak
    finally:
        over.set()
        thread.join()
