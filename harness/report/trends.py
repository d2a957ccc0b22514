"""The run as charts: errors over the angle of incidence, what renderers resolve and how long.

Fed record by record, so that memory does not grow with the number of cases.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from markupsafe import Markup

from harness.record import Curve, Summary
from harness.report.axis import Axis, drawable
from harness.report.chart import SHAPES
from harness.report.links import clean
from harness.report.quantity import SUPERSCRIPT, number, seconds

BIN = 3.0  # degrees
LEAST = 1e-12  # what is smaller is shown there; float64 has no more
MICRORADIANS = {"µrad": 1.0, "°": math.pi / 180 * 1e6}
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 400, 230, 46, 388, 26, 190


@dataclass
class Largest:
    """Of each renderer, the largest |error| in each bin of incidence."""

    by_renderer: dict[str, dict[int, float]] = field(default_factory=dict)

    def add(self, renderer: str, degrees: float, error: float) -> None:
        bins = self.by_renderer.setdefault(renderer, {})
        k = int(degrees // BIN)
        bins[k] = max(bins.get(k, 0.0), error)


@dataclass(frozen=True)
class Panel:
    title: str
    note: str
    svg: Markup


class Trends:
    """Gathers what all cases together show."""

    def __init__(self, renderers: Sequence[str], colours: Mapping[str, str]) -> None:
        self._renderers, self._colours = renderers, colours
        self._angles, self._offsets = Largest(), Largest()

    def add(self, curve: Curve) -> None:
        """Takes the residuals of a curve over the angle of incidence; others say nothing here."""
        if "incidence" not in curve.x_label:
            return
        unit = curve.y_label.rpartition("(")[2].rstrip(")")
        if unit in MICRORADIANS:
            into, scale = self._angles, MICRORADIANS[unit]
        elif curve.id.startswith("slab_offset"):
            into, scale = self._offsets, 1.0
        else:
            return
        for series in curve.residuals:
            for x, y in zip(series.x, series.y, strict=False):
                if drawable(x) and drawable(y):
                    into.add(series.renderer, x, abs(y) * scale)

    def panels(self, summary: Summary) -> list[Panel]:
        """The charts for which there is anything to draw."""
        found = []
        if self._angles.by_renderer:
            svg = self._over_incidence(self._angles, "angle error (µrad)")
            note = f"largest of all rays in bins of {BIN:.0f}°, over all cases"
            found.append(Panel("Angle error against incidence", note, svg))
        if self._offsets.by_renderer:
            svg = self._over_incidence(self._offsets, "offset residual (units)")
            note = f"largest in bins of {BIN:.0f}°, over all slabs"
            found.append(Panel("Offset residuals", note, svg))
        resolved = [
            (name, value)
            for name, known in summary.renderers.items()
            if isinstance(value := known.facts.get("position_resolution"), float) and value > 0
        ]
        if resolved:
            note = "distance that a probe tells apart, measured without glass"
            found.append(Panel("Detection limits", note, self._dots(resolved)))
        times = [(n, known.render_s) for n, known in summary.renderers.items() if known.render_s]
        if times:
            note = "all renders of the run, wall time"
            found.append(Panel("Time per renderer", note, self._bars(times)))
        return found

    def _over_incidence(self, largest: Largest, label: str) -> Markup:
        values = [max(v, LEAST) for bins in largest.by_renderer.values() for v in bins.values()]
        y_axis = _decades(values, BOTTOM, TOP)
        x_axis = Axis(0.0, 90.0, LEFT, RIGHT)
        parts = [_frame(x_axis, y_axis, label)]
        for name in self._renderers:
            bins = largest.by_renderer.get(name)
            if not bins:
                continue
            points = [
                (x_axis.place((k + 0.5) * BIN), y_axis.place(math.log10(max(v, LEAST))))
                for k, v in sorted(bins.items())
            ]
            line = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
            colour = self._colours.get(name, "c7")
            worst = number(max(bins.values()), digits=3)
            parts.append(
                Markup(
                    '<g class="{}"><path class="line" d="{}"/>{}<title>{}: up to {}</title></g>'
                ).format(colour, line, _marks(points, colour), clean(name), worst)
            )
        return _svg(label, parts)

    def _dots(self, rows: Sequence[tuple[str, float]]) -> Markup:
        label = "position resolution (units)"
        x_axis = _decades([value for _, value in rows], 118, RIGHT)
        parts = [_decade_lines(x_axis, 26, BOTTOM)]
        for y, (name, value) in zip(_rows(len(rows)), rows, strict=True):
            colour = self._colours.get(name, "c7")
            x = x_axis.place(math.log10(value))
            parts.append(_row_label(name, y))
            parts.append(
                Markup(
                    '<g class="{}"><path class="stem" d="M118 {:.1f}H{:.1f}"/>'
                    '<path class="mark" d="M{:.1f} {:.1f}{}"/></g>'
                ).format(colour, y, x, x, y, SHAPES.get(colour, ""))
            )
            end = x > RIGHT - 70
            parts.append(_text(x + (-9 if end else 9), y - 6, number(value, digits=2), end=end))
        return _svg(label, parts)

    def _bars(self, rows: Sequence[tuple[str, float]]) -> Markup:
        longest = max(value for _, value in rows)
        parts = []
        for y, (name, value) in zip(_rows(len(rows)), rows, strict=True):
            width = (RIGHT - 118 - 56) * value / longest
            colour = self._colours.get(name, "c7")
            parts.append(_row_label(name, y))
            parts.append(
                Markup(
                    '<rect class="{} amount" x="118" y="{:.1f}" width="{:.1f}" height="12" rx="2"/>'
                ).format(colour, y - 6, max(width, 1.0))
            )
            parts.append(_text(118 + width + 7, y + 4, seconds(value)))
        return _svg("render time", parts)


def _svg(label: str, parts: Sequence[Markup]) -> Markup:
    return Markup(
        '<svg class="trend" viewBox="0 0 {} {}" role="img" aria-label="{}">{}</svg>'
    ).format(WIDTH, HEIGHT, label, Markup("").join(parts))


def _decades(values: Sequence[float], start: float, end: float) -> Axis:
    """An axis of powers of ten; values are placed by their logarithms."""
    low = math.floor(math.log10(min(values)))
    high = math.ceil(math.log10(max(values)))
    return Axis(low, max(high, low + 1), start, end)


def _powers(axis: Axis) -> list[int]:
    step = max(1, -(-int(axis.high - axis.low) // 6))
    return list(range(int(axis.low), int(axis.high) + 1, step))


def _power_of_ten(k: int) -> str:
    return str(10**k) if 0 <= k <= 2 else "10" + str(k).translate(SUPERSCRIPT)


def _frame(x_axis: Axis, y_axis: Axis, label: str) -> Markup:
    parts = [_text(LEFT, TOP - 11, label)]
    for k in _powers(y_axis):
        y = y_axis.place(k)
        parts.append(Markup('<path class="grid" d="M{} {:.1f}H{}"/>').format(LEFT, y, RIGHT))
        parts.append(_text(LEFT - 7, y + 4, _power_of_ten(k), end=True))
    for degrees in (0, 30, 60, 90):
        x = x_axis.place(degrees)
        parts.append(Markup('<path class="grid" d="M{:.1f} {}V{}"/>').format(x, TOP, BOTTOM))
        parts.append(_text(x, BOTTOM + 17, f"{degrees}°", middle=True))
    parts.append(_text(RIGHT, BOTTOM + 34, "angle of incidence", end=True))
    return Markup("").join(parts)


def _decade_lines(axis: Axis, top: float, bottom: float) -> Markup:
    parts = []
    for k in _powers(axis):
        x = axis.place(k)
        parts.append(Markup('<path class="grid" d="M{:.1f} {}V{}"/>').format(x, top, bottom))
        parts.append(_text(x, bottom + 17, _power_of_ten(k), middle=True))
    parts.append(_text(axis.end, bottom + 34, "units", end=True))
    return Markup("").join(parts)


def _rows(count: int) -> list[float]:
    pitch = min(34.0, (BOTTOM - TOP - 6) / count)
    return [TOP + 14 + k * pitch for k in range(count)]


def _row_label(name: str, y: float) -> Markup:
    short = clean(name)
    return _text(110, y + 4, short if len(short) <= 16 else short[:15] + "…", end=True)


def _text(x: float, y: float, text: str, *, end: bool = False, middle: bool = False) -> Markup:
    where = "end" if end else "mid" if middle else ""
    return Markup('<text x="{:.1f}" y="{:.1f}" class="{}">{}</text>').format(x, y, where, text)


def _marks(points: Sequence[tuple[float, float]], colour: str) -> Markup:
    shape = SHAPES.get(colour)
    if shape is None:
        return Markup("")
    path = "".join(f"M{x:.1f} {y:.1f}{shape}" for x, y in points[:: max(1, len(points) // 8)])
    return Markup('<path class="mark" d="{}"/>').format(path)
