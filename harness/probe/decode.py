"""From a coded pixel to the place where its ray landed.

A code plane emits ``amplitude * (c, frac(cells c), 1)`` with c the coordinate along one axis.
Whatever the ray lost on its way (Fresnel, absorption) it lost in all channels alike, so the third
channel divides it out. The coarse channel tells the cell, the fine one the place in the cell.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.renderers.base import Float


class Reason(enum.IntEnum):
    """Why a pixel holds a position, or why not. What does not decode is counted, never guessed."""

    OK = 0
    DARK = 1  # no light from the code plane: missed it, or totally reflected
    FAINT = 2  # some light, too little to tell the cell
    MIXED = 3  # coarse and fine code disagree: more than one path, or an edge, in this pixel
    NOT_FINITE = 4


@dataclass(frozen=True)
class Decoded:
    """Per pixel (flattened): `coordinate` in [0, 1], NaN unless `reason` is OK.

    `uncertainty` is the bound on the coordinate's error that follows from the quantum of the
    image alone; `level` is the constant channel over the amplitude: the weight of the path.
    """

    coordinate: Float
    uncertainty: Float
    level: Float
    reason: NDArray[np.int8]


def decode(pixels: NDArray[np.float32], cells: int, amplitude: float, quantum: float) -> Decoded:
    """Positions from `pixels` (..., 3), whose values are off by at most `quantum`.

    Values above 1 may be off by that many times `quantum`, as floats are.
    With c = r / b and f = g / b the cell is round(c cells - f) and the coordinate (cell + f) /
    cells. Errors of r, g, b of at most q give |dc| <= q (1 + c) / (b - q) with the measured c and
    b, and df alike, so c cells - f strays from an integer by at most q (cells (1 + c) + 1 + f) /
    (b - q): more than that is a mixture of paths, and more than 1/4 cannot be told from the
    neighbouring cell.
    """
    r, g, b = (pixels[..., k].reshape(-1).astype(np.float64) for k in range(3))
    finite = np.isfinite(r) & np.isfinite(g) & np.isfinite(b)
    # Four quanta of light is where a pixel is lit for certain; see `lit_threshold`.
    lit = finite & (b > lit_threshold(quantum))
    safe = np.where(lit, b, 1.0)
    c, f = np.where(lit, r, 0.0) / safe, np.where(lit, g, 0.0) / safe
    # A float above 1 is rounded in proportion: seen from inside glass, a plane shines n^2 times.
    error = quantum * np.maximum(np.where(lit, b, 1.0), 1.0)
    share = error / np.where(lit, b - error, 1.0)
    fine_error = share * (1 + np.abs(f))
    slack = share * cells * (1 + np.abs(c)) + fine_error
    position = c * cells - f
    cell = np.round(position)
    reason = np.full(len(b), Reason.OK, np.int8)
    reason[lit & (np.abs(position - cell) > slack)] = Reason.MIXED
    reason[lit & ((f < -fine_error) | (f > 1 + fine_error))] = Reason.MIXED
    reason[lit & (slack > 0.25)] = Reason.FAINT
    reason[finite & ~lit] = Reason.DARK
    reason[~finite] = Reason.NOT_FINITE
    ok = reason == Reason.OK
    coordinate = np.where(ok, (cell + f) / cells, np.nan)
    uncertainty = np.where(ok, fine_error / cells, np.nan)
    return Decoded(coordinate, uncertainty, np.where(finite, b, np.nan) / amplitude, reason)


def lit_threshold(quantum: float) -> float:
    """A value above this comes from light, not from rounding: 4 quanta."""
    return 4 * quantum


def finest_cells(quantum: float, weakest: float, wanted: int) -> int:
    """The largest number of cells, at most `wanted`, that decodes down to the level `weakest`.

    From `decode`: slack <= 1/4 in the worst place, c = f = 1, where light of that level may be
    measured as level - quantum and c and f as (level + quantum) / (level - quantum).
    """
    if quantum <= 0:
        return wanted
    most = (weakest - 2 * quantum) * (weakest - quantum) / (8 * quantum * weakest) - 1
    return int(max(1, min(wanted, most)))
