"""How much memory a run takes at most, its own and that of all that it started."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator

import psutil

PERIOD_S = 1.0  # a look takes some 10 ms


def memory_mb() -> float:
    """MiB that this process and all below it take now.

    On Linux the sum of proportional sizes (PSS): pages that several share count once. Elsewhere,
    and of what may not be looked into, the resident size, which counts them for each.
    """
    me = psutil.Process()
    return sum(map(_size, [me, *me.children(recursive=True)])) / 2**20


def _size(process: psutil.Process) -> int:
    with contextlib.suppress(psutil.Error):
        full = process.memory_full_info()
        return int(getattr(full, "pss", full.rss))
    with contextlib.suppress(psutil.Error):
        return int(process.memory_info().rss)
    return 0  # it has ended


class Peak:
    """`mb` is the largest that was seen so far."""

    def __init__(self) -> None:
        self.mb = 0.0


@contextlib.contextmanager
def watched(look: Callable[[], float] = memory_mb, period_s: float = PERIOD_S) -> Iterator[Peak]:
    """Looks every `period_s` from a thread, at the beginning and at the end."""
    peak, over = Peak(), threading.Event()

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
