"""Planes without end: as floors, and as the half-spaces that solids are cut by."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.tracer.scenes import GLASS, Floats, X, Y, cube, one
from tracer import SceneError, render
from tracer.camera import Perspective
from tracer.path import HIT, MISS, follow
from tracer.patterns import Constant, Ramp
from tracer.scene import (
    Diffuse,
    DirectionalLight,
    Emissive,
    Mirror,
    PointLight,
    Scene,
    Solid,
    Surface,
    Translucent,
)
from tracer.shapes import Plane, Rectangle, Sphere
from tracer.solids import difference, intersection, union
from tracer.vector import Vec, normalise

EPS = float(np.finfo(float).eps)
WHITE = (1.0, 1.0, 1.0)
FLOOR = Plane(Y, -1.0)
LEVEL = Perspective((0.0, 0.0, 0.0), X, Y, (0.0, 0.0, -1.0), 1.0)  # looks along the floor
LIT = Surface(FLOOR, Emissive(Constant(WHITE)))


def unit_rays(seed: int, n: int) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(n, 3))
    return rng.normal(size=(n, 3)), directions / np.linalg.norm(directions, axis=1)[:, None]


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_rays_meet_a_plane_where_its_equation_says(size: float) -> None:
    """At ``(offset - n . o) / n . d``, for any plane and from both sides."""
    origins, directions = unit_rays(3, 5000)
    normal, offset = normalise((0.3, -0.5, 0.8)), 0.7 * size
    origins *= size
    scene = Scene(LEVEL, surfaces=(Surface(Plane(normal, offset), Emissive(Constant(WHITE))),))
    found = follow(scene, origins, directions, "")
    height, approach = offset - origins @ normal, directions @ normal
    t = height / approach
    ahead = t > 0
    assert ((found.status == HIT) == ahead).all()
    assert 1000 < ahead.sum() < 4000
    assert (found.status[~ahead] == MISS).all()
    expected = origins[ahead] + t[ahead, None] * directions[ahead]
    # Heights are rounded in units of the coordinates; the slope at which the ray comes spreads it.
    reach = np.abs(origins[ahead]).max(axis=1) + offset
    allowed = 8 * EPS * (reach / np.abs(approach[ahead]) + t[ahead] / np.abs(approach[ahead]))
    assert (np.abs(found.point[ahead] - expected).max(axis=1) <= allowed).all()
    assert found.optical_length[ahead] == pytest.approx(t[ahead], rel=1e-9)


def test_a_floor_reaches_to_the_horizon() -> None:
    """Where a rectangle of any size would end before: the last ray ends 1e15 units away."""
    slopes = np.array([1e-3, 1e-9, 1e-15, 0.0, -1e-15])
    directions = np.stack([0 * slopes, -slopes, -np.sqrt(1 - slopes**2)], axis=1)
    scene = Scene(LEVEL, surfaces=(LIT,))
    found = follow(scene, np.zeros((5, 3)), directions, "")
    assert found.status.tolist() == [HIT, HIT, HIT, MISS, MISS]
    assert found.optical_length[:3] == pytest.approx(1 / slopes[:3], rel=8 * EPS)
    image = render(scene, 64, 64).pixels[..., 0]
    assert (image[:32] == 0).all()
    assert (image[32:] == 1).all()


def test_a_plane_is_a_rectangle_that_is_large_enough() -> None:
    """Every material, to the last bit, where the camera sees no edge of the rectangle."""
    large = Rectangle((0.0, -1.0, 0.0), X, (0.0, 0.0, -1.0), Y, (1e12, 1e12))
    down = normalise((0.0, -1.0, -1.0))
    above = replace(LEVEL, forward=down, up=normalise((0.0, 1.0, -1.0)), tan_half_fov_x=0.5)
    lights = (
        PointLight((1.0, 2.0, -1.0), (9.0, 9.0, 9.0)),
        DirectionalLight(normalise((1.0, -2.0, 0.5)), WHITE),
    )
    ball = Solid(Sphere((0.2, -0.5, -1.0), 0.3), GLASS)
    for material in (
        Diffuse((0.5, 0.6, 0.7)),
        Mirror(),
        Emissive(Constant((0.2, 0.4, 0.8))),
        Translucent((0.9, 0.5, 0.1), 0.5, 0.2),
    ):
        images = [
            render(
                Scene(above, (ball,), (Surface(shape, material),), lights, (0.3, 0.4, 0.5)), 48, 48
            ).pixels
            for shape in (large, FLOOR)
        ]
        assert (images[0] == images[1]).all()
        assert images[0].max() > 0.1


def test_rays_that_graze_a_plane_are_no_nan() -> None:
    """A mirror, a diffuse and a clear floor, met as far away as numbers go."""
    slopes = np.geomspace(1e-320, 1e-2, 400)
    directions = np.stack([0 * slopes, -slopes, -np.sqrt(1 - slopes**2)], axis=1)
    ball = Solid(Sphere((0.0, 3.0, -5.0), 1.0), GLASS)
    lights = (PointLight((0.0, 5.0, 0.0), WHITE), DirectionalLight((0.0, -1.0, 0.0), WHITE))
    for material in (Mirror(), Diffuse(WHITE), Translucent(WHITE, 0.5, 0.5)):
        scene = Scene(LEVEL, (ball,), (Surface(FLOOR, material),), lights, WHITE)
        found = follow(scene, np.zeros((400, 3)), directions)
        assert np.isfinite(found.direction).all()
        assert np.isfinite(found.weight).all()
        flat = replace(LEVEL, tan_half_fov_x=1e-160)
        assert np.isfinite(render(replace(scene, camera=flat), 8, 8).pixels).all()


# --- half-spaces ----------------------------------------------------------------------------------


def test_half_a_ball_is_what_a_half_space_leaves_of_it() -> None:
    """As the ball and a box that holds the same half of it; and without the other half."""
    ball, upper = Sphere((0.0, 0.0, 0.0), 1.0), Plane((0.0, 0.0, -1.0), 0.0)
    box = intersection(ball, *(Plane(p.normal, 2.0) for p in cube().bounds), upper)
    origins, directions = unit_rays(5, 4000)
    origins *= 3.0 / np.linalg.norm(origins, axis=1)[:, None]
    directions = 0.9 * directions - origins  # towards a point of the ball's inside
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    cases = {
        "cut": intersection(ball, upper),
        "in a box": box,
        "without": difference(ball, Plane((0.0, 0.0, 1.0), 0.0)),
    }
    found = {
        name: follow(Scene(LEVEL, (Solid(shape, GLASS),)), origins, directions, vertices=True)
        for name, shape in cases.items()
    }
    for name in ("in a box", "without"):
        assert (found[name].status == found["cut"].status).all()
        assert np.array_equal(found[name].vertices, found["cut"].vertices, equal_nan=True)
    seen = found["cut"].vertices[:, 1, 2]
    assert (seen[np.isfinite(seen)] >= -4 * EPS).all()
    assert (np.abs(seen) <= 4 * EPS).sum() > 100  # rays that meet the flat side


def test_a_plano_convex_lens_is_a_ball_cut_by_a_half_space() -> None:
    """Collimated light on the flat side turns by asin(n h / R) - asin(h / R)."""
    cap = intersection(Sphere((0.0, 0.0, 0.0), 1.0), Plane((0.0, 0.0, 1.0), -0.5))
    scene = Scene(LEVEL, (Solid(cap, GLASS),))
    for h in (0.1, 0.3, 0.5):
        found = one(scene, (h, 0.0, 2.0), (0.0, 0.0, -1.0), "TT")
        turn = math.asin(1.5 * h) - math.asin(h)
        assert found.direction[0] == pytest.approx(
            (-math.sin(turn), 0.0, -math.cos(turn)), abs=8 * EPS * 1.5 / math.cos(turn)
        )


# --- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("normal", "offset"),
    [((0.0, 0.0, 0.0), 0.0), ((0.0, 2.0, 0.0), 0.0), ((0.0, math.nan, 1.0), 0.0), (Y, math.inf)],
)
def test_planes_that_are_none_are_refused(normal: Vec, offset: float) -> None:
    with pytest.raises(SceneError, match="plane: needs a unit normal and a finite offset"):
        Plane(normal, offset)


def test_what_a_plane_cannot_be_is_refused() -> None:
    corner = intersection(FLOOR, Plane(X, 1.0))
    for endless in (corner, union(cube(), FLOOR), difference(FLOOR, cube())):
        with pytest.raises(SceneError, match="wedge: goes on for ever"):
            Solid(endless, GLASS, name="wedge")
    Solid(intersection(corner, cube()), GLASS)
    sheet = Surface(FLOOR, Emissive(Ramp((0.0, 0.0, 0.0), WHITE)), "floor")
    with pytest.raises(SceneError, match="floor: only rectangles and disks can show a pattern"):
        render(Scene(LEVEL, surfaces=(sheet,)), 2, 2)
