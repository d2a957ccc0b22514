"""Chords of convex solids against what defines the solid: an implicit function, negative inside.

The functions here know nothing of roots and planes' order; they only tell inside from outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from harness.expected import Float
from harness.scene.model import Icosphere
from harness.scene.resolved import (
    Cone,
    Convex,
    Cylinder,
    Frame,
    Lens,
    Mesh,
    Solid,
    SolidShape,
    Sphere,
)
from harness.scene.shapes import solid_shape
from harness.truth.chord import Body
from harness.truth.intervals import Chord
from tests.catalogue import EPS

Inside = Callable[[Float], Float]

COORDINATES = st.floats(-3.0, 3.0)
POINTS = st.tuples(COORDINATES, COORDINATES, COORDINATES)
DIRECTIONS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 0.1)
SIZES = st.floats(0.1, 2.0)
# Coordinates are at most 3 + 2 * 2, distances along a line at most a few times that.
EXTENT = 20.0


def body(shape: SolidShape) -> Body:
    return Body(Solid(name="solid", shape=shape, medium=1, exterior=0))


def frame_along(z: tuple[float, float, float], origin: tuple[float, float, float]) -> Frame:
    axis = np.array(z) / math.hypot(*z)
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(axis, helper)
    x /= np.linalg.norm(x)
    y = np.cross(axis, x)
    return Frame(origin=origin, x=tuple(x), y=tuple(y), z=tuple(axis))


def box(center: Float, half: Float) -> Convex:
    planes = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            n = [0.0, 0.0, 0.0]
            n[axis] = sign
            planes.append((*n, sign * center[axis] + half[axis]))
    return Convex(planes=tuple(planes), vertices=(), faces=())


# --- implicit functions: negative inside, zero on the surface, of slope 1 there -------------------


def sphere_function(sphere: Sphere) -> Inside:
    return lambda p: np.linalg.norm(p - np.array(sphere.center), axis=-1) - sphere.radius


def box_function(center: Float, half: Float) -> Inside:
    return lambda p: (np.abs(p - center) - half).max(axis=-1)


def cylinder_function(cylinder: Cylinder) -> Inside:
    axis = np.array(cylinder.frame.z)

    def function(p: Float) -> Float:
        local = p - np.array(cylinder.frame.origin)
        along = local @ axis
        away = np.linalg.norm(local - along[..., None] * axis, axis=-1)
        return np.maximum(away - cylinder.radius, np.abs(along) - cylinder.height / 2)

    return function


def gradient(function: Inside, p: Float) -> Float:
    steps = 1e-6 * np.eye(3)
    return np.array([(function(p + s) - function(p - s)) / 2e-6 for s in steps])


def assert_chord_of(function: Inside, chord: Chord, o: Float, d: Float) -> None:
    """The chord of the line o + t d is where `function` is negative, and nothing else is."""
    t_in, t_out = float(chord.t_in[0]), float(chord.t_out[0])
    if t_in >= t_out:  # missed: no point of the line is inside
        t = np.linspace(-EXTENT, EXTENT, 4001)
        assert function(o + t[:, None] * d).min() >= -1e-9
        return
    assert math.isfinite(t_in)
    assert math.isfinite(t_out)
    middle = (t_in + t_out) / 2
    assert function(o + middle * d) <= 16 * EPS * EXTENT
    for t, n in ((t_in, chord.n_in[0]), (t_out, chord.n_out[0])):
        p = o + t * d
        # A distance t is right to 8 eps of the numbers it is made of, divided by the cosine at
        # which the line meets the surface: but across the surface that cosine is taken back.
        assert abs(function(p)) <= 16 * EPS * EXTENT
        assert abs(np.linalg.norm(n) - 1) <= 16 * EPS * EXTENT
        slope = gradient(function, p)
        if abs(np.linalg.norm(slope) - 1) < 1e-6:  # not at an edge
            assert np.abs(slope - n).max() <= 1e-5
    assert float(chord.n_in[0] @ d) <= 1e-6 <= float(chord.n_out[0] @ d) + 2e-6


def line(o: tuple[float, float, float], d: tuple[float, float, float]) -> tuple[Float, Float]:
    return np.array(o), np.array(d) / math.hypot(*d)


@given(POINTS, SIZES, POINTS, DIRECTIONS)
def test_sphere(
    center: tuple[float, float, float],
    radius: float,
    o: tuple[float, float, float],
    d: tuple[float, float, float],
) -> None:
    sphere = Sphere(center=center, radius=radius)
    origin, direction = line(o, d)
    chord = body(sphere).chords(origin[None], direction[None])[0]
    closest = np.cross(np.array(center) - origin, direction)
    assume(abs(np.linalg.norm(closest) - radius) > 1e-6)  # nor does it graze
    assert (chord.t_in[0] < chord.t_out[0]) == (np.linalg.norm(closest) < radius)
    assert_chord_of(sphere_function(sphere), chord, origin, direction)


@given(POINTS, st.tuples(SIZES, SIZES, SIZES), POINTS, DIRECTIONS)
def test_box(
    center: tuple[float, float, float],
    half: tuple[float, float, float],
    o: tuple[float, float, float],
    d: tuple[float, float, float],
) -> None:
    middle, size = np.array(center), np.array(half)
    origin, direction = line(o, d)
    chord = body(box(middle, size)).chords(origin[None], direction[None])[0]
    assert_chord_of(box_function(middle, size), chord, origin, direction)


@given(DIRECTIONS, POINTS, SIZES, SIZES, POINTS, DIRECTIONS)
def test_cylinder(
    axis: tuple[float, float, float],
    center: tuple[float, float, float],
    radius: float,
    height: float,
    o: tuple[float, float, float],
    d: tuple[float, float, float],
) -> None:
    cylinder = Cylinder(frame=frame_along(axis, center), radius=radius, height=height)
    origin, direction = line(o, d)
    across = np.linalg.norm(np.cross(direction, cylinder.frame.z))
    assume(across == 0 or across > 1e-3)  # nearly along the axis the side's roots cancel
    chord = body(cylinder).chords(origin[None], direction[None])[0]
    away = np.cross(direction, np.array(cylinder.frame.z))
    if across:
        gap = abs(float((origin - np.array(center)) @ away)) / across
        assume(abs(gap - radius) > 1e-6)
    assert_chord_of(cylinder_function(cylinder), chord, origin, direction)


FLAT = frame_along((0, 0, 1), (0, 0, 0))


@pytest.mark.parametrize("x", [0.0, 0.3, 0.999, 1.001, 5.0])
def test_lines_along_the_axis_of_a_cylinder_meet_its_caps(x: float) -> None:
    cylinder = Cylinder(frame=FLAT, radius=1.0, height=3.0)
    chord = body(cylinder).chords(np.array([[x, 0.0, 5.0]]), np.array([[0.0, 0.0, -1.0]]))[0]
    if x > 1:
        assert chord.t_in[0] > chord.t_out[0]
        return
    assert (chord.t_in[0], chord.t_out[0]) == (3.5, 6.5)
    assert chord.n_in[0].tolist() == [0, 0, 1]
    assert chord.n_out[0].tolist() == [0, 0, -1]


@pytest.mark.parametrize("height", [-0.5, 0.5, 1.5])
def test_lines_along_the_faces_of_a_slab_are_inside_or_outside(height: float) -> None:
    slab = box(np.zeros(3), np.array([50.0, 50.0, 1.0]))
    chord = body(slab).chords(np.array([[0.0, 0.0, height]]), np.array([[1.0, 0.0, 0.0]]))[0]
    if abs(height) > 1:
        assert chord.t_in[0] > chord.t_out[0]
    else:
        assert (chord.t_in[0], chord.t_out[0]) == (-50.0, 50.0)


def test_a_line_that_starts_inside_enters_behind_itself() -> None:
    (chord,) = body(Sphere(center=(0, 0, 0), radius=2)).chords(
        np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]])
    )
    assert (chord.t_in[0], chord.t_out[0]) == (-1.0, 3.0)


@pytest.mark.parametrize("thickness", [1e-12, 1e-6, 1.0])
def test_a_slab_of_any_thinness_has_its_two_faces(thickness: float) -> None:
    """Nothing in the closed form is thresholded."""
    slab = box(np.array([0.0, 0.0, -thickness / 2]), np.array([50.0, 50.0, thickness / 2]))
    chord = body(slab).chords(np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.6, -0.8]]))[0]
    assert chord.t_in[0] == pytest.approx(1.25, rel=4 * EPS)
    assert chord.t_out[0] - chord.t_in[0] == pytest.approx(thickness / 0.8, abs=4 * EPS * 1.25)
    assert chord.t_in[0] < chord.t_out[0]


# --- meshes ---------------------------------------------------------------------------------------


def icosphere(subdivisions: int, *, smooth: bool = False) -> Mesh:
    shape = solid_shape(
        Icosphere(type="icosphere", radius=1.0, subdivisions=subdivisions, smooth=smooth),
        Path(),
    )
    assert isinstance(shape, Mesh)
    return shape


BALL = icosphere(1)
BALL_BODY = body(BALL)


@given(POINTS, POINTS)
def test_the_chord_of_a_convex_mesh_is_where_the_line_crosses_its_triangles(
    o: tuple[float, float, float], target: tuple[float, float, float]
) -> None:
    """A line crosses a triangle where it passes all three edges on the same side."""
    way = np.array(target) / 3 - np.array(o)
    assume(np.linalg.norm(way) > 0.1)
    origin, direction = np.array(o), way / np.linalg.norm(way)
    corners = (np.array(BALL.vertices) - origin)[np.array(BALL.triangles)]
    a, b, c = (corners[:, k] for k in range(3))
    volumes = np.stack([np.cross(p, q) @ direction for p, q in ((c, b), (a, c), (b, a))], axis=1)
    assume(np.abs(volumes).min() > 1e-6)  # no edge is met
    crossed = np.all(volumes > 0, axis=1) | np.all(volumes < 0, axis=1)
    weights = volumes[crossed] / volumes[crossed].sum(axis=1, keepdims=True)
    hits = np.sort(np.einsum("ij,ijk->ik", weights, corners[crossed]) @ direction)
    chord = BALL_BODY.chords(origin[None], direction[None])[0]
    assert len(hits) in (0, 2)
    if not len(hits):
        assert chord.t_out[0] < chord.t_in[0]
        return
    # Across the surface a point is right to 16 eps of the coordinates; along the line that is
    # divided by the cosine, which for a chord of a ball of radius 1 is near half its length.
    bound = 16 * EPS * EXTENT / (hits[1] - hits[0])
    assert abs(chord.t_in[0] - hits[0]) <= bound
    assert abs(chord.t_out[0] - hits[1]) <= bound


def test_many_lines_are_the_same_as_one_by_one() -> None:
    """Lines are worked through in chunks, of 2 million pairs of a plane and a line."""
    mesh = icosphere(3)
    rng = np.random.default_rng(1)
    o = rng.normal(size=(4000, 3))
    d = rng.normal(size=(4000, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    assert 4000 * len(mesh.triangles) > 2_000_000
    solid = body(mesh)
    whole = solid.chords(o, d)[0]
    for rows in (slice(0, 10), slice(1990, 2010), slice(3990, 4000)):
        part = solid.chords(o[rows], d[rows])[0]
        for name in ("t_in", "t_out", "n_in", "n_out"):
            assert (getattr(whole, name)[rows] == getattr(part, name)).all()


def test_a_mesh_that_is_not_convex_is_refused() -> None:
    ball = icosphere(1)
    vertices = [list(v) for v in ball.vertices]
    vertices[0] = [0.5 * x for x in vertices[0]]  # dented
    dented = Mesh(vertices=tuple(map(tuple, vertices)), triangles=ball.triangles)
    with pytest.raises(ValueError, match="not convex"):
        body(dented)


def test_a_smoothly_shaded_mesh_is_refused() -> None:
    with pytest.raises(ValueError, match="no closed form"):
        body(icosphere(1, smooth=True))


# --- lenses and cones -----------------------------------------------------------------------------


def conicoid_above(p: Float, radius: float | None, conic: float) -> Float:
    """How far below the face z = sag(r) points are, roughly: positive is below it."""
    r2 = p[..., 0] ** 2 + p[..., 1] ** 2
    if radius is None:
        return np.asarray(-p[..., 2])
    root = np.sqrt(np.maximum(1 - (1 + conic) * r2 / radius**2, 0))
    return np.asarray(r2 / (radius * (1 + root)) - p[..., 2])


def in_lens(lens: Lens, p: Float) -> Float:
    """True where points (n, 3) are inside, by the definition of a lens, in its own frame."""
    lower = conicoid_above(p, lens.radii[0], lens.conics[0]) < 0
    upper = conicoid_above(p - [0, 0, lens.thickness], lens.radii[1], lens.conics[1]) > 0
    return np.asarray(lower & upper & (np.hypot(p[..., 0], p[..., 1]) < lens.aperture))


LENSES = {
    "biconvex": ((4.0, -4.0), (0.0, 0.0), 0.8),
    "biconcave": ((-4.0, 4.0), (0.0, 0.0), 0.3),
    "plano-convex": ((None, -3.0), (0.0, 0.0), 0.6),
    "meniscus": ((2.0, 3.0), (0.0, 0.0), 0.4),
    "ellipsoid": ((3.0, None), (-0.44, 0.0), 1.0),
    "hyperboloid": ((None, -3.0), (0.0, -2.25), 0.6),
    "paraboloids": ((3.0, -3.0), (-1.0, -1.0), 0.7),
    "rod with a round end": ((1.2, None), (0.0, 0.0), 5.0),
}


@pytest.mark.parametrize("name", LENSES)
def test_lenses_are_where_their_definition_says(name: str) -> None:
    """2000 random lines, each cut at its chords' ends: inside between them, outside elsewhere."""
    radii, conics, thickness = LENSES[name]
    place = Frame(origin=(0, 0, 0), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
    lens = Lens(frame=place, thickness=thickness, radii=radii, conics=conics, aperture=1.0)
    rng = np.random.default_rng(7)
    o = rng.normal(size=(2000, 3)) * 2
    d = rng.normal(size=(2000, 3)) * 0.5 + np.array([0, 0, thickness / 2]) - o
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    parts = body(lens).chords(o, d)
    t = np.linspace(-12, 12, 1201)
    for k in range(len(o)):
        inside = in_lens(lens, o[k] + t[:, None] * d[k])
        said = np.zeros(len(t), bool)
        near = np.zeros(len(t), bool)
        for part in parts:
            if part.t_in[k] < part.t_out[k]:
                said |= (t > part.t_in[k]) & (t < part.t_out[k])
                for end in (part.t_in[k], part.t_out[k]):
                    near |= np.abs(t - end) < 1e-9
        assert (said == inside)[~near].all(), (name, k)


@pytest.mark.parametrize("name", LENSES)
def test_normals_of_lenses_point_outwards(name: str) -> None:
    radii, conics, thickness = LENSES[name]
    place = Frame(origin=(0, 0, 0), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
    lens = Lens(frame=place, thickness=thickness, radii=radii, conics=conics, aperture=1.0)
    x = np.linspace(-0.95, 0.95, 39)
    o = np.stack([x, 0.1 + 0 * x, np.full_like(x, -9.0)], axis=1)
    d = np.tile([0.02, 0.0, 1.0], (len(x), 1)) / math.hypot(0.02, 1)
    for part in body(lens).chords(o, d):
        real = part.t_in < part.t_out
        for t, n in ((part.t_in, part.n_in), (part.t_out, part.n_out)):
            p = o[real] + t[real, None] * d[real]
            assert np.abs(np.linalg.norm(n[real], axis=1) - 1).max(initial=0) <= 8 * EPS
            assert not in_lens(lens, p + 1e-6 * n[real]).any()
            assert in_lens(lens, p - 1e-6 * n[real]).all()


@pytest.mark.parametrize("top", [0.0, 0.4])
def test_cones(top: float) -> None:
    place = Frame(origin=(0, 0, 0), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
    cone = Cone(frame=place, radius=1.0, top_radius=top, height=1.5)

    def inside(p: Float) -> Float:
        mantle = 1.0 - (1.0 - top) * p[..., 2] / 1.5
        return np.asarray(
            (p[..., 2] > 0) & (p[..., 2] < 1.5) & (np.hypot(p[..., 0], p[..., 1]) < mantle)
        )

    rng = np.random.default_rng(3)
    o = rng.normal(size=(2000, 3)) * 2
    d = rng.normal(size=(2000, 3)) * 0.5 + np.array([0, 0, 0.7]) - o
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    (chord,) = body(cone).chords(o, d)
    t = np.linspace(-12, 12, 1201)
    for k in range(len(o)):
        said = (t > chord.t_in[k]) & (t < chord.t_out[k])
        near = (np.abs(t - chord.t_in[k]) < 1e-9) | (np.abs(t - chord.t_out[k]) < 1e-9)
        assert (said == inside(o[k] + t[:, None] * d[k]))[~near].all(), k
