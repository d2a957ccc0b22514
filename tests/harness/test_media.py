"""Solids that touch, overlap by priority, or lie in each other: one medium at each point."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from harness.expected import fresnel, refract
from harness.renderers.base import Capability, Rays
from harness.renderers.needs import needs
from harness.translate.tracer import translate
from harness.truth.paths import ClosedForm
from harness.truth.tree import light_around
from tests.harness.test_resolve import Document, box, problems_of, resolved_of, scene, sphere
from tracer.image import render
from tracer.path import MISS, TIR, follow
from tracer.scene import Transport

EPS = np.finfo(float).eps
TURNED = {"rotate": [{"axis": [1, 2, 3], "angle": 40}]}
MEDIA = {"ice": {"ior": 1.31}, "water": {"ior": 1.333}, "glass": {"ior": 1.5}}


def world(*solids: tuple[str, Document] | tuple[str, Document, int], **parts: Any) -> Document:
    """A scene of solids (medium, shape, priority)."""
    document = scene(*((medium, shape) for medium, shape, *_ in solids), **parts)
    for row, (_, _, *priority) in zip(document["solids"], solids, strict=True):
        row["priority"] = priority[0] if priority else 0
    wall = {"type": "rectangle", "center": [0, 0, -30], "size": [1e4, 1e4]}
    look = {"type": "emissive", "pattern": {"type": "constant", "radiance": [1, 1, 1]}}
    surfaces = [{"name": "wall", "shape": wall, "material": look}]
    return {"surfaces": surfaces, **document, "media": MEDIA}


def rays(n: int, spread: float = 1.2, seed: int = 5) -> Rays:
    """Down from z = 9, at up to 50 degrees."""
    rng = np.random.default_rng(seed)
    targets = np.column_stack([rng.uniform(-spread, spread, (n, 2)), rng.uniform(-1, 1, n)])
    origins = np.column_stack([rng.uniform(-8, 8, (n, 2)), np.full(n, 9.0)])
    d = targets - origins
    return Rays(origins, d / np.linalg.norm(d, axis=1, keepdims=True))


def slab(top: float, bottom: float, **more: Any) -> Document:
    return {**box([60, 60, top - bottom], z=(top + bottom) / 2), **more}


def test_what_touches_meets_in_one_interface() -> None:
    """Glass on water: the exit angle, Fresnel's factors and the optical path of two refractions."""
    both = resolved_of(world(("glass", slab(1, 0.1)), ("water", slab(0.1, -0.7))))
    assert [s.meets for s in both.solids] == [(1,), (0,)]
    assert Capability.PRIORITY in needs(both)
    theta = np.radians([0, 20, 50, 85])
    d = np.column_stack([np.sin(theta), 0 * theta, -np.cos(theta)])
    found = follow(translate(both), np.tile([0.0, 0.0, 1.5], (4, 1)), d, "TTT")
    weight, length = np.ones(4), 0.5 / np.cos(theta)
    up, c = np.array([[0.0, 0.0, 1.0]]), np.cos(theta)
    x = 0.5 * np.tan(theta)
    for n_i, n_t, depth in ((1, 1.5, 0.9), (1.5, 1.333, 0.8), (1.333, 1, 0)):
        weight *= 1 - fresnel(c, n_i, n_t)
        d, _ = refract(d, np.tile(up, (4, 1)), np.full(4, n_i), np.full(4, n_t))
        c = -d[:, 2]
        length += n_t * depth / c
        x += depth * d[:, 0] / c
    beyond = (-0.7 + 30) / c
    # Three interfaces of some five roundings. Refraction towards grazing multiplies errors by
    # 1 / cos, and so does a long way.
    allowed = 16 * EPS / np.cos(theta) ** 2
    for ours, true in (
        (found.weight, weight),
        (found.direction[:, 0], d[:, 0]),
        (found.optical_length, length + beyond),
        (found.point[:, 0], x + beyond * d[:, 0]),
    ):
        assert (np.abs(ours - true) <= allowed * np.abs(true)).all()


def test_a_shared_face_reflects_totally_as_its_two_media_say() -> None:
    """Glass to water: totally from asin(1.333 / 1.5) = 62.71 degrees, glass to air from 41.81."""
    both = translate(resolved_of(world(("glass", slab(1, 0)), ("water", slab(0, -1)))))
    for theta, total in ((62.6, False), (62.8, True)):
        angle = math.radians(theta)
        found = follow(both, [[0, 0, 0.5]], [[math.sin(angle), 0, -math.cos(angle)]], "T")
        assert (found.status[0] == TIR) == total


SETS: dict[str, tuple[tuple[tuple[Any, ...], ...], tuple[tuple[Any, ...], ...]]] = {
    # By priority, and cut out: the same regions.
    "a ball sinks into a box": (
        (("ice", sphere(0.7, 0, 0, 0.8), 1), ("water", box([3, 3, 2]))),
        (
            ("ice", sphere(0.7, 0, 0, 0.8)),
            ("water", {"type": "difference", "of": [box([3, 3, 2]), sphere(0.7, 0, 0, 0.8)]}),
        ),
    ),
    "a box cuts into a ball": (
        (("ice", sphere(0.7, 0, 0, 0.8)), ("water", box([3, 3, 2]), 1)),
        (
            ("ice", {"type": "difference", "of": [sphere(0.7, 0, 0, 0.8), box([3, 3, 2])]}),
            ("water", box([3, 3, 2])),
        ),
    ),
    "ice in water in glass, flush at the top": (
        (
            ("glass", {"type": "cylinder", "axis": [0, 0, 1], "radius": 1.3, "height": 2}),
            ("water", {"type": "cylinder", "axis": [0, 0, 1], "radius": 1.2, "height": 1.6,
                       "center": [0, 0, 0.2]}),
            ("ice", {**box([0.6, 0.7, 0.5], z=0.75), "rotate": [{"axis": [0, 0, 1], "angle": 20}]}),
        ),
        (
            ("ice", {**box([0.6, 0.7, 0.5], z=0.75), "rotate": [{"axis": [0, 0, 1], "angle": 20}]}),
            ("water", {"type": "difference", "of": [
                {"type": "cylinder", "axis": [0, 0, -1], "radius": 1.2, "height": 1.6,
                 "center": [0, 0, 0.2]},
                {**box([0.6, 0.7, 0.5], z=0.75), "rotate": [{"axis": [0, 0, 1], "angle": 20}]},
            ]}),
            ("glass", {"type": "difference", "of": [
                {"type": "cylinder", "axis": [0, 0, 1], "radius": 1.3, "height": 2},
                {"type": "cylinder", "axis": [0, 0, 1], "radius": 1.2, "height": 1.9,
                 "center": [0, 0, 0.35]},
            ]}),
        ),
    ),
    "a doublet": (
        (
            ("glass", {"type": "lens", "vertex": [0, 0, 0.5], "radii": [3, -2], "thickness": 0.8,
                       "diameter": 2}),
            ("ice", {"type": "lens", "vertex": [0, 0, -0.3], "radii": [-2, -6], "thickness": 0.3,
                     "diameter": 2}),
        ),
        (
            ("glass", {"type": "lens", "vertex": [0, 0, 0.5], "radii": [3, -2], "thickness": 0.8,
                       "diameter": 2}, 1),
            ("ice", {"type": "lens", "vertex": [0, 0, 0], "radii": [math.inf, -6],
                     "thickness": 0.6, "diameter": 2}),
        ),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("path", ["TT", "TTT", "TTTT", "TRT"])
def test_priority_is_the_same_as_cutting_out(name: str, path: str) -> None:
    first, second = (translate(resolved_of(world(*solids))) for solids in SETS[name])
    some = rays(4000)
    a, b = (follow(scene, some.origins, some.directions, path) for scene in (first, second))
    assert (a.status == b.status).all()
    hit = a.status == 0
    # The two describe their faces by other numbers: directions agree to some thousand roundings
    # after curved ways, and a direction that is off by that lands (z^2 + r^2) / z times it away.
    far = np.linalg.norm(a.point[hit], axis=1)
    apart = np.linalg.norm(a.point - b.point, axis=1)[hit]
    assert (apart <= 1e-12 * far**2 / 30).all()
    assert np.abs(a.weight - b.weight)[hit].max(initial=0) <= 1e-12


@pytest.mark.parametrize("name", SETS)
def test_truth_and_tracer_agree_where_solids_meet(name: str) -> None:
    """Two implementations that share no code, on overlapping and touching solids."""
    resolved, some = resolved_of(world(*SETS[name][0])), rays(3000)
    for path in ("TT", "TTT", "TTTT"):
        ours = follow(translate(resolved), some.origins, some.directions, path)
        true = ClosedForm(resolved).follow(some, path)
        both = (ours.status == 0) & (true.status == 0) & ~np.isfinite(true.ahead)
        assert (ours.status == 0).sum() == both.sum()
        assert np.abs(ours.direction - true.direction)[both].max(initial=0) <= 1e-10
        assert np.abs(ours.weight - true.weight)[both].max(initial=0) <= 1e-10


@pytest.mark.parametrize("name", SETS)
def test_the_light_of_all_paths_agrees_where_solids_meet(name: str) -> None:
    """Truth follows the whole tree, in which each ray knows of all solids that it is in."""
    some, depth = rays(1000), 6
    white = resolved_of(world(*SETS[name][0], surfaces=[], background=[1, 1, 1]))
    true = light_around(ClosedForm(white), some, depth, min_weight=1e-9)
    assert np.abs(true.level[:, 0] + true.cut - 1).max() <= 1e-12
    paths = ["".join(path) for k in range(depth) for path in itertools.product("TR", repeat=k)]
    level = np.zeros(1000)
    for path in paths:
        found = follow(translate(white), some.origins, some.directions, path, vertices=True)
        # The background is no surface on which a ray lands: it misses after its last interface.
        gone = (found.status == MISS) & (
            np.isfinite(found.vertices[:, :, 0]).sum(1) == len(path) + 1
        )
        level += np.where(gone, found.weight, 0.0)
    assert np.abs(level - true.level[:, 0]).max() <= 1e-8  # what is below the least weight, in sum


@pytest.mark.parametrize("name", SETS)
def test_a_white_world_stays_white(name: str) -> None:
    for solids in SETS[name]:
        view = translate(resolved_of(world(*solids, surfaces=[], background=[1, 1, 1])))
        image = render(replace(view, transport=Transport(40, 1e-6)), 48, 48)
        assert np.abs(image.pixels + image.cut[:, :, None] - 1).max() <= 1e-12


def test_rays_know_the_medium_that_they_begin_in() -> None:
    inside = resolved_of(
        world(("glass", box([4, 4, 4])), ("water", sphere(1)), ("ice", sphere(0.5)))
    )
    begins = [[0, 0, 0], [0, 0, 0.75], [0, 0, 1.5], [0, 0, 2.5]]
    found = follow(translate(inside), begins, [[0, 0, 1]] * 4, "T")
    fresnel = [((a - b) / (a + b)) ** 2 for a, b in ((1.31, 1.333), (1.333, 1.5), (1.5, 1))]
    assert 1 - found.weight[:3] == pytest.approx(fresnel, rel=1e-12)


def test_one_medium_needs_one_priority() -> None:
    half, other = box([1, 1, 1]), box([1, 1, 1], 0.5)
    assert problems_of(world(("ice", half), ("water", other))) == [
        ("solids[1].shape", "overlaps solid s0 partly")
    ]
    assert [s.priority for s in resolved_of(world(("ice", half, 3), ("water", other))).solids] == [
        1,
        0,
    ]


def test_what_is_hidden_is_a_mistake() -> None:
    hidden = world(("ice", sphere(0.5)), ("water", sphere(1), 1))
    message = "hidden: it lies inside solid s1, which has a higher priority"
    assert problems_of(hidden) == [("solids[0].priority", message)]


MESH = {"type": "polygons", "of": {"type": "box", "center": [0, 0, 0], "size": [1, 1, 1]}}


@pytest.mark.parametrize(
    "other", [box([3, 3, 1], z=-1), {**MESH, "of": box([0.5, 0.5, 1], 0.2, 0.1, 1)}, slab(9, 0.5)]
)
def test_a_mesh_cannot_share_a_face(other: Document) -> None:
    message = "shares a face with solid s0, and one of them is a mesh"
    assert problems_of(world(("ice", MESH), ("water", other))) == [("solids[1].shape", message)]


def test_solids_that_meet_in_points_do_not_share_a_face() -> None:
    stand = resolved_of(world(("ice", sphere(1)), ("water", box([4, 4, 1], z=-1.5))))
    assert [s.meets for s in stand.solids] == [(), ()]
    beside = resolved_of(world(("ice", box([1, 1, 1])), ("water", box([1, 1, 1], 3))))
    assert Capability.PRIORITY not in needs(beside)
