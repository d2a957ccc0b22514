"""How much memory a run takes at most, its own and that of all that it started."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator

import psutil

PERIOD_S = 2.0  # a look that walks through pages takes 10 to 30 ms


def memory_mb(seen: float = 0.0) -> float:
    """MiB that this process and all below it take now; `seen` where that is no less.

    On Linux the sum of proportional sizes (PSS): pages that several share count once. Elsewhere,
    and of what may not be looked into, the resident size, which counts them for each. That is never
    less and cheap to ask for, while for the other the kernel walks through every page: so where
    not even the resident sizes amount to more than `seen`, nothing else is asked for.
    """
    me = psutil.Process()
    everyone = [me, *me.children(recursive=True)]
    if sum(map(_resident, everyone)) <= seen * 2**20:
        return seen
    return max(seen, sum(map(_proportional, everyone)) / 2**20)


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
    look: Callable[[float], float] = memory_mb, period_s: float = PERIOD_S
) -> Iterator[Peak]:
    """Looks every `period_s` from a thread, at the beginning and at the end.

    `look` is told the largest that was seen so far, and need not tell what is less.
    """
    peak, over = Peak(), threading.Event()

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
