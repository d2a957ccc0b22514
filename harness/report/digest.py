"""What the report says of all cases together, gathered case by case.

Fed with one case of the summary after the other, it keeps what the index says of the run and a line
for each case, but no check that is neither the worst of its kind nor the closest to its limit.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from harness.record import SummaryCase, Verdict
from harness.report.checks import BAD, FIRST_TO_LOOK_AT, CheckView, check_view, kind_of
from harness.summary_file import Span, SummaryFile

Rank = tuple[int, float]


@dataclass(frozen=True, slots=True)
class Place:
    """A case and where in the summary it stands; `rank` sorts failures first, worst first."""

    id: str
    status: Verdict
    rank: Rank
    span: Span


@dataclass(frozen=True, slots=True)
class Found:
    """A check that is told of in the index, and its case."""

    case: str
    view: CheckView


@dataclass(slots=True)
class Kind:
    """Failures that are alike: the worst of them, and how many there are."""

    worst: Found
    count: int = 1


@dataclass
class Digest:
    """`kinds` are by who is off and in what; `closest` is the check that passed by least."""

    counts: Counter[Verdict] = field(default_factory=Counter)
    by_renderer: dict[str, Counter[Verdict]] = field(default_factory=dict)
    kinds: dict[tuple[str, str], Kind] = field(default_factory=dict)
    worst: Found | None = None
    closest: Found | None = None
    places: list[Place] = field(default_factory=list)

    def add(self, case: SummaryCase, span: Span) -> None:
        views = [check_view(check) for check in case.checks]
        for view in views:
            check = view.check
            self.counts[check.status] += 1
            self.by_renderer.setdefault(check.renderer, Counter())[check.status] += 1
            if check.status in BAD:
                self._failed(Found(case.id, view))
            elif check.status is Verdict.PASS and view.ratio:
                self._passed(Found(case.id, view), view.ratio)
        self.places.append(Place(case.id, case.status, _rank(case.status, views), span))

    def order(self) -> list[Place]:
        """Failures first, worst first, then errors; otherwise as the run had them."""
        return sorted(self.places, key=lambda place: place.rank)

    def failing(self) -> set[str]:
        """The renderers that are off where a check is bad."""
        return {who for who, _ in self.kinds}

    def _failed(self, found: Found) -> None:
        if self.worst is None or found.view.rank < self.worst.view.rank:
            self.worst = found
        kind = self.kinds.setdefault(kind_of(found.view.check), Kind(found, 0))
        kind.count += 1
        if found.view.rank < kind.worst.view.rank:
            kind.worst = found

    def _passed(self, found: Found, ratio: float) -> None:
        if self.closest is None or ratio > (self.closest.view.ratio or 0.0):
            self.closest = found


def digest_of(file: SummaryFile) -> Digest:
    """Raises InputError at the first case that is not valid."""
    digest = Digest()
    for case, span in zip(file.cases(), file.spans, strict=True):
        digest.add(case, span)
    return digest


def _rank(status: Verdict, views: list[CheckView]) -> Rank:
    place = FIRST_TO_LOOK_AT.index(status)
    if status not in BAD:
        return place, 0.0
    return min((view.rank for view in views), default=(place, 0.0))
