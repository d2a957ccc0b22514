"""Faces that solids share: which of their bounds are one and the same surface.

Where glass touches water there is one interface, from glass to water, and a ray must meet it once.
So two bounds whose numbers agree within rounding are given the same numbers. A ray then meets both
at the same distance to the last bit, and crosses them together.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tracer.shapes import Plane, Quadric
from tracer.vector import Vec, along, cross, dot, scale, sub

EPS = float(np.finfo(float).eps)
# Roundings of a unit vector's components, and of a coordinate, when one place is computed in two
# ways: a few rotations and sums.
OF_DIRECTIONS, OF_PLACES = 8 * EPS, 32 * EPS

Bound = Plane | Quadric


class Surfaces:
    """All different surfaces so far, numbered from 1."""

    def __init__(self) -> None:
        self._planes: list[tuple[Plane, int]] = []
        self._quadrics: list[tuple[Quadric, int]] = []
        self.count = 0

    def find(self, bound: Bound, reach: float) -> tuple[Bound, int]:
        """(`bound` in the numbers of the surface that it is, the surface's number).

        The number is negative where the bound is on the surface's other side. Coordinates of the
        solid go up to `reach`.
        """
        if isinstance(bound, Plane):
            return self._find_plane(bound, reach)
        for known, number in self._quadrics:
            if _same_quadric(known, bound, reach):
                return known, number
        self.count += 1
        self._quadrics.append((bound, self.count))
        return bound, self.count

    def _find_plane(self, bound: Plane, reach: float) -> tuple[Plane, int]:
        opposite = _turned_round(bound)
        for known, number in self._planes:
            if _same_plane(known, bound, reach):
                return known, number
            if _same_plane(known, opposite, reach):
                return _turned_round(known), -number
        self.count += 1
        self._planes.append((bound, self.count))
        return bound, self.count


def _turned_round(plane: Plane) -> Plane:
    return Plane(scale(-1.0, plane.normal), -plane.offset)


def _near(a: Vec, b: Vec, within: float) -> bool:
    return all(abs(x - y) <= within for x, y in zip(a, b, strict=True))


def _same_plane(a: Plane, b: Plane, reach: float) -> bool:
    return abs(a.offset - b.offset) <= OF_PLACES * reach and _near(
        a.normal, b.normal, OF_DIRECTIONS
    )


def _same_quadric(a: Quadric, b: Quadric, reach: float) -> bool:
    """As far as numbers tell: spheres, cylinders, or the same vertex, axis and form."""
    a, b = _centred(a), _centred(b)
    if (a.b, a.c) in ((0.0, -1.0), (0.0, 0.0)) and (a.b, a.c) == (b.b, b.c):
        radius = math.sqrt(a.a)
        within = OF_PLACES * max(reach, radius)
        if abs(radius - math.sqrt(b.a)) > within:
            return False
        if a.c == -1.0:
            return _near(a.origin, b.origin, within)
        apart = sub(b.origin, a.origin)
        off_axis = along(apart, -dot(apart, a.axis), a.axis)
        return _near(off_axis, (0.0,) * 3, within) and _near(
            cross(a.axis, b.axis), (0.0,) * 3, OF_DIRECTIONS
        )
    return (
        _near(a.origin, b.origin, OF_PLACES * reach)
        and _near(a.axis, b.axis, OF_DIRECTIONS)
        and all(
            math.isclose(x, y, rel_tol=OF_PLACES, abs_tol=OF_PLACES * reach**power)
            for x, y, power in ((a.a, b.a, 2), (a.b, b.b, 1), (a.c, b.c, 0))
        )
    )


def _centred(quadric: Quadric) -> Quadric:
    """A sphere that is given from its vertex, from its centre."""
    if quadric.c != -1.0 or quadric.b == 0.0:
        return quadric
    half = 0.5 * quadric.b
    origin = along(quadric.origin, half, quadric.axis)
    return replace(quadric, origin=origin, a=quadric.a + half * half, b=0.0)
