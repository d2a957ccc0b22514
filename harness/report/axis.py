"""Axes of charts: where a value stands, and which values are worth a tick."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from harness.report.quantity import SUPERSCRIPT, number

TICK_ROOM = 13.0  # pixels
LARGEST = 1e300  # beyond it, differences of values overflow
SMALLEST = 1e-300  # below it, steps between ticks vanish


def drawable(value: float) -> bool:
    """Finite, and small enough to be placed on an axis."""
    return abs(value) < LARGEST  # NaN is not less


@dataclass(frozen=True)
class Axis:
    """Maps values in `low` … `high` to pixels in `start` … `end`.

    With `linear_to` the axis is symmetric about zero: linear up to that value, which takes a third
    of the room, and logarithmic beyond. Values outside the axis are placed on its end.
    """

    low: float
    high: float
    start: float
    end: float
    linear_to: float | None = None

    def place(self, value: float) -> float:
        return self.places([value])[0]

    def places(self, values: Iterable[float]) -> list[float]:
        """Where values stand; what they have in common is computed once."""
        low, high = self._bend(self.low), self._bend(self.high)
        room, start = self.end - self.start, self.start
        bent = values if self.linear_to is None else map(self._bend, values)
        shares = [(value - low) / (high - low) for value in bent]
        return [
            start + room * (0.0 if share < 0.0 else 1.0 if share > 1.0 else share)
            for share in shares
        ]

    def holds(self, value: float) -> bool:
        return self.low <= value <= self.high

    def _bend(self, value: float) -> float:
        if self.linear_to is None:
            return value
        size = abs(value) / self.linear_to
        room = 0.5 * math.log10(self.high / self.linear_to)
        return math.copysign(room * size if size <= 1 else room + math.log10(size), value)

    @property
    def power(self) -> int:
        """The power of ten taken out of the tick labels; 0 where plain numbers are short."""
        largest = max(abs(self.low), abs(self.high))
        if self.linear_to is not None or 1e-3 <= largest < 1e5:
            return 0
        return math.floor(math.log10(largest))

    def caption(self, label: str) -> str:
        """`label` with the power of ten that the tick labels leave out."""
        return f"{label}  × 10{str(self.power).translate(SUPERSCRIPT)}" if self.power else label

    def ticks(self, about: int = 5) -> list[tuple[float, str]]:
        """Values with their labels."""
        if self.linear_to is not None:
            return self._decades(self.linear_to)
        step = _round_step((self.high - self.low) / about)
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        scale = 10.0**self.power
        digits = max(0, -math.floor(math.log10(step / scale) + 1e-9))
        values = [k * step for k in range(first, last + 1)]
        return [(v, f"{v / scale:.{digits}f}".replace("-", "−")) for v in values]

    def _decades(self, linear_to: float) -> list[tuple[float, str]]:
        """Zero, the ends of the linear part, and the decades that are TICK_ROOM from each other."""
        sizes = [linear_to]
        for k in range(math.floor(math.log10(self.high)), math.floor(math.log10(linear_to)), -1):
            place = self.place(10.0**k)
            if all(abs(place - self.place(other)) >= TICK_ROOM for other in sizes):
                sizes.append(10.0**k)
        sizes.sort()
        marks = [-v for v in reversed(sizes)] + [0.0] + sizes
        return [(v, number(v, digits=2)) for v in marks]


def _round_step(rough: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is no less than `rough`."""
    power = 10.0 ** math.floor(math.log10(rough))
    return next(k * power for k in (1, 2, 5, 10) if k * power >= rough * (1 - 1e-9))


def spanning(values: Sequence[float], start: float, end: float, margin: float = 0.04) -> Axis:
    """A linear axis that holds all of `values` (drawable, at least one) with a margin."""
    low, high = min(values), max(values)
    room = (high - low) * margin
    if not high - low > 1e-12 * max(abs(low), abs(high)):  # a constant, or as good as one
        room = abs(high) * 0.1 or 1.0
    return Axis(low - room, high + room, start, end)


def for_residuals(residuals: Sequence[float], band: float, start: float, end: float) -> Axis:
    """A symmetric axis on which both the band ±`band` and residuals far outside it can be read."""
    largest = max((abs(v) for v in residuals), default=0.0)
    if 4 * band < largest < 1e30 * band:
        return Axis(-1.5 * largest, 1.5 * largest, start, end, linear_to=band)
    high = max(1.1 * largest, 1.4 * band)
    if high < SMALLEST:
        high = 1.0
    return Axis(-high, high, start, end)
