"""The nearest thing that a ray meets, and what the surface is like there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tracer.arrays import (
    AMBIENT,
    CELL,
    COMPOUND,
    COUNT,
    DISK,
    FIRST,
    MESH,
    NORMALS,
    SHAPE,
    SPHERE,
    Arrays,
    Floats,
)
from tracer.compiled import inlined, merged
from tracer.faces import face_hit, open_face
from tracer.mesh import smooth_normal, triangle_normal
from tracer.shapes import (
    HOLLOW,
    INF,
    NUMBER,
    bound_normal,
    cell_stretch,
    compound_hit,
    sphere_normal,
    sphere_stretch,
    vec_at,
)
from tracer.shared import OF_PLACES
from tracer.vector import Vec, along, dot, scale, sub
from tracer.walk import STACK, Lanes, mesh_hit, mesh_hits

NOTHING = -1
UNKNOWN = -1  # the medium of a ray that begins somewhere


def new_stack(scene: Arrays) -> Floats:
    """Room for walking down meshes' trees and for the bounds of compounds; one per thread."""
    most = scene.objects[:, COUNT][scene.objects[:, SHAPE] == COMPOUND].max(initial=0)
    return np.empty((max(STACK, int(most)), 2))


class Hit(NamedTuple):
    """What a ray meets next: at distance `t`, face `face` of object `object`.

    `object` is NOTHING and `t` infinite if all is missed. `entering` says that the ray comes from
    outside the solid, or from the front of the face. It came through `medium`; behind an interface
    is `beyond`, behind anything else the same medium.
    """

    object: int
    face: int
    t: float
    entering: bool
    medium: int
    beyond: int


@inlined
def nearest_hit(
    scene: Arrays,
    o: Vec,
    d: Vec,
    medium: int,
    left: int,
    left_face: int,
    inward: bool,
    known: Floats,
    stack: Floats,
) -> Hit:
    """The next hit of a ray through `medium`, which may be UNKNOWN if the ray just begins.

    The ray has just left face `left_face` of object `left`, heading to the inside of it if
    `inward`; or nothing, if `left` is NOTHING. `known` has the hits of all meshes (see
    `mesh_hits_ahead`), or is empty.

    Boundaries of solids where a solid of higher rank is on both sides are passed over. Where two of
    them are nearer to each other than rounding, each seems to lie before the other; a ray that
    makes no way there goes on beyond both.
    """
    travelled, waiting = 0.0, 0
    while True:
        hit = _next_hit(scene, o, d, medium, left, left_face, inward, known, stack)
        known = stack[:0]
        visible = hit.object == NOTHING or hit.object >= scene.solids or hit.beyond != hit.medium
        if visible:
            return Hit(
                hit.object, hit.face, travelled + hit.t, hit.entering, hit.medium, hit.beyond
            )
        rounding = _rounding(scene, hit.object)
        waiting = waiting + 1 if hit.t <= rounding else 0
        step = hit.t
        left, left_face, inward = hit.object, hit.face, hit.entering
        if waiting > len(scene.objects):
            waiting, step, left, left_face = 0, rounding, NOTHING, -1
        o, travelled, medium = along(o, step, d), travelled + step, hit.medium


@inlined
def _rounding(scene: Arrays, solid: int) -> float:
    """How far rounding may move where a ray meets a solid."""
    center = vec_at(scene.balls, solid, 0)
    return OF_PLACES * float(np.sqrt(dot(center, center)) + np.sqrt(scene.balls[solid, 3]))


@merged
def _next_hit(
    scene: Arrays,
    o: Vec,
    d: Vec,
    medium: int,
    left: int,
    left_face: int,
    inward: bool,
    known: Floats,
    stack: Floats,
) -> Hit:
    """As `nearest_hit`, but all boundaries of solids count.

    A solid that the ray leaves next is one that it is in. So the same walk over all solids, in the
    order of their rank, also finds the first that it is in before the hit, and behind it.
    """
    best, hit, face, entering = INF, NOTHING, -1, False
    before, beyond, mesh = AMBIENT, AMBIENT, 0
    leaving = surface_left(scene, left, left_face, inward)
    for i in range(len(scene.objects)):
        on_face = left_face if i == left else -1
        t_max = INF if i < scene.solids else best
        if len(known) > 0 and scene.objects[i, SHAPE] == MESH:
            t, i_face, enters = known[mesh, 0], int(known[mesh, 1]), known[mesh, 2] > 0.0
            mesh += 1
        else:
            t, i_face, enters = object_hit(scene, i, o, d, on_face, inward, leaving, t_max, stack)
        if i < scene.solids:
            before, beyond = ranked(before, beyond, best, i, t, enters)
        if t < best:
            best, hit, face, entering = t, i, i_face, enters
    if medium == UNKNOWN:
        medium = before
    if hit >= scene.solids:
        beyond = medium
    return Hit(hit, face, best, entering, medium, beyond)


@inlined
def ranked(
    before: int, beyond: int, best: float, i: int, t: float, enters: bool
) -> tuple[int, int]:
    """(before, beyond) the nearest hit so far, at `best`, once solid `i` is met at `t`."""
    if t == INF:
        return before, beyond
    if t < best:
        beyond = 1 + i if before == AMBIENT and enters else before
    elif beyond == AMBIENT and enters == (t == best):
        beyond = 1 + i
    return 1 + i if before == AMBIENT and not enters else before, beyond


@inlined
def surface_left(scene: Arrays, left: int, left_face: int, inward: bool) -> float:
    """The number of the surface that a ray has left, which solids may share.

    Positive if it points to the inside of that surface; 0 where no other solid has it.
    """
    if left == NOTHING:
        return 0.0
    kind = scene.objects[left, SHAPE]
    if kind != CELL and kind != COMPOUND:
        return 0.0
    number = float(scene.rows[left_face, NUMBER])
    return number if inward == (scene.rows[left_face, HOLLOW] == 0.0) else -number


@inlined
def object_hit(
    scene: Arrays,
    i: int,
    o: Vec,
    d: Vec,
    on_face: int,
    inward: bool,
    leaving: float,
    t_max: float,
    stack: Floats,
) -> tuple[float, int, bool]:
    """What the ray meets of object `i`, whose face `on_face` it has just left (-1: none of it).

    Nothing beyond `t_max` is needed.
    """
    kind = scene.objects[i, SHAPE]
    if kind == MESH:
        return _mesh_hit(scene, i, o, d, on_face, inward, t_max, stack)
    if kind == COMPOUND:
        return _compound_hit(scene, i, o, d, leaving, on_face >= 0 and inward, stack)
    if on_face >= 0 and not (inward and kind <= CELL):
        return INF, -1, False  # nothing of a convex solid lies outwards; a face is not met twice
    if kind == SPHERE:
        row = scene.objects[i, FIRST]
        t, entering = sphere_hit(o, d, vec_at(scene.rows, row, 0), scene.rows[row, 3], on_face >= 0)
        return t, row, entering
    if kind == CELL:
        return _cell_hit(scene, i, o, d, leaving, on_face >= 0)
    face = open_face(scene.rows, scene.objects[i, FIRST])
    t, _, _ = face_hit(o, d, face, kind == DISK, t_max)
    return t, 0, dot(d, face.z) < 0.0


# What a ray meets of one object: (distance, face, entering), infinite distance if it misses.


@inlined
def _mesh_hit(
    scene: Arrays, i: int, o: Vec, d: Vec, on_face: int, inward: bool, t_max: float, stack: Floats
) -> tuple[float, int, bool]:
    root, side = scene.objects[i, FIRST], -1 if inward else 1
    t, face, side = mesh_hit(o, d, scene.nodes, scene.triangles, root, on_face, side, t_max, stack)
    return (t if face >= 0 else INF), face, side > 0


@merged
def mesh_hits_ahead(
    scene: Arrays, origins: Floats, directions: Floats, found: Floats, lanes: Lanes
) -> None:
    """What rays that begin meet of each mesh: `found` (n, meshes, 3), see `walk.mesh_hits`."""
    mesh = 0
    for i in range(len(scene.objects)):
        if scene.objects[i, SHAPE] == MESH:
            root = scene.objects[i, FIRST]
            mesh_hits(
                origins, directions, scene.nodes, scene.triangles, root, found[:, mesh], lanes
            )
            mesh += 1


@inlined
def sphere_hit(o: Vec, d: Vec, center: Vec, radius: float, inwards: bool) -> tuple[float, bool]:
    """(distance, entering). `inwards`: the ray has just left the surface, heading into the ball."""
    if inwards:
        return max(0.0, -2.0 * dot(sub(o, center), d)), False
    enter, leave = sphere_stretch(o, d, center, radius)
    if enter > 0.0:
        return enter, True
    return (leave if leave > 0.0 else INF), False


@inlined
def far_from_ball(o: Vec, d: Vec, center: Vec, radius_squared: float) -> bool:
    """Whether the ray's line misses a sphere."""
    from_center = sub(o, center)
    h = along(from_center, -dot(from_center, d), d)
    return bool(dot(h, h) > radius_squared)


@inlined
def _misses_ball(scene: Arrays, i: int, o: Vec, d: Vec) -> bool:
    return far_from_ball(o, d, vec_at(scene.balls, i, 0), scene.balls[i, 3])


@inlined
def _cell_hit(
    scene: Arrays, i: int, o: Vec, d: Vec, leaving: float, inwards: bool
) -> tuple[float, int, bool]:
    """`inwards`: the ray has just left one of the cell's faces, heading into it."""
    if not inwards and _misses_ball(scene, i, o, d):
        return INF, -1, False
    first, count = scene.objects[i, FIRST], scene.objects[i, COUNT]
    enter, face_in, leave, face_out = cell_stretch(o, d, scene.rows, first, count, leaving)
    if inwards:  # rounding may put the exit behind the ray
        return max(leave, 0.0), face_out, False
    if enter >= leave or leave <= 0.0:
        return INF, -1, False
    if enter > 0.0:
        return enter, face_in, True
    return leave, face_out, False


@inlined
def _compound_hit(
    scene: Arrays, i: int, o: Vec, d: Vec, leaving: float, known_inside: bool, stack: Floats
) -> tuple[float, int, bool]:
    if _misses_ball(scene, i, o, d):
        return INF, -1, False
    first, count = scene.objects[i, FIRST], scene.objects[i, COUNT]
    return compound_hit(o, d, scene.rows, first, count, leaving, known_inside, stack)


@inlined
def hit_point(
    scene: Arrays, o: Vec, t: float, d: Vec, hit: int, face: int, entering: bool
) -> tuple[Vec, Vec, Vec]:
    """(point, shading normal, geometric normal), unit, on the side that the ray comes from."""
    kind, first = scene.objects[hit, SHAPE], scene.objects[hit, FIRST]
    p = along(o, t, d)
    if kind == SPHERE:
        center = vec_at(scene.rows, first, 0)
        n = sphere_normal(p, center, scene.rows[first, 3])
        p = along(center, scene.rows[first, 3], n)  # back onto the sphere, to the last bit
    elif kind == CELL:
        n = bound_normal(p, scene.rows, face)
    elif kind == COMPOUND:
        n = bound_normal(p, scene.rows, face)
        if scene.rows[face, HOLLOW] != 0.0:
            n = scale(-1.0, n)
    elif kind == MESH:
        n = triangle_normal(scene.triangles, face)
    else:
        n = vec_at(scene.rows, first, 9)
    side = 1.0 if entering else -1.0
    facing = scale(side, n)
    row = scene.objects[hit, NORMALS]
    if kind != MESH or row < 0:
        return p, facing, facing
    row += face - scene.objects[hit, COUNT]
    smooth = smooth_normal(p, scene.triangles, face, scene.normals, row)
    return p, scale(side, smooth), facing
