"""Mitsuba's engines as renderers: repeatable, honest about noise, at home in any size of scene."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harness import imagefile
from harness.errors import RendererUnsupported
from harness.renderers.base import Capability, Rays, RenderSettings, Status
from harness.renderers.mitsuba import EXACT_CAPABILITIES, STOCK_CAPABILITIES
from harness.renderers.persistent import WorkerRenderer
from harness.scene import resolved as rs
from harness.translate.mitsuba_scale import scaled
from harness.translate.mitsuba_xml import write
from tests.harness.povray_scenes import (
    GLASS,
    box,
    camera,
    glow,
    make_scene,
    rays,
    rectangle,
    refract,
)

pytestmark = pytest.mark.mitsuba

SETTINGS = RenderSettings(samples=64, threads=2)
SINGLE = 32 * 2.0**-24
BALL = rs.Sphere(center=(0, 0, 0), radius=1)
CHECKER = rs.Emissive(pattern=rs.Checker(a=(0.1, 0.3, 0.9), b=(0.9, 0.6, 0.2), cells=(16, 16)))
TINTED = rs.Medium(name="glass", ior=1.5, absorption=(0.1, 0.2, 0.3))


def busy(**more: object) -> rs.ResolvedScene:
    """A ball and a slab, both absorbing, before a checkerboard in a dim world."""
    return make_scene(
        camera((0.3, 0.2, 6), (0, 0, 0), 30),
        solids=[(BALL, 1, 0), (box((-3, -2, -2.2), (3, 2, -2)), 1, 0)],
        surfaces=[(rectangle((0, 0, -3), (16, 16)), CHECKER)],
        media=(rs.Medium(name="air", ior=1.0), TINTED),
        background=(0.1, 0.2, 0.3),
        **more,
    )


def ramp_behind_ball() -> rs.ResolvedScene:
    ramp = rs.Ramp(start=(0.1, 1.0, 2.0), end=(1.0, 0.5, 0.0), axis="u")
    return make_scene(
        camera((0, 0, 6), (0, 0, 0), 30),
        solids=[(BALL, 1, 0)],
        surfaces=[(rectangle((0, 0, -3), (16, 16)), rs.Emissive(pattern=ramp))],
        film=(48, 32),
    )


# --- repeatable -----------------------------------------------------------------------------------


def test_exact_images_are_the_same_to_the_bit(exact: WorkerRenderer) -> None:
    """In another process, with another number of threads, after other scenes."""
    scene = busy()
    first = exact.render(scene, SETTINGS).pixels
    exact.render(ramp_behind_ball(), SETTINGS)
    again = exact.render(scene, replace(SETTINGS, threads=1, seed=7, samples=1)).pixels
    exact.close()
    afresh = exact.render(scene, SETTINGS).pixels
    assert (first == again).all()
    assert (first == afresh).all()


def test_a_pixel_does_not_depend_on_its_neighbours(exact: WorkerRenderer) -> None:
    """The trees of rays that are followed side by side differ, and must not get mixed up."""
    scene = busy(film=(96, 64))
    whole = exact.render(scene, SETTINGS).pixels
    k = scene.camera.tan_half_fov_x  # type: ignore[union-attr]
    right, up, forward = (
        np.array(v) for v in (scene.camera.right, scene.camera.up, scene.camera.forward)
    )
    # A film of one pixel, whose centre is that of pixel (i, j).
    for i, j in ((48, 32), (20, 11), (47, 50), (70, 31), (5, 5)):
        towards = forward + (2 * (i + 0.5) / 96 - 1) * k * right
        towards = towards + (1 - 2 * (j + 0.5) / 64) * k * 64 / 96 * up
        origin = np.array(scene.camera.origin)
        view = camera(origin, origin + towards, 0.01)
        alone = scene.model_copy(update={"camera": view, "film": rs.Film(width=1, height=1)})
        pixel = exact.render(alone, SETTINGS).pixels[0, 0]
        # The two cameras' rays differ by their rounding, which glass magnifies; cells do not blur.
        assert pixel == pytest.approx(whole[j, i], abs=1e-4)


def test_the_seed_decides_stock_images(stock: WorkerRenderer) -> None:
    scene = ramp_behind_ball()
    first = stock.render(scene, SETTINGS).pixels
    assert (first == stock.render(scene, SETTINGS).pixels).all()
    other = stock.render(scene, replace(SETTINGS, seed=1)).pixels
    assert (first != other).mean() > 0.2  # behind the ball; the ramp alone has little noise


# --- noise ----------------------------------------------------------------------------------------


def test_stock_variance_is_what_seeds_show(stock: WorkerRenderer) -> None:
    """The squared difference of two renders is on average the sum of their variances.

    Over m values of pixels its mean ratio to that sum scatters by sqrt(2 / m), times the root of
    the kurtosis' excess; six times sqrt(8 / m) leaves room for a kurtosis of 5.
    """
    scene = ramp_behind_ball()
    a, b = (stock.render(scene, replace(SETTINGS, seed=seed)) for seed in (1, 2))
    assert a.variance is not None
    assert b.variance is not None
    summed = (a.variance + b.variance).astype(np.float64)
    noisy = summed > 1e-10
    ratio = np.square(a.pixels - b.pixels.astype(np.float64))[noisy].sum() / summed[noisy].sum()
    assert noisy.sum() > 1000
    assert abs(ratio - 1) <= 6 * np.sqrt(8 / noisy.sum())


def test_more_samples_are_less_noise(stock: WorkerRenderer) -> None:
    scene = ramp_behind_ball()
    few, many = (stock.render(scene, replace(SETTINGS, samples=n)) for n in (32, 512))
    assert few.variance is not None
    assert many.variance is not None
    assert many.variance.sum() == pytest.approx(few.variance.sum() / 16, rel=0.2)


def test_one_sample_has_no_variance(stock: WorkerRenderer) -> None:
    assert stock.render(ramp_behind_ball(), replace(SETTINGS, samples=1)).variance is None


def test_stock_and_exact_agree_within_the_noise(
    stock: WorkerRenderer, exact: WorkerRenderer
) -> None:
    """On a smooth backdrop, away from the ball's rim, where a pixel's mean is not its centre."""
    scene = ramp_behind_ball()
    sampled, seen = stock.render(scene, SETTINGS), exact.render(scene, SETTINGS)
    assert sampled.variance is not None
    origins, directions = rays(scene)
    distance = np.linalg.norm(np.cross(origins, directions), axis=1).reshape(32, 48)
    calm = (np.abs(distance - 1) > 0.25)[..., None] & np.ones(3, bool)
    error = np.abs(sampled.pixels - seen.pixels)
    # Over a pixel the ball's view bends: a twelfth of its second difference, across and along.
    bends = np.abs(np.diff(seen.pixels, 2, axis=1)).max() / 6
    # In a pixel of 200 all 64 samples went straight through (0.92^64), and it knows no variance.
    assert (error <= 6 * np.sqrt(sampled.variance) + bends)[calm].mean() > 0.98
    scatter = np.sqrt(sampled.variance[calm].sum(dtype=np.float64)) / calm.sum()
    difference = (sampled.pixels - seen.pixels.astype(np.float64))[calm].mean()
    assert abs(difference) <= 6 * scatter + bends / 10


# --- size and surroundings ------------------------------------------------------------------------


@pytest.mark.parametrize("factor", [2.0**-9, 2.0**9])
def test_a_scene_looks_the_same_at_any_size(exact: WorkerRenderer, factor: float) -> None:
    """A slab of 0.4 thousandths or of 100 units, before a checkerboard.

    The translator brings it back to the size of a room, by a power of two that need not undo the
    test's: so rays start off surfaces elsewhere, and those that graze an edge fall on either side.
    """
    scene = busy()
    pixels = exact.render(scene, SETTINGS).pixels
    error = np.abs(exact.render(scaled(scene, factor), SETTINGS).pixels - pixels).max(axis=2)
    assert np.quantile(error, 0.99) <= SINGLE


def test_rays_are_told_in_the_scenes_own_lengths(exact: WorkerRenderer) -> None:
    scene = make_scene(
        camera((0, 0, 0.06), (0, 0, 0), 10),
        solids=[(rs.Sphere(center=(0, 0, 0), radius=0.01), 1, 0)],
        surfaces=[(rectangle((0, 0, -0.03), (0.2, 0.2)), glow(1, 1, 1))],
    )
    down = Rays(np.array([[0.0, 0.0, 0.06]]), np.array([[0.0, 0.0, -1.0]]))
    paths = exact.trace(scene, down, "TT", SETTINGS)
    assert paths.status.tolist() == [Status.HIT]
    assert paths.point[0] == pytest.approx((0, 0, -0.03), abs=1e-8)
    assert paths.optical_length[0] == pytest.approx(0.05 + 1.5 * 0.02 + 0.02, abs=1e-7)


def test_an_absorbing_world_absorbs_from_the_camera_on(
    exact: WorkerRenderer, stock: WorkerRenderer
) -> None:
    fog = rs.Medium(name="fog", ior=1.0, absorption=(0.5, 0.5, 0.5))
    view = rs.Orthographic(
        origin=(0, 0, 2), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), width=1
    )
    scene = make_scene(
        view,
        solids=[(rs.Sphere(center=(9, 9, 9), radius=1), 1, 0)],
        surfaces=[(rectangle((0, 0, 0), (4, 4)), glow(1, 2, 3))],
        media=(fog, GLASS),
        film=(16, 16),
    )
    expected = np.exp(-1.0) * np.array((1, 2, 3))
    assert np.abs(exact.render(scene, SETTINGS).pixels - expected).max() <= 3 * SINGLE
    image = stock.render(scene, SETTINGS)
    assert image.variance is not None
    assert (np.abs(image.pixels - expected) <= 6 * np.sqrt(image.variance)).all()


def test_a_smooth_mesh_refracts_at_its_normals(exact: WorkerRenderer) -> None:
    """A flat mesh whose normals all lean towards +x."""
    slab = box((-4, -4, -1), (4, 4, 0))
    leaning = [
        np.array((0.2, 0, 1 if z == 0 else -1)) / np.hypot(0.2, 1) for *_, z in slab.vertices
    ]
    mesh = rs.Mesh(
        vertices=slab.vertices,
        triangles=tuple((f[0], f[k], f[k + 1]) for f in slab.faces for k in (1, 2)),
        normals=tuple(tuple(n.tolist()) for n in leaning),
    )
    scene = make_scene(
        camera((0, 0, 3), (0, 0, 0), 20),
        solids=[(mesh, 1, 0)],
        surfaces=[(rectangle((0, 0, -2), (20, 20)), glow(1, 1, 1))],
    )
    down = np.array([[0.0, 0.0, -1.0]])
    paths = exact.trace(scene, Rays(np.array([[1.0, 0.5, 1.0]]), down), "TT", SETTINGS)
    top, bottom = (np.array([[0.2, 0, z]]) / np.hypot(0.2, 1) for z in (1, -1))
    inside = refract(down, top, 1.0, 1.5)
    outside = refract(inside, -bottom, 1.5, 1.0)
    x = 1 - inside[0, 0] / inside[0, 2] - outside[0, 0] / outside[0, 2]
    assert paths.point[0] == pytest.approx((x, 0.5, -2), abs=1e-6)
    assert abs(x - 1) > 0.05


# --- as renderers ---------------------------------------------------------------------------------


def test_capabilities_are_what_the_engines_do(exact: WorkerRenderer, stock: WorkerRenderer) -> None:
    assert exact.capabilities == EXACT_CAPABILITIES
    assert stock.capabilities == STOCK_CAPABILITIES
    assert {Capability.RAYS, Capability.LOBE_SWITCH, Capability.PIXEL_CENTRES} <= EXACT_CAPABILITIES
    assert not {Capability.RAYS, Capability.LOBE_SWITCH} & STOCK_CAPABILITIES
    thin = rs.ThinSlab(medium=1, exterior=0, thickness=0.1)
    scene = make_scene(
        camera((0, 0, 6), (0, 0, 0), 30), surfaces=[(rectangle((0, 0, 0), (2, 2)), thin)]
    )
    for renderer in (exact, stock):
        with pytest.raises(RendererUnsupported, match="thin-slab"):
            renderer.render(scene, SETTINGS)


def test_health_names_variant_and_library(exact: WorkerRenderer) -> None:
    health = exact.health()
    assert health.usable
    assert health.facts["variant"] == "llvm_ad_rgb"
    assert "scalar_rgb" in health.facts["usable variants"]
    assert "libLLVM" in health.facts["libLLVM"]
    assert "3." in health.version


@pytest.mark.slow
def test_the_written_scene_runs_in_mitsubas_command_line(
    stock: WorkerRenderer, tmp_path: Path
) -> None:
    """And shows the same picture, with meshes, textures, media and a translucent sheet."""
    sheet = rs.Translucent(color=(0.9, 0.5, 0.2), filter=0.3, transmit=0.2)
    scene = busy(film=(48, 32))
    extra = rs.Surface(name="sheet", shape=rectangle((1, 1, 1.5), (1, 1)), material=sheet)
    scene = scene.model_copy(update={"surfaces": (*scene.surfaces, extra)})
    program = shutil.which("mitsuba", path=str(Path(sys.executable).parent))
    assert program is not None
    argv = [program, "-m", "scalar_rgb", str(write(scene, tmp_path, samples=64))]
    subprocess.run(argv, cwd=tmp_path, check=True, capture_output=True, timeout=300)
    written, _ = imagefile.read(tmp_path / "scene.exr")
    image = stock.render(scene, SETTINGS)
    assert image.variance is not None
    # Both sample alike; where a rare path was met by one of them only, one variance knows of it.
    allowed = 6 * np.sqrt(2 * (image.variance + image.variance.mean()))
    assert (np.abs(written - image.pixels) <= allowed).mean() > 0.999
    assert written.mean() == pytest.approx(image.pixels.mean(), rel=0.01)
