"""The documented stand-alone renderer stands alone, is right, and is run as the documents say."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from harness.errors import RendererFailed
from harness.renderers.base import Capability, Image, Renderer, RenderSettings
from harness.renderers.command import USUAL_CLAIMS, Template
from harness.renderers.command_file import RendererTable, renderer_from_command, renderer_from_file
from harness.renderers.worker import Server
from harness.scene import resolved as rs

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "bring-your-own-renderer"
FRAME = rs.Frame(origin=(0, 0, -5), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
AIR, GLASS = rs.Medium(name="air", ior=1.0), rs.Medium(name="glass", ior=1.5)
SINGLE = float(np.finfo(np.float32).eps)  # the images are float32


@pytest.fixture(scope="module", params=["student.toml", "student-worker.toml"])
def student(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    renderer = renderer_from_file(FOLDER / request.param)
    yield renderer
    if hasattr(renderer, "close"):
        renderer.close()


def slab(thickness: float) -> rs.Convex:
    """Its front face is z = 0; wide enough for all rays here."""
    wide = 1000.0
    sides = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))
    planes = ((0, 0, 1, 0), (0, 0, -1, thickness), *((*n, wide) for n in sides))
    return rs.Convex(planes=planes, vertices=(), faces=())


def looking_down(
    *solids: rs.Solid, axis: str = "u", max_depth: int = 8, **more: object
) -> rs.ResolvedScene:
    """Rays along (x, 0, -1) for x from 0 to 2 or so, onto a position code in the plane z = -5."""
    camera = rs.Perspective(
        origin=(0, 0, 1), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), tan_half_fov_x=2.0
    )
    code = rs.Emissive(pattern=rs.PositionCode(axis=axis, cells=8, amplitude=0.5))
    face = rs.Rectangle(frame=FRAME, size=(100, 100))
    transport = {"max_depth": max_depth, "min_weight": 0.0, **more}
    return rs.ResolvedScene(
        film=rs.Film(width=32, height=1),
        camera=camera,
        media=(AIR, GLASS),
        solids=solids,
        surfaces=(rs.Surface(name="code", shape=face, material=code),),
        transport=rs.Transport.model_validate(transport),
    )


def tangents(scene: rs.ResolvedScene) -> np.ndarray:
    """tan(theta_i), signed, of each pixel."""
    return (2 * (np.arange(scene.film.width) + 0.5) / scene.film.width - 1) * 2.0


def landed(image: Image) -> np.ndarray:
    """Where on x each ray landed on the plane: the code's first channel over its constant one."""
    row = image.pixels[0].astype(float)
    return (row[:, 0] / row[:, 2] - 0.5) * 100


def test_it_needs_numpy_and_nothing_else() -> None:
    for name in ("student.py", "student_worker.py"):
        tree = ast.parse((FOLDER / name).read_text())
        imported = {
            alias.name.split(".")[0]
            for node in ast.walk(tree)
            if isinstance(node, ast.Import | ast.ImportFrom)
            for alias in (node.names if isinstance(node, ast.Import) else [ast.alias(node.module)])
        }
        assert imported - set(sys.stdlib_module_names) <= {"numpy", "student"}


def test_a_bare_plane(student: Renderer) -> None:
    scene = looking_down()
    image = student.render(scene, RenderSettings())
    # One rounding to float32 of each channel, over a plane 100 wide.
    assert np.abs(landed(image) - 6 * tangents(scene)).max() < 200 * SINGLE


@pytest.mark.parametrize("thickness", [0.01, 1.0, 3.0])
def test_a_slab_only_shifts_rays(thickness: float, student: Renderer) -> None:
    scene = looking_down(
        rs.Solid(name="slab", shape=slab(thickness), medium=1, exterior=0),
        max_depth=3,
        reflection=False,
    )
    image = student.render(scene, RenderSettings())
    tan_i = tangents(scene)
    sin_i = tan_i / np.hypot(1, tan_i)
    tan_t = np.tan(np.arcsin(sin_i / 1.5))  # Snell
    expected = (6 - thickness) * tan_i + thickness * tan_t
    assert np.abs(landed(image) - expected).max() < 200 * SINGLE
    # Fresnel's equations at both faces, E. Hecht, Optics, 5th ed., 4.34 and 4.40
    cos_i, cos_t = np.cos(np.arcsin(sin_i)), np.cos(np.arcsin(sin_i / 1.5))
    r_s = (cos_i - 1.5 * cos_t) / (cos_i + 1.5 * cos_t)
    r_p = (1.5 * cos_i - cos_t) / (1.5 * cos_i + cos_t)
    transmittance = (1 - (r_s**2 + r_p**2) / 2) ** 2
    assert np.allclose(image.pixels[0, :, 2], 0.5 * transmittance, rtol=2 * SINGLE, atol=0)


def furnace(solid: rs.Solid) -> rs.ResolvedScene:
    scene = looking_down(solid, max_depth=200)
    return scene.model_copy(update={"surfaces": (), "background": (0.5, 0.5, 0.5)})


@pytest.mark.parametrize("shape", [rs.Sphere(center=(0, 0, -2), radius=2.5), slab(2.0)])
def test_a_white_world_stays_white(shape: rs.Sphere | rs.Convex, student: Renderer) -> None:
    solid = rs.Solid(name="thing", shape=shape, medium=1, exterior=0)
    image = student.render(furnace(solid), RenderSettings())
    # What 200 reflections leave inside is below double precision, so float32 decides.
    assert np.abs(image.pixels / 0.5 - 1).max() <= 2 * SINGLE


def test_a_ball_against_its_closed_form(student: Renderer) -> None:
    """Rays parallel to the axis, at height h, cross it behind a unit ball at 1 / (2 (n - 1)) …

    exactly: deviation 2 (i - r) with sin i = h, sin r = h / n (E. Hecht, Optics, chapter 6).
    """
    scene = looking_down(
        rs.Solid(name="ball", shape=rs.Sphere(center=(0, 0, 0), radius=1), medium=1, exterior=0),
        max_depth=3,
        reflection=False,
    )
    camera = rs.Orthographic(
        origin=(0, 0, 3), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), width=1.8
    )
    image = student.render(scene.model_copy(update={"camera": camera}), RenderSettings())
    h = (2 * (np.arange(32) + 0.5) / 32 - 1) * 0.9
    i, r = np.arcsin(h), np.arcsin(h / 1.5)
    leaves = 2 * r - i  # polar angle of the exit point, from -z
    tan_out = -np.tan(2 * (i - r))
    expected = np.sin(leaves) + (5 - np.cos(leaves)) * tan_out
    assert np.abs(landed(image) - expected).max() < 200 * SINGLE


def test_absorption(student: Renderer) -> None:
    """Beer and Lambert: exp(-absorption * length), along the refracted ray."""
    ink = rs.Medium(name="ink", ior=1.0, absorption=(0.0, 0.5, 2.0))
    solid = rs.Solid(name="slab", shape=slab(0.8), medium=1, exterior=0)
    scene = looking_down(solid).model_copy(update={"media": (AIR, ink)})
    glow = rs.Emissive(pattern=rs.Constant(radiance=(1, 1, 1)))
    surface = scene.surfaces[0].model_copy(update={"material": glow})
    image = student.render(scene.model_copy(update={"surfaces": (surface,)}), RenderSettings())
    length = 0.8 * np.hypot(1, tangents(scene))
    expected = np.exp(-length[:, None] * (0.0, 0.5, 2.0))
    assert np.allclose(image.pixels[0], expected, rtol=2 * SINGLE, atol=0)


@pytest.mark.parametrize("lobes", [{"transmission": False}, {"reflection": False}])
def test_total_reflection_from_inside(lobes: dict[str, bool], student: Renderer) -> None:
    """A camera in glass under a flat face: beyond the critical angle all light comes back."""
    solid = rs.Solid(name="glass", shape=slab(100.0), medium=1, exterior=0)
    scene = looking_down(solid, max_depth=2, **lobes)
    up = scene.camera.model_copy(
        update={"origin": (0, 0, -4), "forward": (0, 0, 1), "right": (-1, 0, 0), "medium": 1}
    )
    image = student.render(scene.model_copy(update={"camera": up}), RenderSettings())
    sin_i = np.abs(tangents(scene)) / np.hypot(1, tangents(scene))
    reflectance = image.pixels[0, :, 2] / 0.5
    assert np.array_equal(reflectance == 1, sin_i > 1 / 1.5)


@pytest.mark.parametrize(
    ("output", "options", "step"),
    [
        ("npy", "", 0.0),
        ("pfm", "", 0.0),
        ("png", "--bits 16", 1 / 65535),
        ("png", "--bits 8", 1 / 255),
    ],
)
def test_all_its_formats_hold_the_same_image(output: str, options: str, step: float) -> None:
    command = f"{{python}} student.py {{scene}} {{output.{output}}} {options}"
    scene = looking_down(axis="v").model_copy(update={"film": rs.Film(width=3, height=4)})
    image = renderer_from_command(command, FOLDER).render(scene, RenderSettings())
    exact = renderer_from_file(FOLDER / "student.toml").render(scene, RenderSettings())
    # sRGB is steepest at the top, where d(linear)/d(encoded) = 2.4 / 1.055
    assert np.abs(image.pixels - exact.pixels).max() <= step / 2 * 2.4 / 1.055 + SINGLE
    assert ("srgb (as it says)" in image.log) == (output == "png")


def test_its_own_errors_reach_the_user() -> None:
    renderer = renderer_from_command("{python} student.py {scene} {output.exr}", FOLDER)
    with pytest.raises(RendererFailed, match="exit code 1") as caught:
        renderer.render(looking_down(), RenderSettings())
    assert caught.value.log == "I cannot write '.exr'"


def test_health(student: Renderer) -> None:
    assert student.health().usable


def test_the_documents_name_everything() -> None:
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    claims = re.search(r"## What a renderer can claim\n(.*?)\n## ", text, re.DOTALL)
    assert claims is not None
    assert re.findall(r"^\| `([\w-]+)` \|", claims[1], re.MULTILINE) == [str(c) for c in Capability]
    unclaimed = re.search(r"claim all but (.*?)\.\n", claims[1], re.DOTALL)
    assert unclaimed is not None
    assert set(re.findall(r"`([\w-]+)`", unclaimed[1])) == set(Capability) - USUAL_CLAIMS
    keys = re.search(r"\n\| key \|.*?\n\n", text, re.DOTALL)
    assert keys is not None
    assert set(re.findall(r"^\| `(\w+)` \|", keys[0], re.MULTILINE)) == set(
        RendererTable.model_fields
    )
    protocol = (ROOT / "docs" / "worker-protocol.md").read_text(encoding="utf-8")
    operations = set(Server("x:y")._operations)
    assert set(re.findall(r"^### `(\w+)`", protocol, re.MULTILINE)) == operations
    for placeholder in ("scene", "output", "width", "height", "samples", "seed", "threads"):
        assert f"`{{{placeholder}}}`" in text
        Template.parse(f"x {{{placeholder}}}", needs=())
