"""Solids made of triangles, and the tree of boxes that finds the triangle a ray meets.

"Models must be complete: no holes! All faces (triangles) must be tagged to a solid." A mesh that
bounds a medium is refused unless every edge joins exactly two triangles that agree on outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracer.compiled import called, compiled, inlined
from tracer.errors import SceneError
from tracer.vector import Vec, add, cross, dot, normalise, scale, sub

Floats = NDArray[np.float64]
Boxes = NDArray[np.float32]
Ints = NDArray[np.int64]
Ints32 = NDArray[np.int32]
Indices = tuple[int, int, int]

INF = np.inf
LEAF = 4  # triangles at most in a leaf
BINS = 16
DEEP = 48  # below this level ranges are halved, which bounds the tree's height
EMPTY_LEAF = -1
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
# A node is 16 words of 4 bytes, one line of cache: the boxes of its two children in float32,
# rounded outwards (least x, y, z, most x, y, z each), and as integers in columns LEFT and RIGHT
# where they are: the row of another node, or as -1 - (8 first + count) a leaf's triangles.

LEFT, RIGHT, WORDS = 12, 13, 16


@inlined
def _clear(box: Floats) -> None:
    for k in range(3):
        box[k], box[3 + k] = INF, -INF


@inlined
def _include(box: Floats, other: Floats) -> None:
    for k in range(3):
        if other[k] < box[k]:
            box[k] = other[k]
        if other[3 + k] > box[3 + k]:
            box[3 + k] = other[3 + k]


@inlined
def _half_area(box: Floats) -> float:
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x if x >= 0.0 else 0.0


@inlined
def _middle(boxes: Floats, triangle: int, axis: int) -> float:
    """Twice the middle of its box, to be exact."""
    return float(boxes[triangle, axis] + boxes[triangle, 3 + axis])


@called
def _split(boxes: Floats, order: Ints, begin: int, end: int, bins: Floats, halve: bool) -> int:
    """Sorts order[begin:end] into two parts of least surface area cost; where the second starts.

    I. Wald, On fast construction of SAH-based bounding volume hierarchies, 2007.
    """
    axis, low, extent = 0, 0.0, 0.0
    for k in range(3):
        least, most = INF, -INF
        for i in range(begin, end):
            middle = _middle(boxes, order[i], k)
            least, most = min(least, middle), max(most, middle)
        if most - least > extent:
            axis, low, extent = k, least, most - least
    if halve or extent == 0.0:
        return (begin + end) // 2

    to_bin = BINS * (1.0 - 1e-9) / extent
    for k in range(BINS):
        _clear(bins[k])
        bins[k, 6] = 0.0
    for i in range(begin, end):
        k = int((_middle(boxes, order[i], axis) - low) * to_bin)
        bins[k, 6] += 1.0
        _include(bins[k], boxes[order[i]])
    best = _cheapest(bins)

    i, j = begin, end - 1
    while i <= j:
        triangle = order[i]
        if int((_middle(boxes, triangle, axis) - low) * to_bin) < best:
            i += 1
        else:
            order[i], order[j] = order[j], triangle
            j -= 1
    return i


@called
def _cheapest(bins: Floats) -> int:
    """The bin before which to split. Columns of `bins`: box, count, cost; one row is scratch."""
    around = bins[BINS]
    for backwards in range(2):
        _clear(around)
        n = 0.0
        for step in range(1, BINS):
            k = BINS - step if backwards else step - 1
            n += bins[k, 6]
            _include(around, bins[k])
            cost = n * _half_area(around)
            if backwards:
                bins[k, 7] += cost
            else:
                bins[k + 1, 7] = cost
    best = 1
    for k in range(2, BINS):
        if bins[k, 7] < bins[best, 7]:
            best = k
    return best


@compiled
def _build(boxes: Floats, order: Ints, nodes: Floats, tasks: Ints, bins: Floats) -> int:
    """Sorts triangles with bounding `boxes` (T, 6) into a tree; the number of its nodes.

    Fills `order` (T,) and the first `nodes` (T, 16), not yet packed. The rest is scratch: `tasks`
    (2 STACK, 4) and `bins` (BINS + 1, 8).
    """
    total = len(boxes)
    for i in range(total):
        order[i] = i
    count, waiting = 1, 1
    tasks[0, 0], tasks[0, 1], tasks[0, 2], tasks[0, 3] = 0, 0, total, 0
    while waiting > 0:
        waiting -= 1
        node, begin = tasks[waiting, 0], tasks[waiting, 1]
        end, level = tasks[waiting, 2], tasks[waiting, 3]
        middle = end
        if total > LEAF:
            middle = _split(boxes, order, begin, end, bins, level >= DEEP)
        for side in range(2):
            first, last = (begin, middle) if side == 0 else (middle, end)
            box = nodes[node, 6 * side : 6 * side + 6]
            _clear(box)
            for i in range(first, last):
                _include(box, boxes[order[i]])
            if last - first <= LEAF:
                nodes[node, LEFT + side] = -1 - (8 * first + (last - first))
                continue
            nodes[node, LEFT + side] = count
            tasks[waiting, 0], tasks[waiting, 1] = count, first
            tasks[waiting, 2], tasks[waiting, 3] = last, level + 1
            count += 1
            waiting += 1
    return count


@dataclass(frozen=True, eq=False)
class Tree:
    """What the kernels read: nodes, and triangles in the order of the tree's leaves."""

    nodes: NDArray[np.float32]  # (N, 16)
    triangles: Floats  # (T, 9): three vertices each
    normals: Floats  # (T, 9) or (0, 9)

    @property
    def links(self) -> NDArray[np.int32]:
        """The same memory as `nodes`, read as integers."""
        return self.nodes.view(np.int32)


def grow_tree(mesh: Mesh) -> Tree:
    """A tree over the triangles of a mesh, in about a microsecond per triangle."""
    corners = mesh.vertices[mesh.triangles]
    boxes = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1)
    total = len(boxes)
    order, nodes = np.empty(total, np.int64), np.empty((total, WORDS))
    count = _build(boxes, order, nodes, np.empty((2 * STACK, 4), np.int64), np.empty((BINS + 1, 8)))
    packed = np.zeros((count, WORDS), np.float32)
    outwards = np.repeat(np.array([-INF, INF, -INF, INF], np.float32), 3)
    packed[:, :LEFT] = np.nextafter(nodes[:count, :LEFT].astype(np.float32), outwards)
    packed.view(np.int32)[:, LEFT : RIGHT + 1] = nodes[:count, LEFT : RIGHT + 1]
    normals = np.empty((0, 9))
    if mesh.normals is not None:
        normals = mesh.normals[mesh.triangles[order]].reshape(-1, 9)
    return Tree(packed, corners[order].reshape(-1, 9), normals)


# --- tracing --------------------------------------------------------------------------------------


@inlined
def corner(table: Floats, triangle: int, k: int) -> Vec:
    return table[triangle, 3 * k], table[triangle, 3 * k + 1], table[triangle, 3 * k + 2]


@inlined
def triangle_distance(
    o: Vec, d: Vec, triangles: Floats, triangle: int, side: int, t_min: float, t_max: float
) -> tuple[float, int]:
    """(distance, side): side +1 where the ray comes from outside, -1 from inside, 0 if missed.

    Only hits from `side` count, unless it is 0, and only those between `t_min` and `t_max`; most
    triangles fail one of these before anything is divided. Watertight: the three edge functions
    are triple products that change nothing but their sign when an edge is taken the other way
    round, so no ray slips between two neighbours.
    """
    a = sub(corner(triangles, triangle, 0), o)
    b = sub(corner(triangles, triangle, 1), o)
    c = sub(corner(triangles, triangle, 2), o)
    n = cross(sub(b, a), sub(c, a))
    height, approach = dot(n, a), dot(n, d)
    from_side = -1
    if approach < 0.0:
        height, approach, from_side = -height, -approach, 1
    if side == -from_side or not t_min * approach < height < t_max * approach:
        return INF, 0
    u, v, w = dot(d, cross(c, b)), dot(d, cross(a, c)), dot(d, cross(b, a))
    if min(u, v, w) < 0.0 < max(u, v, w):
        return INF, 0
    return max(0.0, height / approach), from_side


@inlined
def _box_distance(
    o: Vec, inverse: Vec, near: Indices, far: Indices, nodes: Boxes, node: int, at: int, best: float
) -> float:
    """Where the ray enters the box at column `at` of a node; infinite where it does not.

    `near` and `far` tell which of its six faces the ray meets first and last along each axis. A
    face in whose plane the ray lies gives 0/0, NaN, which loses both comparisons.
    """
    enter, leave = 0.0, best
    for k in range(3):
        first = (nodes[node, at + near[k]] - o[k]) * inverse[k]
        last = (nodes[node, at + far[k]] - o[k]) * inverse[k]
        if first > enter:
            enter = first
        if last < leave:
            leave = last
    return enter if enter <= leave else INF


@called
def mesh_hit(
    o: Vec,
    d: Vec,
    nodes: Boxes,
    links: Ints32,
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
    t_min = 0.0
    if on_face < 0:
        side = 0
    else:
        t_min = -1e-15 * (abs(o[0]) + abs(o[1]) + abs(o[2]))
    inverse = (1.0 / d[0], 1.0 / d[1], 1.0 / d[2])
    near = (0 if d[0] >= 0.0 else 3, 1 if d[1] >= 0.0 else 4, 2 if d[2] >= 0.0 else 5)
    far = (3 - near[0], 5 - near[1], 7 - near[2])
    height, node = 0, root
    while True:
        while node >= 0:
            t0 = _box_distance(o, inverse, near, far, nodes, node, 0, best)
            t1 = _box_distance(o, inverse, near, far, nodes, node, 6, best)
            first, second = links[node, LEFT], links[node, RIGHT]
            if t1 < t0:
                t0, t1, first, second = t1, t0, second, first
            if t1 < INF:
                stack[height, 0], stack[height, 1] = t1, second
                height += 1
            node = first if t0 < INF else EMPTY_LEAF
        leaf = -1 - node
        for triangle in range(leaf >> 3, (leaf >> 3) + (leaf & 7)):
            if triangle != on_face:
                t, from_side = triangle_distance(o, d, triangles, triangle, side, t_min, best)
                if from_side != 0:
                    best, hit, hit_side = t, triangle, from_side
        while height > 0 and stack[height - 1, 0] > best:
            height -= 1
        if height == 0:
            return best, hit, hit_side
        height -= 1
        node = int(stack[height, 1])


@inlined
def triangle_normal(triangles: Floats, triangle: int) -> Vec:
    a = corner(triangles, triangle, 0)
    ab, ac = sub(corner(triangles, triangle, 1), a), sub(corner(triangles, triangle, 2), a)
    return normalise(cross(ab, ac))


@called
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
