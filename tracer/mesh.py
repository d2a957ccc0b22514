"""Solids made of triangles, and the tree of boxes that finds the triangle a ray meets.

"Models must be complete: no holes! All faces (triangles) must be tagged to a solid." A mesh that
bounds a medium is refused unless every edge joins exactly two triangles that agree on outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracer.compiled import compiled
from tracer.errors import SceneError
from tracer.vector import Vec, add, cross, dot, normalise, scale, sub

Floats = NDArray[np.float64]
Boxes = NDArray[np.float32]
Ints = NDArray[np.int32]

LEAF = 4  # triangles at most in a leaf
BINS = 16
DEEP = 48  # below this level ranges are halved, which bounds the tree's height
STACK = 96  # > DEEP + log2 of any number of triangles that fits in memory


@dataclass(frozen=True, eq=False)
class Mesh:
    """`vertices` (V, 3), `triangles` (T, 3) counter-clockwise from outside.

    With unit `normals` (V, 3) rays refract at the interpolated normal, without at the triangle's.
    """

    vertices: Floats
    triangles: NDArray[np.int64]
    normals: Floats | None = None

    def __post_init__(self) -> None:
        count = len(self.vertices)
        if len(self.triangles) == 0:
            raise SceneError("a mesh needs triangles")
        if self.triangles.min() < 0 or self.triangles.max() >= count:
            raise SceneError(f"a mesh of {count} vertices has indices outside 0..{count - 1}")
        if not np.isfinite(self.vertices).all():
            raise SceneError("a mesh has vertices that are not finite")
        if self.normals is not None and len(self.normals) != count:
            raise SceneError(f"{count} vertices need {count} normals, not {len(self.normals)}")


def edge_defects(mesh: Mesh) -> list[tuple[int, int, str]]:
    """All (vertex, vertex, what is wrong) that keep a mesh from being closed and oriented."""
    t = mesh.triangles.astype(np.int64)
    a, b = t.ravel(), np.roll(t, -1, axis=1).ravel()
    count = len(mesh.vertices)
    edges, times = np.unique(a * count + b, return_counts=True)
    reverse = edges % count * count + edges // count
    at = np.minimum(np.searchsorted(edges, reverse), len(edges) - 1)
    opposite = np.where(edges[at] == reverse, times[at], 0)
    defects = []
    for k in np.nonzero((times != 1) | (opposite != 1))[0].tolist():
        around = int(times[k] + opposite[k])
        what = {1: "borders a hole", 2: "joins faces that disagree on outside"}.get(
            around, f"joins {around} faces"
        )
        defects.append((int(edges[k] // count), int(edges[k] % count), what))
    return defects


def require_closed(mesh: Mesh, name: str) -> None:
    """Raises SceneError naming the first offending edges, or a mesh that is inside out."""
    defects = edge_defects(mesh)
    if defects:
        some = "; ".join(f"edge {a}-{b} {what}" for a, b, what in defects[:5])
        raise SceneError(f"{name}: not a closed solid, {len(defects)} bad edges: {some}")
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    if float(np.einsum("ij,ij->", a, np.cross(b, c))) <= 0.0:
        raise SceneError(f"{name}: triangles must be counter-clockwise from outside")


# --- building the tree ----------------------------------------------------------------------------
# A node holds the boxes of its two children, in float32 and rounded outwards, and where they are:
# another node, or as -1 - (8 first + count) a leaf.


@compiled
def _grow(boxes: Floats, order: Ints, begin: int, end: int, box: Floats) -> None:
    """The box around triangles order[begin:end], into box[0:6]."""
    box[0:3] = np.inf
    box[3:6] = -np.inf
    for i in range(begin, end):
        for k in range(3):
            box[k] = min(box[k], boxes[order[i], k])
            box[3 + k] = max(box[3 + k], boxes[order[i], 3 + k])


@compiled
def _half_area(box: Floats) -> float:
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x if x >= 0.0 else 0.0


@compiled
def _split(
    boxes: Floats, order: Ints, begin: int, end: int, bins: Floats, counts: Ints, halve: bool
) -> int:
    """Sorts order[begin:end] into two parts of least surface area cost; where the second starts.

    I. Wald, On fast construction of SAH-based bounding volume hierarchies, 2007.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(begin, end):
        for k in range(3):
            middle = boxes[order[i], k] + boxes[order[i], 3 + k]
            low[k] = min(low[k], middle)
            high[k] = max(high[k], middle)
    axis = int(np.argmax(high - low))
    extent = high[axis] - low[axis]
    if halve or not extent > 0.0:
        return (begin + end) // 2

    to_bin = BINS * (1.0 - 1e-9) / extent
    counts[:] = 0
    bins[:, 0:3] = np.inf
    bins[:, 3:6] = -np.inf
    for i in range(begin, end):
        t = order[i]
        bin_ = int((boxes[t, axis] + boxes[t, 3 + axis] - low[axis]) * to_bin)
        counts[bin_] += 1
        for k in range(3):
            bins[bin_, k] = min(bins[bin_, k], boxes[t, k])
            bins[bin_, 3 + k] = max(bins[bin_, 3 + k], boxes[t, 3 + k])

    cost = np.zeros(BINS)
    for backwards in range(2):
        around = np.array([np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf])
        n = 0
        for step in range(BINS - 1):
            bin_ = BINS - 1 - step if backwards else step
            n += counts[bin_]
            for k in range(3):
                around[k] = min(around[k], bins[bin_, k])
                around[3 + k] = max(around[3 + k], bins[bin_, 3 + k])
            cost[bin_ if backwards else bin_ + 1] += n * _half_area(around)
    best = 1 + int(np.argmin(cost[1:]))

    i, j = begin, end - 1
    while i <= j:
        t = order[i]
        if int((boxes[t, axis] + boxes[t, 3 + axis] - low[axis]) * to_bin) < best:
            i += 1
        else:
            order[i], order[j] = order[j], t
            j -= 1
    return i if begin < i < end else (begin + end) // 2


@compiled
def build_tree(boxes: Floats) -> tuple[Ints, Floats, Ints]:
    """(order, node boxes (N, 12), children (N, 2)) over triangles with bounding `boxes` (T, 6)."""
    total = len(boxes)
    order = np.arange(total).astype(np.int32)
    node_boxes = np.empty((max(total, 1), 12))
    children = np.empty((max(total, 1), 2), np.int32)
    tasks = np.empty((2 * STACK, 4), np.int64)  # node, begin, end, level
    bins, counts = np.empty((BINS, 6)), np.empty(BINS, np.int32)
    nodes, waiting = 1, 1
    tasks[0] = 0, 0, total, 0
    while waiting:
        waiting -= 1
        node, begin, end, level = tasks[waiting]
        middle = (
            end if total <= LEAF else _split(boxes, order, begin, end, bins, counts, level >= DEEP)
        )
        for side in range(2):
            first, last = (begin, middle) if side == 0 else (middle, end)
            _grow(boxes, order, first, last, node_boxes[node, 6 * side : 6 * side + 6])
            if last - first <= LEAF:
                children[node, side] = -1 - (8 * first + (last - first))
                continue
            children[node, side] = nodes
            tasks[waiting] = nodes, first, last, level + 1
            nodes += 1
            waiting += 1
    return order, node_boxes[:nodes], children[:nodes]


@dataclass(frozen=True, eq=False)
class Tree:
    """What the kernels read: triangles in the order of the tree's leaves."""

    boxes: Boxes  # (N, 12)
    children: Ints  # (N, 2)
    triangles: Floats  # (T, 9): three vertices each
    normals: Floats  # (T, 9) or (0, 9)


def grow_tree(mesh: Mesh) -> Tree:
    corners = mesh.vertices[mesh.triangles]
    bounds = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1)
    order, boxes, children = build_tree(np.ascontiguousarray(bounds))
    rounded = boxes.astype(np.float32)
    outwards = np.repeat(np.array([-np.inf, np.inf] * 2, np.float32), 3)
    normals = np.empty((0, 9))
    if mesh.normals is not None:
        normals = mesh.normals[mesh.triangles[order]].reshape(-1, 9)
    return Tree(np.nextafter(rounded, outwards), children, corners[order].reshape(-1, 9), normals)


# --- tracing --------------------------------------------------------------------------------------


@compiled
def corner(table: Floats, triangle: int, k: int) -> Vec:
    return table[triangle, 3 * k], table[triangle, 3 * k + 1], table[triangle, 3 * k + 2]


@compiled
def triangle_distance(o: Vec, d: Vec, triangles: Floats, triangle: int) -> tuple[float, int]:
    """(distance, side): side +1 where the ray comes from outside, -1 from inside, 0 if missed.

    Watertight: the three edge functions are triple products that change nothing but their sign
    when an edge is taken the other way round, so no ray slips between two neighbours.
    """
    a = sub(corner(triangles, triangle, 0), o)
    b = sub(corner(triangles, triangle, 1), o)
    c = sub(corner(triangles, triangle, 2), o)
    u, v, w = dot(d, cross(c, b)), dot(d, cross(a, c)), dot(d, cross(b, a))
    outside = u >= 0.0 and v >= 0.0 and w >= 0.0
    inside = u <= 0.0 and v <= 0.0 and w <= 0.0
    if outside == inside:  # missed, or seen edge-on
        return np.inf, 0
    n = cross(sub(b, a), sub(c, a))
    return dot(n, a) / dot(n, d), 1 if outside else -1


@compiled
def _box_distance(o: Vec, inverse: Vec, boxes: Boxes, node: int, at: int, t_max: float) -> float:
    """Where the ray enters a child's box, infinite where it misses. NaN (0/0) is passed over."""
    enter, leave = 0.0, t_max
    for k in range(3):
        near = (boxes[node, at + k] - o[k]) * inverse[k]
        far = (boxes[node, at + 3 + k] - o[k]) * inverse[k]
        if near > far:
            near, far = far, near
        enter = max(enter, near) if near == near else enter
        leave = min(leave, far) if far == far else leave
    return enter if enter <= leave else np.inf


@compiled
def mesh_hit(
    o: Vec,
    d: Vec,
    boxes: Boxes,
    children: Ints,
    triangles: Floats,
    root: int,
    on_face: int,
    side: int,
    t_max: float,
    stack: Floats,
) -> tuple[float, int, int]:
    """(distance, triangle, side) of the nearest hit before `t_max`; triangle -1 if there is none.

    A ray that has just left triangle `on_face` of this mesh (-1: has not) can only hit other
    triangles, and only from `side`. Those may begin where it stands, within rounding.
    """
    best, hit, hit_side = t_max, -1, 0
    t_min = 0.0 if on_face < 0 else -1e-15 * (abs(o[0]) + abs(o[1]) + abs(o[2]))
    inverse = (1.0 / d[0], 1.0 / d[1], 1.0 / d[2])
    height, node = 0, root
    while True:
        if node >= 0:
            t0 = _box_distance(o, inverse, boxes, node, 0, best)
            t1 = _box_distance(o, inverse, boxes, node, 6, best)
            near, far = children[node, 0], children[node, 1]
            if t1 < t0:
                t0, t1 = t1, t0
                near, far = far, near
            if t1 < np.inf:
                stack[height, 0], stack[height, 1] = t1, far
                height += 1
            if t0 < np.inf:
                node = near
                continue
        else:
            leaf = -1 - node
            for triangle in range(leaf // 8, leaf // 8 + leaf % 8):
                if triangle == on_face:
                    continue
                t, from_side = triangle_distance(o, d, triangles, triangle)
                if from_side == 0 or (on_face >= 0 and from_side != side):
                    continue
                if t < best and (t > 0.0 or (on_face >= 0 and t >= t_min)):
                    best, hit, hit_side = max(t, 0.0), triangle, from_side
        while height > 0 and stack[height - 1, 0] > best:
            height -= 1
        if height == 0:
            return best, hit, hit_side
        height -= 1
        node = int(stack[height, 1])


@compiled
def triangle_normal(triangles: Floats, triangle: int) -> Vec:
    a = corner(triangles, triangle, 0)
    ab, ac = sub(corner(triangles, triangle, 1), a), sub(corner(triangles, triangle, 2), a)
    return normalise(cross(ab, ac))


@compiled
def smooth_normal(p: Vec, triangles: Floats, triangle: int, normals: Floats, row: int) -> Vec:
    """The normals of the corners, weighted by the barycentric coordinates of `p`."""
    a, b, c = (
        corner(triangles, triangle, 0),
        corner(triangles, triangle, 1),
        corner(triangles, triangle, 2),
    )
    n = cross(sub(b, a), sub(c, a))
    weight_a = dot(n, cross(sub(b, p), sub(c, p)))
    weight_b = dot(n, cross(sub(c, p), sub(a, p)))
    weight_c = dot(n, cross(sub(a, p), sub(b, p)))
    mean = add(
        scale(weight_a, corner(normals, row, 0)),
        add(scale(weight_b, corner(normals, row, 1)), scale(weight_c, corner(normals, row, 2))),
    )
    return normalise(mean)
