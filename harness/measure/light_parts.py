"""What observables of light share: the worst pixel decides; how far the model is from nature."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.curves import curve_of_rows
from harness.measure.probe_truth import ProbeTruth


def worst_level(
    truth: ProbeTruth,
    measured: Float,
    true: Float,
    tolerance: Float,
    used: NDArray[np.bool_],
    detail: dict[str, float | int | str],
    title: str,
    derivation: str,
) -> Comparison:
    """Pixels (m, 3) against true values within tolerances (m,): the worst decides."""
    error = np.abs(measured - true)
    limit = np.broadcast_to(tolerance[:, None], error.shape)
    if not np.isfinite(error[used]).all():
        raise Unmeasurable("a measured pixel is not finite")
    ratio = np.where(used[:, None], error / limit, -np.inf)
    k, channel = np.unravel_index(int(ratio.argmax()), ratio.shape)
    width = truth.scene.film.width
    detail = {
        "max": float(error[used].max()), "rms": float(np.sqrt(np.mean(error[used] ** 2))),
        "p999": float(np.quantile(error[used], 0.999)), "rays": int(used.sum()),
        "excluded_grazing": int(truth.grazing.sum()), "channel": "rgb"[int(channel)],
        **truth.conditions(used),
        "worst_pixel_x": int(k % width), "worst_pixel_y": int(k // width),
        "worst_theta_i_deg": float(np.degrees(truth.theta_i[k])), **detail,
    }  # fmt: skip
    curve = curve_of_rows(
        truth, used, title, "weight (green)", measured[:, 1], true[:, 1], limit[:, 1]
    )
    return Comparison(
        float(measured[k, channel]), float(true[k, channel]), float(limit[k, channel]),
        bool(np.all(error[used] <= limit[used])), derivation, detail=detail, curve=curve,
    )  # fmt: skip


def distance_to_nature(
    natural: Float, true: Float, used: NDArray[np.bool_]
) -> dict[str, float | int | str]:
    """How far the model that is judged is from nature, at worst, and what nature shows there.

    Nature's light is polarised by each interface that it meets (`harness.truth.tree`).
    """
    gap = np.abs(natural - true).max(axis=1)
    k = int(np.argmax(np.where(used, gap, -1)))
    return {
        "distance_to_nature": float(gap[k]),
        "nature": float(natural[k].max()),
        "model": float(true[k].max()),
    }


def nature(truth: ProbeTruth, used: NDArray[np.bool_]) -> dict[str, float | int | str]:
    """The same of a probe's one path, on rays that take it."""
    if truth.path.count("T") + truth.path.count("R") < 2:
        return {}  # one interface weighs natural light as the model does
    level, natural = np.nan_to_num(truth.level), np.nan_to_num(truth.natural_level)
    return distance_to_nature(natural, level, used)
