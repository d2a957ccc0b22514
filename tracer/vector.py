"""Three-vectors as plain tuples of floats: compiled, they live in registers.

A colour is a three-vector too.
"""

from __future__ import annotations

import math

from tracer.compiled import compiled

Vec = tuple[float, float, float]


@compiled
def dot(a: Vec, b: Vec) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Vec, b: Vec) -> Vec:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def add(a: Vec, b: Vec) -> Vec:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def sub(a: Vec, b: Vec) -> Vec:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def mul(a: Vec, b: Vec) -> Vec:
    """Component by component, as colours multiply."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@compiled
def scale(s: float, a: Vec) -> Vec:
    return s * a[0], s * a[1], s * a[2]


@compiled
def along(origin: Vec, t: float, direction: Vec) -> Vec:
    """The point at distance `t` along a ray."""
    return (
        origin[0] + t * direction[0],
        origin[1] + t * direction[1],
        origin[2] + t * direction[2],
    )


@compiled
def chosen(first: bool, a: Vec, b: Vec) -> Vec:
    """One of two, without a branch."""
    return a[0] if first else b[0], a[1] if first else b[1], a[2] if first else b[2]


@compiled
def normalise(a: Vec) -> Vec:
    return scale(1.0 / math.sqrt(dot(a, a)), a)
