"""Many cases: what the index weighs and what is held at once do not grow faster than they may.

How long it takes is measured in tests/bench/report_scale.py.
"""

from __future__ import annotations

import gc
import tracemalloc
from pathlib import Path

from harness.report import write_report
from tests.bench.report_scale import apart, make_run

PER_CASE = 5_000  # bytes of the index: a thousand cases are 5 MB
# Bytes of memory: a line of the index and links are some 1,200, the checks of a case some 45,000.
HELD_PER_CASE = 3_000


def test_a_thousand_cases_would_be_five_megabytes(tmp_path: Path) -> None:
    sizes = {}
    for count in (160, 220):  # above what strips draw case by case
        root = make_run(tmp_path / str(count), count)
        sizes[count] = write_report(root).stat().st_size
        assert len(list((root / "cases").glob("*.html"))) == count
    per_case = (sizes[220] - sizes[160]) / 60
    assert per_case < PER_CASE
    assert sizes[160] - 160 * per_case < 200_000


def test_what_is_held_at_once_does_not_grow_by_what_cases_say(tmp_path: Path) -> None:
    """In a process of its own, where it can be told how often to look for garbage."""
    held = apart(held_at_once, tmp_path, 60)
    assert held < 50 * HELD_PER_CASE


def held_at_once(root: Path, count: int) -> int:
    """Bytes that a report of `count` cases holds at most beyond one of ten.

    Garbage is none of it. Python lets as much of that lie as suits what else it holds, which
    depends on what has been imported: of the pages of sixty cases up to 900 kB.
    """
    gc.freeze()
    gc.set_threshold(200, 1, 1)
    held = {}
    for cases in (3, 10, count):  # of the first, what is loaded once
        run = make_run(root / str(cases), cases)
        tracemalloc.start()
        write_report(run)
        held[cases] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    return held[count] - held[10]
