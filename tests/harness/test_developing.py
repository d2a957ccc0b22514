"""Pixels that are weighed means of samples."""

from __future__ import annotations

import numpy as np
import pytest

from harness.measure.comparison import Unmeasurable
from harness.measure.precision import Precision
from harness.measure.radiance import against_truth
from harness.probe.scenes import light_scene
from harness.renderers.base import Capability, Image, RenderSettings
from harness.renderers.developing import developed, of_samples
from harness.renderers.needs import needs
from harness.renderers.persistent import WorkerRenderer
from harness.renderers.povray import PovRayRenderer
from harness.scene import resolved as rs
from harness.translate.tracer import sampling, translate
from tests.harness.povray_measure import needs_povray, step
from tests.harness.povray_scenes import Array, camera, make_scene, rectangle
from tests.harness.test_resolve import problems_of, resolved_of, sphere
from tests.harness.test_resolve import scene as document
from tracer.image import render

BOARD = rectangle((0, 0, -3), (16, 16))
LOOK = rs.Emissive(pattern=rs.Ramp(start=(0.1, 0.3, 0.9), end=(0.9, 0.6, 0.2), axis="u"))


def film(samples: int, sigma: float | None) -> rs.Film:
    return rs.Film(width=24, height=16, samples=samples, sigma=sigma)


def ball(samples: int, sigma: float | None) -> rs.ResolvedScene:
    made = make_scene(
        camera((0, 0, 6), (0, 0, 0), 30),
        solids=[(rs.Sphere(center=(0, 0, 0), radius=1), 1, 0)],
        surfaces=[(BOARD, LOOK)],
    )
    return made.model_copy(update={"film": film(samples, sigma)})


def traced(scene: rs.ResolvedScene) -> Array:
    size = scene.film.width, scene.film.height
    return render(translate(scene), *size, sampling=sampling(scene.film)).pixels


def develop(samples: Array, like: rs.Film) -> Array:
    return developed(Image(pixels=samples.astype(np.float32)), like).pixels.astype(np.float64)


@pytest.mark.parametrize("sigma", [None, 0.3, 0.5, 1.5])
def test_what_is_alike_everywhere_stays(sigma: float | None) -> None:
    grey = np.full((16 * 3, 24 * 3, 3), 0.25)
    assert np.abs(develop(grey, film(3, sigma)) - 0.25).max() <= 2.0**-24


def test_a_box_is_the_mean_of_a_pixels_own_samples() -> None:
    samples = np.random.default_rng(1).random((16 * 4, 24 * 4, 3))
    means = samples.reshape(16, 4, 24, 4, 3).mean(axis=(1, 3))
    assert np.abs(develop(samples, film(4, None)) - means).max() <= 2.0**-23


def test_one_sample_spreads_as_the_filter_says() -> None:
    """One lit sample of 3 x 3, at the centre of a pixel: weights at 0, 1/3, 2/3, 1 … of a pixel."""
    lit = np.zeros((16 * 3, 24 * 3, 3))
    lit[8 * 3 + 1, 12 * 3 + 1] = 1
    w = np.maximum(np.exp(-0.5 * (np.arange(-12, 13) / 3 / 0.5) ** 2) - np.exp(-8), 0)
    along = np.array([w[12 - 3 * k] for k in range(-2, 3)]) / w.sum()
    found = develop(lit, film(3, 0.5))[6:11, 10:15, 0]
    assert found == pytest.approx(np.outer(along, along), abs=1e-7)


@pytest.mark.parametrize(("samples", "sigma"), [(2, None), (3, 0.5)])
def test_the_tracers_own_film_is_the_same(samples: int, sigma: float | None) -> None:
    """It develops while it traces; this does after a render of the samples."""
    scene = ball(samples, sigma)
    fine = develop(traced(of_samples(scene)), scene.film)
    assert np.abs(traced(scene) - fine).max() <= 2.0**-23


@pytest.mark.povray
@needs_povray
def test_povray_takes_the_same_samples() -> None:
    scene = ball(3, 0.5)
    pixels = PovRayRenderer().render(scene, RenderSettings()).pixels
    assert np.abs(pixels - traced(scene)).max() <= step(scene)


@pytest.mark.mitsuba
def test_mitsuba_exact_takes_the_same_samples(exact: WorkerRenderer) -> None:
    """Near the rim the ball magnifies single precision some thousandfold."""
    scene = ball(3, 0.5)
    difference = np.abs(exact.render(scene, RenderSettings()).pixels - traced(scene))
    assert difference.max() <= 1e-4
    assert np.median(difference) <= 4 * 2.0**-24


def test_probes_go_through_the_centres_of_pixels() -> None:
    probed = light_scene(ball(4, 0.5), BOARD, "TT")
    assert probed.film == rs.Film(width=24, height=16)


def test_a_film_of_samples_is_asked_of_those_who_claim_it() -> None:
    assert Capability.SAMPLING in needs(ball(2, None))
    assert Capability.SAMPLING not in needs(ball(1, None))


def test_it_has_no_truth_of_its_own() -> None:
    plain = ball(2, None).model_copy(update={"solids": ()})
    with pytest.raises(Unmeasurable, match="samples"):
        against_truth(plain, np.zeros((16, 24, 3), np.float32), 1e-6, Precision(2e-16, 2e-16), None)


def test_scene_files_say_how() -> None:
    made = document(("glass", sphere(1)))
    gaussian = {"type": "gaussian", "sigma": 0.7}
    made["film"] = {"width": 8, "height": 4, "samples": 2, "filter": gaussian}
    assert resolved_of(made).film == rs.Film(width=8, height=4, samples=2, sigma=0.7)
    made["film"] = {"filter": gaussian}
    message = "weighs samples, of which there is one at the pixel's centre"
    assert problems_of(made) == [("film.filter", message)]
