"""Highlights, lights from far away, and pictures of all around, against their formulas."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tracer import Orthographic, Perspective, Scene, SceneError, Solid, Surface, render
from tracer.patterns import Picture
from tracer.scene import Diffuse, DirectionalLight, Medium, Phong, PointLight
from tracer.shapes import Rectangle, Sphere

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
DOWN = (0.0, 0.0, -1.0)
FACE = Rectangle((0.0, 0.0, 0.0), X, Y, Z, (4.0, 4.0))
# One pixel, seen along the normal: the viewer is in direction Z of the face's centre.
ABOVE = Orthographic((0.0, 0.0, 6.0), X, Y, DOWN, 1e-9)
SLANT = (0.0, math.sin(0.5), -math.cos(0.5))
GREY = (0.5, 0.25, 0.125)
EPS = 2.0**-52


def seen(*lights: PointLight | DirectionalLight, material: object = None, **more: object) -> object:
    surface = Surface(FACE, material or Diffuse(GREY))  # type: ignore[arg-type]
    scene = Scene(ABOVE, surfaces=(surface,), lights=lights, **more)  # type: ignore[arg-type]
    return render(scene, 1, 1).pixels[0, 0]


def test_light_from_far_away_falls_off_with_the_cosine_alone() -> None:
    light = DirectionalLight(SLANT, (3.0, 2.0, 1.0))
    expected = np.array(GREY) * (3.0, 2.0, 1.0) * math.cos(0.5) / math.pi
    assert seen(light) == pytest.approx(expected, rel=16 * EPS)


def test_light_from_far_away_is_a_point_light_far_away() -> None:
    """At r = 1e6 units the direction to a point light differs by 1e-6 over the face."""
    r = 1e6
    point = PointLight((-r * SLANT[0], -r * SLANT[1], -r * SLANT[2]), (r * r, r * r, r * r))
    assert seen(DirectionalLight(SLANT, (1.0, 1.0, 1.0))) == pytest.approx(seen(point), rel=1e-8)


def test_light_from_far_away_throws_shadows_through_nothing_but_glass() -> None:
    light = DirectionalLight(SLANT, (1.0, 1.0, 1.0))
    between = Sphere((0.0, -2 * math.sin(0.5), 2 * math.cos(0.5)), 0.1)
    surfaces = (Surface(FACE, Diffuse(GREY)), Surface(between, Diffuse(GREY)))
    blocked = Scene(ABOVE, surfaces=surfaces, lights=(light,))
    assert (render(blocked, 1, 1).pixels == 0).all()
    glass = Solid(between, Medium(1.5))
    assert seen(light, solids=(glass,)) == pytest.approx(seen(light), rel=16 * EPS)


@pytest.mark.parametrize("exponent", [1.0, 8.0, 200.0])
def test_a_highlight_has_phongs_formula(exponent: float) -> None:
    """The mirror direction is as far from the normal, where the viewer is, as the light: 0.5."""
    light = DirectionalLight(SLANT, (math.pi, math.pi, math.pi))
    expected = np.array(GREY) * math.cos(0.5) + 0.7 * math.cos(0.5) ** exponent
    found = seen(light, material=Phong(GREY, 0.7, exponent))
    # A power multiplies the relative error of its base by the exponent.
    assert found == pytest.approx(expected, rel=16 * EPS * max(1.0, exponent))


def test_a_highlight_is_on_the_lit_side_only() -> None:
    light = DirectionalLight((0.0, math.sin(0.5), math.cos(0.5)), (1.0, 1.0, 1.0))
    assert (seen(light, material=Phong(GREY, 1.0, 2.0)) == 0).all()


def test_without_a_highlight_phong_is_lambert() -> None:
    light = PointLight((1.0, 2.0, 3.0), (5.0, 5.0, 5.0))
    assert (seen(light, material=Phong(GREY, 0.0, 5.0)) == seen(light)).all()


def test_light_without_meaning_is_refused() -> None:
    with pytest.raises(SceneError, match="unit direction"):
        DirectionalLight((0.0, 0.0, 2.0), GREY)
    with pytest.raises(SceneError, match="at least 0"):
        Phong(GREY, -1.0, 2.0)


# --- a picture of all around ----------------------------------------------------------------------

# Red rises with the azimuth from -z by way of +x, green with the height; texels are 1 degree wide.
COLUMNS = (np.arange(360) + 0.5) / 360
LINES = (np.arange(180) + 0.5) / 180
AROUND = np.zeros((180, 360, 3))
AROUND[..., 0] = COLUMNS
AROUND[..., 1] = 1 - LINES[:, None]


def look(direction: tuple[float, float, float]) -> object:
    forward = np.array(direction) / np.linalg.norm(direction)
    right = np.cross(forward, Z if abs(forward[1]) > 0.9 else Y)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    camera = Perspective((3.0, 2.0, 1.0), *(tuple(v) for v in (right, up, forward)), 1e-6)  # type: ignore[arg-type]
    return render(Scene(camera, background=Picture(AROUND)), 1, 1).pixels[0, 0]


@pytest.mark.parametrize(
    ("direction", "u"),
    [((0, 0, -1), 0.5), ((1, 0, 0), 0.75), ((-1, 0, 0), 0.25), ((1, 0, -1), 0.625)],
)
def test_a_panorama_has_its_middle_ahead_and_right_to_the_right(
    direction: tuple[float, float, float], u: float
) -> None:
    assert look(direction)[:2] == pytest.approx([u, 0.5], abs=1e-12)  # type: ignore[index]


def test_a_panorama_is_upright_and_has_poles() -> None:
    half = 0.5 / 180
    assert look((0, 1, 0))[1] == pytest.approx(1 - half, abs=1e-12)  # type: ignore[index]
    assert look((0, -1, 0))[1] == pytest.approx(half, abs=1e-12)  # type: ignore[index]
    assert look((0, 1, -1))[1] == pytest.approx(0.75, abs=1e-12)  # type: ignore[index]


def test_a_panorama_has_no_seam() -> None:
    """Right behind, the first column and the last meet: their mean."""
    assert look((0, 0, 1))[0] == pytest.approx(0.5, abs=1e-12)  # type: ignore[index]


def test_glass_refracts_a_panorama() -> None:
    """Through the middle of a ball a ray goes straight on, to what is ahead."""
    camera = Perspective((0.0, 0.0, 6.0), X, Y, DOWN, 1e-9)
    ball = Solid(Sphere((0.0, 0.0, 0.0), 1.0), Medium(1.5))
    scene = Scene(camera, solids=(ball,), background=Picture(AROUND))
    alone = Scene(camera, background=Picture(AROUND))
    ahead = render(alone, 1, 1).pixels[0, 0]
    back = np.array(look((0, 0, 1)))
    # 4% of each face is reflected; what comes back leaves forwards or backwards (see optics).
    T = 0.96 * 0.96 / (1 - 0.04**2)
    found = render(scene, 1, 1).pixels[0, 0]
    assert found == pytest.approx(T * ahead + (1 - T) * back, abs=2e-6)
