"""What a case's page tells its script: one JSON document in the page, see ui/src/case.ts."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from harness.record import CaseRecord, Curve, RendererRun, Verdict
from harness.report.chart import LEFT, RIGHT, Chart
from harness.report.checks import sorted_views
from harness.report.links import RunFolder, clean
from harness.report.view import renderer_verdict

BASELINE = "baseline: "  # what approved pictures are called by


def case_data(
    record: CaseRecord, folder: RunFolder, colours: Mapping[str, str], charts: Sequence[Chart]
) -> Markup:
    """The data block's text: JSON in which nothing can end a script element."""
    packs = {"": record.pack, **record.other_packs}
    found = [(prefix, folder.href(path)) for prefix, path in packs.items()]
    verdicts = {run.name: renderer_verdict(run.name, record.checks, run) for run in record.runs}
    return embeddable(
        {
            "id": record.id,
            "packs": [
                {"href": href, "prefix": clean(prefix), "aside": prefix == BASELINE}
                for prefix, href in found
                if href
            ],
            "colours": dict(colours),
            "verdicts": {name: verdict for name, verdict in verdicts.items() if verdict},
            "suspects": _suspects(record),
            "ray": _ray(record),
            "absent": [_absent(run) for run in record.runs if not run.images],
            "curves": [
                _curve(curve, chart) for curve, chart in zip(record.curves, charts, strict=True)
            ],
        }
    )


def _suspects(record: CaseRecord) -> list[str]:
    """Renderers that are said to be off, those named most often first."""
    named = [name for check in record.checks if check.attribution for name in check.attribution.off]
    bad = (Verdict.FAIL, Verdict.ERROR)
    named += [c.renderer for c in record.checks if c.against == "truth" and c.status in bad]
    return [clean(name) for name, _ in Counter(named).most_common()]


def _ray(record: CaseRecord) -> dict[str, Any] | None:
    """The ray to look at first: where the worst check that does not pass is furthest off."""
    for view in sorted_views(record.checks):
        check = view.check
        if view.pixel and check.against == "truth" and check.status is not Verdict.PASS:
            probe = view.label.removeprefix("probe ")
            return {"renderer": clean(check.renderer), "probe": probe, "pixel": view.pixel}
    return None


def embeddable(data: object) -> Markup:
    """`data` as JSON that may stand in a page's script element."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _absent(run: RendererRun) -> dict[str, str]:
    word = "failed" if run.status == Verdict.ERROR else "no picture"
    return {"name": clean(run.name), "word": word, "reason": clean(run.reason)}


def _curve(curve: Curve, chart: Chart) -> dict[str, Any]:
    residuals = {series.renderer: series.y for series in curve.residuals}
    return {
        "low": chart.x_axis.low,
        "high": chart.x_axis.high,
        "left": LEFT,
        "right": RIGHT,
        "unit": "°" if "°" in curve.x_label else "",
        "byIncidence": "incidence" in curve.x_label,
        "lines": [
            {
                "renderer": clean(series.renderer),
                "x": _finite(series.x),
                "y": _finite(series.y),
                "residual": _finite(residuals.get(series.renderer, [])),
            }
            for series in curve.series
        ],
    }


def _finite(values: Sequence[float]) -> list[float | None]:
    return [float(f"{v:.7g}") if math.isfinite(v) else None for v in values]
