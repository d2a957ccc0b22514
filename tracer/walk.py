"""The way of a ray down a tree of boxes, to the nearest triangle of a mesh."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracer.boxes import (
    SINGLE,
    WIDTH,
    Bytes,
    Ints,
    Sight,
    child_of,
    first_bit,
    limit_of,
    meets_boxes,
    prefetch,
    sight,
)
from tracer.compiled import called, inlined
from tracer.mesh import middle, rises, triangle_distance
from tracer.shapes import vec_at
from tracer.tree import HIGHEST, LEAF
from tracer.vector import Vec, along, sub

Floats = NDArray[np.float64]
Singles = NDArray[Any]  # in single precision

INF = np.inf
BOTTOM = WIDTH  # below in the stack are the keys of the boxes that are looked at
STACK = (BOTTOM + HIGHEST) // 2  # rows of two numbers, each as long as a key
LANES = 12
ROUNDING = 1e-15  # of a ray's origin, from where it has left a triangle
# Triangles that are nearer to each other than this part of their distance are met in one place: at
# their edge a ray that grazes meets them so much apart. Nothing in a scene is that small.
TIE = 1e-10


class Query(NamedTuple):
    """A ray, and which of a mesh's triangles it can hit."""

    o: Vec
    d: Vec
    sight: Sight
    slack: float  # how far rounding may have put the ray from where it has left a triangle
    on_face: int
    side: int


class Found(NamedTuple):
    t: float
    triangle: int
    side: int


@inlined
def _step(
    query: Query,
    nodes: Bytes,
    triangles: Floats,
    keys: Ints,
    height: int,
    found: Found,
) -> tuple[int, Found]:
    """Looks at what is on top of the stack; its new height, and what is found so far."""
    height -= 1
    node = child_of(keys[height])
    if node >= 0:
        met = meets_boxes(nodes, node, query.sight, limit_of(found.t), keys)
        return _push(met, keys, nodes, triangles, height), found
    leaf = -1 - node
    for triangle in range(leaf >> 3, (leaf >> 3) + (leaf & 7)):
        if triangle != query.on_face:
            t_max = found.t if query.on_face >= 0 else found.t * (1.0 + TIE)
            t, side = triangle_distance(
                query.o, query.d, triangles, triangle, query.side, query.slack, t_max
            )
            if side != 0 and _counts(query, triangles, found, t, triangle, side):
                found = Found(t, triangle, side)
    while height > BOTTOM and keys[height - 1] > limit_of(found.t):
        height -= 1
    return height, found


@inlined
def _counts(
    query: Query, triangles: Floats, found: Found, t: float, triangle: int, side: int
) -> bool:
    """Whether a hit is to be taken instead of the one that is `found` so far.

    At an edge a ray meets two triangles in one place, and only what their edge is like tells
    whether it crosses both, and which first. From outside, of two that meet in a convex edge the
    one that faces the ray is first; a ray that has left one of them outwards is past the other. Of
    a reflex edge the opposite holds.
    """
    if query.on_face >= 0:
        near = t < query.slack * (TIE / ROUNDING)
        return not near or side * rises(triangles, query.on_face, triangle) > 0.0
    if side * found.side >= 0 or t < found.t * (1.0 - TIE):
        return t < found.t
    return side * rises(triangles, found.triangle, triangle) < 0.0


@inlined
def _push(met: int, keys: Ints, nodes: Bytes, triangles: Floats, height: int) -> int:
    """Puts the children that are met on the stack, the nearest on top; the stack's height."""
    bottom = height
    while met != 0:
        key = keys[first_bit(met)]
        met &= met - 1
        _fetch(child_of(key), nodes, triangles)
        for at in range(bottom, height):
            other = keys[at]
            keys[at], key = max(other, key), min(other, key)
        keys[height] = key
        height += 1
    return height


@inlined
def _fetch(child: int, nodes: Bytes, triangles: Floats) -> None:
    """Rays wait for memory more than for anything else, so it is asked for at once."""
    if child >= 0:
        prefetch(nodes, child)
    else:
        first = (-1 - child) >> 3
        prefetch(triangles, first)
        prefetch(triangles, first + LEAF // 2)


@called
def mesh_hit(
    o: Vec,
    d: Vec,
    nodes: Bytes,
    triangles: Floats,
    root: int,
    on_face: int,
    side: int,
    t_max: float,
    stack: Floats,
) -> Found:
    """The nearest hit before `t_max`.

    A ray that has just left triangle `on_face` of this mesh (-1: has not) can only hit other
    triangles, and only from `side`. Those may begin where it stands, within rounding. If it is
    inside the mesh and finds no way out, rounding has put it past an edge of its triangle.
    """
    slack = 0.0
    if on_face < 0:
        side = 0
    else:
        slack = ROUNDING * (abs(o[0]) + abs(o[1]) + abs(o[2]))
    keys = stack.view(np.int64).reshape(-1)
    found = Found(t_max, -1, 0)
    for _ in range(2):
        query = Query(o, d, sight(o, d, nodes, root), slack, on_face, side)
        keys[BOTTOM], height = root, BOTTOM + 1
        while height > BOTTOM:
            height, found = _step(query, nodes, triangles, keys, height, found)
        if found.triangle >= 0 or side >= 0 or t_max < INF:
            break
        o = along(o, TIE, sub(middle(triangles, on_face), o))
    return found


# --- several rays ---------------------------------------------------------------------------------


class Lanes(NamedTuple):
    """Rays that take turns: while one waits for memory, the others go on."""

    keys: Ints  # (LANES, 2 STACK): a stack for each
    height: Ints  # (LANES,)
    ray: Ints  # (LANES,): which it is
    sight: Singles  # (LANES, 9)


def new_lanes() -> Lanes:
    return Lanes(
        np.empty((LANES, 2 * STACK), np.int64),
        np.empty(LANES, np.int64),
        np.empty(LANES, np.int64),
        np.empty((LANES, 9), SINGLE),
    )


@called
def mesh_hits(
    origins: Floats,
    directions: Floats,
    nodes: Bytes,
    triangles: Floats,
    root: int,
    found: Floats,
    lanes: Lanes,
) -> None:
    """Fills rows of `found` (n, 3) with the distance, triangle and side of rays' nearest hits."""
    following, under_way = 0, 0
    lanes.height[:] = BOTTOM
    while following < len(found) or under_way > 0:
        for lane in range(LANES):
            if lanes.height[lane] == BOTTOM:
                if following == len(found):
                    continue
                under_way += 1
                _begin(origins, directions, following, nodes, root, found, lanes, lane)
                following += 1
            i, of = lanes.ray[lane], lanes.sight
            seen = Sight(vec_at(of, lane, 0), vec_at(of, lane, 3), vec_at(of, lane, 6))
            query = Query(vec_at(origins, i, 0), vec_at(directions, i, 0), seen, 0.0, -1, 0)
            hit = Found(found[i, 0], int(found[i, 1]), int(found[i, 2]))
            height = lanes.height[lane]
            height, hit = _step(query, nodes, triangles, lanes.keys[lane], height, hit)
            found[i, 0], found[i, 1], found[i, 2] = hit.t, hit.triangle, hit.side
            lanes.height[lane] = height
            if height == BOTTOM:
                under_way -= 1


@inlined
def _begin(
    origins: Floats,
    directions: Floats,
    i: int,
    nodes: Bytes,
    root: int,
    found: Floats,
    lanes: Lanes,
    lane: int,
) -> None:
    seen = sight(vec_at(origins, i, 0), vec_at(directions, i, 0), nodes, root)
    for k in range(3):
        lanes.sight[lane, k], lanes.sight[lane, 3 + k] = seen.nearer[k], seen.farther[k]
        lanes.sight[lane, 6 + k] = seen.inverse[k]
    lanes.keys[lane, BOTTOM], lanes.height[lane], lanes.ray[lane] = root, BOTTOM + 1, i
    found[i, 0], found[i, 1], found[i, 2] = INF, -1.0, 0.0
