"""Past runs for the terminal and for the page of plots."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from harness.history.store import Point, Run
from harness.record import Curve, Series

Figure = Callable[[Point], float | None]

BLOCKS = "▁▂▃▄▅▆▇█"
COMMIT = 9  # characters of it


def runs(past: Sequence[Run], console: Console | None = None) -> None:
    """A line per run."""
    table = Table("run", "started", "commit", "quality", "exit code", "checks")
    for run in past:
        counts = ", ".join(f"{count} {status}" for status, count in sorted(run.counts.items()))
        table.add_row(
            str(run.id), run.started, _commit(run.commit, run.dirty), run.quality,
            str(run.exit_code), counts,
        )  # fmt: skip
    (console or Console()).print(table)


def case(points: Sequence[Point], console: Console | None = None) -> None:
    """A line per check: its deviations as a row of blocks, its first and its last figure."""
    table = Table("check", "deviation over runs", "first", "last", "tolerance", "last verdict")
    for check in dict.fromkeys(point.check for point in points):
        mine = [point for point in points if point.check == check]
        first, last = mine[0], mine[-1]
        table.add_row(
            escape(check), blocks([point.deviation for point in mine]), _number(first.deviation),
            f"{_number(last.deviation)} {last.unit}", _number(last.tolerance), last.status,
        )  # fmt: skip
    (console or Console()).print(table)


def blocks(values: Sequence[float | None]) -> str:
    """Their sizes as blocks, the largest one high; a gap where there is no number."""
    sizes = [None if value is None else abs(value) for value in values]
    top = max((size for size in sizes if size is not None), default=0.0)
    if top == 0.0:
        return "".join(" " if size is None else BLOCKS[0] for size in sizes)
    last = len(BLOCKS) - 1
    return "".join(" " if size is None else BLOCKS[round(last * size / top)] for size in sizes)


def curves(case: str, points: Sequence[Point]) -> list[Curve]:
    """A chart per check, a line per renderer: the value over runs, and its deviation."""
    charts = []
    for name in dict.fromkeys(_what(point) for point in points):
        mine = [p for p in points if _what(p) == name and p.deviation is not None]
        if not mine:
            continue
        residuals = list(_series(mine, lambda point: point.deviation, _tolerance))
        widest = {
            run: max(_tolerance(point) for point in mine if point.run == run)
            for run in map(int, residuals[0].x)
        }
        unit = next((point.unit for point in mine if point.unit), "")
        charts.append(
            Curve(
                id=name, title=f"{case}: {name}", x_label="run",
                y_label=f"value, {unit}" if unit else "value",
                series=list(_series(mine, lambda point: point.value)),
                residual_label="value less expected value", residuals=residuals,
                tolerance=list(widest.values()),
            )
        )  # fmt: skip
    return charts


def rows(points: Sequence[Point]) -> list[list[str]]:
    """A line per run for the page: number, time, commit, versions, verdicts that are not PASS."""
    found = []
    for run in dict.fromkeys(point.run for point in points):
        mine = [point for point in points if point.run == run]
        versions = {point.renderer: point.version for point in mine}
        bad = [f"{p.check}: {p.status}" for p in mine if p.status not in ("pass", "known")]
        told = ", ".join(f"{name} {version}" for name, version in versions.items())
        commit = _commit(mine[0].commit, mine[0].dirty)
        found.append([str(run), mine[0].started, commit, told, "; ".join(bad)])
    return found


def _series(
    points: Sequence[Point], figure: Figure, tolerance: Callable[[Point], float] | None = None
) -> Iterator[Series]:
    for renderer in dict.fromkeys(point.renderer for point in points):
        mine = [(p, figure(p)) for p in points if p.renderer == renderer]
        known = [(point, value) for point, value in mine if value is not None]
        yield Series(
            renderer=renderer, x=[float(point.run) for point, _ in known],
            y=[value for _, value in known],
            tolerance=[tolerance(point) for point, _ in known] if tolerance else [],
        )  # fmt: skip


def _tolerance(point: Point) -> float:
    return point.tolerance or 0.0


def _what(point: Point) -> str:
    """The check without its renderer: what all renderers have in common."""
    return point.check.replace(f"/{point.renderer}/", " against ")


def _commit(commit: str, dirty: bool) -> str:
    return commit[:COMMIT] + ("+" if dirty else "")


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
