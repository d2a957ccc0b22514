"""What reaches POV-Ray is numbers and words of ours, within what POV-Ray can hold."""

from __future__ import annotations

import base64
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.errors import RendererUnsupported
from harness.scene import resolved as rs
from harness.translate.povray import LEAST_ADC_BAILOUT, options, translate
from harness.translate.povray_fit import FLOORS, HIT_FLOOR, exposure, length_scale
from tests.harness.povray_scenes import AIR, GLASS, box, camera, glow, make_scene, rectangle

VIEW = camera((0.3, 0.4, 6), (0.1, 0, 0), 40)
BALL = rs.Sphere(center=(0, 0, 0), radius=1)
WALL = rectangle((0, 0, -3), (16, 16))
TETRAHEDRON = rs.Mesh(
    vertices=((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    triangles=((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)),
)
TEXELS = np.arange(18, dtype="<u2").reshape(2, 3, 3)
PICTURE = rs.Picture(width=3, height=2, pixels=base64.b64encode(TEXELS.tobytes()).decode())
PATTERNS: tuple[rs.Pattern, ...] = (
    rs.Constant(radiance=(0.1, 0.2, 0.3)),
    rs.Checker(a=(0.1, 0.3, 0.9), b=(0.9, 0.6, 0.2), cells=(4, 3)),
    rs.Ramp(start=(0, 0, 0), end=(1, 1, 1), axis="v"),
    rs.PositionCode(axis="u", cells=1000, amplitude=0.9),
    PICTURE,
)
# Every word that the translator knows. A scene's own words would show up as others.
WORDS = set(
    re.findall(
        r"\w+",
        """version global_settings assumed_gamma max_trace_level adc_bailout camera perspective
    orthographic location direction right up background light_source fade_distance fade_power
    media_interaction off sphere cylinder intersection plane polygon disc mesh2 vertex_vectors
    normal_vectors face_indices inside_vector union matrix translate scale pigment rgb rgbt rgbft
    finish ambient diffuse emission reflection fresnel conserve_energy interior ior media
    absorption method intervals samples hollow inverse checker gradient color_map average
    pigment_map image_map ppm gamma x y z""",
    )
)


def everything(name: str) -> rs.ResolvedScene:
    """A scene with one of each kind of thing, all of them called `name`."""
    smooth = TETRAHEDRON.model_copy(update={"normals": ((0, 0, 1),) * 4})
    cylinder = rs.Cylinder(frame=WALL.frame, radius=1, height=2)
    shapes = (BALL, box((-1, -1, -1), (1, 1, 1)), cylinder, TETRAHEDRON, smooth)
    materials: tuple[rs.Material, ...] = (
        rs.Diffuse(reflectance=(0.5, 0.6, 0.7)),
        rs.Mirror(reflectance=(1, 1, 1)),
        rs.Translucent(color=(1, 0, 0), filter=0.5, transmit=0.25),
        *(rs.Emissive(pattern=pattern) for pattern in PATTERNS),
    )
    disk = rs.Disk(frame=WALL.frame, radius=2)
    dome = rs.Sphere(center=(0, 0, 0), radius=100)
    surfaces = [(shape, m) for m in materials for shape in (WALL, disk)] + [(dome, materials[0])]
    scene = make_scene(
        VIEW,
        solids=[(shape, 1, 0) for shape in shapes],
        surfaces=surfaces,
        media=(
            rs.Medium(name=name, ior=1.333, absorption=(0.1, 0, 0)),
            rs.Medium(name=name, ior=1.5, absorption=(1, 2, 3)),
        ),
        lights=(rs.PointLight(position=(3, 3, 3), intensity=(1, 2, 3)),),
        background=(0.1, 0.2, 0.3),
    )
    renamed = {
        "solids": tuple(s.model_copy(update={"name": name}) for s in scene.solids),
        "surfaces": tuple(s.model_copy(update={"name": name}) for s in scene.surfaces),
    }
    return scene.model_copy(update=renamed)


@pytest.mark.parametrize(
    "name",
    [
        '"; #include "/etc/passwd" //',
        '}\n#fopen F "gone" write\n#write(F, "x")',
        "*/ #declare sphere = box /*",
        "picture-0.ppm",
        "\x00\\\n",
        "<script>",
        "é\u202e",
    ],
)
def test_names_of_a_scene_never_reach_the_text(name: str) -> None:
    hostile, plain = everything(name), everything("plain")
    assert translate(hostile) == translate(plain)
    assert options(hostile) == options(plain)


def test_the_text_is_ours_but_for_its_numbers() -> None:
    scene = everything("plain")
    text = translate(scene).sdl
    text = re.sub(r"//.*", "", text)
    strings = re.findall(r'"([^"]*)"', text)
    assert set(strings) == {"picture-0.ppm", "picture-1.ppm"}
    without_numbers = re.sub(
        r"(?<![\w.])-?\d+(\.\d+)?(e[-+]?\d+)?", "", re.sub(r'"[^"]*"', "", text)
    )
    assert set(re.findall(r"[A-Za-z_]\w*", without_numbers)) <= WORDS
    assert set(re.sub(r"\w|\s", "", without_numbers)) <= set("{}<>[],;#/*-")
    assert re.findall(r"#\w+", without_numbers) == ["#version"]
    assert text.isascii()


@given(st.tuples(*[st.floats(-1000, 1000).filter(lambda x: abs(x) > 1e-300)] * 3))
def test_numbers_lose_nothing(origin: tuple[float, float, float]) -> None:
    view = VIEW.model_copy(update={"origin": origin})
    translated = translate(make_scene(view, surfaces=[(WALL, glow(1, 1, 1))]))
    found = re.search(r"location <(.*?), (.*?), (.*?)>", translated.sdl)
    assert found
    # A power of two changes no digit.
    assert tuple(float(n) / translated.length_scale for n in found.groups()) == origin


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_no_number_is_not_written(value: float) -> None:
    view = VIEW.model_copy(update={"right": (value, 0.0, 0.0)})
    with pytest.raises(ValueError, match="not a finite number"):
        translate(make_scene(view))


@pytest.mark.parametrize(
    ("asked", "written"), [(0.0, LEAST_ADC_BAILOUT), (1e-20, LEAST_ADC_BAILOUT), (1e-3, 1e-3)]
)
def test_weights_always_have_a_floor(asked: float, written: float) -> None:
    transport = rs.Transport(max_depth=300, min_weight=asked)
    text = translate(make_scene(VIEW, transport=transport)).sdl
    assert float(re.findall(r"adc_bailout (\S+)", text)[0]) == written > 0
    assert re.findall(r"max_trace_level (\S+)", text) == ["256"]


# --- fitting lengths ----------------------------------------------------------------------------


@pytest.mark.parametrize("thickness", [1.0, 1e-2, 1e-4, 1e-5])
@pytest.mark.parametrize("size", [1e-6, 1e-3, 1.0, 1e5])
def test_solids_stay_far_above_the_hit_floor(thickness: float, size: float) -> None:
    slab = box((-30 * size, -30 * size, -thickness * size), (30 * size, 30 * size, 0))
    view = VIEW.model_copy(update={"origin": (0.0, 0.0, size)})
    factor = length_scale(make_scene(view, solids=[(slab, 1, 0)]))
    assert math.frexp(factor)[0] == 0.5  # a power of two
    assert thickness * size * factor >= FLOORS * HIT_FLOOR
    assert 30 * size * factor <= 1e6  # a tenth of what POV-Ray sees


def test_what_no_scale_fits_is_unsupported() -> None:
    slab = box((-30, -30, -1e-9), (30, 30, 0))
    with pytest.raises(RendererUnsupported, match=r"1e-09 units thick in a scene 30 units wide"):
        translate(make_scene(VIEW, solids=[(slab, 1, 0)]))


def test_lengths_and_absorption_scale_together() -> None:
    glass = rs.Medium(name="glass", ior=1.5, absorption=(0.5, 0, 0))
    translated = translate(make_scene(VIEW, solids=[(BALL, 1, 0)], media=(AIR, glass)))
    radius = re.findall(r"sphere \{ <.*>, (\S+)", translated.sdl)
    absorption = re.findall(r"absorption rgb <(\S+),", translated.sdl)
    assert translated.length_scale > 1
    assert float(radius[0]) * float(absorption[0]) == 0.5


# --- fitting radiance ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pattern", "brightest"),
    [
        (rs.Constant(radiance=(0.1, 4, 0.3)), 4),
        (rs.Checker(a=(0.1, 0.3, 0.9), b=(8, 0.6, 0.2), cells=(4, 3)), 8),
        (rs.Ramp(start=(0, 0, 0), end=(0, 0.25, 0), axis="v"), 0.25),
        (rs.PositionCode(axis="u", cells=10, amplitude=0.5), 0.5),
        (PICTURE, 1),  # so that its texels are kept to the bit
    ],
)
def test_the_brightest_emitter_becomes_one(pattern: rs.Pattern, brightest: float) -> None:
    scene = make_scene(VIEW, surfaces=[(WALL, rs.Emissive(pattern=pattern))])
    assert exposure(scene) * brightest == 1
    assert exposure(scene.model_copy(update={"background": (0, 16, 0)})) == 1 / 16


def test_a_black_scene_needs_no_exposure() -> None:
    assert exposure(make_scene(VIEW)) == 1


def test_the_brightest_lit_point_becomes_one() -> None:
    """Straight below a light at height h: reflectance / pi * intensity / h^2."""
    light = rs.PointLight(position=(2, 1, -1), intensity=(10, 1, 1))
    lit = rs.Diffuse(reflectance=(0.5, 1, 1))
    scene = make_scene(VIEW, surfaces=[(WALL, lit)], lights=(light, light))
    assert exposure(scene) == pytest.approx(1 / (2 * 0.5 / math.pi * 10 / 2**2), rel=1e-12)
    beside = light.model_copy(update={"position": (11.0, 12.0, -3.0)})  # 3 and 4 off the corner
    scene = scene.model_copy(update={"lights": (beside,)})
    assert exposure(scene) == pytest.approx(1 / (0.5 / math.pi * 10 / 5**2), rel=1e-12)


def test_a_light_on_a_surface_is_unsupported() -> None:
    light = rs.PointLight(position=(0, 0, -3), intensity=(1, 1, 1))
    scene = make_scene(VIEW, surfaces=[(WALL, rs.Diffuse(reflectance=(1, 1, 1)))], lights=(light,))
    with pytest.raises(RendererUnsupported, match="touches"):
        translate(scene)


# --- media, pictures, order ---------------------------------------------------------------------


def test_indices_are_relative_and_absorption_adds_up() -> None:
    media = (
        rs.Medium(name="water", ior=1.25, absorption=(0.5, 0.5, 0.5)),
        rs.Medium(name="glass", ior=1.5, absorption=(1.0, 2.0, 4.0)),
        rs.Medium(name="air", ior=1.0),
    )
    inner = rs.Sphere(center=(0, 0, 0), radius=0.5)
    scene = make_scene(VIEW, solids=[(inner, 2, 1), (BALL, 1, 0)], media=media)
    translated = translate(scene)
    outer_text, inner_text = re.findall(r"interior \{.*\}", translated.sdl)  # outer first
    assert "ior 1.2 " in outer_text
    assert "ior 0.8 " in inner_text
    absorptions = [
        np.array([float(n) for n in found]) * translated.length_scale
        for found in re.findall(r"absorption rgb <(.*?), (.*?), (.*?)>", translated.sdl)
    ]
    sums = np.cumsum(absorptions, axis=0)  # the atmosphere, then in the ball, then in both
    assert sums == pytest.approx(np.array([m.absorption for m in media]), abs=1e-12)


def test_a_picture_becomes_its_texels() -> None:
    translated = translate(make_scene(VIEW, surfaces=[(WALL, rs.Emissive(pattern=PICTURE))]))
    assert translated.attachments == {
        "picture-0.ppm": b"P6\n3 2\n65535\n" + TEXELS.astype(">u2").tobytes()
    }


def test_a_pattern_on_a_closed_shape_is_unsupported() -> None:
    checker = rs.Emissive(pattern=PATTERNS[1])
    with pytest.raises(RendererUnsupported, match="texture coordinates"):
        translate(make_scene(VIEW, surfaces=[(BALL, checker)]))


def test_a_thin_face_is_unsupported() -> None:
    thin = rs.ThinSlab(medium=1, exterior=0, thickness=0.1)
    with pytest.raises(RendererUnsupported, match="thin face"):
        translate(make_scene(VIEW, surfaces=[(WALL, thin)], media=(AIR, GLASS)))
