"""The tree over a mesh's triangles finds what a look at every triangle finds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tracer import boxes
from tracer.boxes import CENTER, CORNER, LEAST, LINK, MOST, REACH, SCALE, WIDTH
from tracer.compiled import compiled
from tracer.mesh import Mesh, triangle_distance
from tracer.tree import LEAF, Tree, grow_tree
from tracer.vector import Vec
from tracer.walk import LANES, STACK, Lanes, mesh_hit, mesh_hits, new_lanes

Floats = np.ndarray
EPS = float(np.finfo(float).eps)


def soup(count: int, seed: int, *, size: float = 0.3, at: float = 0.0, flat: bool = False) -> Mesh:
    """Triangles that lie about in a cube, or in the plane z = 0 of it; no closed solid."""
    rng = np.random.default_rng(seed)
    middles = rng.uniform(-1.0, 1.0, (count, 1, 3))
    corners = middles + rng.uniform(-size, size, (count, 3, 3))
    if flat:
        corners[..., 2] = 0.0
    return Mesh(corners.reshape(-1, 3) + at, np.arange(3 * count).reshape(-1, 3))


def tree_of(mesh: Mesh) -> Tree:
    return grow_tree(mesh.vertices, mesh.triangles, mesh.normals)


def rays(mesh: Mesh, count: int, seed: int) -> tuple[Floats, Floats]:
    """Some at random, some along an axis, some from a corner, some in a corner's plane."""
    rng = np.random.default_rng(seed)
    middle = mesh.vertices.mean(axis=0)
    o = middle + rng.uniform(-2.0, 2.0, (count, 3))
    d = rng.normal(size=(count, 3))
    corners = mesh.vertices[rng.integers(0, len(mesh.vertices), count)]
    d[1::4] = np.eye(3)[rng.integers(0, 3, len(d[1::4]))] * rng.choice([-1, 1], (len(d[1::4]), 1))
    o[1::8, 0] = corners[1::8, 0]
    o[2::4] = corners[2::4]
    d[3::4] = (corners - o)[3::4]  # at a corner, and at what shares it
    return o, d / np.linalg.norm(d, axis=1)[:, None]


@compiled
def _through_tree(
    o: Vec, d: Vec, nodes: Floats, triangles: Floats, stack: Floats
) -> tuple[float, int, int]:
    return mesh_hit(o, d, nodes, triangles, 0, -1, 0, np.inf, stack)


@compiled
def _one_by_one(o: Vec, d: Vec, triangles: Floats) -> float:
    best = np.inf
    for k in range(len(triangles)):
        t, side = triangle_distance(o, d, triangles, k, 0, 0.0, best)
        if side != 0:
            best = t
    return best


def distances(tree: Tree, o: Floats, d: Floats) -> tuple[list[float], list[float]]:
    """By the tree, and by trying all triangles."""
    stack = np.empty((STACK, 2))
    by_tree, by_all = [], []
    for origin, direction in zip(o.tolist(), d.tolist(), strict=True):
        ray = tuple(origin), tuple(direction)
        t, hit, _ = _through_tree(*ray, tree.nodes, tree.triangles, stack)
        by_tree.append(t if hit >= 0 else np.inf)
        by_all.append(_one_by_one(*ray, tree.triangles))
    return by_tree, by_all


MESHES: dict[str, Callable[[], Mesh]] = {
    **{f"{n} triangles": lambda n=n: soup(n, n) for n in (1, 2, 3, 4, 5, 8, 9, 33)},
    "many": lambda: soup(3000, 1, size=0.05),
    "flat": lambda: soup(200, 2, flat=True),
    "far away": lambda: soup(500, 3, at=1e6),
    "long and thin": lambda: soup(300, 4, size=5.0),
    "all the same": lambda: Mesh(np.tile(np.eye(3), (50, 1)), np.arange(150).reshape(-1, 3)),
    "ever smaller": lambda: shrinking(0.8, 60),
}


def shrinking(by: float, count: int) -> Mesh:
    corners = by ** np.arange(count)[:, None, None] * (np.eye(3) + 1.0)
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


@pytest.mark.parametrize("make", MESHES.values(), ids=MESHES.keys())
def test_finds_what_a_look_at_every_triangle_finds(make: Callable[[], Mesh]) -> None:
    """The boxes only leave out triangles.

    Where several are met within two roundings, those of the distance and of what it is compared
    with, the first that is looked at counts.
    """
    mesh = make()
    by_tree, by_all = distances(tree_of(mesh), *rays(mesh, 2000, 5))
    assert by_tree == pytest.approx(by_all, rel=2 * EPS, abs=0.0)
    assert any(t < np.inf for t in by_all)


@settings(deadline=None)
@given(st.integers(1, 60), st.integers(0, 10**6), st.floats(1e-6, 1.0), st.floats(-1e8, 1e8))
def test_finds_it_in_any_soup(count: int, seed: int, size: float, at: float) -> None:
    mesh = soup(count, seed, size=size, at=at)
    by_tree, by_all = distances(tree_of(mesh), *rays(mesh, 60, seed))
    assert by_tree == pytest.approx(by_all, rel=2 * EPS, abs=0.0)


def test_a_tree_is_not_too_high_for_the_stack() -> None:
    """Of triangles each half the size of the one before, the cheapest tree is a list.

    A node's children wait in the stack while the ray is below one of them.
    """
    tree = tree_of(shrinking(0.5, 1000))

    def height(node: int) -> int:
        return 1 + max(height(k) if k >= 0 else 0 for k in tree.links[node, LINK:].tolist())

    assert WIDTH + (WIDTH - 1) * height(0) <= 2 * STACK


@pytest.mark.parametrize("make", MESHES.values(), ids=MESHES.keys())
def test_every_triangle_is_in_one_leaf_and_every_box_around_what_is_below(
    make: Callable[[], Mesh],
) -> None:
    mesh = make()
    tree = tree_of(mesh)
    seen = np.zeros(len(tree.triangles), int)
    center = tree.nodes.view(np.float32)[0, CENTER:REACH].astype(float)
    rounding = 4 * EPS * np.abs(mesh.vertices).max()

    def below(node: int) -> tuple[Floats, Floats]:
        row = tree.nodes[node]
        frame = row[:LEAST].view(np.float32).astype(float)
        corner, scale = frame[CORNER : CORNER + 3] + center, frame[SCALE : SCALE + 3]
        least, most = [], []
        for k in range(WIDTH):
            child = int(tree.links[node, LINK + k])
            if child >= 0:
                low, high = below(child)
            else:
                first, count = -1 - child >> 3, -1 - child & 7
                assert count <= LEAF
                if count == 0:
                    continue
                seen[first : first + count] += 1
                corners = tree.triangles[first : first + count].reshape(-1, 3)
                low, high = corners.min(axis=0), corners.max(axis=0)
            sides = [row[at + k : at + 24 : WIDTH] for at in (LEAST, MOST)]
            assert (corner + sides[0] * scale - rounding <= low).all()
            assert (corner + sides[1] * scale + rounding >= high).all()
            least.append(low)
            most.append(high)
        return np.min(least, axis=0), np.max(most, axis=0)

    below(0)
    assert (seen == 1).all()
    given_corners = np.sort(mesh.vertices[mesh.triangles].reshape(-1, 9), axis=0)
    assert np.array_equal(np.sort(tree.triangles, axis=0), given_corners)


@compiled
def _side_by_side(
    origins: Floats,
    directions: Floats,
    nodes: Floats,
    triangles: Floats,
    found: Floats,
    lanes: Lanes,
) -> None:
    mesh_hits(origins, directions, nodes, triangles, 0, found, lanes)


@pytest.mark.parametrize("count", [0, 1, LANES - 1, LANES + 1, 500])
def test_rays_that_take_turns_find_what_each_finds_alone(count: int) -> None:
    """To the last bit: a turn is the same step, whoever's it is."""
    mesh = soup(3000, 1, size=0.05)
    tree, (o, d) = tree_of(mesh), rays(mesh, count, 9)
    found, stack = np.full((count, 3), np.nan), np.empty((STACK, 2))
    _side_by_side(o, d, tree.nodes, tree.triangles, found, new_lanes())
    alone = [
        _through_tree(tuple(a), tuple(b), tree.nodes, tree.triangles, stack)
        for a, b in zip(o.tolist(), d.tolist(), strict=True)
    ]
    assert found.tolist() == [list(hit) for hit in alone]
    assert count < 500 or 50 < np.isfinite(found[:, 0]).sum() < 450


@compiled
def _by_machine(o: Vec, d: Vec, nodes: Floats, node: int, farthest: float, keys: Floats) -> int:
    ray = boxes.sight(o, d, nodes, 0)
    return boxes.meets_boxes(nodes, node, ray, boxes.limit_of(farthest), keys)


@compiled
def _sight(o: Vec, d: Vec, nodes: Floats) -> boxes.Sight:
    return boxes.sight(o, d, nodes, 0)


@pytest.mark.parametrize("name", ["many", "far away", "flat", "9 triangles"])
def test_machine_code_does_what_is_written_in_python(name: str) -> None:
    """Bit by bit: which boxes are met, and the keys of all."""
    mesh = MESHES[name]()
    tree = tree_of(mesh)
    rng = np.random.default_rng(8)
    of_machine, of_python = np.empty((2, WIDTH), np.int64)
    met = 0
    for origin, direction in zip(*rays(mesh, 400, 6), strict=True):
        o, d = tuple(origin.tolist()), tuple(direction.tolist())
        node, near = int(rng.integers(len(tree.nodes))), float(rng.exponential(3.0))
        for farthest in (near, np.inf):
            found = _by_machine(o, d, tree.nodes, node, farthest, of_machine)
            limit = boxes.limit_in_python(farthest)
            expected = boxes.in_python(tree.nodes, node, _sight(o, d, tree.nodes), limit, of_python)
            assert found == expected
            assert np.array_equal(of_machine, of_python)
            met += found.bit_count()
    assert met > 0
