"""Double recursion: how many rays it takes, that nothing is lost, that threads do not matter."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.tracer.scenes import GLASS
from tracer import Orthographic, Perspective, Render, Scene, Solid, render
from tracer.scene import Medium, Transport
from tracer.shapes import Plane, Sphere
from tracer.solids import cylinder, polyhedron

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
WHITE = (1.0, 1.0, 1.0)
AHEAD = Orthographic((0.0, 0.0, 50.0), X, Y, (0.0, 0.0, -1.0), 1e-6)


def pane(z: float) -> Solid:
    """A wide slab of glass from z to z + 0.5."""
    corners = [(x, y, z + h) for x in (-9, 9) for y in (-9, 9) for h in (0, 0.5)]
    planes = [Plane((s * (k == 0), s * (k == 1), 0), 9) for k in range(2) for s in (-1.0, 1.0)]
    planes += [Plane(Z, z + 0.5), Plane((0.0, 0.0, -1.0), -z)]
    return Solid(polyhedron(planes, corners), GLASS)


def panes(count: int, segments: int) -> Render:
    solids = tuple(pane(float(k)) for k in range(count))
    transport = Transport(max_depth=segments, min_weight=0.0)
    return render(Scene(AHEAD, solids, background=WHITE, transport=transport), 1, 1)


# --- how many rays --------------------------------------------------------------------------------
# At depth d a ray has been split d times: it is segment d + 1. The figures at depth 20 were
# counted by a program without a tracer, see below; the worst case would be 2^21 - 1 = 2,097,151.


@pytest.mark.parametrize(("count", "rays"), [(1, 41), (2, 35_421), (10, 383_347)])
def test_double_recursion_need_not_double(count: int, rays: int) -> None:
    """The lecture's erratum 7."""
    assert panes(count, 21).rays == rays
    assert rays == counted(2 * count, 20)


def counted(interfaces: int, depth: int) -> int:
    """Rays in a stack of parallel interfaces: those that leave it are split no more.

    A ray is where it is, an interface ahead of it upwards or downwards; nothing else matters.
    """
    moving = {(0, 1): 1}  # (gap, direction) -> how many; gap k lies before interface k
    total = 1
    for _ in range(depth):
        after: dict[tuple[int, int], int] = {}
        for (gap, way), rays in moving.items():
            if (way > 0 and gap == interfaces) or (way < 0 and gap == 0):
                continue
            for child in ((gap + way, way), (gap, -way)):
                after[child] = after.get(child, 0) + rays
        moving = after
        total += sum(moving.values())
    return total


@pytest.mark.parametrize("depth", [1, 2, 5, 12])
def test_rays_are_counted_at_any_depth(depth: int) -> None:
    for count in (1, 2, 3):
        assert panes(count, depth + 1).rays == counted(2 * count, depth)


# --- nothing is lost ------------------------------------------------------------------------------

BALL = Solid(Sphere((0.0, 0.0, 0.0), 1.0), Medium(1.5))
ROD = Solid(cylinder((0.0, 0.0, 0.0), (0.6, 0.0, 0.8), 0.5, 1.5), Medium(2.4))
CORE = Solid(Sphere((0.0, 0.0, 0.0), 0.5), Medium(1.1))
CAMERA = Perspective((0.0, 0.0, 6.0), X, Y, (0.0, 0.0, -1.0), 0.2)


@pytest.mark.parametrize("solids", [(BALL,), (ROD,), (BALL, CORE), (pane(0.0), pane(1.0))])
def test_a_white_world_stays_white(solids: tuple[Solid, ...]) -> None:
    """White furnace: pixels and cut make 1. At most 1e4 weights are added, each with an error of
    its 40 factors: 40 eps.
    """
    scene = Scene(CAMERA, solids, background=WHITE, transport=Transport(40, 1e-7))
    image = render(scene, 24, 24)
    assert np.abs(image.pixels + image.cut[..., None] - 1).max() < 1e-11
    assert (image.cut >= 0).all()


def test_a_white_world_is_white_when_nothing_is_cut() -> None:
    """A slab head on: what is left after k crossings is R^k, 0.04^30 at last."""
    image = panes(1, 31)
    assert np.abs(image.pixels - 1).max() < 1e-9
    assert image.cut.max() < 1e-9
    camera = replace(CAMERA, tan_half_fov_x=0.11)  # clear of the rim, where R nears 1
    transport = Transport(max_depth=300, min_weight=1e-13)
    image = render(Scene(camera, (BALL,), background=WHITE, transport=transport), 16, 16)
    assert np.abs(image.pixels - 1).max() < 1e-9


def test_what_is_cut_bounds_what_is_missing() -> None:
    """Deeper and deeper, an image grows by no more than had been cut."""
    scenes = [
        Scene(CAMERA, (BALL, CORE), background=(0.5, 1.0, 0.2), transport=Transport(depth, 0.0))
        for depth in (3, 5, 8, 12)
    ]
    images = [render(scene, 24, 24) for scene in scenes]
    for coarse, fine in pairwise(images):
        grown = (fine.pixels - coarse.pixels).max(axis=2)
        assert (grown >= -1e-15).all()
        assert (grown <= coarse.cut + 1e-15).all()
        assert (fine.cut <= coarse.cut + 1e-15).all()


# --- threads --------------------------------------------------------------------------------------


def test_threads_change_no_bit() -> None:
    scene = Scene(CAMERA, (BALL, CORE), background=(0.5, 1.0, 0.2))
    images = [render(scene, 61, 37, threads) for threads in (1, 2, 3, 7, None)]
    for image in images[1:]:
        assert (image.pixels == images[0].pixels).all()
        assert (image.cut == images[0].cut).all()
        assert (image.closest == images[0].closest).all()
        assert image.rays == images[0].rays
