"""Highlights, directional lights and lenses of scene files, as each renderer is given them."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from harness.errors import InputError, RendererUnsupported
from harness.renderers.base import Capability, RenderSettings
from harness.renderers.needs import needs
from harness.renderers.povray import PovRayRenderer
from harness.renderers.tracer import TracerEngine
from harness.scene import resolved as rs
from harness.scene.load import load_cases
from harness.scene.resolve import resolve
from harness.translate import mitsuba
from harness.translate.mitsuba_scale import scaled
from harness.translate.povray import translate
from harness.truth.camera import primary_rays
from tests.harness.povray_measure import needs_povray

SCENES = Path(__file__).parents[2] / "scenes"
RHO, GLINT, EXPONENT = np.array([0.5, 0.25, 0.125]), 0.7, 12.0
TOWARDS = np.array([1.0, 2.0, 2.0]) / 3
IRRADIANCE = np.array([2.0, 1.5, 1.0])


def board(material: rs.Material, *lights: rs.Light) -> rs.ResolvedScene:
    """A face in the plane z = 0 that fills the view."""
    frame = rs.Frame(origin=(0, 0, 0), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
    return rs.ResolvedScene(
        film=rs.Film(width=24, height=16),
        camera=rs.Perspective(
            origin=(0.2, -0.1, 3), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1),
            tan_half_fov_x=0.8,
        ),
        media=(rs.Medium(name="air", ior=1.0),),
        surfaces=(
            rs.Surface(name="b", shape=rs.Rectangle(frame=frame, size=(9, 9)), material=material),
        ),
        lights=lights,
        transport=rs.Transport(max_depth=4, min_weight=0),
    )  # fmt: skip


def glossy(light: rs.Light) -> rs.ResolvedScene:
    phong = rs.Phong(reflectance=tuple(RHO), specular=GLINT, exponent=EXPONENT)
    return board(phong, light)


SUN = rs.DirectionalLight(direction=tuple(-TOWARDS), irradiance=tuple(IRRADIANCE))
LAMP = rs.PointLight(position=(1, 1.5, 2), intensity=(20, 15, 10))


def closed_form(scene: rs.ResolvedScene) -> np.ndarray:
    """(rho cos + s cos(alpha)^e) E / pi at each pixel, by hand."""
    rays = primary_rays(scene)
    point = rays.origins - (rays.origins[:, 2] / rays.directions[:, 2])[:, None] * rays.directions
    (light,) = scene.lights
    if isinstance(light, rs.DirectionalLight):
        to_light = np.broadcast_to(-np.array(light.direction), point.shape)
        arriving = np.broadcast_to(np.array(light.irradiance), point.shape)
    else:
        way = np.array(light.position) - point
        r = np.linalg.norm(way, axis=1, keepdims=True)
        to_light, arriving = way / r, np.array(light.intensity) / r**2
    mirrored = to_light * [-1, -1, 1]
    alpha = np.maximum(np.sum(mirrored * -rays.directions, axis=1), 0)[:, None]
    sent = (RHO * to_light[:, 2:] + GLINT * alpha**EXPONENT) * arriving / math.pi
    return sent.reshape(scene.film.height, scene.film.width, 3)


@pytest.mark.parametrize("light", [SUN, LAMP], ids=["directional", "point"])
def test_the_tracer_shows_the_closed_form(light: rs.Light) -> None:
    scene = glossy(light)
    # The image is float32.
    found = TracerEngine().render(scene, RenderSettings()).pixels
    assert found == pytest.approx(closed_form(scene), rel=2**-23)


@pytest.mark.povray
@needs_povray
@pytest.mark.parametrize("light", [SUN, LAMP], ids=["directional", "point"])
def test_povray_shows_the_closed_form(light: rs.Light) -> None:
    """To half a step of 16 bits of the brightest value, and POV-Ray's colours are float32."""
    scene = glossy(light)
    found = PovRayRenderer().render(scene, RenderSettings()).pixels
    expected = closed_form(scene)
    quantum = 0.5 / 65535 / translate(scene).exposure
    # The lamp's fall-off is right to 1e-6 of it, and five single roundings come on top.
    assert np.abs(found - expected).max() <= quantum + 2e-6 * expected.max()


def test_each_renderer_is_asked_for_what_it_can() -> None:
    assert {Capability.PHONG, Capability.DIRECTIONAL_LIGHT} <= needs(glossy(SUN))
    assert Capability.DIRECTIONAL_LIGHT not in needs(glossy(LAMP))
    with pytest.raises(RendererUnsupported, match="no BSDF that is the scene's phong"):
        mitsuba.describe(glossy(SUN))
    node = mitsuba.describe(board(rs.Diffuse(reflectance=tuple(RHO)), SUN))
    assert node["light_0"]["type"] == "directional"
    assert node["light_0"]["direction"] == list(SUN.direction)


def test_light_from_far_away_is_the_same_at_any_scale() -> None:
    scene = glossy(SUN)
    grown = scaled(scene, 1000.0)
    assert grown.lights == scene.lights
    pictures = [TracerEngine().render(s, RenderSettings()).pixels for s in (scene, grown)]
    assert pictures[0] == pytest.approx(pictures[1], rel=1e-6)


# --- lenses ---------------------------------------------------------------------------------------


def with_lens(**more: float) -> rs.ResolvedScene:
    # No edge of the board lies on the centre of a pixel.
    scene = board(rs.Emissive(pattern=rs.Checker(a=(1, 1, 1), b=(0, 0, 0), cells=(11, 11))))
    lens = {**scene.camera.model_dump(exclude={"type"}), "lens_samples": 4, **more}
    return scene.model_copy(update={"camera": rs.ThinLens.model_validate(lens)})


def test_a_lens_in_focus_shows_what_a_pinhole_shows() -> None:
    sharp, pinhole = with_lens(aperture=0.2, focus=3.0), with_lens(aperture=0.2, focus=3.0)
    camera = rs.Perspective.model_validate(
        pinhole.camera.model_dump(exclude={"type", "aperture", "focus", "lens_samples"})
    )
    pinhole = pinhole.model_copy(update={"camera": camera})
    pictures = [TracerEngine().render(s, RenderSettings()).pixels for s in (sharp, pinhole)]
    assert pictures[0] == pytest.approx(pictures[1], abs=1e-6)
    blurred = TracerEngine().render(with_lens(aperture=0.2, focus=1.0), RenderSettings()).pixels
    assert np.abs(blurred - pictures[1]).max() > 0.2


@pytest.mark.parametrize("describe", [mitsuba.describe, translate], ids=["mitsuba", "povray"])
def test_lenses_that_sample_by_themselves_are_not_compared(
    describe: Callable[[rs.ResolvedScene], object],
) -> None:
    scene = with_lens(aperture=0.2, focus=3.0)
    assert Capability.THIN_LENS in needs(scene)
    with pytest.raises(RendererUnsupported, match="lens"):
        describe(scene)


# --- scene files ----------------------------------------------------------------------------------


def test_scene_files_describe_them(tmp_path: Path) -> None:
    text = (SCENES / "light" / "highlights.toml").read_text(encoding="utf-8")
    text = text.replace('type = "perspective"', 'type = "thin_lens"\naperture = 0.1\nfocus = 5')
    file = tmp_path / "light" / "made.toml"
    file.parent.mkdir()
    file.write_text(text, encoding="utf-8")
    scene = resolve(load_cases(file, "normal")[0])
    assert isinstance(scene.camera, rs.ThinLens)
    assert (scene.camera.aperture, scene.camera.focus) == (0.1, 5)
    sun = scene.lights[1]
    assert isinstance(sun, rs.DirectionalLight)
    assert math.hypot(*sun.direction) == pytest.approx(1, abs=1e-15)
    assert isinstance(scene.surfaces[1].material, rs.Phong)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("direction = [0.6, -1, -0.4]", "direction = [0, 0, 0]", "lights[1].direction: has no"),
        ("exponent = 30", "exponent = 0.5", "surfaces[1].material.exponent"),
        ('type = "directional"', 'type = "sun"', "lights[1].type: unknown type"),
    ],
)
def test_lights_without_meaning_are_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    text = (SCENES / "light" / "highlights.toml").read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / "light" / "made.toml"
    file.parent.mkdir()
    file.write_text(text.replace(old, new), encoding="utf-8")

    def prepared() -> None:
        resolve(load_cases(file, "normal")[0])

    with pytest.raises(InputError) as error:
        prepared()
    assert message in str(error.value)
