"""Curves over the angle of incidence, as records hold them and reports draw them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float
from harness.measure.probe_truth import ProbeTruth
from harness.record import Curve, Series

POINTS = 96


def curve_of_rows(
    truth: ProbeTruth,
    used: NDArray[np.bool_],
    title: str,
    label: str,
    value: Float,
    true: Float,
    tolerance: Float,
) -> Curve:
    """Values (m,), truth and tolerance of the middle row's rays, thinned to `POINTS` for drawing.

    The renderer's name is filled in by who knows it.
    """
    rows = np.flatnonzero(used & truth.central_row)
    rows = rows[np.argsort(truth.theta_i[rows], kind="stable")]
    if len(rows) > POINTS:
        rows = rows[np.linspace(0, len(rows) - 1, POINTS).astype(int)]
    x = np.degrees(truth.theta_i[rows]).tolist()
    band = tolerance[rows].tolist()
    return Curve(
        id=title.lower().replace(" ", "-"),
        title=title,
        x_label="angle of incidence (°)",
        y_label=label,
        series=[
            Series(renderer="truth", x=x, y=true[rows].tolist()),
            Series(renderer="", x=x, y=value[rows].tolist()),
        ],
        residual_label="measured − truth",
        residuals=[Series(renderer="", x=x, y=(value - true)[rows].tolist(), tolerance=band)],
        tolerance=band,
    )
