"""How much memory a run takes at most, its own and that of all that it started."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator

import psutil

PERIOD_S = 2.0  # a look that walks through pages takes 10 to 30 ms


class Look:
    """Looks at the MiB that this process and all below it take now.

    On Linux the sum of proportional sizes (PSS): pages that several share count once. Elsewhere,
    and of what may not be looked into, the resident size, which counts them for each. That is never
    less and cheap to ask for, while for the other the kernel walks through every page.
    """

    def __init__(self) -> None:
        self._shared = (
            0.0  # by how many bytes the resident sizes were more when both were looked at
        )

    def __call__(self, seen: float = 0.0) -> float:
        """MiB; `seen` where that is no less.

        So much is taken for granted where the resident sizes, less half of what they had counted
        more than once, do not amount to more. Libraries that renderers share are most of that: to
        be rid of half of it, about half of the renderers must end, and what they held goes, too.
        """
        me = psutil.Process()
        everyone = [me, *me.children(recursive=True)]
        resident = sum(map(_resident, everyone))
        if resident - self._shared / 2 <= seen * 2**20:
            return seen
        proportional = sum(map(_proportional, everyone))
        self._shared = max(0.0, resident - proportional)
        return max(seen, proportional / 2**20)


def memory_mb(seen: float = 0.0) -> float:
    """A single look."""
    return Look()(seen)


def _resident(process: psutil.Process) -> int:
    with contextlib.suppress(psutil.Error):
        return int(process.memory_info().rss)
    return 0  # it has ended


def _proportional(process: psutil.Process) -> int:
    with contextlib.suppress(psutil.Error):
        full = process.memory_full_info()
        return int(getattr(full, "pss", full.rss))
    return _resident(process)


class Peak:
    """`mb` is the largest that was seen so far."""

    def __init__(self) -> None:
        self.mb = 0.0


@contextlib.contextmanager
def watched(
    look: Callable[[float], float] | None = None, period_s: float = PERIOD_S
) -> Iterator[Peak]:
    """Looks every `period_s` from a thread, at the beginning and at the end.

    `look` is told the largest that was seen so far, and need not tell what is less.
    """
    peak, over = Peak(), threading.Event()
    look = look or Look()

    def watch() -> None:
        while True:
            peak.mb = max(peak.mb, look(peak.mb))
            if over.wait(period_s):
                break
        peak.mb = max(peak.mb, look(peak.mb))

    thread = threading.Thread(target=watch, name="memory", daemon=True)
    thread.start()
    try:
        yield peak
    finally:
        over.set()
        thread.join()
