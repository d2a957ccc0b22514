"""How much light POV-Ray lets through, sends back and absorbs, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from harness.scene import resolved as rs
from tests.harness.povray_measure import (
    assert_image,
    assert_images,
    assert_landed,
    images,
    located,
    needs_povray,
    with_transport,
)
from tests.harness.povray_scenes import (
    AIR,
    BALL,
    BEHIND,
    GLASS,
    N,
    box,
    camera,
    frame,
    fresnel,
    glow,
    make_scene,
    on_plane,
    on_sphere,
    polygons,
    rays,
    rectangle,
    refract,
    through_ball,
)

pytestmark = [pytest.mark.povray, needs_povray]

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
    # Closer to grazing, rays pass the emitter's edge.
    towards &= cosine > 0.01
    expected = fresnel(cosine, n_from, n_to)[:, None] * np.ones(3)
    if inside:
        assert 0.2 < (expected[towards] == 1).mean() < 0.9
    total = (expected == 1).astype(float)
    pairs = [
        (reflected, expected),
        (transmitted, 1 - expected),
        (with_transport(reflected, transmission=False), expected),
        # Without reflection the transmitted ray keeps its light, and total reflection stays.
        (with_transport(transmitted, reflection=False), 1 - total),
        (with_transport(reflected, reflection=False), total),
    ]
    assert_images(pairs, where=towards)


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
