"""Closed solids, built of bounds: the inside of all of them, or composed by set operations.

A `Cell` is convex: box, prism, cylinder, cone, most lenses. A `Compound` says inside of which
bounds, and outside of which, a point of the solid is, joined by "and" and "or": hollow lenses, and
whatever `union`, `intersection` and `difference` make.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracer.errors import SceneError
from tracer.shapes import (
    INF,
    INSIDE,
    OUTSIDE,
    Plane,
    Quadric,
    Sphere,
    require_positive,
)
from tracer.vector import Vec, along, dot, scale

Bound = Plane | Quadric


@dataclass(frozen=True)
class Cell:
    """The convex solid inside all `bounds`. The sphere `center`, `radius` encloses it."""

    bounds: tuple[Bound, ...]
    center: Vec
    radius: float


@dataclass(frozen=True)
class Side:
    """Inside of `bound`; outside of it where `hollow`."""

    bound: Bound
    hollow: bool = False


@dataclass(frozen=True)
class AllOf:
    parts: tuple[Where, ...]


@dataclass(frozen=True)
class AnyOf:
    parts: tuple[Where, ...]


Where = Side | AllOf | AnyOf


@dataclass(frozen=True)
class Compound:
    """The solid whose points are `where`. The sphere `center`, `radius` encloses it."""

    where: Where
    center: Vec
    radius: float


Analytic = Sphere | Cell | Compound
Part = Analytic | Plane  # a half-space, which ends nowhere until it cuts something that does


# --- set operations -------------------------------------------------------------------------------


def _where(part: Part) -> Where:
    match part:
        case Plane():
            return Side(part)
        case Sphere(center, radius):
            return Side(Quadric(center, (0.0, 0.0, 1.0), radius * radius, 0.0, -1.0))
        case Cell(bounds):
            return AllOf(tuple(Side(bound) for bound in bounds))
        case Compound(where):
            return where


def _outside(where: Where) -> Where:
    """De Morgan: the outside of an intersection is the union of the outsides."""
    match where:
        case Side(bound, hollow):
            return Side(bound, not hollow)
        case AllOf(parts):
            return AnyOf(tuple(map(_outside, parts)))
        case AnyOf(parts):
            return AllOf(tuple(map(_outside, parts)))


def union(*parts: Part) -> Compound:
    """What is inside any of the parts. Faces that they share are no faces of it."""
    return Compound(AnyOf(tuple(map(_where, parts))), *_ball_around(parts))


def intersection(*parts: Part) -> Compound:
    """What is inside all of the parts."""
    smallest = min(map(_ball, parts), key=lambda ball: ball[1])
    return Compound(AllOf(tuple(map(_where, parts))), *smallest)


def difference(part: Part, *without: Part) -> Compound:
    """What is inside of one part, and outside of all others."""
    where = (_where(part), *(_outside(_where(other)) for other in without))
    return Compound(AllOf(where), *_ball(part))


def _ball(part: Part) -> tuple[Vec, float]:
    """(center, radius) of a sphere around it, as far as its parts tell."""
    return ((0.0, 0.0, 0.0), INF) if isinstance(part, Plane) else (part.center, part.radius)


def _ball_around(parts: Sequence[Part]) -> tuple[Vec, float]:
    balls = list(map(_ball, parts))
    if any(radius == INF for _, radius in balls):
        return (0.0, 0.0, 0.0), INF
    centers, radii = (np.array(column) for column in zip(*balls, strict=True))
    low, high = (centers - radii[:, None]).min(axis=0), (centers + radii[:, None]).max(axis=0)
    x, y, z = ((low + high) / 2.0).tolist()
    reach = np.linalg.norm(centers - (x, y, z), axis=1) + radii
    return (x, y, z), float(reach.max())


def compound_rows(where: Where) -> tuple[list[Bound], list[list[float]]]:
    """(bounds, what to look at next after each): short-circuit evaluation, written out.

    The numbers belong into the columns from HOLLOW on.
    """
    bounds: list[Bound] = []
    rows: list[list[float]] = []

    def write(part: Where, if_true: int, if_false: int) -> None:
        match part:
            case Side(bound, hollow):
                decided = (if_false, if_true) if hollow else (if_true, if_false)
                bounds.append(bound)
                rows.append([float(hollow), *map(float, decided)])
            case AllOf(parts) | AnyOf(parts):
                *others, last = parts
                for one in others:
                    then = len(rows) + _count(one)
                    if isinstance(part, AllOf):
                        write(one, then, if_false)
                    else:
                        write(one, if_true, then)
                write(last, if_true, if_false)

    write(where, INSIDE, OUTSIDE)
    return bounds, rows


def _count(where: Where) -> int:
    return 1 if isinstance(where, Side) else sum(map(_count, where.parts))


# --- optical shapes -------------------------------------------------------------------------------


def polyhedron(planes: list[Plane], vertices: list[Vec]) -> Cell:
    """The convex solid behind all `planes`, whose corners are `vertices`."""
    corners = np.array(vertices, dtype=float)
    center = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    radius = float(np.linalg.norm(corners - center, axis=1).max())
    x, y, z = center.tolist()
    return Cell(tuple(planes), (x, y, z), radius)


def cylinder(center: Vec, axis: Vec, radius: float, height: float) -> Cell:
    """Capped cylinder around `center`; `axis` is unit."""
    require_positive("cylinder", radius=radius, height=height)
    side = Quadric(center, axis, radius * radius, 0.0, 0.0)
    half = height / 2.0
    ends = _up_to(half, axis, center), _up_to(half, scale(-1.0, axis), center)
    return Cell((side, *ends), center, math.hypot(radius, half))


def cone(tip: Vec, axis: Vec, radius: float, height: float, tip_radius: float = 0.0) -> Cell:
    """Cone that opens from `tip` along the unit vector `axis` to a base of `radius`.

    With a `tip_radius` of at most `radius` it is cut off there.
    """
    require_positive("cone", radius=radius, height=height)
    if not 0.0 <= tip_radius <= radius:
        raise SceneError(f"cone: tip_radius must be from 0 to {radius}, not {tip_radius}")
    # rho <= tip_radius + slope z. From the narrow end its digits are kept at any slope.
    slope = (radius - tip_radius) / height
    side = Quadric(tip, axis, tip_radius**2, 2.0 * tip_radius * slope, slope * slope)
    bounds: list[Bound] = [side, _up_to(height, axis, tip)]
    if tip_radius > 0.0:
        bounds.append(_up_to(0.0, scale(-1.0, axis), tip))
    return Cell(tuple(bounds), along(tip, height / 2.0, axis), math.hypot(radius, height / 2.0))


def lens(
    front: Vec,
    axis: Vec,
    radii: tuple[float, float],
    thickness: float,
    aperture: float,
    conics: tuple[float, float] = (0.0, 0.0),
) -> Cell | Compound:
    """Lens with its front vertex at `front`, its optical axis along the unit vector `axis`.

    `radii` of curvature are positive where the centre lies in the direction of `axis`, infinite
    for a plane: a biconvex lens has (+, -), a biconcave one (-, +). `aperture` is the radius of
    the cylinder that is its edge; `conics` are the conic constants: 0 a sphere, -1 a paraboloid,
    below -1 a hyperboloid, otherwise an ellipsoid.
    """
    require_positive("lens", thickness=thickness, aperture=aperture)
    back = along(front, thickness, axis)
    edge = Side(Quadric(front, axis, aperture * aperture, 0.0, 0.0))
    parts = [
        edge,
        *_lens_side(front, axis, radii[0], conics[0], thickness, aperture),
        *_lens_side(back, scale(-1.0, axis), -radii[1], conics[1], thickness, aperture),
    ]
    depth = thickness / 2.0 + max(
        sag(r, k, aperture) if r < 0.0 else 0.0
        for r, k in zip((radii[0], -radii[1]), conics, strict=True)
    )
    center, ball = along(front, thickness / 2.0, axis), math.hypot(aperture, depth)
    bounds = [part.bound for part in parts if isinstance(part, Side) and not part.hollow]
    if len(bounds) == len(parts):
        return Cell(tuple(bounds), center, ball)
    return Compound(AllOf(tuple(parts)), center, ball)


def sag(radius: float, conic: float, height: float) -> float:
    """How deep the surface of a conic is at `height` from its axis, at least 0.

    Raises SceneError where it does not reach that far.
    """
    rest = 1.0 - (1.0 + conic) * (height / radius) ** 2
    if not rest >= 0.0:
        raise SceneError(
            f"lens: a surface of radius {radius} and conic constant {conic} "
            f"does not reach {height} from its axis"
        )
    return height * height / (abs(radius) * (1.0 + math.sqrt(rest)))


def _lens_side(
    vertex: Vec, inwards: Vec, radius: float, conic: float, thickness: float, aperture: float
) -> list[Where]:
    """Bounds of a lens at one side; `radius` is positive where that is convex."""
    outwards = scale(-1.0, inwards)
    if abs(radius) == INF:
        return [Side(_up_to(0.0, outwards, vertex))]
    if not abs(radius) > 0.0:
        raise SceneError(f"lens: a radius of curvature cannot be {radius}")
    if radius < 0.0:  # outside of the body, and behind the plane of its rim
        body = Quadric(vertex, outwards, 0.0, -2.0 * radius, -(1.0 + conic))
        rim = _up_to(sag(radius, conic, aperture), outwards, vertex)
        return [Side(body, hollow=True), Side(rim)]
    body = Quadric(vertex, inwards, 0.0, 2.0 * radius, -(1.0 + conic))
    middle = radius / (1.0 + conic) if conic > -1.0 else INF
    if thickness <= middle:
        return [Side(body)]
    # The far half of a sphere or an ellipsoid is no surface of the lens.
    return [AnyOf((Side(body), Side(_up_to(-middle, outwards, vertex))))]


def _up_to(height: float, axis: Vec, point: Vec) -> Plane:
    """Everything that is not more than `height` along `axis` from `point`."""
    return Plane(axis, height + dot(point, axis))
