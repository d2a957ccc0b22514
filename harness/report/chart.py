"""Curves with their residuals as inline SVG: no script, colours and text left to the stylesheet.

Why not matplotlib: docs/decisions/0004-charts-are-our-own-svg.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from harness.record import Curve, Series
from harness.report.axis import Axis, drawable, for_residuals, spanning
from harness.report.links import clean
from harness.report.quantity import number, share

Point = tuple[float, float]

WIDTH, LEFT, RIGHT, TOP = 720, 62, 706, 24
MAIN_END = 232  # bottom of the upper panel
RESIDUAL_START, RESIDUAL_END = 288, 424
MOST_POINTS = 400  # per line; more are reduced to the extremes of each stretch
MARKS = 12  # per line

# Relative paths; with its colour each renderer has its shape, for those who see no difference.
SHAPES = {
    "c0": "m-3.4 0a3.4 3.4 0 1 0 6.8 0a3.4 3.4 0 1 0-6.8 0",
    "c1": "m-3-3h6v6h-6z",
    "c2": "m0-4 3.9 6.8h-7.8z",
    "c3": "m0-4.3 4.3 4.3-4.3 4.3-4.3-4.3z",
    "c4": "m0 4 3.9-6.8h-7.8z",
    "c5": "m-3.3-1.9 3.3-1.9 3.3 1.9v3.8l-3.3 1.9-3.3-1.9z",
    "c6": "m-1.3-3.9h2.6v2.6h2.6v2.6h-2.6v2.6h-2.6v-2.6h-2.6v-2.6h2.6z",
    "c7": "m-4-2.2h8l-2.4 4.4h-3.2z",
}


@dataclass(frozen=True)
class Entry:
    """A line of the legend. `used` is the worst |residual| relative to its own tolerance there."""

    name: str
    colour: str
    shape: str
    worst: str
    used: str
    over: bool
    note: str


@dataclass(frozen=True)
class Chart:
    title: str
    svg: Markup
    legend: list[Entry]
    residual_label: str
    bent: bool  # the residuals' axis is logarithmic beyond the band
    widest: bool  # the band is the widest of the renderers', which have tolerances of their own
    x_axis: Axis


def draw(curve: Curve, colours: Mapping[str, str]) -> Chart:
    """The chart of `curve`; `colours` gives each renderer its stylesheet class."""
    residuals = [s for s in curve.residuals if s.x]
    bottom = RESIDUAL_END if residuals else MAIN_END
    xs = [x for s in (*curve.series, *residuals) for x in s.x if drawable(x)]
    x_axis = spanning(xs or [0.0, 1.0], LEFT, RIGHT, 0.02)
    parts = [_panel(curve, x_axis, colours, labelled=not residuals)]
    bent = False
    if residuals:
        y_axis = _residual_axis(curve, residuals)
        bent = y_axis.linear_to is not None
        parts.append(_residual_panel(curve, residuals, x_axis, y_axis, colours))
    label = f"{clean(curve.title)}: {clean(curve.y_label)} over {clean(curve.x_label)}"
    svg = Markup(
        '<svg class="chart" viewBox="0 0 {} {}" role="img" aria-label="{}">\n{}\n</svg>'
    ).format(WIDTH, bottom + 44, label, Markup("\n").join(parts))
    legend = [_entry(s, curve, colours) for s in curve.series]
    widest = len({tuple(s.tolerance) for s in residuals}) > 1
    return Chart(clean(curve.title), svg, legend, clean(curve.residual_label), bent, widest, x_axis)


def sparkline(curve: Curve, renderer: str, colours: Mapping[str, str]) -> Markup | None:
    """The residuals of one renderer within the tolerance band, small; None where there are none."""
    residual = next((s for s in curve.residuals if s.renderer == renderer and s.x), None)
    if residual is None:
        return None
    width, height = 96, 60
    xs = [x for x in residual.x if drawable(x)]
    x_axis = spanning(xs or [0.0, 1.0], 1, width - 1, 0.0)
    own = residual.tolerance or curve.tolerance
    band = max((t for t in own if drawable(t)), default=0.0)
    values = [y for y in residual.y if drawable(y)]
    y_axis = for_residuals(values, band, height - 1, 1)
    points = list(zip(residual.x, residual.y, strict=False))
    runs = [_thinned(run, width // 2) for run in _finite_runs(points)]
    placed = [_placed(run, x_axis, y_axis) for run in runs]
    step = max(1, len(residual.x) // 8)
    few = [*range(0, len(residual.x) - 1, step), len(residual.x) - 1]
    tolerance = [own[k] for k in few if k < len(own)]
    return Markup(
        '<svg class="spark {}" viewBox="0 0 {} {}" role="img" aria-label="{}">'
        '<path class="band" d="{}"/><path class="line" d="{}"/></svg>'
    ).format(
        colours.get(renderer, "c7"),
        width,
        height,
        f"residuals of {clean(renderer)}",
        _band_outline([residual.x[k] for k in few], tolerance, x_axis, y_axis),
        "".join(map(_path, placed)),
    )


# --- panels ---------------------------------------------------------------------------------------


def _panel(curve: Curve, x_axis: Axis, colours: Mapping[str, str], *, labelled: bool) -> Markup:
    y_axis = _value_axis(curve.series)
    frame = _frame(x_axis, y_axis, curve.y_label, curve.x_label if labelled else "")
    # Truth lies beneath, broad and pale, so that lines on top of it can be told from it.
    ordered = sorted(curve.series, key=lambda s: s.renderer != "truth")
    lines = [
        _line(s, x_axis, y_axis, colours, phase=k / max(1, len(ordered)))
        for k, s in enumerate(ordered)
    ]
    return Markup('<g class="panel">{}{}</g>').format(frame, Markup("").join(lines))


def _residual_panel(
    curve: Curve,
    residuals: Sequence[Series],
    x_axis: Axis,
    y_axis: Axis,
    colours: Mapping[str, str],
) -> Markup:
    label = curve.residual_label or "measured − truth"
    band = _band(residuals[0].x, curve.tolerance, x_axis, y_axis)
    frame = _frame(x_axis, y_axis, label, curve.x_label)
    zero = y_axis.place(0.0)
    axis = Markup('<path class="zero" d="M{} {:.1f}H{}"/>').format(LEFT, zero, RIGHT)
    lines = [
        _line(s, x_axis, y_axis, colours, phase=k / len(residuals)) for k, s in enumerate(residuals)
    ]
    content = Markup("").join(lines)
    return Markup('<g class="panel">{}{}{}{}</g>').format(band, frame, axis, content)


def _value_axis(series: Sequence[Series]) -> Axis:
    """Holds the truth wholly and what is near it; what is far off is put on the edge."""
    truth = [y for s in series if s.renderer == "truth" for y in s.y if drawable(y)]
    values = [y for s in series for y in s.y if drawable(y)]
    if truth:
        reach = 2 * (max(truth) - min(truth)) or math.inf
        low, high = min(truth) - reach, max(truth) + reach
        values = [y for y in values if low <= y <= high]
    return spanning(values or [0.0, 1.0], MAIN_END, TOP)


def _residual_axis(curve: Curve, residuals: Sequence[Series]) -> Axis:
    values = [y for s in residuals for y in s.y if drawable(y)]
    band = max((t for t in curve.tolerance if drawable(t)), default=0.0)
    return for_residuals(values, band, RESIDUAL_END, RESIDUAL_START)


def _frame(x_axis: Axis, y_axis: Axis, y_label: str, x_label: str) -> Markup:
    """Grid, ticks and labels. Without `x_label` the axis below carries the numbers."""
    bottom, top = y_axis.start, y_axis.end
    parts: list[Markup] = []
    text = Markup('<text x="{:.1f}" y="{:.1f}" class="{}">{}</text>')
    for value, label in y_axis.ticks(5 if bottom - top > 150 else 4):
        y = y_axis.place(value)
        parts.append(Markup('<path class="grid" d="M{} {:.1f}H{}"/>').format(LEFT, y, RIGHT))
        parts.append(text.format(LEFT - 8, y + 4, "tick end", label))
    for value, label in x_axis.ticks(9):
        x = x_axis.place(value)
        parts.append(Markup('<path class="grid" d="M{:.1f} {}V{}"/>').format(x, top, bottom))
        if x_label:
            parts.append(text.format(x, bottom + 18, "tick mid", label))
    parts.append(text.format(LEFT, top - 9, "label", y_axis.caption(clean(y_label))))
    if x_label:
        caption = x_axis.caption(clean(x_label))
        parts.append(text.format(RIGHT, bottom + 36, "label end", caption))
    return Markup("").join(parts)


def _band(xs: Sequence[float], tolerance: Sequence[float], x_axis: Axis, y_axis: Axis) -> Markup:
    outline = _band_outline(xs, tolerance, x_axis, y_axis)
    return Markup('<path class="band" d="{}"/>').format(outline) if outline else Markup("")


def _band_outline(
    xs: Sequence[float], tolerance: Sequence[float], x_axis: Axis, y_axis: Axis
) -> str:
    """There along the upper edge, back along the lower."""
    pairs = zip(xs, tolerance, strict=False)
    known = [(x, t) for x, t in pairs if drawable(x) and drawable(t)]
    upper = _placed(known, x_axis, y_axis)
    lower = _placed([(x, -t) for x, t in reversed(known)], x_axis, y_axis)
    return _path(upper + lower) + "z" if known else ""


# --- lines ----------------------------------------------------------------------------------------


def _line(
    series: Series, x_axis: Axis, y_axis: Axis, colours: Mapping[str, str], *, phase: float
) -> Markup:
    """A line with sparse marks; gaps where a value is not finite, and a cross below each gap.

    `phase` (0 … 1) shifts the marks, so that lines on top of each other each show some.
    """
    colour = colours.get(series.renderer, "c7")
    points = list(zip(series.x, series.y, strict=False))
    runs = [_thinned(run) for run in _finite_runs(points)]
    placed = [_placed(run, x_axis, y_axis) for run in runs]
    parts = [Markup('<path class="line" d="{}"/>').format("".join(map(_path, placed)))]
    if colour in SHAPES:
        parts += _marks(series, points, (x_axis, y_axis), SHAPES[colour], phase)
    lost = [x for x, y in points if drawable(x) and not drawable(y)]
    if lost:
        cross = "m-3-3 6 6m-6 0 6-6"
        at = f"{y_axis.start - 6:.1f}"
        path = "".join(f"M{x_axis.place(x):.1f} {at}{cross}" for x in lost[:MOST_POINTS])
        parts.append(Markup('<path class="lost" d="{}"/>').format(path))
    return Markup('<g class="{}">{}</g>').format(colour, Markup("").join(parts))


def _marks(
    series: Series, points: Sequence[Point], axes: tuple[Axis, Axis], shape: str, phase: float
) -> Iterable[Markup]:
    """Marks at some points, and wherever a value lies beyond the axis, each naming its values."""
    x_axis, y_axis = axes
    every = max(1.0, len(points) / MARKS)
    count = min(len(points), MARKS)
    chosen = {min(len(points) - 1, int((k + phase) * every)) for k in range(count)}
    shown = [points[k] for k in sorted(chosen) if all(map(drawable, points[k]))]
    name = escape(clean(series.renderer))
    for (x, y), (at_x, at_y) in zip(shown, _placed(shown, x_axis, y_axis), strict=True):
        beyond = "" if y_axis.holds(y) else " (beyond the axis)"
        # Numbers need no escaping, and there are many of them.
        yield Markup(
            f'<path class="mark" d="M{at_x:.1f} {at_y:.1f}{shape}"><title>'
            f"{name}: {number(x, digits=6)}, {number(y, digits=6)}{beyond}</title></path>"
        )


def _finite_runs(points: Sequence[Point]) -> list[list[Point]]:
    runs: list[list[Point]] = [[]]
    for x, y in points:
        if drawable(x) and drawable(y):
            runs[-1].append((x, y))
        elif runs[-1]:
            runs.append([])
    return [run for run in runs if run]


def _thinned(run: list[Point], most: int = MOST_POINTS) -> list[Point]:
    """At most `most` points that look the same: each stretch's lowest and highest."""
    if len(run) <= most:
        return run
    stretch = -(-2 * len(run) // most)
    kept: list[Point] = []
    for start in range(0, len(run), stretch):
        part = run[start : start + stretch]
        ends = {min(part, key=lambda p: p[1]), max(part, key=lambda p: p[1])}
        kept += [point for point in part if point in ends][:2]
    return kept


def _placed(points: Sequence[Point], x_axis: Axis, y_axis: Axis) -> list[Point]:
    xs, ys = x_axis.places([x for x, _ in points]), y_axis.places([y for _, y in points])
    return list(zip(xs, ys, strict=True))


def _path(points: Sequence[Point]) -> str:
    if len(points) == 1:  # a single point between gaps would draw nothing
        return f"M{points[0][0]:.1f} {points[0][1]:.1f}h.1"
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


# --- legend ---------------------------------------------------------------------------------------


def _entry(series: Series, curve: Curve, colours: Mapping[str, str]) -> Entry:
    residual = next((r for r in curve.residuals if r.renderer == series.renderer), None)
    own = (residual.tolerance or curve.tolerance) if residual else []
    worst, used = _worst(residual, own) if residual else (None, None)
    lost = sum(not drawable(y) for y in series.y)
    colour = colours.get(series.renderer, "c7")
    return Entry(
        name=clean(series.renderer),
        colour=colour,
        shape=SHAPES.get(colour, ""),
        worst=number(worst, digits=3) if worst is not None else "",
        used=share(used),
        over=used is not None and not used <= 1,
        note=f"{lost} of {len(series.y)} values not finite" if lost else "",
    )


def _worst(residual: Series, tolerance: Sequence[float]) -> tuple[float | None, float | None]:
    """Largest |residual|, and the largest share of the tolerance at its own x; None if unknown."""
    sizes = [abs(y) for y in residual.y if drawable(y)]
    pairs = zip(residual.y, tolerance, strict=False)
    shares = [abs(y) / t for y, t in pairs if drawable(y) and t > 0]
    return max(sizes, default=None), max(shares, default=None)
