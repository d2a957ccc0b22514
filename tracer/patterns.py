"""What an emissive surface shows: radiance over its texture coordinates (u, v)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracer.compiled import called, inlined
from tracer.shapes import vec_at
from tracer.vector import Vec, add, scale

CONSTANT, CHECKER, RAMP, POSITION_CODE, PICTURE = range(5)
AXES = {"u": 0.0, "v": 1.0}


@dataclass(frozen=True)
class Constant:
    radiance: Vec


@dataclass(frozen=True)
class Checker:
    """`cells` along u and v; the cell at (0, 0) shows `a`."""

    a: Vec
    b: Vec
    cells: tuple[int, int]


@dataclass(frozen=True)
class Ramp:
    start: Vec
    end: Vec
    axis: str = "u"


@dataclass(frozen=True)
class PositionCode:
    """``amplitude (c, frac(cells c), 1)`` with c = u or v: the colour tells the place."""

    axis: str
    cells: int
    amplitude: float


@dataclass(frozen=True, eq=False)
class Picture:
    """Nearest texel of `pixels` (H, W, 3), radiance, row 0 at the top (v = 1)."""

    pixels: NDArray[np.float64]


Pattern = Constant | Checker | Ramp | PositionCode | Picture


def pattern_row(pattern: Pattern, first_texel: int) -> list[float]:
    match pattern:
        case Constant(radiance):
            return [CONSTANT, *radiance]
        case Checker(a, b, cells):
            return [CHECKER, *a, *b, *cells]
        case Ramp(start, end, axis):
            return [RAMP, *start, *end, AXES[axis]]
        case PositionCode(axis, cells, amplitude):
            return [POSITION_CODE, AXES[axis], cells, amplitude]
        case Picture(pixels):
            height, width, _ = pixels.shape
            return [PICTURE, first_texel, width, height]


@called
def panorama_radiance(row: NDArray[np.float64], texels: NDArray[np.float64], d: Vec) -> Vec:
    """What lies in direction `d`, from a `Picture` of all around (see `scene.Scene`).

    Interpolated between the centres of its texels, across the seam too.
    """
    width, height = int(row[2]), int(row[3])
    x = (0.5 + math.atan2(d[0], -d[2]) / (2.0 * math.pi)) * width - 0.5
    y = math.acos(min(max(d[1], -1.0), 1.0)) / math.pi * height - 0.5
    y = min(max(y, 0.0), height - 1.0)
    column, line = math.floor(x), math.floor(y)
    fx, fy = x - column, y - line
    first = int(row[1])
    i, j = int(column) % width, int(line)
    i1, j1 = (i + 1) % width, min(j + 1, height - 1)
    seen = (0.0, 0.0, 0.0)
    for corner in range(4):
        right, below = corner % 2 == 1, corner >= 2
        weight = (fx if right else 1.0 - fx) * (fy if below else 1.0 - fy)
        at = first + (j1 if below else j) * width + (i1 if right else i)
        seen = add(seen, scale(weight, vec_at(texels, at, 0)))
    return seen


@inlined
def pattern_radiance(
    rows: NDArray[np.float64], row: int, texels: NDArray[np.float64], u: float, v: float
) -> Vec:
    kind = int(rows[row, 0])
    if kind == CONSTANT:
        return vec_at(rows, row, 1)
    if kind == CHECKER:
        columns, lines = int(rows[row, 7]), int(rows[row, 8])
        i, j = min(int(u * columns), columns - 1), min(int(v * lines), lines - 1)
        return vec_at(rows, row, 1 if (i + j) & 1 == 0 else 4)
    if kind == RAMP:
        c = u if rows[row, 7] == 0.0 else v
        a, b = vec_at(rows, row, 1), vec_at(rows, row, 4)
        return a[0] + c * (b[0] - a[0]), a[1] + c * (b[1] - a[1]), a[2] + c * (b[2] - a[2])
    if kind == POSITION_CODE:
        c = u if rows[row, 1] == 0.0 else v
        fine = rows[row, 2] * c
        amplitude = rows[row, 3]
        return amplitude * c, amplitude * (fine - math.floor(fine)), amplitude
    width, height = int(rows[row, 2]), int(rows[row, 3])
    column = min(int(u * width), width - 1)
    line = min(int((1.0 - v) * height), height - 1)
    return vec_at(texels, int(rows[row, 1]) + line * width + column, 0)
