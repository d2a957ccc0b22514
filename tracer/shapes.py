"""What solids are bounded by, intersected in closed form; and the shapes of open faces.

A bound is convex: a half-space (`Plane`) or a body of revolution of second degree (`Quadric`). A
ray meets it in one stretch from `enter` to `leave`. What is inside all of some bounds (a `Cell` of
`tracer.solids`: a box, a cylinder, a lens) it meets from the last `enter` to the first `leave`
(T. Kay, J. Kajiya, SIGGRAPH 1986). What is composed of bounds in any other way (a `Compound`) it
enters and leaves at some of their crossings, which are looked through in turn (S. Roth, Ray casting
for modeling solids, 1982).

No ray is ever moved off the surface that it leaves. Instead it knows which face of which object
it has left and to which side, and that face then counts as crossed at exactly t = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracer.compiled import inlined, merged
from tracer.errors import SceneError
from tracer.vector import Vec, along, dot, normalise, scale, sub

Rows = NDArray[np.float64]
INF = math.inf
PLANE, QUADRIC = 0.0, 1.0
NUMBER = 1  # column of the number of the surface that a bound is
COLUMNS = 14  # of the table that all shapes are written to
# Of a compound's bounds: whether the solid is outside of it, and which of the compound's bounds
# decides next, for a point inside of it and for one outside; or that all is decided.
HOLLOW, IF_INSIDE, IF_OUTSIDE = 11, 12, 13
INSIDE, OUTSIDE = -1, -2


# --- what a scene is built of ---------------------------------------------------------------------


def require_positive(shape: object, **sizes: float) -> None:
    for name, size in sizes.items():
        if not 0.0 < size < INF:
            kind = shape if isinstance(shape, str) else type(shape).__name__.lower()
            raise SceneError(f"{kind}: {name} must be positive and finite, not {size}")


@dataclass(frozen=True)
class Sphere:
    center: Vec
    radius: float

    def __post_init__(self) -> None:
        require_positive(self, radius=self.radius)


@dataclass(frozen=True)
class Plane:
    """The half-space ``normal . p <= offset``; `normal` is unit and points outwards.

    As the shape of a surface it is the plane that ends it, whose front is where `normal` points.
    """

    normal: Vec
    offset: float

    def __post_init__(self) -> None:
        if not (abs(math.hypot(*self.normal) - 1.0) < 1e-9 and abs(self.offset) < INF):
            raise SceneError(
                "plane: needs a unit normal and a finite offset, "
                f"not {self.normal} and {self.offset}"
            )


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
class Rectangle:
    """Open face; `x`, `y`, `z` are orthonormal, `z` its front; `size` along x and y."""

    origin: Vec
    x: Vec
    y: Vec
    z: Vec
    size: tuple[float, float]

    def __post_init__(self) -> None:
        require_positive(self, width=self.size[0], height=self.size[1])


@dataclass(frozen=True)
class Disk:
    origin: Vec
    x: Vec
    y: Vec
    z: Vec
    radius: float

    def __post_init__(self) -> None:
        require_positive(self, radius=self.radius)


# --- rows of numbers ------------------------------------------------------------------------------


def bound_row(bound: Plane | Quadric, number: int) -> list[float]:
    """`number` is that of the surface that the bound is, negative on its other side."""
    if isinstance(bound, Plane):
        return [PLANE, number, *bound.normal, bound.offset]
    return [QUADRIC, number, *bound.origin, *bound.axis, bound.a, bound.b, bound.c]


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
    t = height / approach  # whatever that is along the plane: no branch, for LLVM to take several
    along_it = approach == 0.0
    enter = INF if along_it & (height < 0.0) else -INF
    return t if approach < 0.0 else enter, t if approach > 0.0 else -enter


@merged
def quadric_stretch(o: Vec, d: Vec, rows: Rows, row: int, on_it: bool) -> tuple[float, float]:
    """`on_it` says that `o` lies on the surface and `d` points inwards: one root is t = 0."""
    axis = vec_at(rows, row, 5)
    a, b, c = rows[row, 8], rows[row, 9], rows[row, 10]
    start = sub(o, vec_at(rows, row, 2))
    dz = dot(d, axis)
    shift = 0.0 if on_it else -dot(start, d)
    p = along(start, shift, d)
    z = dot(p, axis)
    # inside is where  qa t^2 + 2 qb t + qc <= 0
    qa = 1.0 - (1.0 + c) * dz * dz
    if c <= 0.0 and qa < 0.0:
        qa = 0.0  # along the axis, with a direction that is too long by rounding
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
def bound_stretch(o: Vec, d: Vec, rows: Rows, row: int, on_it: bool) -> tuple[float, float]:
    if rows[row, 0] != PLANE:
        return quadric_stretch(o, d, rows, row, on_it)
    if on_it:
        return 0.0, INF  # entered through it; a plane is not crossed twice
    return plane_stretch(o, d, vec_at(rows, row, 2), rows[row, 5])


@inlined
def cell_stretch(
    o: Vec, d: Vec, rows: Rows, first: int, count: int, leaving: float
) -> tuple[float, int, float, int]:
    """(enter, row entered through, leave, row left through) of what is inside `count` bounds.

    The ray starts on the surface of number `leaving` (0: on none), and points to the inside of the
    bounds that are this surface; to the outside if it is negative.
    """
    enter, row_in, leave, row_out = -INF, -1, INF, -1
    for row in range(first, first + count):
        number = rows[row, NUMBER]
        if leaving != 0.0 and number == -leaving:
            return INF, -1, -INF, -1  # a convex bound is not met again
        t0, t1 = bound_stretch(o, d, rows, row, number == leaving)
        if t0 > enter:
            enter, row_in = t0, row
        if t1 < leave:
            leave, row_out = t1, row
    return enter, row_in, leave, row_out


@merged
def compound_hit(
    o: Vec,
    d: Vec,
    rows: Rows,
    first: int,
    count: int,
    leaving: float,
    known_inside: bool,
    stretches: Rows,
) -> tuple[float, int, bool]:
    """(distance, row, entering) where a ray next enters or leaves a compound of `count` bounds.

    `leaving` as in `cell_stretch`; `known_inside` says that the ray starts in the solid,
    whatever rounding makes of it. `stretches` is scratch. Infinite distance where the solid is not
    met again.
    """
    for k in range(count):
        row = first + k
        number = rows[row, NUMBER]
        if leaving != 0.0 and number == -leaving:
            stretches[k, 0], stretches[k, 1] = -INF, 0.0
        else:
            t0, t1 = bound_stretch(o, d, rows, row, number == leaving)
            stretches[k, 0], stretches[k, 1] = t0, t1
    t, inside = 0.0, _inside_after(rows, first, stretches, 0.0)
    if known_inside and not inside:
        # Rounding puts the ray beyond a bound that it leaves by, or before one that it came by.
        t = _changes_at(rows, first, count, stretches, 0.0, False)
        behind, row = _left_behind(o, d, rows, first, count, stretches)
        if t >= behind:
            return 0.0, row, False
        inside = True
    t = _changes_at(rows, first, count, stretches, t, inside)
    if t == INF:
        return INF, -1, False
    return t, _crossed(rows, first, count, stretches, t, not inside), not inside


@inlined
def _changes_at(
    rows: Rows, first: int, count: int, stretches: Rows, t: float, inside: bool
) -> float:
    """Where beyond `t` a ray leaves the compound that it is inside of, or else enters it."""
    while True:
        crossing = INF
        for k in range(count):
            for end in range(2):
                if t < stretches[k, end] < crossing:
                    crossing = stretches[k, end]
        if crossing == INF or _inside_after(rows, first, stretches, crossing) != inside:
            return crossing
        t = crossing


@inlined
def _inside_after(rows: Rows, first: int, stretches: Rows, t: float) -> bool:
    """Whether a ray is inside the compound just beyond `t`.

    Bounds that are crossed at the same `t` are crossed together: no gap opens between two parts
    that share a face.
    """
    k = 0
    while k >= 0:
        inside = stretches[k, 0] <= t < stretches[k, 1]
        k = int(rows[first + k, IF_INSIDE if inside else IF_OUTSIDE])
    return k == INSIDE


@inlined
def _crossed(rows: Rows, first: int, count: int, stretches: Rows, t: float, entering: bool) -> int:
    """The row of a bound that is crossed at `t` in the same sense as the solid.

    There is one: the solid is composed of insides and outsides of bounds by "and" and "or" alone,
    so it cannot become true before one of them does.
    """
    for k in range(count):
        hollow = rows[first + k, HOLLOW] != 0.0
        if stretches[k, 0 if entering != hollow else 1] == t:
            return first + k
    return first


@inlined
def _left_behind(
    o: Vec, d: Vec, rows: Rows, first: int, count: int, stretches: Rows
) -> tuple[float, int]:
    """(how far behind, row) of the bound through which a ray has left the solid last.

    Along a plane there is no crossing; the ray is then beside it by less than rounding.
    """
    best, row = -INF, first
    for k in range(count):
        at = first + k
        t = stretches[k, 0 if rows[at, HOLLOW] != 0.0 else 1]
        if rows[at, 0] == PLANE and dot(vec_at(rows, at, 2), d) == 0.0:
            t = -abs(rows[at, 5] - dot(vec_at(rows, at, 2), o))
        if best < t <= 0.0:
            best, row = t, at
    return -best, row


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
        return vec_at(rows, row, 2)
    axis = vec_at(rows, row, 5)
    from_origin = sub(p, vec_at(rows, row, 2))
    z = dot(from_origin, axis)
    gradient = sub(from_origin, scale((1.0 + rows[row, 10]) * z + 0.5 * rows[row, 9], axis))
    if dot(gradient, gradient) == 0.0:  # the tip of a cone
        return -axis[0], -axis[1], -axis[2]
    return normalise(gradient)


@inlined
def face_coordinates(x: float, y: float, rows: Rows, row: int) -> tuple[float, float]:
    """Texture coordinates (u, v) in [0, 1], at `x`, `y` from a rectangle's or disk's centre."""
    u, v = 0.5 + 0.5 * x / rows[row, 12], 0.5 + 0.5 * y / rows[row, 13]
    return min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
