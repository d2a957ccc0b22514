"""Cuts work into bands that threads take one by one; kernels release the interpreter lock.

Every pixel and every ray is computed by itself, so the number of threads changes no bit.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor


def for_bands(work: Callable[[int, int], None], total: int, band: int, threads: int | None) -> None:
    """Calls ``work(begin, end)`` for all bands of [0, total), on all cores by default."""
    workers = threads or os.cpu_count() or 1
    bands = [(begin, min(begin + band, total)) for begin in range(0, total, band)]
    if not bands:
        return
    work(*bands[0])  # the first call compiles, if anything must be
    if workers == 1:
        for begin, end in bands[1:]:
            work(begin, end)
        return
    with ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(work, begin, end) for begin, end in bands[1:]]:
            done.result()
