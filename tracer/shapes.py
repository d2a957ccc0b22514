"""Closed solids that a ray meets in one stretch, and open faces; intersected in closed form.

A `Cell` is what lies inside all of its bounds: half-spaces (`Plane`) and bodies of revolution of
second degree (`Quadric`). A box is six planes, a cylinder one quadric and two planes, a lens two
quadrics. A ray meets every bound in one stretch from `enter` to `leave`, so it meets their
intersection from the last `enter` to the first `leave` (T. Kay, J. Kajiya, SIGGRAPH 1986).

No ray is ever moved off the surface that it leaves. Instead it knows which face of which object
it has left and to which side, and that face then counts as crossed at exactly t = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracer.compiled import called, inlined
from tracer.errors import SceneError
from tracer.vector import Vec, along, dot, normalise, scale, sub

Rows = NDArray[np.float64]
INF = math.inf
PLANE, QUADRIC = 0.0, 1.0
COLUMNS = 14  # of the table that all shapes are written to


# --- what a scene is built of ---------------------------------------------------------------------


def _require_positive(shape: object, **sizes: float) -> None:
    for name, size in sizes.items():
        if not 0.0 < size < INF:
            kind = shape if isinstance(shape, str) else type(shape).__name__.lower()
            raise SceneError(f"{kind}: {name} must be positive and finite, not {size}")


@dataclass(frozen=True)
class Sphere:
    center: Vec
    radius: float

    def __post_init__(self) -> None:
        _require_positive(self, radius=self.radius)


@dataclass(frozen=True)
class Plane:
    """The half-space ``normal . p <= offset``; `normal` is unit and points outwards."""

    normal: Vec
    offset: float


@dataclass(frozen=True)
class Quadric:
    """The body of revolution ``rho^2 <= a + b z + c z^2`` around the line through `origin`.

    z is measured from `origin` along the unit vector `axis`, rho at right angles to it. For c > 0
    it is the convex half in which ``z > -b / 2c`` (one nappe of a cone, one sheet of a
    hyperboloid).
    """

    origin: Vec
    axis: Vec
    a: float
    b: float
    c: float


@dataclass(frozen=True)
class Cell:
    """The convex solid inside all `bounds`. The sphere `center`, `radius` encloses it."""

    bounds: tuple[Plane | Quadric, ...]
    center: Vec
    radius: float


@dataclass(frozen=True)
class Rectangle:
    """Open face; `x`, `y`, `z` are orthonormal, `z` its front; `size` along x and y."""

    origin: Vec
    x: Vec
    y: Vec
    z: Vec
    size: tuple[float, float]

    def __post_init__(self) -> None:
        _require_positive(self, width=self.size[0], height=self.size[1])


@dataclass(frozen=True)
class Disk:
    origin: Vec
    x: Vec
    y: Vec
    z: Vec
    radius: float

    def __post_init__(self) -> None:
        _require_positive(self, radius=self.radius)


def polyhedron(planes: list[Plane], vertices: list[Vec]) -> Cell:
    """The convex solid behind all `planes`, whose corners are `vertices`."""
    corners = np.array(vertices, dtype=float)
    center = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    radius = float(np.linalg.norm(corners - center, axis=1).max())
    x, y, z = center.tolist()
    return Cell(tuple(planes), (x, y, z), radius)


def cylinder(center: Vec, axis: Vec, radius: float, height: float) -> Cell:
    """Capped cylinder around `center`; `axis` is unit."""
    _require_positive("cylinder", radius=radius, height=height)
    middle = sum(c * a for c, a in zip(center, axis, strict=True))
    back = (-axis[0], -axis[1], -axis[2])
    bounds = (
        Quadric(center, axis, radius * radius, 0.0, 0.0),
        Plane(axis, height / 2.0 + middle),
        Plane(back, height / 2.0 - middle),
    )
    return Cell(bounds, center, math.hypot(radius, height / 2.0))


def cone(tip: Vec, axis: Vec, radius: float, height: float) -> Cell:
    """Cone that opens from `tip` along the unit vector `axis` to a base of `radius`."""
    _require_positive("cone", radius=radius, height=height)
    slope = radius / height
    base = sum(t * a for t, a in zip(tip, axis, strict=True)) + height
    bounds = (Quadric(tip, axis, 0.0, 0.0, slope * slope), Plane(axis, base))
    center = tuple(t + height / 2.0 * a for t, a in zip(tip, axis, strict=True))
    return Cell(bounds, (center[0], center[1], center[2]), math.hypot(radius, height / 2.0))


def lens(
    front: Vec,
    axis: Vec,
    radii: tuple[float, float],
    thickness: float,
    aperture: float,
    conics: tuple[float, float] = (0.0, 0.0),
) -> Cell:
    """Lens with its front vertex at `front`, its optical axis along the unit vector `axis`.

    `radii` of curvature are positive where the centre lies in the direction of `axis`, infinite
    for a plane: a biconvex lens has (+, -). A lens that is hollow on a side is no convex solid
    and is refused. `aperture` is the radius of the cylinder that is its edge; `conics` are the
    conic constants: 0 a sphere, -1 a paraboloid, below -1 a hyperboloid.
    """
    _require_positive("lens", thickness=thickness, aperture=aperture)
    if not (radii[0] > 0.0 and (radii[1] < 0.0 or radii[1] == INF)):
        raise SceneError(f"a lens must be convex or plane on both sides, not {radii}")
    back = tuple(f + thickness * a for f, a in zip(front, axis, strict=True))
    reverse = (-axis[0], -axis[1], -axis[2])
    sides = (front, axis, radii[0], conics[0]), (back, reverse, -radii[1], conics[1])
    bounds: list[Plane | Quadric] = [Quadric(front, axis, aperture * aperture, 0.0, 0.0)]
    for vertex, inwards, radius, conic in sides:
        v = (vertex[0], vertex[1], vertex[2])
        if abs(radius) == INF:
            outwards = (-inwards[0], -inwards[1], -inwards[2])
            bounds.append(Plane(outwards, sum(o * p for o, p in zip(outwards, v, strict=True))))
        else:
            bounds.append(Quadric(v, inwards, 0.0, 2.0 * radius, -(1.0 + conic)))
    center = tuple((f + b) / 2.0 for f, b in zip(front, back, strict=True))
    ball = math.hypot(aperture, thickness / 2.0)
    return Cell(tuple(bounds), (center[0], center[1], center[2]), ball)


# --- rows of numbers ------------------------------------------------------------------------------


def bound_row(bound: Plane | Quadric) -> list[float]:
    if isinstance(bound, Plane):
        return [PLANE, *bound.normal, bound.offset]
    return [QUADRIC, *bound.origin, *bound.axis, bound.a, bound.b, bound.c]


def face_row(face: Rectangle | Disk) -> list[float]:
    half = (face.radius,) * 2 if isinstance(face, Disk) else (face.size[0] / 2, face.size[1] / 2)
    return [*face.origin, *face.x, *face.y, *face.z, *half]


@inlined
def vec_at(rows: Rows, row: int, column: int) -> Vec:
    return rows[row, column], rows[row, column + 1], rows[row, column + 2]


# --- where a ray crosses them ---------------------------------------------------------------------
# A stretch is (enter, leave); it is empty where enter > leave. Directions are unit vectors.

EMPTY = (INF, -INF)


@inlined
def sphere_stretch(o: Vec, d: Vec, center: Vec, radius: float) -> tuple[float, float]:
    """Computed from the point of the ray next to the centre, which keeps far spheres exact.

    E. Haines, J. Günther, T. Akenine-Möller, Precision improvements for ray/sphere intersection,
    Ray Tracing Gems, chapter 7, 2019.
    """
    from_center = sub(o, center)
    nearest = -dot(from_center, d)
    h = along(from_center, nearest, d)
    half_chord_squared = radius * radius - dot(h, h)
    if half_chord_squared < 0.0:
        return INF, -INF
    half_chord = math.sqrt(half_chord_squared)
    return nearest - half_chord, nearest + half_chord


@inlined
def plane_stretch(o: Vec, d: Vec, normal: Vec, offset: float) -> tuple[float, float]:
    approach = dot(normal, d)
    height = offset - dot(normal, o)
    if approach < 0.0:
        return height / approach, INF
    if approach > 0.0:
        return -INF, height / approach
    if height >= 0.0:
        return -INF, INF
    return INF, -INF


@called
def quadric_stretch(o: Vec, d: Vec, rows: Rows, row: int, on_it: bool) -> tuple[float, float]:
    """`on_it` says that `o` lies on the surface and `d` points inwards: one root is t = 0."""
    axis = vec_at(rows, row, 4)
    a, b, c = rows[row, 7], rows[row, 8], rows[row, 9]
    start = sub(o, vec_at(rows, row, 1))
    dz = dot(d, axis)
    shift = 0.0 if on_it else -dot(start, d)
    p = along(start, shift, d)
    z = dot(p, axis)
    # inside is where  qa t^2 + 2 qb t + qc <= 0
    qa = 1.0 - (1.0 + c) * dz * dz
    qb = dot(p, d) - ((1.0 + c) * z + 0.5 * b) * dz
    if on_it:
        return 0.0, -2.0 * qb / qa if qa > 0.0 else INF
    qc = dot(p, p) - ((1.0 + c) * z + b) * z - a
    root_squared = qb * qb - qa * qc
    if qa <= 0.0 and root_squared < 0.0:
        root_squared = 0.0
    if root_squared < 0.0:
        return INF, -INF
    root = math.sqrt(root_squared)
    q = -qb - math.copysign(root, qb)  # the two roots are q / qa and qc / q
    if qa == 0.0:
        if qb == 0.0:
            return (-INF, INF) if qc <= 0.0 else (INF, -INF)
        t = shift - 0.5 * qc / qb
        return (t, INF) if qb < 0.0 else (-INF, t)
    t0 = q / qa
    t1 = qc / q if q != 0.0 else t0
    if t0 > t1:
        t0, t1 = t1, t0
    if c > 0.0:  # two sheets: only the one ahead of the middle along the axis is ours
        if qa < 0.0:
            return (shift + t1, INF) if dz > 0.0 else (-INF, shift + t0)
        if z + 0.5 * (t0 + t1) * dz < -0.5 * b / c:
            return INF, -INF
    return shift + t0, shift + t1


@inlined
def cell_stretch(
    o: Vec, d: Vec, rows: Rows, first: int, count: int, on_face: int
) -> tuple[float, int, float, int]:
    """(enter, face entered, leave, face left).

    With `on_face` >= 0 the ray starts on that face and points inwards: enter is 0.
    """
    enter, enter_face, leave, leave_face = -INF, -1, INF, -1
    for face in range(count):
        row = first + face
        if rows[row, 0] == PLANE:
            if face == on_face:
                continue  # entered through it; a plane is not crossed twice
            t0, t1 = plane_stretch(o, d, vec_at(rows, row, 1), rows[row, 4])
        else:
            t0, t1 = quadric_stretch(o, d, rows, row, face == on_face)
        if t0 > enter:
            enter, enter_face = t0, face
        if t1 < leave:
            leave, leave_face = t1, face
    if on_face >= 0:
        return 0.0, on_face, max(leave, 0.0), leave_face
    return enter, enter_face, leave, leave_face


@inlined
def face_distance(o: Vec, d: Vec, rows: Rows, row: int, is_disk: bool, best: float) -> float:
    """Distance to a rectangle or disk, from either side; infinite if missed or not before `best`.

    Whatever lies behind the ray or beyond `best` is sorted out before anything is divided.
    """
    z = vec_at(rows, row, 9)
    center = vec_at(rows, row, 0)
    height, approach = dot(z, sub(center, o)), dot(z, d)
    if approach < 0.0:
        height, approach = -height, -approach
    if not 0.0 < height < best * approach:
        return INF
    t = height / approach
    p = sub(along(o, t, d), center)
    x, y = dot(p, vec_at(rows, row, 3)), dot(p, vec_at(rows, row, 6))
    if is_disk:
        inside = x * x + y * y <= rows[row, 12] * rows[row, 12]
    else:
        inside = abs(x) <= rows[row, 12] and abs(y) <= rows[row, 13]
    return t if inside else INF


# --- their outward normals ------------------------------------------------------------------------


@inlined
def sphere_normal(p: Vec, center: Vec, radius: float) -> Vec:
    """Unit to the last bit for a point on the sphere within rounding, without a root.

    With v of length sqrt(1 + e), one step of Newton's, v (3 - v^2) / 2, leaves 3 e^2 / 8 of e.
    """
    v = scale(1.0 / radius, sub(p, center))
    return scale(1.5 - 0.5 * dot(v, v), v)


@inlined
def bound_normal(p: Vec, rows: Rows, row: int) -> Vec:
    if rows[row, 0] == PLANE:
        return vec_at(rows, row, 1)
    axis = vec_at(rows, row, 4)
    from_origin = sub(p, vec_at(rows, row, 1))
    z = dot(from_origin, axis)
    gradient = sub(from_origin, scale((1.0 + rows[row, 9]) * z + 0.5 * rows[row, 8], axis))
    if dot(gradient, gradient) == 0.0:  # the tip of a cone
        return -axis[0], -axis[1], -axis[2]
    return normalise(gradient)


@inlined
def face_coordinates(p: Vec, rows: Rows, row: int) -> tuple[float, float]:
    """Texture coordinates (u, v) of a point on a rectangle or disk, each in [0, 1]."""
    from_center = sub(p, vec_at(rows, row, 0))
    u = 0.5 + 0.5 * dot(from_center, vec_at(rows, row, 3)) / rows[row, 12]
    v = 0.5 + 0.5 * dot(from_center, vec_at(rows, row, 6)) / rows[row, 13]
    return min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
