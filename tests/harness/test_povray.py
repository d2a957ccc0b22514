"""POV-Ray's images against closed forms computed here.

Tolerances. An image is 16 bits: after the exposure is undone a pixel is off by at most half a step
of 1 / (65535 exposure), plus single precision rounding on the way (`SINGLE`, a few of its 6e-8
relative steps). A position is (cell + fine) / cells with fine = green / blue, so an error q of
both channels moves it by at most q (1 + fine) / blue / cells of the plane's size: see `located`.
Indices, and ratios of indices of nested media, are single precision in POV-Ray: the ones used here
are exact, or rounded alike.
"""

from __future__ import annotations

import base64
import math
import shutil
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from harness.errors import RendererFailed, RendererMissing, RendererUnsupported
from harness.renderers.base import Capability, Image, Renderer, RenderSettings
from harness.renderers.povray import INSTALL, PovRayRenderer
from harness.scene import resolved as rs
from harness.translate.povray import PovScene, options, translate
from tests.harness.povray_scenes import (
    AIR,
    GLASS,
    Array,
    box,
    camera,
    frame,
    fresnel,
    glow,
    make_scene,
    on_plane,
    on_sphere,
    rays,
    rectangle,
    refract,
)

pytestmark = [
    pytest.mark.povray,
    pytest.mark.skipif(shutil.which("povray") is None, reason=f"needs POV-Ray: {INSTALL}"),
]

Mask = NDArray[np.bool_]
SETTINGS = RenderSettings(threads=1)
SINGLE = 4e-7  # of the brightest radiance: six roundings to single precision
CELLS = 1000
N = 1.5
BALL = rs.Sphere(center=(0, 0, 0), radius=1)
BEHIND = rectangle((0.1, 0, -3), (16, 16))


def images(*scenes: rs.ResolvedScene) -> list[Array]:
    """All at the same time, since a POV-Ray process sleeps most of its life. (H * W, 3) each."""
    renderer = PovRayRenderer()
    with ThreadPoolExecutor(8) as pool:
        done = list(pool.map(lambda scene: renderer.render(scene, SETTINGS), scenes))
    assert [image.log for image in done] == [""] * len(scenes)
    return [image.pixels.reshape(-1, 3).astype(np.float64) for image in done]


def step(scene: rs.ResolvedScene) -> float:
    """How far a pixel may be from what it should be."""
    return (0.5 / 65535 + SINGLE) / translate(scene).exposure


def assert_image(scene: rs.ResolvedScene, expected: Array, where: Mask | None = None) -> None:
    (pixels,) = images(scene)
    difference = np.abs(pixels - expected)[slice(None) if where is None else where]
    assert difference.size > 0
    assert difference.max() <= step(scene)


def with_transport(scene: rs.ResolvedScene, **change: object) -> rs.ResolvedScene:
    return scene.model_copy(update={"transport": scene.transport.model_copy(update=change)})


def coded(scene: rs.ResolvedScene, plane: rs.Rectangle, axis: str, path: str) -> rs.ResolvedScene:
    """`scene` with nothing luminous but a position code, deep enough for `path` alone."""
    code = rs.PositionCode.model_validate({"axis": axis, "cells": CELLS, "amplitude": 1.0})
    kept = tuple(s for s in scene.surfaces if isinstance(s.material, rs.Mirror))
    face = rs.Surface(name="code", shape=plane, material=rs.Emissive(pattern=code))
    lobes = {"reflection": "R" in path, "transmission": "T" in path or not path}
    dark = scene.model_copy(update={"surfaces": (*kept, face), "background": (0.0, 0.0, 0.0)})
    return with_transport(dark, max_depth=len(path) + 1, min_weight=0.0, **lobes)


def located(scene: rs.ResolvedScene, plane: rs.Rectangle, path: str) -> tuple[Array, Array, Array]:
    """Where rays land on `plane` in its frame, and by how much that may be wrong; NaN if dark."""
    found, allowed = [], []
    q = 0.5 / 65535 + SINGLE
    for pixels, size in zip(
        images(*(coded(scene, plane, axis, path) for axis in "uv")), plane.size, strict=True
    ):
        red, green, blue = np.where(pixels[:, 2:] > 1e-3, pixels, np.nan).T
        fine = green / blue
        cell = np.round(red / blue * CELLS - fine)
        found.append(((cell + fine) / CELLS - 0.5) * size)
        allowed.append(q * (1 + fine) / blue / CELLS * size)
    return found[0], found[1], np.maximum(*allowed)


def assert_landed(
    scene: rs.ResolvedScene, plane: rs.Rectangle, path: str, origins: Array, directions: Array
) -> None:
    """All rays that leave towards `plane` were located on it, within what 16 bits allow."""
    x, y, distance = on_plane(origins, directions, plane.frame)
    inside = (np.abs(x) < plane.size[0] / 2) & (np.abs(y) < plane.size[1] / 2) & (distance > 0)
    assert inside.sum() > 500
    found_x, found_y, allowed = located(scene, plane, path)
    error = np.maximum(np.abs(found_x - x), np.abs(found_y - y))[inside]
    assert np.isfinite(error).all()
    assert (error <= allowed[inside]).all()


# --- camera and patterns ------------------------------------------------------------------------

PERSPECTIVE = camera((0.3, 0.4, 6), (0.5, -0.2, -3), 33)
PARALLEL = rs.Orthographic(
    origin=(-5.5, 0.2, 5), right=(0.8, 0, 0.6), up=(0, 1, 0), forward=(0.6, 0, -0.8), width=7
)
TILTED = rectangle((0.5, -0.2, -3), (6, 4), z=(0.3, -0.2, 1), up=(0.2, 1, 0))
TEXELS = np.random.default_rng(1).integers(0, 65536, (37, 53, 3)).astype("<u2")
PICTURE = rs.Picture(width=53, height=37, pixels=base64.b64encode(TEXELS.tobytes()).decode())


def picture_at(u: Array, v: Array) -> Array:
    return np.asarray(TEXELS[((1 - v) * 37).astype(int), (u * 53).astype(int)] / 65535)


def checker_at(u: Array, v: Array) -> Array:
    even = (np.floor(u * 31) + np.floor(v * 17)) % 2 == 0
    return np.where(even[:, None], (0.1, 0.3, 0.9), (0.9, 0.6, 0.2))


def ramp_at(u: Array, v: Array) -> Array:
    return np.array((0.1, 2, 0.5)) + v[:, None] * (np.array((3, 0.2, 0.5)) - (0.1, 2, 0.5))


PATTERNS: list[tuple[rs.Pattern, Callable[[Array, Array], Array]]] = [
    (PICTURE, picture_at),
    (rs.Checker(a=(0.1, 0.3, 0.9), b=(0.9, 0.6, 0.2), cells=(31, 17)), checker_at),
    (rs.Ramp(start=(0.1, 2, 0.5), end=(3, 0.2, 0.5), axis="v"), ramp_at),
]


@pytest.mark.parametrize(("pattern", "at"), PATTERNS, ids=["picture", "checker", "ramp"])
def test_patterns_lie_where_they_should(
    pattern: rs.Pattern, at: Callable[[Array, Array], Array]
) -> None:
    """A picture of noise is as asymmetric as can be: it tells every mirror image and shift."""
    faces = (TILTED, rs.Disk(frame=TILTED.frame, radius=2))
    scenes = [
        make_scene(view, surfaces=[(face, rs.Emissive(pattern=pattern))])
        for view in (PERSPECTIVE, PARALLEL)
        for face in faces
    ]
    for scene, face, pixels in zip(scenes, faces * 2, images(*scenes), strict=True):
        x, y, _ = on_plane(*rays(scene), TILTED.frame)
        if isinstance(face, rs.Disk):
            u, v, inside = x / 4 + 0.5, y / 4 + 0.5, np.hypot(x, y) < 2
        else:
            u, v = x / 6 + 0.5, y / 4 + 0.5
            inside = (np.abs(x) < 3) & (np.abs(y) < 2)
        assert 0.2 < inside.mean() < 1
        seen = at(np.clip(u, 0, 1 - 1e-9), np.clip(v, 1e-9, 1))
        assert np.abs(pixels - np.where(inside[:, None], seen, 0)).max() <= step(scene)


def test_texels_come_back_to_the_bit() -> None:
    scene = make_scene(PERSPECTIVE, surfaces=[(TILTED, rs.Emissive(pattern=PICTURE))])
    (pixels,) = images(scene)
    values = pixels * 65535
    assert np.abs(values - np.round(values)).max() < 0.01
    assert set(np.round(values[:, 0])) <= {0, *TEXELS[..., 0].ravel().tolist()}


@pytest.mark.parametrize("axis", ["u", "v"])
def test_position_codes_of_many_cells(axis: str) -> None:
    """16384 cells are as exact as 1000: within a cell, a place is known to 1 / 65535 of it."""
    code = rs.PositionCode.model_validate({"axis": axis, "cells": 16384, "amplitude": 1.0})
    scene = make_scene(PERSPECTIVE, surfaces=[(TILTED, rs.Emissive(pattern=code))])
    x, y, _ = on_plane(*rays(scene), TILTED.frame)
    c = x / 6 + 0.5 if axis == "u" else y / 4 + 0.5
    inside = (np.abs(x) < 3) & (np.abs(y) < 2)
    fine = c * 16384 % 1
    inside &= (fine > 1e-6) & (fine < 1 - 1e-6)  # where a cell ends no rounding is right
    expected = np.stack([c, fine, np.ones_like(c)], axis=1)
    assert_image(scene, expected, where=inside)


# --- where rays go ------------------------------------------------------------------------------


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


def through_ball(
    ball: rs.Sphere, origins: Array, directions: Array, outside: float, inside: float
) -> tuple[Array, Array]:
    center = np.array(ball.center)
    first = on_sphere(origins, directions, ball, far=False)
    inner = refract(directions, (first - center) / ball.radius, outside, inside)
    second = on_sphere(first, inner, ball, far=True)
    return second, refract(inner, (center - second) / ball.radius, inside, outside)


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


def polygons(solid: rs.Convex, turned: rs.Frame) -> rs.Mesh:
    """The faces of `solid`, four-sided each, as triangles in another frame."""
    to_world = np.array([turned.x, turned.y, turned.z])
    corners = np.array(solid.vertices) @ to_world + np.array(turned.origin)
    return rs.Mesh(
        vertices=tuple(map(tuple, corners.tolist())),
        triangles=tuple(t for a, b, c, d in solid.faces for t in ((a, b, c), (a, c, d))),
    )


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


# --- how much light -----------------------------------------------------------------------------

HALF_SPACE = box((-300, -300, -200), (300, 300, 0))
FROM_AIR = camera((0, 0, 0.5), (0.5, 0, 0), 88)
FROM_GLASS = camera((0, 0, -0.5), (0.5, 0, 0), 88, medium=1)


@pytest.mark.parametrize("inside", [False, True], ids=["from air", "from glass"])
def test_fresnel(inside: bool) -> None:
    """R and T separately, from normal to grazing incidence; beyond critical R is 1 and T is 0.

    The emitter is what the reflected or the transmitted ray alone can see.
    """
    view, n_from, n_to = (FROM_GLASS, N, 1) if inside else (FROM_AIR, 1, N)
    beneath = rectangle((0, 0, -1), (599, 599))
    scene = make_scene(view, solids=[(HALF_SPACE, 1, 0)], depth=2)
    sky = scene.model_copy(update={"background": (1.0, 1.0, 1.0)})
    ground = make_scene(
        view, solids=[(HALF_SPACE, 1, 0)], surfaces=[(beneath, glow(1, 1, 1))], depth=2
    )
    reflected, transmitted = (ground, sky) if inside else (sky, ground)
    directions = rays(scene)[1]
    cosine = np.abs(directions[:, 2])
    towards = (directions[:, 2] > 0) == inside
    # Rays to the emitter beneath go at most from one metre of it to its edge.
    towards &= cosine > 0.01
    expected = fresnel(cosine, n_from, n_to)[:, None] * np.ones(3)
    if inside:
        assert 0.2 < (expected[towards] == 1).mean() < 0.9
    assert_image(reflected, expected, where=towards)
    assert_image(transmitted, 1 - expected, where=towards)
    assert_image(with_transport(reflected, transmission=False), expected, where=towards)
    # Without reflection the transmitted ray keeps its light, and total reflection stays.
    total = (expected == 1).astype(float)
    assert_image(with_transport(transmitted, reflection=False), 1 - total, where=towards)
    if inside:
        assert_image(with_transport(reflected, reflection=False), total, where=towards)


def test_furnace() -> None:
    """A white world stays white. What is lost: weights below 1e-7, of which each ball sheds few."""
    scene = make_scene(
        camera((0, 0, 6), (0, 0, 0), 25),
        solids=[(BALL, 1, 0)],
        background=(1.0, 1.0, 1.0),
        depth=256,
    )
    (pixels,) = images(scene)
    assert np.abs(pixels - 1).max() <= 1.01 / 65535


ABSORBING = rs.Medium(name="glass", ior=N, absorption=(0.3, 1.0, 2.5))


def test_beer_lambert() -> None:
    slab = box((-30, -30, -1), (30, 30, 0))
    scene = make_scene(
        camera((0, 0, 0.5), (0.4, 0, -0.6), 70),
        solids=[(slab, 1, 0)],
        surfaces=[(rectangle((0, 0, -2), (60, 60)), glow(1, 1, 1))],
        media=(AIR, ABSORBING),
        depth=3,
    )
    cosine = -rays(scene)[1][:, 2]
    path = 1 / np.sqrt(1 - (1 - cosine**2) / N**2)
    passed = np.exp(-np.outer(path, ABSORBING.absorption))
    expected = (1 - fresnel(cosine, 1, N)[:, None]) ** 2 * passed
    assert_image(scene, expected)


def test_absorption_goes_on_after_total_reflection() -> None:
    """A prism of 45 degrees: every ray goes one unit in all, part before, part after it turns."""
    s = math.sqrt(0.5)
    solid = rs.Convex(
        planes=((0, 0, 1, 0), (1, 0, 0, 0), (-s, 0, -s, s), (0, -1, 0, 1), (0, 1, 0, 1)),
        vertices=((0, -1, 0), (-1, -1, 0), (0, -1, -1), (0, 1, 0), (-1, 1, 0), (0, 1, -1)),
        faces=((0, 3, 4, 1), (0, 2, 5, 3), (1, 4, 5, 2), (0, 1, 2), (3, 5, 4)),
    )
    view = rs.Orthographic(
        origin=(-0.5, 0, 2), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), width=0.9
    )
    side = rectangle((3, 0, 0), (10, 10), z=(-1, 0, 0))
    scene = make_scene(
        view,
        solids=[(solid, 1, 0)],
        surfaces=[(side, glow(1, 1, 1))],
        media=(AIR, ABSORBING),
        depth=4,
    )
    expected = 0.96**2 * np.exp(-np.array(ABSORBING.absorption)) * np.ones((96 * 64, 1))
    assert_image(scene, expected)


def test_absorbing_surroundings_do_not_reach_into_solids() -> None:
    """Fog outside, a clear ball inside: each leg has its own medium."""
    fog = rs.Medium(name="fog", ior=1.0, absorption=(0.1, 0.2, 0.4))
    view = rs.Orthographic(
        origin=(0, 0, 4), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), width=1
    )
    clear = box((-2, -2, -1), (2, 2, 1))
    scene = make_scene(
        view,
        solids=[(clear, 1, 0)],
        surfaces=[(BEHIND, glow(1, 1, 1))],
        media=(fog, GLASS),
        depth=3,
    )
    expected = 0.96**2 * np.exp(-5 * np.array(fog.absorption)) * np.ones((96 * 64, 1))
    assert_image(scene, expected)


# --- nested solids, camera inside ---------------------------------------------------------------

INNER = rs.Sphere(center=(0.2, 0, 0), radius=0.5)
NESTED = (
    AIR,
    rs.Medium(name="glass", ior=1.5, absorption=(0.2, 0.3, 0.1)),
    rs.Medium(name="gem", ior=3.0, absorption=(0.5, 0.1, 0.7)),
)
CLEAR = tuple(m.model_copy(update={"absorption": (0.0, 0.0, 0.0)}) for m in NESTED)


def test_nested_solids_refract_in_any_order() -> None:
    view = camera((0.3, 0.2, 6), (0.2, 0, 0), 6)
    scene = make_scene(view, solids=[(INNER, 2, 1), (BALL, 1, 0)], media=CLEAR)
    origins, directions = rays(scene)
    first = on_sphere(origins, directions, BALL, far=False)
    directions = refract(directions, first, 1, 1.5)
    origins, directions = through_ball(INNER, first, directions, 1.5, 3)
    last = on_sphere(origins, directions, BALL, far=True)
    assert_landed(scene, BEHIND, "TTTT", last, refract(directions, -last, 1.5, 1))


def test_camera_inside_nested_solids() -> None:
    """Directions are right, and absorption.

    The exit from the inner solid has R = 0 instead of Fresnel's, which is POV-Ray's own doing:
    ComputeRelativeIOR in its trace.cpp divides the index by itself.
    """
    view = camera((0.3, 0.05, 0), (0.2, 0, -1), 40, medium=2)
    solids = [(INNER, 2, 1), (BALL, 1, 0)]
    scene = make_scene(view, solids=solids, media=CLEAR)
    origins, directions = rays(scene)
    first = on_sphere(origins, directions, INNER, far=True)
    inner = np.linalg.norm(first - origins, axis=1)
    normal = (np.array(INNER.center) - first) / INNER.radius
    directions = refract(directions, normal, 3, 1.5)
    last = on_sphere(first, directions, BALL, far=True)
    outer = np.linalg.norm(last - first, axis=1)
    cosine = (directions * last).sum(axis=1)
    assert_landed(scene, BEHIND, "TT", last, refract(directions, -last, 1.5, 1))
    lit = make_scene(view, solids=solids, media=NESTED, surfaces=[(BEHIND, glow(1, 1, 1))], depth=3)
    lengths = np.outer(outer, NESTED[1].absorption) + np.outer(inner, NESTED[2].absorption)
    assert_image(lit, (1 - fresnel(cosine, 1.5, 1))[:, None] * np.exp(-lengths))


def test_camera_inside_a_mesh() -> None:
    """Which POV-Ray finds out by counting triangles along inside_vector."""
    mesh = polygons(box((-2, -2, -1), (2, 2, 1)), frame())
    scene = make_scene(camera((0, 0, 0), (0, 0, -1), 40, medium=1), solids=[(mesh, 1, 0)])
    origins, directions = rays(scene)
    down = np.array([[0.0, 0.0, -1.0]])
    first = origins - directions / directions[:, 2:]
    x, y, _ = on_plane(first, refract(directions, -down, N, 1), BEHIND.frame)
    found_x, found_y, allowed = located(scene, BEHIND, "T")
    # Its planes z = -1 and 1 are exact in single precision.
    assert (np.maximum(np.abs(found_x - x), np.abs(found_y - y)) <= allowed).all()


def test_camera_under_a_dome() -> None:
    """An opaque closed surface around everything is no medium to be in."""
    dome = rs.Sphere(center=(0, 0, 0), radius=20)
    view = camera((0, 0, 6), (0, 0, 0), 25)
    glowing = make_scene(
        view, solids=[(INNER, 2, 1), (BALL, 1, 0)], media=NESTED, surfaces=[(dome, glow(1, 1, 1))]
    )
    sky = glowing.model_copy(update={"surfaces": (), "background": (1.0, 1.0, 1.0)})
    under, outside = images(glowing, sky)
    assert (under == outside).all()


# --- surfaces that bound no medium --------------------------------------------------------------


def test_point_lights_on_diffuse_faces() -> None:
    lights = (
        rs.PointLight(position=(1, 2, 1), intensity=(10, 20, 5)),
        rs.PointLight(position=(-1, -2, 0), intensity=(3, 1, 5)),
    )
    reflectance = (0.8, 0.5, 0.3)
    scene = make_scene(
        PERSPECTIVE, surfaces=[(TILTED, rs.Diffuse(reflectance=reflectance))], lights=lights
    )
    x, y, _ = on_plane(*rays(scene), TILTED.frame)
    axes = TILTED.frame
    points = np.array(axes.origin) + np.outer(x, axes.x) + np.outer(y, axes.y)
    expected = np.zeros((len(x), 3))
    for light in lights:
        towards = np.array(light.position) - points
        falloff = towards @ np.array(axes.z) / np.linalg.norm(towards, axis=1) ** 3
        expected += np.outer(falloff, light.intensity) * reflectance / math.pi
    assert_image(scene, expected, where=(np.abs(x) < 3) & (np.abs(y) < 2))


def test_mirror() -> None:
    mirror = rectangle((0, 0, -1), (10, 10), z=(0.1, 0.2, 1))
    ahead = rectangle((1, 2, 8), (20, 20), z=(0, 0, -1))
    scene = make_scene(
        camera((0.3, 0.4, 6), (0, 0, -1), 33),
        surfaces=[(mirror, rs.Mirror(reflectance=(1, 1, 1)))],
        depth=2,
    )
    origins, directions = rays(scene)
    _, _, distance = on_plane(origins, directions, mirror.frame)
    normal = np.array([mirror.frame.z])
    landed = origins + distance[:, None] * directions
    directions = directions - 2 * (directions @ normal.T) * normal
    assert_landed(scene, ahead, "R", landed, directions)
    tinted = rs.Surface(
        name="tinted", shape=mirror, material=rs.Mirror(reflectance=(0.9, 0.5, 0.2))
    )
    lit = rs.Surface(name="lit", shape=ahead, material=glow(1, 1, 1))
    bright = scene.model_copy(update={"surfaces": (tinted, lit)})
    assert_image(bright, np.full((96 * 64, 3), (0.9, 0.5, 0.2)))


@pytest.mark.parametrize(("filtered", "transmit"), [(0.5, 0.2), (0, 1), (1, 0), (0, 0)])
def test_translucence_as_the_lecture_has_it(filtered: float, transmit: float) -> None:
    color, light = np.array((0.8, 0.4, 0.2)), (1, 2, 5)
    veil = rs.Translucent(color=tuple(color.tolist()), filter=filtered, transmit=transmit)
    scene = make_scene(
        camera((0, 0, 6), (0, 0, 0), 20),
        surfaces=[(rectangle((0, 0, 1), (20, 20)), veil), (BEHIND, glow(0.5, 0.6, 0.7))],
        lights=(rs.PointLight(position=light, intensity=(10, 10, 10)),),
    )
    origins, directions = rays(scene)
    points = origins - 5 / directions[:, 2:] * directions
    towards = np.array(light) - points
    lit = 10 * towards[:, 2:] / np.linalg.norm(towards, axis=1, keepdims=True) ** 3 / math.pi
    passed = (filtered * color + transmit) * (0.5, 0.6, 0.7)
    assert_image(scene, passed + (1 - filtered - transmit) * color * lit)


@pytest.mark.parametrize("normal", [1, -1])
def test_a_clear_face_does_not_change_what_is_behind(normal: int) -> None:
    """POV-Ray takes a ray through an open face to be in it for good, if it is not led out again."""
    clear = rs.Translucent(color=(1, 1, 1), filter=0, transmit=1)
    plain = make_scene(
        camera((0, 0, 6), (0, 0, 0), 20),
        solids=[(BALL, 1, 0)],
        surfaces=[(BEHIND, glow(0.5, 0.6, 0.7))],
        background=(0.2, 0.2, 0.2),
    )
    face = rs.Surface(
        name="clear", shape=rectangle((0, 0, 2), (20, 20), z=(0, 0, normal)), material=clear
    )
    veiled = plain.model_copy(update={"surfaces": (face, *plain.surfaces)})
    with_face, without = images(veiled, plain)
    assert np.abs(with_face - without).max() <= 2 * step(plain)


# --- the process --------------------------------------------------------------------------------

SIMPLE = make_scene(
    camera((0, 0, 6), (0, 0, 0), 25),
    solids=[(BALL, 1, 0)],
    surfaces=[(BEHIND, rs.Emissive(pattern=PICTURE))],
)


def test_it_is_a_renderer() -> None:
    renderer: Renderer = PovRayRenderer()
    assert isinstance(renderer, Renderer)
    assert Capability.THIN_SLAB not in renderer.capabilities
    assert renderer.version().startswith("3.")
    health = renderer.health()
    assert health.usable, health
    assert Path(health.path).is_file()


def test_the_emitted_scene_runs_by_itself(tmp_path: Path) -> None:
    main = PovRayRenderer().emit(SIMPLE, tmp_path / "scene")
    assert main.name == "scene.pov"
    subprocess.run(["povray", "scene.ini"], cwd=main.parent, check=True, capture_output=True)
    stored = (main.parent / "image.ppm").read_bytes()[-96 * 64 * 6 :]
    pixels = np.frombuffer(stored, ">u2").reshape(-1, 3) / 65535
    assert np.abs(pixels - images(SIMPLE)[0]).max() < 1e-6


def test_threads_do_not_matter() -> None:
    one, many = (
        PovRayRenderer().render(SIMPLE, RenderSettings(threads=threads)) for threads in (1, 4)
    )
    assert (one.pixels == many.pixels).all()
    assert one.command == "povray scene.ini +WT1"
    assert one.pixels.dtype == np.float32
    assert one.pixels.shape == (64, 96, 3)
    assert 0 <= one.seconds < 60


def rewritten(monkeypatch: pytest.MonkeyPatch, old: str, new: str) -> None:
    """From now on the translator writes `new` for `old`."""

    def changed(scene: rs.ResolvedScene) -> PovScene:
        made = translate(scene)
        assert old in made.sdl
        return PovScene(
            made.sdl.replace(old, new), made.attachments, made.exposure, made.length_scale
        )

    monkeypatch.setattr("harness.renderers.povray.translate", changed)


def test_warnings_reach_the_log(monkeypatch: pytest.MonkeyPatch) -> None:
    rewritten(monkeypatch, "max_trace_level 20", "max_trace_level 400")
    image: Image = PovRayRenderer().render(SIMPLE, SETTINGS)
    assert " ".join(image.log.split()) == (
        "File 'scene.pov' line 6: Parse Warning: Maximum max_trace_level is 256 but 400 was "
        "specified. Going to use max_trace_level 256."
    )


def test_parse_errors_are_told_word_for_word(monkeypatch: pytest.MonkeyPatch) -> None:
    rewritten(monkeypatch, "ior 1.5", "ior 1.5 nonsense")
    with pytest.raises(RendererFailed, match="undeclared identifier 'nonsense'") as caught:
        PovRayRenderer().render(SIMPLE, SETTINGS)
    assert "Parse Error: No matching } in 'interior'" in " ".join(str(caught.value).split())
    assert caught.value.log.startswith("File 'scene.pov' line ")
    assert "Copyright" not in caught.value.log


def test_an_image_that_is_not_written_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "harness.renderers.povray.options", lambda scene: options(scene) + "Output_To_File=Off\n"
    )
    with pytest.raises(RendererFailed, match="no image"):
        PovRayRenderer().render(SIMPLE, SETTINGS)


def test_eight_bits_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "harness.renderers.povray.options", lambda scene: options(scene) + "Bits_Per_Color=8\n"
    )
    with pytest.raises(RendererFailed, match="8 bits"):
        PovRayRenderer().render(SIMPLE, SETTINGS)


def test_time_is_limited() -> None:
    with pytest.raises(RendererFailed, match=r"0\.01 s"):
        PovRayRenderer().render(SIMPLE, RenderSettings(timeout_s=0.01))


def test_it_says_where_256_levels_are_not_enough() -> None:
    """Between two parallel mirrors light goes on for ever, as far as it is let."""
    mirrors = [
        (rectangle((0, 0, z), (1e4, 1e4), z=(0, 0, -z)), rs.Mirror(reflectance=(1, 1, 1)))
        for z in (-1, 1)
    ]
    scene = make_scene(camera((0, 0, 0), (0, 0.1, -1), 10), surfaces=mirrors, depth=256)
    images(scene)
    with pytest.raises(RendererUnsupported, match=r"max_depth asks for 257"):
        PovRayRenderer().render(with_transport(scene, max_depth=257), SETTINGS)


def test_missing() -> None:
    renderer = PovRayRenderer("snellcheck-no-such-program")
    for ask in (renderer.version, lambda: renderer.render(SIMPLE, SETTINGS)):
        with pytest.raises(RendererMissing, match="install povray"):
            ask()
    health = renderer.health()
    assert not health.usable
    assert health.remedy == INSTALL


def test_too_old(tmp_path: Path) -> None:
    old = tmp_path / "povray"
    old.write_text("#!/bin/sh\necho 'POV-Ray 3.6.1' >&2\n")
    old.chmod(0o755)
    with pytest.raises(RendererMissing, match=r"POV-Ray 3\.6\.1 is too old"):
        PovRayRenderer(str(old)).version()


def test_settings_of_the_user_do_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    personal = tmp_path / ".povray" / "3.7" / "povray.ini"
    personal.parent.mkdir(parents=True)
    personal.write_text("Antialias=On\nAntialias_Threshold=0\nGrayscale_Output=On\n")
    before = images(SIMPLE)[0]
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("POVINI", str(personal))
    assert (images(SIMPLE)[0] == before).all()
