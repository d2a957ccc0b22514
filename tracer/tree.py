"""The tree of boxes that finds the triangle a ray meets: halved again and again, then folded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracer.boxes import (
    CENTER,
    CORNER,
    LEAST,
    LINK,
    MOST,
    NODE,
    REACH,
    SCALE,
    SINGLE,
    STEPS,
    WIDTH,
    Bytes,
)
from tracer.compiled import compiled, inlined, merged
from tracer.shapes import vec_at
from tracer.vector import Vec

Floats = NDArray[np.float64]
Singles = NDArray[Any]  # in single precision
Ints = NDArray[np.int64]
Ints32 = NDArray[np.int32]

INF = SINGLE(np.inf)
LEAF = 4  # triangles at most in a leaf
BINS = 16
DEEP = 48  # below this level ranges are halved, which bounds the tree's height
# What can wait on the way down to one of 2^32 triangles.
HIGHEST = (WIDTH - 1) * (DEEP + 32)
# To look at a node's boxes costs 1; these are what it costs to fetch a leaf, and per triangle.
LEAF_COST, TRIANGLE_COST = SINGLE(0.2), SINGLE(0.2)
EMPTY = -1  # a leaf of no triangles
FIRST, COUNT, LEFT = range(3)


class Halves(NamedTuple):
    """A tree of T - 1 nodes over T triangles that are in order, each node before its halves.

    The first half of node k is node k + 1, the second is as many nodes behind k as the first has
    triangles. A half of one triangle is no node.
    """

    ranges: Ints32  # (T - 1, 3): FIRST triangle, COUNT, and how many are in the LEFT half
    boxes: Singles  # (T - 1, 6): least x, y, z, most x, y, z
    triangles: Singles  # (T, 6): their boxes


@dataclass(frozen=True, eq=False)
class Tree:
    """What the kernels read: nodes, and triangles in the order of the tree's leaves."""

    nodes: Bytes  # (N, NODE): see `boxes`
    triangles: Floats  # (T, 9): three vertices each
    normals: Floats  # (T, 9) or (0, 9)

    @property
    def links(self) -> Ints32:
        """The same memory as `nodes`, read as integers."""
        return self.nodes.view(np.int32)


def grow_tree(vertices: Floats, triangles: Ints, normals: Floats | None) -> Tree:
    """A tree over the triangles of a mesh, in about a microsecond per triangle."""
    total = len(triangles)
    corners = np.ascontiguousarray(vertices[triangles]).reshape(-1, 9)
    places = corners.reshape(-1, 3)
    center = ((places.min(axis=0) + places.max(axis=0)) / 2.0).astype(SINGLE)
    halves = Halves(
        np.empty((total - 1, 3), np.int32),
        np.empty((total - 1, 6), SINGLE),
        np.empty((total, 6), SINGLE),
    )
    order = np.empty(total, np.int32)
    _bound(corners, tuple(center.tolist()), halves.triangles, order)
    _halve(halves, order, np.empty((DEEP + 32, 4), np.int64), np.empty((BINS, 8), SINGLE))
    shares = np.empty((total, WIDTH), np.uint8)
    _weigh(halves, np.empty((total, WIDTH), SINGLE), np.empty((2, WIDTH), SINGLE), shares)
    nodes = lined_up(total // 2 + 1)
    views = Views(nodes, nodes.view(np.int32), nodes.view(SINGLE))
    tops, parts = np.empty(len(nodes), np.int64), np.empty((2 * WIDTH, 2), np.int64)
    boxes = np.empty((WIDTH, 6), SINGLE)
    count = _fold(halves, shares, views, tops, parts, boxes)
    views.singles[0, CENTER:REACH] = center
    views.singles[0, REACH] = 1.01 * np.abs(halves.triangles).max()  # boxes are up to 1/254 larger
    in_order = np.empty((0, 9))
    if normals is not None:
        in_order = normals[triangles[order]].reshape(-1, 9)
    return Tree(nodes[:count], corners[order], in_order)


def lined_up(count: int) -> Bytes:
    """Room for nodes, each on its own lines of cache."""
    room = np.empty((count + 1) * NODE, np.uint8)
    start = -room.ctypes.data % NODE
    return room[start : start + count * NODE].reshape(count, NODE)


# --- halves ---------------------------------------------------------------------------------------


@inlined
def _least(a: Vec, b: Vec) -> Vec:
    return min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2])


@inlined
def _most(a: Vec, b: Vec) -> Vec:
    return max(a[0], b[0]), max(a[1], b[1]), max(a[2], b[2])


@inlined
def _put(boxes: Singles, row: int, least: Vec, most: Vec) -> None:
    boxes[row, 0], boxes[row, 1], boxes[row, 2] = least
    boxes[row, 3], boxes[row, 4], boxes[row, 5] = most


@inlined
def _half_area(least: Vec, most: Vec) -> float:
    x, y, z = most[0] - least[0], most[1] - least[1], most[2] - least[2]
    return x * y + y * z + z * x


@inlined
def _outwards(x: float, towards: float) -> Any:
    """The next float beyond x, which is in doubles."""
    return np.nextafter(SINGLE(x), towards)


@compiled
def _bound(corners: Floats, center: Vec, boxes: Singles, order: Ints32) -> None:
    """The box of each triangle, seen from `center`, and rounded outwards."""
    for i in range(len(corners)):
        order[i] = i
        for k in range(3):
            a, b, c = corners[i, k], corners[i, 3 + k], corners[i, 6 + k]
            boxes[i, k] = _outwards(min(a, b, c) - center[k], -INF)
            boxes[i, 3 + k] = _outwards(max(a, b, c) - center[k], INF)


@compiled
def _halve(halves: Halves, order: Ints32, tasks: Ints, bins: Singles) -> None:
    """Sorts `order` and the triangles' boxes into a tree, and fills its `ranges`.

    `tasks` (DEEP + 32, 4) and `bins` (BINS, 8) are scratch.
    """
    waiting = 0
    node, first, last, level = 0, 0, len(order), 0
    while True:
        while last - first > 1:
            middle = _split(halves.triangles, order, first, last, bins, level >= DEEP)
            left = middle - first
            halves.ranges[node, FIRST], halves.ranges[node, COUNT] = first, last - first
            halves.ranges[node, LEFT] = left
            level += 1
            tasks[waiting, 0], tasks[waiting, 1] = node + left, middle
            tasks[waiting, 2], tasks[waiting, 3] = last, level
            waiting += 1
            node, last = node + 1, middle
        if waiting == 0:
            return
        waiting -= 1
        node, first = tasks[waiting, 0], tasks[waiting, 1]
        last, level = tasks[waiting, 2], tasks[waiting, 3]


@merged
def _split(boxes: Singles, order: Ints32, first: int, last: int, bins: Singles, halve: bool) -> int:
    """Sorts a range into two parts of least surface area cost; where the second begins.

    I. Wald, On fast construction of SAH-based bounding volume hierarchies, 2007. Middles of boxes
    are taken twice, to be exact.
    """
    least, most = (INF, INF, INF), (-INF, -INF, -INF)
    for i in range(first, last):
        a, b = vec_at(boxes, i, 0), vec_at(boxes, i, 3)
        middle = a[0] + b[0], a[1] + b[1], a[2] + b[2]
        least, most = _least(least, middle), _most(most, middle)
    axis, low, extent = 0, least[0], most[0] - least[0]
    for k in range(1, 3):
        if most[k] - least[k] > extent:
            axis, low, extent = k, least[k], most[k] - least[k]
    half = (first + last) // 2
    if halve or last - first == 2 or extent == SINGLE(0.0):
        return half

    count = BINS if last - first > 4 * BINS else BINS // 2
    to_bin = SINGLE(count * (1.0 - 1e-6)) / extent
    for k in range(count):
        _put(bins, k, (INF, INF, INF), (-INF, -INF, -INF))
        bins[k, 6] = SINGLE(0.0)
    for i in range(first, last):
        k = _bin(boxes, i, axis, low, to_bin)
        a, b = vec_at(boxes, i, 0), vec_at(boxes, i, 3)
        _put(bins, k, _least(vec_at(bins, k, 0), a), _most(vec_at(bins, k, 3), b))
        bins[k, 6] += SINGLE(1.0)
    best = _cheapest(bins, count)

    i, j = first, last - 1
    while i <= j:
        if _bin(boxes, i, axis, low, to_bin) < best:
            i += 1
            continue
        order[i], order[j] = order[j], order[i]
        for k in range(6):
            boxes[i, k], boxes[j, k] = boxes[j, k], boxes[i, k]
        j -= 1
    return i if first < i < last else half


@inlined
def _bin(boxes: Singles, i: int, axis: int, low: float, to_bin: float) -> int:
    return int((boxes[i, axis] + boxes[i, 3 + axis] - low) * to_bin)


@merged
def _cheapest(bins: Singles, count: int) -> int:
    """The bin before which to split. Columns of `bins`: box, number of triangles, cost."""
    best, lowest = 1, INF
    for backwards in range(2):
        least, most, n = (INF, INF, INF), (-INF, -INF, -INF), SINGLE(0.0)
        for step in range(count - 1):
            k = step if backwards == 0 else count - 1 - step
            least, most = _least(least, vec_at(bins, k, 0)), _most(most, vec_at(bins, k, 3))
            n += bins[k, 6]
            cost = n * _half_area(least, most) if n > SINGLE(0.0) else SINGLE(0.0)
            if backwards == 0:
                bins[k + 1, 7] = cost
            elif bins[k, 7] + cost < lowest:
                best, lowest = k, bins[k, 7] + cost
    return best


# --- folding --------------------------------------------------------------------------------------
# Below a node of eight, part of the tree can hang as one child, or as several, its two halves
# having a share of them each. What is cheapest is told from the leaves up (Ylitie, Karras and Laine
# 2017, section 3). Column w - 1 of `shares` is for w children: how many of them the first half
# gets, or 0 if fewer than w are no worse. Column 0, for one child, is 0 if that is a leaf.


@compiled
def _weigh(halves: Halves, costs: Singles, of_halves: Singles, shares: Bytes) -> None:
    """Fills `shares` (T, WIDTH) and the boxes of `halves`.

    `costs` (T, WIDTH), by number of children, and `of_halves` (2, WIDTH) are scratch.
    """
    for node in range(len(halves.ranges) - 1, -1, -1):
        first, count, left = _range(halves, node)
        least, most = (INF, INF, INF), (-INF, -INF, -INF)
        for side in range(2):
            half = node + 1 if side == 0 else node + left
            if (left if side == 0 else count - left) == 1:
                boxes, half = halves.triangles, first if side == 0 else first + left
                area = _half_area(vec_at(boxes, half, 0), vec_at(boxes, half, 3))
                for k in range(WIDTH):
                    of_halves[side, k] = area * (LEAF_COST + TRIANGLE_COST)
            else:
                boxes = halves.boxes
                for k in range(WIDTH):
                    of_halves[side, k] = costs[half, k]
            least = _least(least, vec_at(boxes, half, 0))
            most = _most(most, vec_at(boxes, half, 3))
        _put(halves.boxes, node, least, most)

        area = _half_area(least, most)
        cost, shares[node, WIDTH - 1] = _share(of_halves, WIDTH, INF)
        costs[node, 0], shares[node, 0] = area + cost, 1
        as_leaf = area * (LEAF_COST + TRIANGLE_COST * SINGLE(count))
        if count <= LEAF and as_leaf <= costs[node, 0]:
            costs[node, 0], shares[node, 0] = as_leaf, 0
        for w in range(2, WIDTH):
            costs[node, w - 1], shares[node, w - 1] = _share(of_halves, w, costs[node, w - 2])


@inlined
def _range(halves: Halves, node: int) -> tuple[int, int, int]:
    return halves.ranges[node, FIRST], halves.ranges[node, COUNT], halves.ranges[node, LEFT]


@inlined
def _share(of_halves: Singles, w: int, of_fewer: float) -> tuple[float, int]:
    best, share = of_fewer, 0
    for k in range(1, w):
        cost = of_halves[0, k - 1] + of_halves[1, w - k - 1]
        if cost < best:
            best, share = cost, k
    return best, share


class Views(NamedTuple):
    """The memory of nodes in its three readings."""

    sides: Bytes  # (N, NODE)
    links: Ints32
    singles: Singles


@compiled
def _fold(
    halves: Halves,
    shares: Bytes,
    nodes: Views,
    tops: Ints,
    parts: Ints,
    boxes: Singles,
) -> int:
    """Makes the nodes of eight, those near the root first; their number.

    `tops` (N,), `parts` (2 WIDTH, 2) and `boxes` (WIDTH, 6) are scratch: of which node of `halves`
    each is made, what of that is still to be shared out, and the children's boxes. What is negative
    is a single triangle.
    """
    node, count = 0, 1
    tops[0] = 0 if len(halves.ranges) > 0 else -1
    while node < count:
        parts[0, 0], parts[0, 1] = tops[node], WIDTH
        waiting, child = 1, 0
        while waiting > 0:
            waiting -= 1
            part, w = parts[waiting, 0], parts[waiting, 1]
            if part < 0:
                first, triangles, of = -1 - part, 1, halves.triangles
                least, most = vec_at(of, first, 0), vec_at(of, first, 3)
            else:
                while w > 1 and shares[part, w - 1] == 0:
                    w -= 1
                first, triangles, left = _range(halves, part)
                if w > 1:
                    share = shares[part, w - 1]
                    parts[waiting, 1] = w - share
                    parts[waiting, 0] = part + left if triangles - left > 1 else -1 - (first + left)
                    parts[waiting + 1, 1] = share
                    parts[waiting + 1, 0] = part + 1 if left > 1 else -1 - first
                    waiting += 2
                    continue
                least, most = vec_at(halves.boxes, part, 0), vec_at(halves.boxes, part, 3)
            if part >= 0 and shares[part, 0] == 1:
                tops[count], link = part, count
                count += 1
            else:
                link = -1 - (8 * first + triangles)
            _put(boxes, child, least, most)
            nodes.links[node, LINK + child] = link
            child += 1
        _pack(boxes, child, nodes, node)
        node += 1
    return count


@merged
def _pack(boxes: Singles, count: int, nodes: Views, node: int) -> None:
    """Writes the boxes of `count` children into a node; the others get boxes inside out."""
    for child in range(count, WIDTH):
        nodes.links[node, LINK + child] = EMPTY
    for k in range(3):
        least, most = INF, -INF
        for child in range(count):
            least, most = min(least, boxes[child, k]), max(most, boxes[child, 3 + k])
        corner = np.float64(least)
        scale = SINGLE(max(1e-30, (np.float64(most) - corner) / (STEPS - 1.0)))
        nodes.singles[node, CORNER + k], nodes.singles[node, SCALE + k] = least, scale
        for child in range(WIDTH):
            low, high = STEPS, 0.0
            if child < count:
                low = np.floor((np.float64(boxes[child, k]) - corner) / scale)
                high = np.ceil((np.float64(boxes[child, 3 + k]) - corner) / scale)
            nodes.sides[node, LEAST + WIDTH * k + child] = np.uint8(low)
            nodes.sides[node, MOST + WIDTH * k + child] = np.uint8(high)
