"""Where a renderer's rays went: from coded images, or from its ray API.

Both give the same `RayMeasurement`, so everything after this point is one piece of code.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float, lengths
from harness.measure.probe_truth import ProbeTruth
from harness.probe.decode import Decoded, Reason, decode, lit_threshold
from harness.probe.scenes import AMPLITUDE, AXES
from harness.renderers.base import RayPaths, Status
from harness.scene.resolved import Rectangle

Images = Mapping[tuple[int, str], NDArray[np.float32]]


@dataclass(frozen=True)
class RayMeasurement:
    """Of m rays: landing `point` (m, 3) on the first plane and `direction` (m, 3), NaN if unseen.

    `seen` (m,) tells that the ray reached the plane; `undecided` (m,) that a pixel held light which
    does not decode. `faint` (m,) marks rays whose light is too weak to be demanded. The
    uncertainties (m,) are what the image's quantum alone allows: units and radians. `reflected`
    (m,) is what a ray API says of total internal reflection; images only show darkness. So is
    `optical_length` (m,) up to the landing point.
    """

    point: Float
    direction: Float | None
    seen: NDArray[np.bool_]
    undecided: NDArray[np.bool_]
    faint: NDArray[np.bool_]
    mixed: NDArray[np.bool_]
    point_uncertainty: Float
    direction_uncertainty: Float
    reasons: dict[str, int]
    method: str
    reflected: NDArray[np.bool_] | None = None
    optical_length: Float | None = None


def from_paths(paths: RayPaths) -> RayMeasurement:
    """From a ray API: nothing is quantised."""
    m = len(paths.status)
    seen = paths.status == Status.HIT
    names = {
        Status(k).name.lower(): int((paths.status == k).sum()) for k in np.unique(paths.status)
    }
    none = np.zeros(m)
    nothing = np.zeros(m, bool)
    missing = ~seen[:, None]
    return RayMeasurement(
        np.where(missing, np.nan, paths.point), np.where(missing, np.nan, paths.direction),
        seen, nothing, nothing, nothing, none, none, names, "ray API", paths.status == Status.TIR,
        paths.optical_length,
    )  # fmt: skip


def _order(truth: ProbeTruth) -> Float:
    """(m,) 1 where a ray passes the first plane first, -1 where the second.

    By where the true ray meets them, not by its direction: a measured one may go anywhere, even
    backwards. Where the true ray meets neither, as most of the others do.
    """
    first, second = (landing.point for landing in truth.landings)
    signs = np.sign(np.einsum("ij,ij->i", second - first, truth.paths.direction))
    known = np.isfinite(signs) & (signs != 0)
    usual = -1.0 if (signs[known] < 0).sum() > known.sum() / 2 else 1.0
    return np.asarray(np.where(known, signs, usual))


def from_images(
    images: Images,
    truth: ProbeTruth,
    cells: int,
    quantum: float,
    epsilon: float,
    mixed: NDArray[np.bool_],
    samples: int | None,
) -> RayMeasurement:
    """From coded images keyed by (plane, axis). Two planes give the direction.

    `quantum` bounds the error of the renderer's codes: `Preflight.code_quantum`, and `epsilon` is
    the precision in which it evaluates a coordinate and its product with the cells. `mixed` (m,)
    are the rays that share their pixels with another path, `samples` the number of times that a
    sampling renderer chose among them.
    """
    places = [
        _place(images, index, plane, cells, quantum, epsilon)
        for index, plane in enumerate(truth.planes)
    ]
    point, uncertainty, seen, undecided, reasons = places[0]
    direction, direction_uncertainty = None, np.zeros(len(seen))
    if len(places) == 2:
        far, far_uncertainty, far_seen, far_undecided, _ = places[1]
        gap = far - point
        length = lengths(gap)
        with np.errstate(invalid="ignore", divide="ignore"):
            direction = gap / length[:, None] * _order(truth)[:, None]
            direction_uncertainty = (uncertainty + far_uncertainty) / length
        seen, undecided = seen & far_seen, undecided | far_undecided
    weakest = truth.paths.weight * truth.landings[0].transmission.min(axis=1) * AMPLITUDE
    # `decode` needs slack <= 1/4 in the worst place of a cell; half of that light is not demanded.
    needed = max(lit_threshold(quantum), 8 * quantum * (cells + 1))
    faint = weakest < 2 * needed
    if samples is not None:
        faint |= weakest < AMPLITUDE * surely_sampled(samples, len(faint))
    return RayMeasurement(
        point, direction, seen, undecided, faint, mixed, uncertainty,
        direction_uncertainty, reasons, f"position code, {cells} cells",
    )  # fmt: skip


def surely_sampled(samples: int, rays: int) -> float:
    """The weight of a path that misses no ray at all but once in 10,000 probes.

    A path of weight w is never chosen in N samples with a chance of (1 - w)^N.
    """
    return float(1 - (1e-4 / rays) ** (1 / samples))


def _place(
    images: Images, index: int, plane: Rectangle, cells: int, quantum: float, epsilon: float
) -> tuple[Float, Float, NDArray[np.bool_], NDArray[np.bool_], dict[str, int]]:
    u, v = (decode(images[index, axis], cells, AMPLITUDE, quantum) for axis in AXES)
    frame = plane.frame
    width, height = plane.size
    point = (
        np.array(frame.origin)
        + ((u.coordinate - 0.5) * width)[:, None] * np.array(frame.x)
        + ((v.coordinate - 0.5) * height)[:, None] * np.array(frame.y)
    )
    uncertainty = np.hypot(
        (u.uncertainty + 2 * epsilon) * width, (v.uncertainty + 2 * epsilon) * height
    )
    seen = (u.reason == Reason.OK) & (v.reason == Reason.OK)
    dark = (u.reason == Reason.DARK) & (v.reason == Reason.DARK)
    return point, uncertainty, seen, ~seen & ~dark, _count(u, v)


def _count(u: Decoded, v: Decoded) -> dict[str, int]:
    worst = np.maximum(u.reason, v.reason)
    return {Reason(k).name.lower(): int((worst == k).sum()) for k in np.unique(worst)}
