"""Rays through the very edges and corners of meshes, where a rounding decides what they meet."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from tests.tracer.scenes import CAMERA, Floats, Y, cube_mesh
from tracer import SceneError, render
from tracer.camera import Orthographic
from tracer.mesh import Mesh, require_closed
from tracer.path import NO_LEG, follow
from tracer.scene import Medium, Scene, Solid, Transport

NOTHING = Medium(1.0)  # rays go straight on, so a line tells what they must meet


def ball(subdivisions: int) -> Mesh:
    trimesh = pytest.importorskip("trimesh")
    shape = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Mesh(np.array(shape.vertices), np.array(shape.faces, np.int64))


def torus() -> Mesh:
    trimesh = pytest.importorskip("trimesh")
    shape = trimesh.creation.torus(1.0, 0.4, major_sections=24, minor_sections=12)
    return Mesh(np.array(shape.vertices), np.array(shape.faces, np.int64))


def scene(mesh: Mesh) -> Scene:
    return Scene(CAMERA, (Solid(mesh, NOTHING),), transport=Transport(30, 0.0))


def towards(targets: Floats, origins: Floats) -> Floats:
    d = targets - origins
    return np.asarray(d / np.linalg.norm(d, axis=1)[:, None])


def test_no_ray_slips_between_the_triangles_around_a_corner() -> None:
    """From the axes, where symmetry puts corners exactly in the way.

    With edge functions that are triple products of the corners, each of six triangles around a
    corner could take it for another's: the smallest case is a ray along an axis.
    """
    mesh = ball(4)
    for axis, sign in itertools.product(np.eye(3), (-1.0, 1.0)):
        start = 3.0 * sign * axis
        facing = mesh.vertices @ start > 1.2  # the cap that is seen from there, to its rim
        corners = mesh.vertices[facing]
        origins = np.tile(start, (len(corners), 1))
        found = follow(scene(mesh), origins, towards(corners, origins), vertices=True)
        assert (found.solid[:, :3] == [-1, 0, -1]).all()
        assert np.abs(found.vertices[:, 1] - corners).max() < 1e-14


@pytest.mark.parametrize("make", [cube_mesh, lambda: ball(3), torus], ids=["cube", "ball", "torus"])
def test_what_enters_at_an_edge_leaves_there(make: object) -> None:
    """Rays from outside at corners, middles of edges, and points anywhere on edges.

    They must be outside at first and at last, and each crosses as often inwards as outwards. Where
    a ray grazes a corner of many triangles, rounding may leave one in ten thousand inside.
    """
    mesh: Mesh = make()  # type: ignore[operator]
    rng = np.random.default_rng(4)
    edges = mesh.vertices[mesh.triangles][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2, 3)
    chosen = edges[rng.integers(0, len(edges), 12_000)]
    share = rng.choice([0.0, 0.5, np.nan], (12_000, 1))
    share = np.where(np.isnan(share), rng.random((12_000, 1)), share)
    targets = chosen[:, 0] * (1 - share) + chosen[:, 1] * share
    origins = rng.normal(size=(12_000, 3))
    origins *= 4.0 / np.linalg.norm(origins, axis=1)[:, None]
    origins[:2000] = 4.0 * np.eye(3)[rng.integers(0, 3, 2000)]
    found = follow(scene(mesh), origins, towards(targets, origins), vertices=True)
    legs = np.arange(found.solid.shape[1])
    there = found.solid != NO_LEG
    sound = ((found.solid == np.where(legs % 2 == 0, -1, 0)) | ~there).all(axis=1)
    sound &= there.sum(axis=1) % 2 == 1
    assert (~sound).sum() <= 1
    assert there.sum(axis=1).max() < 9 or (there.sum(axis=1) >= 9).sum() <= 1


def test_an_image_whose_rays_meet_the_edges_of_a_cube_goes_on_to_what_is_behind() -> None:
    """Seen along a face's diagonal, at its edges. Rays that went in and out for ever were cut."""
    slope = math.sqrt(0.5)
    right, ahead = (-slope, 0.0, slope), (-slope, 0.0, -slope)
    camera = Orthographic((9.0, 0.0, 9.0), right, Y, ahead, 5.0 * math.sqrt(0.5))
    world = Scene(
        camera,
        (Solid(cube_mesh(), NOTHING),),
        background=(1.0, 1.0, 1.0),
        transport=Transport(8, 0.0),
    )
    image = render(world, 5, 5)
    assert (image.pixels == 1.0).all()
    assert (image.cut == 0.0).all()


@pytest.mark.parametrize("distance", [0.0, 1e5, 1e8])
def test_a_mesh_is_told_from_one_inside_out_wherever_it_is(distance: float) -> None:
    """Its volume is of differences of volumes to the origin, which cancel."""
    mesh = torus()
    away = mesh.vertices + distance * np.array([0.6, -0.48, 0.64])
    require_closed(Mesh(away, mesh.triangles), "cube")
    with pytest.raises(SceneError, match="cube: triangles must be counter-clockwise"):
        require_closed(Mesh(away, mesh.triangles[:, ::-1]), "cube")
