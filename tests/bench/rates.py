"""How often a right renderer is accused: ``make rates`` measures it and writes docs/rates.md."""

from __future__ import annotations

import os
import platform
import sys

import numpy as np
from scipy.stats import beta, binom

from harness.documents import write_text
from harness.measure.statistics import FALSE_ALARM, SUITE_CHECKS, SUITE_LEVEL, samples_needed
from harness.renderers import registry
from tests.bench.measuring import ROOT
from tests.harness.rates import CASES, rounds, short_suite

RUNS = 200
LEVELS = (0.05, 0.2)
# The suite's means, of 4 checks in 3 channels, and how many of them do not follow from others.
MEANS, INDEPENDENT = 12, 2
PAGE = ROOT / "docs" / "rates.md"

TEXT = """\
# How often a right renderer is accused

Made by `make rates`; do not edit. Measured with mitsuba {version}, whose pictures are sampled, on
{system}.

A short suite of {checks} checks, what one face transmits and reflects from outside and from
inside ({cases}), {samples} samples
per pixel, was judged {runs} times, each time with fresh seeds, by the code that judges every suite.
Its level, the chance that any of its checks raises a false alarm, is set so high here that alarms
can be counted: at the level of real suites, {suite:.0%} for {most:,} checks or {check:.2g} for one,
{runs} runs would show none.

| level | allowed | expected | runs with an alarm | 95% interval of the rate | chance of as many |
|--|--|--|--|--|--|
{rows}

The level allows for {means} means that are independent: {checks} checks of three channels.
Here two are: glass without colour shows all channels alike, and what a face transmits it does not
reflect. So fewer alarms are expected than allowed, by Šidák's formula for two. The interval is
Clopper and Pearson's; the last column is the chance of as many alarms or more where as many are
expected.
"""


def row(level: float, alarmed: int) -> str:
    """A line of the table."""
    low = beta.ppf(0.025, alarmed, RUNS - alarmed + 1) if alarmed else 0.0
    high = beta.ppf(0.975, alarmed + 1, RUNS - alarmed)
    expected = 1 - (1 - level) ** (INDEPENDENT / MEANS)
    rare = binom.sf(alarmed - 1, RUNS, expected)
    return (
        f"| {level:.0%} | {level * RUNS:.0f} | {expected * RUNS:.1f} | {alarmed} of {RUNS} "
        f"| {low:.1%} to {high:.1%} | {rare:.2g} |"
    )


def main() -> None:
    renderer = registry.create("mitsuba")
    try:
        alarms = np.array(list(rounds(renderer, RUNS, LEVELS))) > 0
        counts = alarms.sum(axis=0)
        rows = [row(level, int(k)) for level, k in zip(LEVELS, counts, strict=True)]
        version = renderer.version()
    finally:
        renderer.close()  # type: ignore[attr-defined]
    text = TEXT.format(
        version=version, system=f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        means=MEANS, checks=len(short_suite()), cases=", ".join(f"`{case}`" for case in CASES),
        runs=RUNS, samples=samples_needed(), suite=SUITE_LEVEL, most=SUITE_CHECKS,
        check=FALSE_ALARM, rows="\n".join(rows),
    )  # fmt: skip
    write_text(PAGE, text)
    sys.stderr.write(f"wrote {PAGE.relative_to(ROOT)}\n")


if __name__ == "__main__":
    main()
