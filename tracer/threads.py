"""Cuts work into bands that threads take one by one; kernels release the interpreter lock.

Every pixel and every ray is computed by itself, so the number of threads changes no bit.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

Work = Callable[[int, int], None]


def for_bands(worker: Callable[[], Work], total: int, band: int, threads: int | None) -> None:
    """Calls ``work(begin, end)`` for all bands of [0, total), on all cores by default.

    Each thread has a `work` of its own from `worker()`, with tables that it need not share.
    """
    begins = iter(range(0, total, band))  # shared: each thread takes what is next

    def some() -> None:
        work = worker()
        for begin in begins:
            work(begin, min(begin + band, total))

    workers = min(threads or os.cpu_count() or 1, -(-total // band))
    if workers <= 1:
        some()
        return
    with ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(some) for _ in range(workers)]:
            done.result()
