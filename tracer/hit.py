"""The nearest thing that a ray meets, and what the surface is like there."""

from __future__ import annotations

import numpy as np

from tracer.arrays import (
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
from tracer.compiled import inlined
from tracer.mesh import STACK, mesh_hit, smooth_normal, triangle_normal
from tracer.shapes import (
    HOLLOW,
    INF,
    bound_normal,
    cell_stretch,
    compound_hit,
    face_distance,
    sphere_normal,
    sphere_stretch,
    vec_at,
)
from tracer.vector import Vec, along, dot, scale, sub

NOTHING = -1


def new_stack(scene: Arrays) -> Floats:
    """Room for walking down meshes' trees and for the bounds of compounds; one per thread."""
    most = scene.objects[:, COUNT][scene.objects[:, SHAPE] == COMPOUND].max(initial=0)
    return np.empty((max(STACK, int(most)), 2))


@inlined
def nearest_hit(
    scene: Arrays,
    o: Vec,
    d: Vec,
    left: int,
    left_face: int,
    inward: bool,
    stack: Floats,
) -> tuple[int, int, float, bool]:
    """(object, face, distance, entering), object NOTHING and distance infinite if all is missed.

    The ray has just left face `left_face` of object `left`, heading to the inside of it if
    `inward`; or nothing, if `left` is NOTHING. `entering` says that the ray comes from outside
    the hit solid, or from the front of the hit face.
    """
    best, hit, hit_face, hit_entering = INF, NOTHING, -1, False
    for i in range(len(scene.objects)):
        kind = scene.objects[i, SHAPE]
        on_face = left_face if i == left else -1
        if kind == MESH:
            root, side = scene.objects[i, FIRST], -1 if inward else 1
            t, face, side = mesh_hit(
                o, d, scene.nodes, scene.links, scene.triangles, root, on_face, side, best, stack
            )
            entering = side > 0
        elif kind == COMPOUND:
            t, face, entering = _compound_hit(scene, i, o, d, on_face, inward, stack)
        elif on_face >= 0 and not (inward and kind <= CELL):
            continue  # nothing of a convex solid lies outwards; a face is not met twice
        elif kind == SPHERE:
            t, face, entering = _sphere_hit(scene, i, o, d, on_face)
        elif kind == CELL:
            t, face, entering = _cell_hit(scene, i, o, d, on_face)
        else:
            t, face, entering = _face_hit(scene, i, o, d, kind == DISK, best)
        if t < best:
            best, hit, hit_face, hit_entering = t, i, face, entering
    return hit, hit_face, best, hit_entering


# What a ray meets of one object: (distance, face, entering), infinite distance if it misses.
# Where on_face >= 0, it has just left that face of the object and heads inwards.


@inlined
def _sphere_hit(scene: Arrays, i: int, o: Vec, d: Vec, on_face: int) -> tuple[float, int, bool]:
    row = scene.objects[i, FIRST]
    center, radius = vec_at(scene.rows, row, 0), scene.rows[row, 3]
    if on_face >= 0:
        return max(0.0, -2.0 * dot(sub(o, center), d)), 0, False
    enter, leave = sphere_stretch(o, d, center, radius)
    if enter > 0.0:
        return enter, 0, True
    return (leave if leave > 0.0 else INF), 0, False


@inlined
def _far_from_ball(scene: Arrays, i: int, o: Vec, d: Vec) -> bool:
    """Whether the ray's line misses the sphere around object `i`."""
    to_center = sub(vec_at(scene.balls, i, 0), o)
    ahead = dot(to_center, d)
    return bool(dot(to_center, to_center) - ahead * ahead > scene.balls[i, 3])


@inlined
def _cell_hit(scene: Arrays, i: int, o: Vec, d: Vec, on_face: int) -> tuple[float, int, bool]:
    if on_face < 0 and _far_from_ball(scene, i, o, d):
        return INF, -1, False
    enter, face_in, leave, face_out = cell_stretch(
        o, d, scene.rows, scene.objects[i, FIRST], scene.objects[i, COUNT], on_face
    )
    if on_face >= 0:
        return leave, face_out, False
    if enter >= leave or leave <= 0.0:
        return INF, -1, False
    if enter > 0.0:
        return enter, face_in, True
    return leave, face_out, False


@inlined
def _compound_hit(
    scene: Arrays, i: int, o: Vec, d: Vec, on_face: int, inward: bool, stack: Floats
) -> tuple[float, int, bool]:
    if on_face < 0 and _far_from_ball(scene, i, o, d):
        return INF, -1, False
    first, count = scene.objects[i, FIRST], scene.objects[i, COUNT]
    return compound_hit(o, d, scene.rows, first, count, on_face, inward, stack)


@inlined
def _face_hit(
    scene: Arrays, i: int, o: Vec, d: Vec, is_disk: bool, best: float
) -> tuple[float, int, bool]:
    row = scene.objects[i, FIRST]
    entering = dot(d, vec_at(scene.rows, row, 9)) < 0.0
    return face_distance(o, d, scene.rows, row, is_disk, best), 0, entering


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
