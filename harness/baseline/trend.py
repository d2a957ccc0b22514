"""A slow slide: a check that moves in one direction, run after run, within its tolerance.

Steps that are each too small to mention add up. The test is that of Mann and Kendall: of n runs in
their order, count the pairs that rise and those that fall. If nothing drifts, every order is as
likely as any other, whatever the distribution of the deviations, so the chance of an order this
monotone follows from counting permutations (M. G. Kendall, Rank Correlation Methods, chapter 1).
With k checks that move at all, each is tested at the level of Šidák, 1 - (1 - LEVEL)^(1/k), so that
a suite without drift is accused at all once in a hundred times. Nine runs in perfect order have a
chance of 2 / 9! = 5.5e-6, enough for 1,800 checks; with fewer runs only fewer checks can be seen.

A run that repeats the one before it is no new draw: the same renderer measures the same again.
Counted as runs, fifteen repetitions before one change and fifteen after it would be a slide.
"""

from __future__ import annotations

import statistics
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from harness.baseline.document import MEASURED
from harness.errors import InputError
from harness.record import Summary, Trend, read_summary

LEVEL = 0.01
LONGEST = 30  # runs that are looked at, of those that differ
SHORTEST = 5  # 2 / 5! = 0.017 is the least that five runs can show
# A slide of less than this in all, in tolerances, is real and matters to nobody.
NEGLIGIBLE = 0.01
# Closer than this to the last run that counted, a run repeats it, but for roundings of another
# machine. Smaller steps of a slide are counted once they add up to it.
REPEATED = NEGLIGIBLE / 10

Key = tuple[str, str]  # case, check
Deviations = Mapping[Key, float]  # of one run, in tolerances


def read_history(folder: Path, run: Summary) -> list[Deviations]:
    """Of the runs in `folder` and its subfolders but `run`, those of its quality, oldest first.

    Raises InputError where there is no run, or one that cannot be read.
    """
    files = sorted({*folder.glob("summary.json"), *folder.glob("*/summary.json")})
    if not files:
        raise InputError.of("holds no runs (*/summary.json)", file=folder)
    runs = sorted(map(read_summary, files), key=lambda summary: summary.started)
    of_a_kind = (one for one in runs if one.quality == run.quality)
    return [deviations(one) for one in of_a_kind if one.started != run.started]


def deviations(summary: Summary) -> Deviations:
    """The deviations of a run's checks, of those that were measured now."""
    return {
        (case.id, check.id): in_tolerances(check.value, check.expected, check.tolerance)
        for case in summary.cases
        for check in case.checks
        if check.status in MEASURED and not check.stored
        if check.value is not None and check.expected is not None and check.tolerance is not None
    }


def in_tolerances(value: float, expected: float, tolerance: float) -> float:
    """The deviation in tolerances; where the tolerance is 0, in the unit of the value."""
    return (value - expected) / (tolerance or 1.0)


def trends(runs: Iterable[Deviations]) -> list[Trend]:
    """The checks that drift over `runs`, with how soon they leave their tolerance at this pace."""
    series: dict[Key, list[float]] = defaultdict(list)
    for run in runs:
        for key, deviation in run.items():
            before = series[key]
            if not before or abs(deviation - before[-1]) >= REPEATED:
                before.append(deviation)
    moving = {key: d[-LONGEST:] for key, d in series.items() if len(d) >= SHORTEST}
    level = 1 - (1 - LEVEL) ** (1 / max(1, len(moving)))
    found = []
    for (case, check), d in moving.items():
        p_value = chance(d)
        if p_value <= level and max(d) - min(d) >= NEGLIGIBLE:
            found.append(_trend(case, check, d, p_value))
    return sorted(found, key=lambda trend: (trend.p_value, trend.case, trend.check))


def chance(d: Sequence[float]) -> float:
    """The two-sided chance that runs without drift are in an order as monotone as this."""
    from scipy.stats import kendalltau

    return float(kendalltau(range(len(d)), d).pvalue)


def slope(d: Sequence[float]) -> float:
    """Change per run: the median over all pairs (Sen 1968), which single odd runs do not bend."""
    return statistics.median(
        (d[j] - d[i]) / (j - i) for i in range(len(d)) for j in range(i + 1, len(d))
    )


def _trend(case: str, check: str, d: Sequence[float], p_value: float) -> Trend:
    pace = slope(d)
    reason = f"{pace:+.2g} tolerances a run over the last {len(d)} runs that differ"
    left = (1 - abs(d[-1])) / abs(pace) if pace * d[-1] > 0 else None
    if left is not None and left > 0:
        reason += f"; leaves its tolerance in some {left:.0f} runs at this pace"
    return Trend(case=case, check=check, runs=len(d), slope=pace, p_value=p_value, reason=reason)
