"""Maps of differences as a page shows them: in groups that share a scale and a colour bar."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from harness.record import CaseRecord, Check, DifferenceMap
from harness.report.checks import CheckView, sorted_views
from harness.report.links import RunFolder, clean
from harness.report.quantity import number, with_unit


@dataclass(frozen=True)
class DifferenceView:
    a: str
    b: str
    href: str | None
    figures: list[CheckView]  # the checks that compare just these two


@dataclass(frozen=True)
class DifferenceGroup:
    """Maps that share one scale, and so one colour bar."""

    low: str
    limit: str
    ticks: list[tuple[float, str]]  # share of the bar, and what it says there
    maps: list[DifferenceView]


def differences(record: CaseRecord, folder: RunFolder) -> list[DifferenceGroup]:
    groups: dict[tuple[float, float, str], list[DifferenceMap]] = {}
    for item in record.differences:
        groups.setdefault((item.low, item.limit, item.unit), []).append(item)
    return [
        DifferenceGroup(
            low=number(low, digits=3),
            limit=with_unit(number(limit, digits=3), clean(unit)),
            ticks=_ticks(low, limit, clean(unit)),
            maps=[_difference(item, record.checks, folder) for item in items],
        )
        for (low, limit, unit), items in groups.items()
    ]


def _ticks(low: float, limit: float, unit: str) -> list[tuple[float, str]]:
    """Both ends and what is between them; of a logarithmic bar every third power of ten."""
    last = (1.0, with_unit(number(limit, digits=3), unit))
    if not 0 < low < limit < math.inf:
        return [(0.0, "0"), (0.5, number(limit / 2, digits=3)), last]
    decades = math.log10(limit / low)
    between = range(0, math.ceil(decades - 1e-9), 3)
    return [*((k / decades, number(low * 10**k, digits=3)) for k in between), last]


def _difference(item: DifferenceMap, checks: Iterable[Check], folder: RunFolder) -> DifferenceView:
    pair = {item.a, item.b}
    between = [check for check in checks if {check.renderer, check.against} == pair]
    return DifferenceView(item.a, item.b, folder.href(item.path), sorted_views(between))
