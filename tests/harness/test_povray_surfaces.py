"""Surfaces that bound no medium, in POV-Ray: diffuse, mirror, translucent."""

from __future__ import annotations

import math

import numpy as np
import pytest

from harness.scene import resolved as rs
from tests.harness.povray_measure import assert_image, assert_landed, images, needs_povray, step
from tests.harness.povray_scenes import (
    BALL,
    BEHIND,
    PERSPECTIVE,
    TILTED,
    camera,
    glow,
    make_scene,
    on_plane,
    rays,
    rectangle,
)

pytestmark = [pytest.mark.povray, needs_povray]


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
