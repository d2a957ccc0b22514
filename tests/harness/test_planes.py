"""Planes in scene files: floors without end, half-spaces that cut solids, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from harness.errors import InputError, RendererUnsupported
from harness.measure.comparison import Unmeasurable
from harness.measure.radiance import footprint, true_picture
from harness.renderers.base import RenderSettings
from harness.renderers.needs import needs
from harness.renderers.povray import PovRayRenderer
from harness.renderers.tracer import TracerEngine
from harness.scene import resolved as rs
from harness.scene.containment import surface_points
from harness.scene.load import load_cases
from harness.scene.resolve import resolve
from harness.section import Cut, draw, ray_path
from harness.section.canvas import WIDTH
from harness.section.drawing import Window
from harness.translate import mitsuba, povray
from harness.translate.mitsuba_scale import scaled
from harness.translate.povray_fit import FAR, length_scale
from tests.harness.povray_measure import needs_povray

HEAD = """format = 1
title = "t"
family = "t"
sources = ["s"]
background = [0.35, 0.5, 0.8]
film = { width = 48, height = 36 }
media = { glass = { ior = 1.5 } }
"""
REST = """
[camera]
type = "perspective"
origin = [0, %s, 4]
target = [0, %s, 0]
fov_x = 50

[[lights]]
type = "point"
position = [-2, %s, 1]
intensity = [18, 17, 15]

[[solids]]
name = "ball"
medium = "glass"
shape = { type = "sphere", center = [-1, %s, 0], radius = 0.7 }

[[surfaces]]
name = "mark"
shape = { type = "sphere", center = [1.2, %s, -1], radius = 0.5 }
material = { type = "diffuse", reflectance = [0.9, 0.2, 0.2] }

[[checks]]
observable = "rmse"
against = "renderers"
"""
ABOVE = REST % (1.5, 1.2, 3, 0.9, 0.8)
BELOW = REST % (-1.5, -1.2, -3, -0.9, -0.8)
MATERIALS = {
    "diffuse": "reflectance = [0.7, 0.6, 0.45]",
    "mirror": "reflectance = [0.7, 0.8, 0.9]",
    "translucent": "color = [0.9, 0.4, 0.2], filter = 0.5, transmit = 0.2",
    "emissive": 'pattern = { type = "constant", radiance = [0.2, 0.6, 0.3] }',
}


def loaded(tmp_path: Path, text: str) -> rs.ResolvedScene:
    file = tmp_path / "scene.toml"
    file.write_text(HEAD + text, encoding="utf-8")
    return resolve(load_cases(file, "normal")[0])


def floor(material: str = "mirror", normal: str = "[0, 1, 0]", more: str = "") -> str:
    return f"""
[[surfaces]]
name = "floor"
shape = {{ type = "plane", normal = {normal}{more} }}
material = {{ type = "{material}", {MATERIALS[material]} }}
"""


def solid(operation: str, *parts: str) -> str:
    return f"""
[[solids]]
name = "composed"
medium = "glass"
shape = {{ type = "{operation}", of = [{", ".join(parts)}] }}
"""


BALL = '{ type = "sphere", center = [3, 3, -4], radius = 1 }'
HALF = '{ type = "plane", center = [3, 3, -4], normal = [0, 0, 1] }'


# --- numbers --------------------------------------------------------------------------------------


def test_a_plane_is_its_unit_normal_and_its_distance_from_the_origin(tmp_path: Path) -> None:
    more = ", center = [1, 2, 3], rotate = [{ axis = [0, 0, 1], angle = 90 }]"
    shape = loaded(tmp_path, floor(normal="[0, 3, 4]", more=more) + ABOVE).surfaces[0].shape
    assert isinstance(shape, rs.Plane)
    assert shape.normal == pytest.approx((-0.6, 0, 0.8), abs=1e-16)  # turned about its centre
    assert shape.offset == pytest.approx(-0.6 * 1 + 0.8 * 3, abs=1e-15)


def test_scaling_moves_it_and_does_not_turn_it(tmp_path: Path) -> None:
    scene = loaded(tmp_path, floor(more=", center = [0, -3, 0]") + ABOVE)
    shape = scaled(scene, 4.0).surfaces[0].shape
    assert shape == rs.Plane(normal=(0, 1, 0), offset=-12)


def test_points_of_half_a_ball_are_on_its_flat_side_too(tmp_path: Path) -> None:
    half = loaded(tmp_path, solid("intersection", BALL, HALF) + ABOVE).solids[0].shape
    points = surface_points(half) - np.array([3, 3, -4])
    assert (points[:, 2] <= 1e-12).all()
    assert (np.abs(points[:, 2]) < 1e-12).sum() > 100
    assert (points[:, 2] < -0.9).any()


def test_a_solid_inside_a_cut_one_is_found_there(tmp_path: Path) -> None:
    """By where the half-space cuts: the same ball sticks out of the other half."""
    inner = """
[[solids]]
name = "core"
medium = "air"
shape = { type = "sphere", center = [3, 3, -4.5], radius = 0.3 }
"""
    scene = loaded(tmp_path, solid("intersection", BALL, HALF) + inner + ABOVE)
    assert scene.solids[1].exterior == scene.solids[0].medium
    with pytest.raises(InputError, match="overlaps solid composed partly"):
        loaded(tmp_path, solid("intersection", BALL, HALF) + inner.replace("-4.5", "-4") + ABOVE)


# --- renderers ------------------------------------------------------------------------------------


@needs_povray
@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("side", [ABOVE, BELOW], ids=["above", "below"])
def test_povray_sees_what_the_tracer_sees(tmp_path: Path, material: str, side: str) -> None:
    """Ball, shadow, reflections and the horizon, to one step of 16 bits."""
    scene = loaded(tmp_path, floor(material) + side)
    ours = TracerEngine().render(scene, RenderSettings()).pixels
    theirs = PovRayRenderer().render(scene, RenderSettings()).pixels
    step = 1 / 65535 / povray.translate(scene).exposure
    assert np.abs(ours - theirs).max() <= step + 1e-6
    assert np.ptp(ours) > 0.2


@needs_povray
def test_povray_cuts_solids_by_half_spaces(tmp_path: Path) -> None:
    parts = BALL.replace("[3, 3, -4]", "[0.2, 1.2, 0.5]"), HALF.replace("[3, 3, -4]", "[0.2, 1, 0]")
    for operation in ("intersection", "difference"):
        scene = loaded(tmp_path, solid(operation, *parts) + ABOVE.replace("[-1, 0.9", "[-3, 0.9"))
        ours = TracerEngine().render(scene, RenderSettings()).pixels
        theirs = PovRayRenderer().render(scene, RenderSettings()).pixels
        step = 1 / 65535 / povray.translate(scene).exposure
        assert np.abs(ours - theirs).max() <= step + 1e-6


def test_povray_reaches_further_where_there_is_a_horizon(tmp_path: Path) -> None:
    """Its planes end at `FAR`: as many scenes away as may be, at a thousand hit floors' cost."""
    with_floor, without = loaded(tmp_path, floor() + ABOVE), loaded(tmp_path, ABOVE)
    assert FAR / (4 * length_scale(with_floor)) >= 3e4
    assert length_scale(without) > 100 * length_scale(with_floor)


def test_who_lacks_planes_is_not_asked(tmp_path: Path) -> None:
    scene = loaded(tmp_path, floor() + ABOVE)
    assert "plane" in needs(scene)
    with pytest.raises(RendererUnsupported, match="Mitsuba has no plane"):
        mitsuba.describe(scene)
    cut = loaded(tmp_path, solid("intersection", BALL, HALF) + ABOVE)
    assert {"csg", "half-space"} <= needs(cut)
    assert "plane" not in needs(cut)


# --- pictures -------------------------------------------------------------------------------------


def test_the_truth_of_a_floor_is_lamberts_law_to_the_horizon(tmp_path: Path) -> None:
    alone = ABOVE[: ABOVE.index("[[solids]]")] + ABOVE[ABOVE.index("[[checks]]") :]
    scene = loaded(tmp_path, floor("diffuse") + alone)
    truth, edge = true_picture(scene)
    assert np.abs(truth - TracerEngine().render(scene, RenderSettings()).pixels).max() < 1e-7
    assert (truth[0] == [0.35, 0.5, 0.8]).all()
    assert np.isinf(edge).all()
    with pytest.raises(Unmeasurable, match="horizon"):
        footprint(scene)


def test_a_section_shows_a_plane_from_side_to_side(tmp_path: Path) -> None:
    scene = loaded(tmp_path, floor() + ABOVE)
    rays = [ray_path(scene, [(-3, 2, 0), (0, 0, 0), (3, 2, 0)])]
    assert rays[0].angles == [(pytest.approx(56.309932474), pytest.approx(56.309932474))]
    across = Cut(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))
    svg = draw(scene, rays, cut=across, window=Window(-2, -1, 2, 1))
    (line,) = re.findall(r'<line class="face"[^>]*>', svg)
    x1, x2 = (float(re.search(rf'{name}="([-\d.]+)"', line)[1]) for name in ("x1", "x2"))
    assert {x1, x2} == {0.0, float(WIDTH)}
    # The plane of the drawing itself, and one beside it, show no line.
    level = Cut(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))
    assert 'class="face"' not in draw(scene, rays, cut=level, window=Window(-2, -1, 2, 1))


# --- bad input ------------------------------------------------------------------------------------

BAD = {
    "no normal": (floor(normal="[0, 0, 0]"), r"surfaces\[0\].shape.normal: has no direction"),
    "half a key": (floor(more=", up = [0, 0, 1]"), r"shape.up: unknown key"),
    "a pattern": (
        floor("emissive").replace('"constant", radiance = [0.2, 0.6, 0.3]', '"checker", '
        "a = [1, 1, 1], b = [0, 0, 0], cells = [2, 2]"),
        "a pattern has no place on a plane",
    ),
    "a thin slab": (
        floor().replace('"mirror", reflectance = [0.7, 0.8, 0.9]', '"thin_slab", '
        'medium = "glass", thickness = 0.1'),
        "a thin slab is flat",
    ),
    "a solid": (
        '[[solids]]\nname = "sea"\nmedium = "glass"\nshape = { type = "plane" }\n',
        r"solids\[0\].shape.type: a plane ends nowhere",
    ),
    "two half-spaces": (solid("intersection", HALF, HALF), "goes on for ever"),
    "a union": (solid("union", BALL, HALF), "goes on for ever"),
    "less than a half-space": (solid("difference", HALF, BALL), "goes on for ever"),
    "a part without a normal": (
        solid("intersection", BALL, HALF.replace("[0, 0, 1]", "[0, 0, 0]")),
        r"solids\[0\].shape.of\[1\].normal: has no direction",
    ),
    "nothing left": (
        solid("intersection", BALL, HALF.replace("[3, 3, -4]", "[3, 3, -9]")),
        "nothing is left of it",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD.keys())
def test_what_a_plane_cannot_be_is_said(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        loaded(tmp_path, text + ABOVE)
