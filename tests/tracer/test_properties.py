"""What holds for every ray and every scene: Hypothesis looks for one where it does not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from tests.tracer.scenes import CAMERA, Floats, angles, cube, cube_mesh, glass, prism, wall
from tracer import optics
from tracer.image import render
from tracer.mesh import Mesh
from tracer.path import HIT, MISS, TIR, follow
from tracer.scene import Medium, Scene, Solid, Surface, ThinSlab, Transport
from tracer.shapes import Plane, Quadric, Rectangle, Sphere
from tracer.solids import (
    Cell,
    Compound,
    Side,
    Where,
    cone,
    cylinder,
    difference,
    intersection,
    lens,
    union,
)
from tracer.vector import Vec, dot, normalise

EPS = float(np.finfo(float).eps)
compiled = settings(deadline=None, max_examples=60)  # the first call compiles

seeds = st.integers(0, 2**32 - 1)
iors = st.floats(1.05, 3.0)
SHAPES = {
    "ball": Sphere((0.0, 0.0, 0.0), 1.0),
    "cube": cube(),
    "polygons": cube_mesh(),
    "rod": cylinder((0.0, 0.0, 0.0), (0.6, 0.0, 0.8), 0.7, 1.5),
    "cone": cone((0.0, 0.0, 0.9), (0.0, 0.0, -1.0), 0.8, 1.6),
    "lens": lens((0.0, 0.0, 0.3), (0.0, 0.0, -1.0), (1.5, -1.2), 0.6, 0.5),
    "frustum": cone((0.0, 0.0, 0.9), (0.0, 0.6, -0.8), 0.8, 1.6, 0.3),
    "biconcave lens": lens((0.0, 0.0, 0.2), (0.0, 0.0, -1.0), (-1.5, 1.2), 0.4, 0.8),
    "meniscus": lens((0.0, 0.0, 0.3), (0.0, 0.0, -1.0), (1.5, 2.2), 0.6, 0.8, (-1.0, 0.3)),
    "drilled cube": difference(cube(), cylinder((0.2, 0.1, 0.0), (0.6, 0.0, 0.8), 0.4, 9.0)),
    "ball on a cube": union(cube(), Sphere((0.0, 0.5, 1.0), 0.6)),
    "rounded cube": intersection(cube(), Sphere((0.0, 0.0, 0.0), 1.3)),
    "hyperbolic lens": lens((0.0, 0.0, 0.3), (0.0, 0.0, -1.0), (1.5, -1.2), 0.6, 0.5, (-3.0, 0.0)),
}
shapes = st.sampled_from(sorted(SHAPES))


def rays_at(rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
    """From a sphere of radius 4 to points within the unit cube's reach."""
    origins = rng.normal(size=(n, 3))
    origins *= 4.0 / np.linalg.norm(origins, axis=1)[:, None]
    towards = rng.uniform(-1.0, 1.0, (n, 3)) - origins
    return origins, towards / np.linalg.norm(towards, axis=1)[:, None]


@compiled
@given(seeds, shapes, iors, st.sampled_from(["TT", "TRT", "TRRT"]))
def test_rays_can_be_run_backwards(seed: int, shape: str, ior: float, path: str) -> None:
    origins, directions = rays_at(np.random.default_rng(seed), 200)
    scene = glass(SHAPES[shape], ior)
    there = follow(scene, origins, directions, path, vertices=True)
    out = np.isfinite(there.vertices[:, len(path)]).all(axis=1) & (there.status == MISS)
    out &= np.isnan(there.vertices[:, len(path) + 1]).all(axis=1)
    last = there.vertices[out, len(path)]
    # Rays that graze are ill-conditioned: leave those out whose weight shows it.
    fair = there.weight[out] > (1e-2 if path == "TT" else 1e-5)
    start = last[fair] + there.direction[out][fair]
    back = follow(scene, start, -there.direction[out][fair], path[::-1], vertices=True)
    same = np.abs(back.vertices[:, 1] - last[fair]).max(axis=1, initial=0) <= 1e-9
    again = angles(back.direction, -directions[out][fair])
    assert (again[same] <= 1e-9).all()
    assert np.allclose(back.weight[same], there.weight[out][fair][same], rtol=1e-8)
    assert same.mean() > 0.97 if same.size else True  # the others start inside another face


@compiled
@given(
    st.floats(0.0, math.pi / 2 * 0.9999),
    st.floats(0, 2 * math.pi),
    st.floats(0.3, 4.0),
    st.floats(0.3, 4.0),
    seeds,
)
def test_refraction_keeps_what_it_must(
    theta: float, phi: float, ior_i: float, ior_t: float, seed: int
) -> None:
    """Unit length, one plane, and the tangential part of ior * direction."""
    a, b, c = np.random.default_rng(seed).normal(size=3).tolist()
    n = normalise((a, b, c))
    t, u = perpendicular(n)
    s, k = math.sin(theta), math.cos(theta)
    side = (math.cos(phi), math.sin(phi))
    wi = np.array(n) * k + s * (side[0] * np.array(t) + side[1] * np.array(u))
    wi /= np.linalg.norm(wi)
    transmits, wt_ = optics.refract((wi[0], wi[1], wi[2]), n, ior_i, ior_t)
    assume(transmits)
    wt = np.array(wt_)
    # wi and n are unit to eps; |wt|^2 - 1 holds mu^2 times what |wi|^2 and |n|^2 lack.
    mu = ior_i / ior_t
    assert abs(np.linalg.norm(wt) - 1.0) <= 8 * EPS * max(1.0, mu * mu)
    assert abs(np.dot(np.cross(wi, np.array(n)), wt)) <= 8 * EPS * max(1.0, mu)
    momentum_i = -ior_i * np.cross(wi, np.array(n))
    momentum_t = ior_t * np.cross(wt, np.array(n))
    assert np.abs(momentum_i - momentum_t).max() <= 8 * EPS * max(ior_i, ior_t)
    mirrored = np.array(optics.reflect((wi[0], wi[1], wi[2]), n))
    assert abs(np.linalg.norm(mirrored) - 1.0) <= 8 * EPS
    assert np.abs(np.cross(mirrored + wi, np.array(n))).max() <= 8 * EPS


def perpendicular(n: Vec) -> tuple[Vec, Vec]:
    a = np.cross(np.array(n), [1.0, 0.0, 0.0] if abs(n[0]) < 0.9 else [0.0, 1.0, 0.0])
    a /= np.linalg.norm(a)
    b = np.cross(np.array(n), a)
    return (a[0], a[1], a[2]), (b[0], b[1], b[2])


@compiled
@given(st.floats(1e-3, math.pi / 2 - 1e-3), iors)
def test_refraction_keeps_etendue(theta: float, ior: float) -> None:
    """n^2 cos(theta) d(omega) is the same on both sides: d(sin^2 theta) n^2 is."""
    h = 1e-5
    _, a = optics.snell(theta - h, 1.0, ior)
    _, b = optics.snell(theta + h, 1.0, ior)
    outside = math.sin(2 * theta) * math.sin(2 * h)  # sin^2(theta + h) - sin^2(theta - h)
    inside = ior**2 * math.sin(a + b) * math.sin(b - a)
    assert abs(inside / outside - 1) <= 8 * EPS / (h * min(theta, math.pi / 2 - theta))


@compiled
@given(seeds, shapes, iors, st.floats(1e-6, 1e6))
def test_size_does_not_matter(seed: int, shape: str, ior: float, size: float) -> None:
    size = 2.0 ** round(math.log2(size))  # then scaling is exact, and so must the answer be
    solid = SHAPES[shape]
    origins, directions = rays_at(np.random.default_rng(seed), 100)
    a = follow(glass(solid, ior), origins, directions, "TT")
    b = follow(glass(scaled(solid, size), ior), size * origins, directions, "TT")
    assert (a.status == b.status).all()
    assert (a.direction == b.direction).all()
    assert (a.weight == b.weight).all()


def scaled(shape: object, s: float) -> object:
    def times(v: Vec) -> Vec:
        return s * v[0], s * v[1], s * v[2]

    def bound(b: Plane | Quadric) -> Plane | Quadric:
        if isinstance(b, Plane):
            return Plane(b.normal, s * b.offset)
        return Quadric(times(b.origin), b.axis, s * s * b.a, s * b.b, b.c)

    if isinstance(shape, Mesh):
        return replace(shape, vertices=s * shape.vertices)
    assert isinstance(shape, Sphere | Cell | Compound)
    return mapped(shape, bound, times(shape.center), s * shape.radius)


def mapped(
    shape: Sphere | Cell | Compound,
    bound: Callable[[Plane | Quadric], Plane | Quadric],
    center: Vec,
    radius: float,
) -> Sphere | Cell | Compound:
    """The shape with all of its bounds replaced."""

    def of(where: Where) -> Where:
        if isinstance(where, Side):
            return replace(where, bound=bound(where.bound))
        return replace(where, parts=tuple(map(of, where.parts)))

    if isinstance(shape, Sphere):
        return Sphere(center, radius)
    if isinstance(shape, Cell):
        return Cell(tuple(map(bound, shape.bounds)), center, radius)
    return Compound(of(shape.where), center, radius)


@compiled
@given(seeds, shapes, iors)
def test_turning_the_world_turns_the_rays(seed: int, shape: str, ior: float) -> None:
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    solid = SHAPES[shape]
    origins, directions = rays_at(rng, 100)
    a = follow(glass(solid, ior), origins, directions, "TT", vertices=True)
    directions = directions @ turn.T
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    b = follow(glass(turned(solid, turn), ior), origins @ turn.T, directions, "TT", vertices=True)
    # Rays within 1e-9 of an edge or of critical may fall on the other side of it.
    same = a.status == b.status
    assert same.mean() > 0.97
    close = angles(a.direction @ turn.T, b.direction) <= 1e-9
    assert (close | ~same).mean() > 0.97


def turned(shape: object, turn: Floats) -> object:
    def around(v: Vec) -> Vec:
        x, y, z = (turn @ np.array(v)).tolist()
        return x, y, z

    def bound(b: Plane | Quadric) -> Plane | Quadric:
        if isinstance(b, Plane):
            return Plane(normalise(around(b.normal)), b.offset)
        return replace(b, origin=around(b.origin), axis=normalise(around(b.axis)))

    if isinstance(shape, Mesh):
        return replace(shape, vertices=shape.vertices @ turn.T)
    assert isinstance(shape, Sphere | Cell | Compound)
    return mapped(shape, bound, around(shape.center), shape.radius)


@compiled
@given(seeds, shapes, iors)
def test_energy_is_kept_at_every_interface(seed: int, shape: str, ior: float) -> None:
    """R + T = 1 along both ways that a ray can take, so the weights of all paths sum to 1."""
    origins, directions = rays_at(np.random.default_rng(seed), 100)
    scene = glass(SHAPES[shape], ior)
    met = ~np.isnan(follow(scene, origins, directions, "R", vertices=True).vertices[:, 1, 0])
    reflected = follow(scene, origins, directions, "R").weight[met]
    passed = follow(scene, origins, directions, "T").weight[met]
    assert np.abs(reflected + passed - 1).max(initial=0.0) <= 4 * EPS


@compiled
@given(seeds)
def test_no_ray_is_ever_nan(seed: int) -> None:
    """Random scenes of all shapes, rays of all paths: every number that must be one is one."""
    rng = np.random.default_rng(seed)
    names = rng.choice(sorted(SHAPES), 3, replace=False)
    solids = tuple(
        Solid(moved(SHAPES[name], (3.0 * k - 3.0, 0.0, 0.0)), Medium(float(rng.uniform(0.5, 3))))
        for k, name in enumerate(names)
    )
    face = Rectangle(
        (0.0, 0.0, -2.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (9.0, 9.0)
    )
    scene = Scene(
        CAMERA,
        solids,
        (Surface(face, ThinSlab(Medium(1.5), 0.1)), wall(-5.0)),
        background=(1.0, 1.0, 1.0),
        transport=Transport(20, 1e-4),
    )
    origins, directions = rays_at(rng, 400)
    for path in ("", "T", "R", "TT", "TTTT", "RR", "TRRT", "TTTTTTTT"):
        found = follow(scene, origins, directions, path, vertices=True)
        assert np.isfinite(found.direction).all()
        assert np.isfinite(found.weight).all()
        assert np.isfinite(found.optical_length).all()
        assert np.isfinite(found.point[found.status == HIT]).all()
        assert set(found.status.tolist()) <= {0, 1, 2, 3}
        assert (found.weight[found.status == TIR] > 0).all()
    image = render(scene, 16, 16)
    assert np.isfinite(image.pixels).all()
    assert np.isfinite(image.cut).all()
    assert (image.pixels + image.cut[:, :, None] >= 1 - 1e-9).all()  # nothing darkens a white world


@settings(deadline=None, max_examples=25)
@example(3)  # the tip of a cone in a face of a cube, to the last bit: each lay before the other
@given(seeds)
def test_a_million_rays_through_whatever_overlaps(seed: int) -> None:
    """Solids anywhere, one inside, beside or across another, and rays that begin anywhere."""
    rng = np.random.default_rng(seed)
    names = rng.choice(sorted(SHAPES), 6)
    solids = tuple(
        Solid(
            moved(SHAPES[name], tuple(rng.choice([-0.75, -0.5, 0.0, 0.5, 1.0], 3).tolist())),
            Medium(float(rng.uniform(0.5, 3))),
            priority=k,
        )
        for k, name in enumerate(names)
    )
    scene = Scene(CAMERA, solids, (wall(-5.0),), transport=Transport(60, 0.0))
    origins, directions = rays_at(rng, 40_000)
    # Some along the axes and from within, where planes, corners and axes of the shapes are.
    origins[:4000] = rng.choice([-0.5, 0.0, 0.25, 1.0, 2.0], (4000, 3))
    directions[1000:9000] = np.eye(3)[rng.integers(0, 3, 8000)] * rng.choice([-1, 1], (8000, 1))
    found = follow(scene, origins, directions)
    for numbers in (found.direction, found.weight, found.optical_length):
        assert np.isfinite(numbers).all()
    assert np.abs(np.linalg.norm(found.direction, axis=1) - 1).max() <= 60 * 8 * EPS * 9
    assert ((found.weight >= 0) & (found.weight <= 1)).all()
    assert (found.optical_length >= 0).all()
    assert np.isfinite(found.point[found.status == HIT]).all()
    white = replace(scene, surfaces=(), background=(1.0, 1.0, 1.0), transport=Transport(12, 1e-3))
    image = render(white, 12, 12)
    assert np.abs(image.pixels + image.cut[:, :, None] - 1).max() <= 1e-9


def moved(shape: object, by: Vec) -> object:
    def plus(v: Vec) -> Vec:
        return v[0] + by[0], v[1] + by[1], v[2] + by[2]

    def bound(b: Plane | Quadric) -> Plane | Quadric:
        if isinstance(b, Plane):
            return Plane(b.normal, b.offset + dot(b.normal, by))
        return replace(b, origin=plus(b.origin))

    if isinstance(shape, Mesh):
        return replace(shape, vertices=shape.vertices + np.array(by))
    assert isinstance(shape, Sphere | Cell | Compound)
    return mapped(shape, bound, plus(shape.center), shape.radius)


def test_prism_is_a_solid_of_planes() -> None:
    """A ray along each outward normal, from outside, enters and leaves at opposite points."""
    for plane in prism(60.0).bounds:
        assert isinstance(plane, Plane)
        assert abs(dot(plane.normal, plane.normal) - 1) <= 4 * EPS
