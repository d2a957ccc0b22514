"""Where rays go in POV-Ray, from position codes, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from harness.scene import resolved as rs
from tests.harness.povray_measure import assert_landed, located, needs_povray
from tests.harness.povray_scenes import (
    AIR,
    BALL,
    BEHIND,
    PERSPECTIVE,
    N,
    box,
    camera,
    frame,
    make_scene,
    on_plane,
    polygons,
    rays,
    rectangle,
    refract,
    through_ball,
)

pytestmark = [pytest.mark.povray, needs_povray]


def test_rays_in_the_air() -> None:
    scene = make_scene(PERSPECTIVE)
    assert_landed(scene, BEHIND, "", *rays(scene))


def test_slab() -> None:
    """The camera of the slab family: 0 to 80 degrees in one image."""
    angle = math.radians(38)
    view = camera((0, 0, 0.5), (math.sin(angle), 0, 0.5 - math.cos(angle)), 84)
    scene = make_scene(view, solids=[(box((-30, -30, -1), (30, 30, 0)), 1, 0)])
    origins, directions = rays(scene)
    up = np.array([[0.0, 0.0, 1.0]])
    inner = refract(directions, up, 1, N)
    first = origins - (origins[:, 2:] / directions[:, 2:]) * directions
    second = first - inner / inner[:, 2:]
    plane = rectangle((6, 0, -1.25), (16, 16))
    assert_landed(scene, plane, "TT", second, directions)


def prism(apex_angle: float) -> rs.Convex:
    """Apex edge along y through the origin, opening towards -x, sides of length 3."""
    half = math.radians(apex_angle / 2)
    sine, cosine = 3 * math.sin(half), 3 * math.cos(half)
    corners = [(0.0, y, 0.0) for y in (-2.0, 2.0)] + [
        (-cosine, y, z) for z in (sine, -sine) for y in (-2.0, 2.0)
    ]
    normal = math.sin(half), math.cos(half)
    return rs.Convex(
        planes=(
            (normal[0], 0, normal[1], 0),
            (normal[0], 0, -normal[1], 0),
            (-1, 0, 0, cosine),
            (0, 1, 0, 2),
            (0, -1, 0, 2),
        ),
        vertices=tuple(corners),
        faces=((0, 1, 3, 2), (0, 4, 5, 1), (2, 3, 5, 4), (1, 5, 3), (0, 2, 4)),
    )


def test_prism() -> None:
    solid = prism(40)
    scene = make_scene(camera((-2.5, 0.2, 5), (-1.2, 0, 0), 12), solids=[(solid, 1, 0)])
    origins, directions = rays(scene)
    for k, (n_from, n_to) in enumerate(((1, N), (N, 1))):
        normal = np.array([solid.planes[k][:3]])
        distance = -(origins @ normal.T) / (directions @ normal.T)
        origins = origins + distance * directions
        directions = refract(directions, normal if k == 0 else -normal, n_from, n_to)
    assert (np.abs(origins[:, 1]) < 2).all()  # all rays leave through the second face
    assert_landed(
        scene, rectangle((-3, 0, -4), (16, 16), z=(0.4, 0.1, 1)), "TT", origins, directions
    )


def test_ball() -> None:
    scene = make_scene(camera((0.3, 0.2, 6), (0, 0, 0), 22), solids=[(BALL, 1, 0)])
    assert_landed(scene, BEHIND, "TT", *through_ball(BALL, *rays(scene), 1, N))


def test_bubble_in_water() -> None:
    """Indices are taken relative to that of the surroundings: 1 / 1.25, rounded to single."""
    water = rs.Medium(name="water", ior=1.25)
    view = camera((0.3, 0.2, 6), (0, 0, 0), 10)
    scene = make_scene(view, solids=[(BALL, 1, 0)], media=(water, AIR))
    bubble = float(np.float32(1 / 1.25))
    assert_landed(scene, BEHIND, "TT", *through_ball(BALL, *rays(scene), 1, bubble))


def test_cylinder() -> None:
    """Seen from the side, in a frame of its own: in and out through the round face."""
    axes = frame((0.1, -0.2, 0.3), z=(0.4, 1, 0.2), up=(1, 0, 0))
    shape = rs.Cylinder(frame=axes, radius=1, height=20)
    scene = make_scene(camera((0.3, 0.2, 6), (0.1, -0.2, 0.3), 14), solids=[(shape, 1, 0)])
    origins, directions = rays(scene)
    to_local = np.array([axes.x, axes.y, axes.z]).T
    local, heading = (origins - np.array(axes.origin)) @ to_local, directions @ to_local
    for far, (n_from, n_to) in ((False, (1, N)), (True, (N, 1))):
        a = (heading[:, :2] ** 2).sum(axis=1)
        b = (local[:, :2] * heading[:, :2]).sum(axis=1)
        with np.errstate(invalid="ignore"):
            root = np.sqrt(b**2 - a * ((local[:, :2] ** 2).sum(axis=1) - 1))
        local = local + (((root if far else -root) - b) / a)[:, None] * heading
        outward = local * (1, 1, 0)
        heading = refract(heading, -outward if far else outward, n_from, n_to)
    origins, directions = local @ to_local.T + np.array(axes.origin), heading @ to_local.T
    assert_landed(scene, BEHIND, "TT", origins, directions)


def test_cylinder_has_caps() -> None:
    """Along its axis a cylinder is a slab: no ray changes its direction."""
    shape = rs.Cylinder(frame=frame((0, 0, 0)), radius=1, height=1)
    view = rs.Orthographic(
        origin=(0, 0, 3), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), width=1.4
    )
    scene = make_scene(view, solids=[(shape, 1, 0)])
    assert_landed(scene, BEHIND, "TT", *rays(scene))


def test_mesh_of_a_slab() -> None:
    """As polygons, tilted. Vertices and normals are single precision: 2^-24 of their lengths.

    A normal wrong by 1e-7 turns the rays by (n - 1) 1e-7 at the first face and back at the second;
    a face shifted by 2^-24 of the mesh's size of 4 moves them by less than that. Both together
    stay below 1e-6, where what is said for analytic shapes would be 2.5e-7.
    """
    turned = frame((0.2, 0.1, 0), z=(0.3, 0.2, 1))
    mesh = polygons(box((-2, -2, -1), (2, 2, 0)), turned)
    scene = make_scene(camera((0.3, 0.2, 6), (0.2, 0.1, 0), 12), solids=[(mesh, 1, 0)])
    origins, directions = rays(scene)
    normal = np.array([turned.z])
    x, y, first = on_plane(origins, directions, turned)
    inner = refract(directions, normal, 1, N)
    origins = origins + first[:, None] * directions - inner / (inner @ normal.T)
    x, y, _ = on_plane(origins, directions, BEHIND.frame)
    found_x, found_y, _ = located(scene, BEHIND, "TT")
    assert max(np.abs(found_x - x).max(), np.abs(found_y - y).max()) < 1e-6


def test_smooth_mesh_refracts_at_the_interpolated_normal() -> None:
    """One triangle fills the view; its three normals are tilted, each in its own way."""
    corners = np.array([[-9.0, -5.0, 0.0], [9.0, -5.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, -9.0]])
    normals = np.array([[-0.2, 0.0, 1.0], [0.1, -0.2, 1.0], [0.0, 0.3, 1.0], [0.0, 0.0, -1.0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mesh = rs.Mesh(
        vertices=tuple(map(tuple, corners.tolist())),
        triangles=((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
        normals=tuple(map(tuple, normals.tolist())),
    )
    scene = make_scene(camera((0.3, 0.2, 6), (0, 0, 0), 20), solids=[(mesh, 1, 0)])
    origins, directions = rays(scene)
    first = origins - (origins[:, 2:] / directions[:, 2:]) * directions
    flat = np.column_stack([corners[:3, :2], np.ones(3)]).T
    shares = np.linalg.solve(flat, np.column_stack([first[:, :2], np.ones(len(first))]).T).T
    normal = shares @ normals[:3]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    x, y, _ = on_plane(first, refract(directions, normal, 1, N), BEHIND.frame)
    found_x, found_y, _ = located(scene, BEHIND, "T")
    # Single precision normals (2^-24 each, some operations on them) turn rays over 3 units.
    assert max(np.abs(found_x - x).max(), np.abs(found_y - y).max()) < 2e-6


@pytest.mark.parametrize("size", [1e-5, 1e-3, 1e4])
def test_scenes_of_any_size(size: float) -> None:
    ball = rs.Sphere(center=(0, 0, 0), radius=size)
    scene = make_scene(
        camera((0.3 * size, 0.2 * size, 6 * size), (0, 0, 0), 22), solids=[(ball, 1, 0)]
    )
    plane = rectangle((0.1 * size, 0, -3 * size), (16 * size, 16 * size))
    assert_landed(scene, plane, "TT", *through_ball(ball, *rays(scene), 1, N))


def test_a_slab_thinner_than_the_hit_floor() -> None:
    """8e-5 units are below POV-Ray's floor of 1e-4, where every ray would miss its far face."""
    slab = box((-30, -30, -8e-5), (30, 30, 0))
    scene = make_scene(camera((0, 0, 0.5), (0.6, 0, 0), 60), solids=[(slab, 1, 0)])
    origins, directions = rays(scene)
    inner = refract(directions, np.array([[0.0, 0.0, 1.0]]), 1, N)
    first = origins - (origins[:, 2:] / directions[:, 2:]) * directions
    second = first - 8e-5 * inner / inner[:, 2:]
    assert_landed(scene, rectangle((0, 0, -0.1), (16, 16)), "TT", second, directions)
