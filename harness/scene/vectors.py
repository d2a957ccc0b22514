"""Small vectors for building geometry: exact dot products, frames and rotations.

Scenes hold few numbers, so these are tuples of Python floats; sums of products are taken exactly
and rounded once, so that planes and vertices of one solid agree to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from harness.scene.degrees import cosd, sind
from harness.scene.resolved import Frame, Vec3

Matrix = tuple[Vec3, Vec3, Vec3]  # rows

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

SHORTEST = 1e-100  # a shorter vector has too few digits for a direction
# Between these, products of numbers and of their halves neither overflow nor lose bits.
TINY, HUGE = 2.0**-400, 2.0**400
SPLITTER = 2.0**27 + 1
PARALLEL = 1e-6  # sine of an angle below which two directions define no frame


def exact_dot(a: Sequence[float], b: Sequence[float]) -> Fraction:
    return sum((Fraction(x) * Fraction(y) for x, y in zip(a, b, strict=True)), Fraction())


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """The dot product, correctly rounded.

    Each product is split into its rounded value and the exact rest of it (Dekker 1971), and
    `math.fsum` rounds their sum once; ten times as fast as fractions.
    """
    terms: list[float] = []
    for x, y in zip(a, b, strict=True):
        if x != 0.0 and y != 0.0:
            if not (TINY < abs(x) < HUGE and TINY < abs(y) < HUGE):  # parts could be lost
                return float(exact_dot(a, b))
            (x_high, x_low), (y_high, y_low) = _halves(x), _halves(y)
            product = x * y
            rest = x_low * y_low - (((product - x_high * y_high) - x_low * y_high) - x_high * y_low)
            terms += product, rest
    return math.fsum(terms)


def _halves(x: float) -> tuple[float, float]:
    """`x` as a sum of two numbers of 26 bits each, so that products of such are exact."""
    scaled = SPLITTER * x
    high = scaled - (scaled - x)
    return high, x - high


def cross(a: Vec3, b: Vec3) -> Vec3:
    return (
        dot((a[1], a[2]), (b[2], -b[1])),
        dot((a[2], a[0]), (b[0], -b[2])),
        dot((a[0], a[1]), (b[1], -b[0])),
    )


def combination(origin: Vec3, scales: Sequence[float], axes: Sequence[Vec3]) -> Vec3:
    """Origin + sum of scale * axis, each component rounded once."""
    x, y, z = (
        dot((1.0, *scales), (origin[i], *(axis[i] for axis in axes))) + 0.0 for i in range(3)
    )
    return x, y, z


def difference(a: Vec3, b: Vec3) -> Vec3:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def length(a: Vec3) -> float:
    return math.hypot(*a)


def unit(a: Vec3) -> Vec3 | None:
    """`a` at length 1; None where it has no direction."""
    size = length(a)
    if size < SHORTEST:
        return None
    x, y, z = (component / size + 0.0 for component in a)  # + 0.0 turns -0.0 into 0.0
    return x, y, z


def frame(origin: Vec3, normal: Vec3, up: Vec3) -> Frame | None:
    """Z along `normal`, y as near to `up` as it can be; None where they are parallel or zero."""
    z, towards = unit(normal), unit(up)
    if z is None or towards is None:
        return None
    across = cross(towards, z)
    if length(across) < PARALLEL:
        return None
    x = unit(across)
    assert x is not None
    y = unit(cross(z, x))
    assert y is not None
    return Frame(origin=origin, x=x, y=y, z=z)


def any_frame(origin: Vec3, normal: Vec3) -> Frame | None:
    """A frame with z along `normal` where the other axes do not matter; None for no direction."""
    size = length(normal)
    upright = size > 0.0 and abs(normal[1]) / size <= 0.9
    return frame(origin, normal, (0.0, 1.0, 0.0) if upright else (0.0, 0.0, -1.0))


def rotation(axis: Vec3, angle: float) -> Matrix | None:
    """Right-handed rotation by `angle` degrees; None for an axis without direction.

    Exact for quarter turns about the coordinate axes.
    """
    k = unit(axis)
    if k is None:
        return None
    sine, cosine = sind(angle), cosd(angle)
    skew = ((0.0, -k[2], k[1]), (k[2], 0.0, -k[0]), (-k[1], k[0], 0.0))

    def entry(i: int, j: int) -> float:
        return (cosine if i == j else 0.0) + (1.0 - cosine) * k[i] * k[j] + sine * skew[i][j]

    rows = [(entry(i, 0), entry(i, 1), entry(i, 2)) for i in range(3)]
    return rows[0], rows[1], rows[2]


def product(a: Matrix, b: Matrix) -> Matrix:
    columns = list(zip(*b, strict=True))
    rows = [tuple(dot(row, column) for column in columns) for row in a]
    return rows[0], rows[1], rows[2]  # type: ignore[return-value]


def rotated(matrix: Matrix, a: Vec3) -> Vec3:
    x, y, z = (dot(row, a) + 0.0 for row in matrix)
    return x, y, z


def turned(matrix: Matrix, direction: Vec3) -> Vec3:
    """A unit direction, rotated, and again of unit length."""
    if matrix == IDENTITY:
        return direction
    result = unit(rotated(matrix, direction))
    assert result is not None
    return result
