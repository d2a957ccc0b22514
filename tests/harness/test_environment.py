"""A panorama around everything: what is seen of it, in every renderer, and behind glass."""

from __future__ import annotations

import base64
import math
from pathlib import Path

import numpy as np
import pytest

from harness.measure.panorama import panorama_radiance
from harness.renderers.base import Capability, RenderSettings
from harness.renderers.needs import needs
from harness.renderers.persistent import WorkerRenderer
from harness.scene import resolved as rs
from harness.scene.crosscheck import _environment
from harness.scene.findings import Finding
from harness.translate.texels import knots_of, radiance_of
from harness.translate.tracer import translate
from tests.harness.povray_measure import assert_image, needs_povray, step
from tests.harness.povray_scenes import Array, camera, glow, make_scene, rays, rectangle
from tests.harness.test_resolve import Document, resolved_of
from tests.harness.test_resolve import scene as document
from tracer.image import render

U = 2.0**-24
WIDTH, HEIGHT = 12, 7
VIEWS = {
    "ahead": (0, 0, -1),
    "to the right": (1, 0, 0),
    "behind": (0.1, 0.2, 1),
    "to the left": (-1, 0.1, 0.3),
    "up": (0.1, 1, 0.1),
    "down": (0.1, -1, -0.2),
}


def panorama(seed: int = 3) -> rs.Panorama:
    levels = np.random.default_rng(seed).integers(0, 65536, (HEIGHT, WIDTH, 3), dtype=np.uint16)
    pixels = base64.b64encode(levels.astype("<u2").tobytes()).decode()
    return rs.Panorama(width=WIDTH, height=HEIGHT, pixels=pixels)


def looking(towards: tuple[float, float, float]) -> rs.ResolvedScene:
    """A wide view from a place that is not the origin, which must not matter.

    POV-Ray warns of scenes without objects, so there is one too small to be seen.
    """
    here = (3.0, -2.0, 5.0)
    view = camera(here, [h + t for h, t in zip(here, towards, strict=True)], 100)
    speck = (rectangle((0, 0, 0), (1e-6, 1e-6)), glow(0, 0, 0))
    made = make_scene(view, surfaces=[speck], film=(32, 24))
    return made.model_copy(update={"background": panorama()})


def seen(scene: rs.ResolvedScene) -> Array:
    assert isinstance(scene.background, rs.Panorama)
    return panorama_radiance(scene.background, rays(scene)[1])


def test_texels_lie_where_the_format_says() -> None:
    """The middle of texel (column 9, row 2) of 12 x 7: 90 degrees to the right, and up."""
    around = panorama()
    azimuth, polar = (9.5 / WIDTH - 0.5) * 2 * math.pi, 2.5 / HEIGHT * math.pi
    d = [[
        math.sin(polar) * math.sin(azimuth), math.cos(polar), -math.sin(polar) * math.cos(azimuth)
    ]]  # fmt: skip
    assert panorama_radiance(around, np.array(d)) == pytest.approx(
        radiance_of(around)[2:3, 9], abs=1e-12
    )


def test_knots_are_the_panorama_at_half_texels() -> None:
    around = panorama()
    j, i = np.meshgrid(np.arange(1, 2 * HEIGHT), np.arange(WIDTH), indexing="ij")
    polar, azimuth = j / 2 / HEIGHT * np.pi, ((i + 0.5) / WIDTH - 0.5) * 2 * np.pi
    d = np.stack([np.sin(polar) * np.sin(azimuth), np.cos(polar), -np.sin(polar) * np.cos(azimuth)])
    true = panorama_radiance(around, d.reshape(3, -1).T).reshape(*j.shape, 3)
    assert knots_of(around)[1:-1] == pytest.approx(true, abs=1e-12)
    assert (knots_of(around)[[0, -1]] == radiance_of(around)[[0, -1]]).all()


@pytest.mark.parametrize("view", VIEWS)
def test_the_tracer_sees_it(view: str) -> None:
    scene = looking(VIEWS[view])
    image = render(translate(scene), scene.film.width, scene.film.height)
    assert np.abs(image.pixels.reshape(-1, 3) - seen(scene)).max() <= 1e-12


@pytest.mark.povray
@needs_povray
@pytest.mark.parametrize("view", VIEWS)
def test_povray_sees_it(view: str) -> None:
    """Beside the half step, directions in double precision cost nothing that shows."""
    scene = looking(VIEWS[view])
    assert_image(scene, seen(scene))


@pytest.mark.mitsuba
@pytest.mark.parametrize("view", VIEWS)
def test_mitsuba_exact_sees_it(exact: WorkerRenderer, view: str) -> None:
    """Directions to single precision, over which the panorama changes by a texel's step at most.

    `asin` and `atan2` lose as many digits near the poles as azimuths there count less.
    """
    scene = looking(VIEWS[view])
    pixels = exact.render(scene, RenderSettings(samples=1)).pixels.reshape(-1, 3)
    d = rays(scene)[1]
    slope = (WIDTH / (2 * np.pi) / np.hypot(d[:, 0], d[:, 2]) + HEIGHT / np.pi)[:, None]
    assert (np.abs(pixels - seen(scene)) <= 32 * U * (1 + slope)).all()


@pytest.mark.mitsuba
def test_stock_mitsuba_sees_it(stock: WorkerRenderer) -> None:
    """Means over pixels, which differ from the middle by curvature; so a panorama that has none."""
    level = np.full((HEIGHT, WIDTH, 3), 20000, np.uint16)
    pixels = base64.b64encode(level.astype("<u2").tobytes()).decode()
    scene = looking((0, 0, -1)).model_copy(
        update={"background": rs.Panorama(width=WIDTH, height=HEIGHT, pixels=pixels)}
    )
    image = stock.render(scene, RenderSettings(samples=16))
    assert np.abs(image.pixels - 20000 / 65535).max() <= 32 * U


def test_it_is_asked_of_none_that_does_not_claim_it() -> None:
    assert Capability.ENVIRONMENT in needs(looking((0, 0, -1)))


def test_it_comes_from_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import imagecodecs

    texels = np.zeros((2, 4, 3), np.uint8)
    texels[0] = 255
    (tmp_path / "sky.png").write_bytes(imagecodecs.png_encode(texels))
    made: Document = document(("water", {"type": "sphere", "radius": 1}))
    made["environment"] = {"file": "sky.png", "encoding": "linear"}
    monkeypatch.chdir(tmp_path)
    around = resolved_of(made).background
    assert isinstance(around, rs.Panorama)
    assert radiance_of(around)[:, 0, 0].tolist() == [1, 0]


def test_it_is_said_once() -> None:
    made: Document = document(("water", {"type": "sphere", "radius": 1}))
    made |= {"environment": {"file": "sky.png"}, "background": [1, 1, 1]}
    assert list(_environment(made)) == [
        Finding(("background",), "there is an environment, too", None, "one of the two")
    ]


def test_povray_steps_are_the_panoramas() -> None:
    """Radiance 1 at most, so that 16-bit texels stay what they are."""
    assert step(looking((0, 0, -1))) == pytest.approx(0.5 / 65535, rel=0.1)
