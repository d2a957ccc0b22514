"""The page of a case over past runs: one file, with its style in it."""

from __future__ import annotations

import importlib.resources
from collections.abc import Sequence
from pathlib import Path

from harness.record import Curve, write_text
from harness.report import chart
from harness.report.build import PACKAGE, environment
from harness.report.colours import colour_classes
from harness.report.links import page_name

COLUMNS = ("run", "started", "commit", "renderers", "not passed")


def write_history(
    folder: Path, case: str, curves: Sequence[Curve], rows: Sequence[Sequence[str]]
) -> Path:
    """Writes `folder`/history-CASE.html with a chart per curve and a line per run."""
    names = {series.renderer for curve in curves for series in curve.series}
    colours = colour_classes(names)
    style = importlib.resources.files(PACKAGE).joinpath("assets", "report.css").read_text("utf-8")
    text = environment().get_template("history.html.j2").render(
        case=case, style=style, columns=COLUMNS, rows=rows, colours=colours,
        charts=[chart.draw(curve, colours) for curve in curves],
    )  # fmt: skip
    path = folder / f"history-{page_name(case)}"
    write_text(path, text)
    return path
