"""Solids as the insides and outsides of half-spaces and bodies of revolution.

What POV-Ray is told of lenses and composed solids, and how the harness knows whether a point is in
one. Written apart from the tracer's `solids`, so that a mistake in one is not a mistake in both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.scene import resolved
from harness.scene.resolved import Vec3

Points = NDArray[np.float64]  # (n, 3)
Values = NDArray[np.float64]  # (n,)


@dataclass(frozen=True)
class HalfSpace:
    """``normal . p <= offset``, normal unit and outward."""

    normal: Vec3
    offset: float


@dataclass(frozen=True)
class Round:
    """``rho^2 <= a + b z + c z^2``, z along `axis` from `origin`, rho at right angles to it.

    For c > 0 only the part with ``z > -b / 2c``: one nappe of a cone, one sheet of a hyperboloid.
    """

    origin: Vec3
    axis: Vec3
    a: float
    b: float
    c: float


@dataclass(frozen=True)
class Side:
    """Inside of a bound; `outside` of it if so."""

    bound: HalfSpace | Round
    outside: bool = False


@dataclass(frozen=True)
class Both:
    """Inside of all parts."""

    parts: tuple[Region, ...]


@dataclass(frozen=True)
class Either:
    """Inside of any part."""

    parts: tuple[Region, ...]


Region = Side | Both | Either


def region(shape: resolved.Part) -> Region:
    """The points of a shape."""
    match shape:
        case resolved.Sphere():
            return Side(Round(shape.center, (0.0, 0.0, 1.0), shape.radius**2, 0.0, -1.0))
        case resolved.Convex():
            return Both(tuple(Side(HalfSpace((x, y, z), d)) for x, y, z, d in shape.planes))
        case resolved.Cylinder():
            frame, half = shape.frame, shape.height / 2
            side = Side(Round(frame.origin, frame.z, shape.radius**2, 0.0, 0.0))
            ends = (up_to(half, axis, frame.origin) for axis in (frame.z, opposite(frame.z)))
            return Both((side, *ends))
        case resolved.Cone():
            return _cone(shape)
        case resolved.Lens():
            return _lens(shape)
        case resolved.Plane():
            return Side(HalfSpace(shape.normal, shape.offset))
        case resolved.Csg():
            return _composed(shape)


def _composed(shape: resolved.Csg) -> Region:
    first, *others = map(region, shape.parts)
    match shape.operation:
        case "union":
            return Either((first, *others))
        case "intersection":
            return Both((first, *others))
        case "difference":
            return Both((first, *map(complement, others)))


def complement(where: Region) -> Region:
    """All other points (De Morgan)."""
    match where:
        case Side(bound, outside):
            return Side(bound, not outside)
        case Both(parts):
            return Either(tuple(map(complement, parts)))
        case Either(parts):
            return Both(tuple(map(complement, parts)))


def up_to(height: float, axis: Vec3, origin: Vec3) -> Side:
    """All points not more than `height` along `axis` from `origin`."""
    return Side(HalfSpace(axis, height + sum(a * o for a, o in zip(axis, origin, strict=True))))


def opposite(axis: Vec3) -> Vec3:
    return 0.0 - axis[0], 0.0 - axis[1], 0.0 - axis[2]


def _cone(shape: resolved.Cone) -> Region:
    frame, slope = shape.frame, (shape.radius - shape.top_radius) / shape.height
    top, down = along(frame.origin, shape.height, frame.z), opposite(frame.z)
    # From the narrow end, where the digits of the tip are.
    side = Round(top, down, shape.top_radius**2, 2 * slope * shape.top_radius, slope**2)
    ends = up_to(0.0, frame.z, top), up_to(0.0, down, frame.origin)
    return Both((Side(side), *ends))


def _lens(shape: resolved.Lens) -> Region:
    frame = shape.frame
    front, back = frame.origin, along(frame.origin, shape.thickness, frame.z)
    first, second = shape.radii
    sides = (
        _face(front, frame.z, first, shape.conics[0], shape),
        _face(back, opposite(frame.z), None if second is None else -second, shape.conics[1], shape),
    )
    edge = Side(Round(front, frame.z, shape.aperture**2, 0.0, 0.0))
    return Both((edge, *sides[0], *sides[1]))


def _face(
    vertex: Vec3, inwards: Vec3, radius: float | None, conic: float, shape: resolved.Lens
) -> list[Region]:
    """Bounds of a lens at one of its sides; `radius` is positive where that is convex."""
    outwards = opposite(inwards)
    if radius is None:
        return [up_to(0.0, outwards, vertex)]
    if radius < 0:
        body = Round(vertex, outwards, 0.0, -2 * radius, -(1 + conic))
        return [
            Side(body, outside=True),
            up_to(sag(radius, conic, shape.aperture), outwards, vertex),
        ]
    body = Round(vertex, inwards, 0.0, 2 * radius, -(1 + conic))
    equator = radius / (1 + conic) if conic > -1 else math.inf
    if shape.thickness <= equator:
        return [Side(body)]
    return [Either((Side(body), up_to(-equator, outwards, vertex)))]


def sag(radius: float, conic: float, height: float) -> float:
    """Depth of a conic of revolution at `height` from its axis, at least 0; NaN where it ends."""
    rest = 1 - (1 + conic) * (height / radius) ** 2
    return height**2 / (abs(radius) * (1 + math.sqrt(rest))) if rest >= 0 else math.nan


def profile(lens: resolved.Lens, face: int, height: float) -> float:
    """Where a face (0 front, 1 back) is along the lens's axis, from its front vertex."""
    radius, vertex = lens.radii[face], face * lens.thickness
    if radius is None:
        return vertex
    return vertex + math.copysign(sag(radius, lens.conics[face], height), radius)


def ends(lens: resolved.Lens) -> tuple[float, float]:
    """The range of the lens along its axis."""
    low = min(0.0, profile(lens, 0, lens.aperture))
    return low, max(lens.thickness, profile(lens, 1, lens.aperture))


def along(origin: Vec3, distance: float, axis: Vec3) -> Vec3:
    x, y, z = (o + distance * a for o, a in zip(origin, axis, strict=True))
    return x, y, z


def depth(where: Region, points: Points) -> Values:
    """Negative inside, positive outside; near a surface the distance from it, to first order."""
    match where:
        case Side(HalfSpace(normal, offset), outside):
            away = points @ np.array(normal) - offset
        case Side(bound, outside):
            assert isinstance(bound, Round)
            away = _beyond(bound, points)
        case Both(parts):
            return np.asarray(np.max([depth(part, points) for part in parts], axis=0))
        case Either(parts):
            return np.asarray(np.min([depth(part, points) for part in parts], axis=0))
    return np.asarray(-away if outside else away)


def _beyond(bound: Round, points: Points) -> Values:
    """How far points are outside of a body: what makes it positive, over how steep that is."""
    local = points - np.array(bound.origin)
    z = local @ np.array(bound.axis)
    rho = np.linalg.norm(local - z[:, None] * np.array(bound.axis), axis=1)
    if bound.b == 0 and bound.c in (0, -1):  # a cylinder or a sphere
        away = np.hypot(rho, z) if bound.c else rho
        return np.asarray(away - math.sqrt(bound.a))
    value = rho**2 - (bound.a + (bound.b + bound.c * z) * z)
    steep = np.hypot(2 * rho, bound.b + 2 * bound.c * z)
    away = np.where(steep > 0, value / np.where(steep > 0, steep, 1.0), 0.0)
    if bound.c > 0:
        away = np.maximum(away, -bound.b / (2 * bound.c) - z)
    return np.asarray(away)


def thickness(shape: resolved.SolidShape | resolved.Plane) -> float:
    """How thick a solid is where it is thinnest, as far as its bounds tell."""
    match shape:
        case resolved.Sphere():
            return 2 * shape.radius
        case resolved.Cylinder() | resolved.Cone():
            return min(2 * shape.radius, shape.height)
        case resolved.Lens():
            rims = profile(shape, 1, shape.aperture) - profile(shape, 0, shape.aperture)
            return min(2 * shape.aperture, max(shape.thickness, rims))
        case resolved.Convex():
            planes = np.array(shape.planes)
            depths = planes[:, 3] - (np.array(shape.vertices) @ planes[:, :3].T).min(axis=0)
            return float(depths.min())
        case resolved.Csg():
            return min(map(thickness, shape.parts))
        case resolved.Plane():
            return math.inf
        case resolved.Mesh():
            return float(np.ptp(np.array(shape.vertices), axis=0).min())
