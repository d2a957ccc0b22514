"""Rays in solids that are alone are followed by themselves: as one by one, and as in physics.

A solid is also made one that is not alone, by a speck inside it that no ray meets.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.tracer.scenes import GLASS, X, Y, Z
from tests.tracer.test_properties import SHAPES
from tracer import Orthographic, Perspective, Scene, Solid, Surface, render
from tracer.apart import BALL as BALL_ALONE
from tracer.apart import CROWD, FLAT, alone
from tracer.arrays import ALONE, flatten
from tracer.patterns import Ramp
from tracer.scene import Diffuse, Emissive, Medium, Transport
from tracer.shapes import Disk, Plane, Rectangle, Sphere
from tracer.solids import Cell, polyhedron
from tracer.vector import Vec

CAMERA = Perspective((0.0, 0.0, 6.0), X, Y, (0.0, 0.0, -1.0), 0.2)
WALL = Surface(
    Rectangle((0.0, 0.0, -3.0), X, Y, Z, (4.0, 4.0)),
    Emissive(Ramp((0.1, 0.3, 0.9), (0.9, 0.6, 0.2))),
)
BALL = Solid(Sphere((0.1, -0.2, 0.3), 0.7), GLASS)
AROUND = (0.3, 0.4, 0.5)


def with_specks(scene: Scene) -> Scene:
    specks = []
    for solid in scene.solids:
        assert isinstance(solid.shape, Sphere | Cell)
        x, y, z = solid.shape.center
        disk = Disk((x + 1e-3 * math.pi, y + 1e-3 * math.e, z), X, Y, Z, 1e-9)
        specks.append(Surface(disk, Diffuse(AROUND)))
    return replace(scene, surfaces=(*scene.surfaces, *specks))


def turned_box(center: Vec, half: Vec) -> Cell:
    """Its axes are (2, 2, 1) / 3, (1, -2, 2) / 3 and (2, -1, -2) / 3."""
    axes = np.array([[2, 2, 1], [1, -2, 2], [2, -1, -2]]) / 3.0
    planes = [
        Plane(tuple((sign * axis).tolist()), float(sign * axis @ center) + size)
        for axis, size in zip(axes, half, strict=True)
        for sign in (1.0, -1.0)
    ]
    signs = [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
    return polyhedron(
        planes, [tuple((center + (half * np.array(s)) @ axes).tolist()) for s in signs]
    )


RUBY = Medium(1.5, (0.1, 0.7, 2.0))
TWO = (BALL, Solid(Sphere((-0.9, 0.3, 0.0), 0.3), RUBY))
BLOCK = Solid(turned_box((0.1, -0.3, 0.2), (0.5, 0.3, 0.4)), GLASS)
PILE = (*TWO, Solid(turned_box((0.5, 0.95, -0.2), (0.3, 0.2, 0.1)), RUBY))


@pytest.mark.parametrize(
    ("solids", "ambient", "transport"),
    [
        ((BALL,), 1.0, Transport(40, 1e-6)),
        ((BALL,), 1.0, Transport(40, 1e-9)),
        ((BALL,), 1.0, Transport(5, 0.0)),
        ((BALL,), 1.0, Transport(2, 0.0)),
        ((BALL,), 1.0, Transport(40, 1e-6, radiance_n2=True)),
        ((BALL,), 1.0, Transport(40, 1e-6, reflection=False)),
        ((BALL,), 1.0, Transport(40, 1e-6, transmission=False)),
        ((BALL,), 1.5, Transport(40, 1e-6)),
        ((BALL,), 2.0, Transport(40, 1e-6)),  # a bubble
        (TWO, 1.0, Transport(40, 1e-6)),
        ((BLOCK,), 1.0, Transport(16, 1e-6)),
        ((BLOCK,), 1.0, Transport(16, 1e-6, radiance_n2=True)),
        ((BLOCK,), 1.0, Transport(5, 0.0)),
        ((BLOCK,), 1.0, Transport(16, 1e-6, reflection=False)),
        ((BLOCK,), 1.0, Transport(16, 1e-6, transmission=False)),
        ((BLOCK,), 2.0, Transport(16, 1e-6)),
        (PILE, 1.0, Transport(16, 1e-6)),
    ],
)
def test_a_solid_by_itself_shows_the_same(
    solids: tuple[Solid, ...], ambient: float, transport: Transport
) -> None:
    """Each weight is a product of at most 40 factors, each direction turned as often: 1e-11.

    Every ray is followed in both, unless its weight is within rounding of the least.
    """
    scene = Scene(
        CAMERA, solids, (WALL,), ambient=Medium(ambient), background=AROUND, transport=transport
    )
    other = with_specks(scene)
    assert flatten(scene).objects[: len(solids), ALONE].all()
    assert not flatten(other).objects[:, ALONE].any()  # all CROWD
    mine, one_by_one = render(scene, 61, 47), render(other, 61, 47)
    assert mine.rays == one_by_one.rays > 61 * 47
    np.testing.assert_allclose(mine.pixels, one_by_one.pixels, rtol=0, atol=1e-11)
    np.testing.assert_allclose(mine.cut, one_by_one.cut, rtol=0, atol=1e-11)
    np.testing.assert_allclose(mine.closest, one_by_one.closest, rtol=1e-11)


@pytest.mark.parametrize("sine", [0.0, 0.3, 0.9, 0.999])
def test_light_in_a_ball_that_absorbs_is_a_geometric_series(sine: float) -> None:
    """All in white, a ray shows ``R + (1 - R)^2 a / (1 - R a)`` with a = exp(-absorption chord)."""
    camera = Orthographic((sine, 0.0, 6.0), X, Y, (0.0, 0.0, -1.0), 1e-12)
    ball = Solid(Sphere((0.0, 0.0, 0.0), 1.0), RUBY)
    scene = Scene(camera, (ball,), background=(1.0, 1.0, 1.0), transport=Transport(200, 0.0))
    cos_i, cos_t = math.sqrt(1.0 - sine**2), math.sqrt(1.0 - (sine / 1.5) ** 2)
    s = (cos_i - 1.5 * cos_t) / (cos_i + 1.5 * cos_t)
    p = (1.5 * cos_i - cos_t) / (1.5 * cos_i + cos_t)
    R, a = 0.5 * (s * s + p * p), np.exp(-2.0 * cos_t * np.array(RUBY.absorption))
    expected = R + (1.0 - R) ** 2 * a / (1.0 - R * a)
    # The pixel's place is rounded to eps, at the rim R changes 1 / cos_i times as fast.
    assert render(scene, 1, 1).pixels[0, 0] == pytest.approx(expected, rel=1e-13)


BALLS = [[0.0, 0.0, 0.0, 1.0], [3.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, math.inf]]
UNIT = Sphere((0.0, 0.0, 0.0), 1.0)


@pytest.mark.parametrize(
    ("face", "kind"),
    [
        (Plane(Z, -1.0), BALL_ALONE),  # a floor that it lies on
        (Plane(Z, -0.999), CROWD),
        (Rectangle((0.0, 1.5, 0.0), X, Y, Z, (9.0, 0.9)), BALL_ALONE),
        (Rectangle((0.0, 1.5, 0.0), X, Y, Z, (9.0, 1.1)), CROWD),
        (Rectangle((1.2, 1.2, 0.0), X, Y, Z, (0.9, 0.9)), BALL_ALONE),  # its corner: 0.75, 0.75
        (Rectangle((1.2, 1.2, 0.0), X, Y, Z, (1.1, 1.1)), CROWD),
        (Disk((1.2, 1.2, 0.0), X, Y, Z, 0.6), BALL_ALONE),
        (Disk((1.2, 1.2, 0.0), X, Y, Z, 0.8), CROWD),
        (Disk((0.0, 0.0, 0.5), X, Y, Z, 1e-9), CROWD),
    ],
)
def test_a_ball_that_has_a_face_inside_is_not_alone(
    face: Plane | Rectangle | Disk, kind: int
) -> None:
    assert alone([UNIT, UNIT], BALLS, {2: face})[0] == kind


@pytest.mark.parametrize(
    ("height", "kind"), [(-1.001, FLAT), (-1.0, CROWD), (-0.9, CROWD), (1.001, FLAT)]
)
def test_a_cube_above_or_below_a_floor_is_alone(height: float, kind: int) -> None:
    """One that stands on it is not: where a ray leaves the cube, it meets the floor at once."""
    balls = [[0.0, 0.0, 0.0, 3.0], [0.0, 0.0, 0.0, math.inf]]
    assert alone([SHAPES["cube"]], balls, {1: Plane(Z, height)}) == [kind]
    assert alone([SHAPES["rod"]], balls, {1: Plane(Z, height)}) == [CROWD]


def test_solids_that_touch_are_not_alone() -> None:
    far = [[0.0, 0.0, 0.0, 1.0], [2.001, 0.0, 0.0, 1.0]]
    touching = [[0.0, 0.0, 0.0, 1.0], [2.0, 0.0, 0.0, 1.0]]
    assert alone([UNIT, UNIT], far, {}) == [BALL_ALONE, BALL_ALONE]
    assert alone([UNIT, UNIT], touching, {}) == [CROWD, CROWD]
    assert alone([UNIT], touching, {}) == [BALL_ALONE]  # the other is a surface
    assert alone([UNIT], [[0.0, 0.0, 0.0, 1.0], [1.9, 0.0, 0.0, 1.0]], {}) == [CROWD]
