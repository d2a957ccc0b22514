"""Many cases: what the index weighs, and that nothing in it grows faster than their number.

How long it takes is measured in tests/bench/report_scale.py.
"""

from __future__ import annotations

from pathlib import Path

from harness.report import write_report
from tests.bench.report_scale import make_run

PER_CASE = 5_000  # bytes of the index: a thousand cases are 5 MB


def test_a_thousand_cases_would_be_five_megabytes(tmp_path: Path) -> None:
    sizes = {}
    for count in (160, 220):  # above what strips draw case by case
        root = make_run(tmp_path / str(count), count)
        sizes[count] = write_report(root).stat().st_size
        assert len(list((root / "cases").glob("*.html"))) == count
    per_case = (sizes[220] - sizes[160]) / 60
    assert per_case < PER_CASE
    assert sizes[160] - 160 * per_case < 200_000
