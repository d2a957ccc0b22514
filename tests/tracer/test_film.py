"""Samples of a pixel and of a lens: filters and blur, against integrals that are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tracer import (
    Box,
    Gaussian,
    Perspective,
    Sampling,
    Scene,
    SceneError,
    Surface,
    ThinLens,
    render,
)
from tracer.film import weights
from tracer.patterns import Checker, Constant, Ramp
from tracer.scene import Emissive
from tracer.shapes import Disk, Rectangle

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
DOWN = (0.0, 0.0, -1.0)
AXES = (X, Y, DOWN)
PINHOLE = Perspective((0.0, 0.0, 0.0), *AXES, 0.5)
WHITE = (1.0, 1.0, 1.0)


def board(distance: float, pattern: object, size: float = 20.0) -> Surface:
    face = Rectangle((0.0, 0.0, -distance), X, Y, Z, (size, size))
    return Surface(face, Emissive(pattern))  # type: ignore[arg-type]


# --- filters --------------------------------------------------------------------------------------


@pytest.mark.parametrize("sampling", [Sampling(1), Sampling(4), Sampling(3, Gaussian(0.5))])
def test_weights_sum_to_one_everywhere(sampling: Sampling) -> None:
    table, _ = weights(sampling, 0, 9, 9)
    assert table.sum(axis=1) == pytest.approx(np.ones(9), abs=1e-15)
    assert (table >= 0).all()


def test_gaussian_weights_are_symmetric_and_fall_off() -> None:
    table, _ = weights(Sampling(4, Gaussian(0.5)), 4, 5, 9)
    middle = table[0]
    assert middle == pytest.approx(middle[::-1], abs=1e-15)
    d = (np.arange(len(middle)) - (len(middle) - 1) / 2) / 4
    expected = np.maximum(0, np.exp(-2 * d**2) - math.exp(-8))
    assert middle == pytest.approx(expected / expected.sum(), abs=1e-15)


def test_a_constant_stays_constant() -> None:
    scene = Scene(PINHOLE, background=(0.3, 0.6, 0.9))
    for sampling in (Sampling(2), Sampling(3, Gaussian(0.7))):
        pixels = render(scene, 7, 5, sampling=sampling).pixels
        assert pixels == pytest.approx(np.broadcast_to([0.3, 0.6, 0.9], (5, 7, 3)), abs=1e-14)


def test_box_samples_are_the_pixels_of_a_finer_film() -> None:
    scene = Scene(PINHOLE, surfaces=(board(3.0, Checker(WHITE, (0.0, 0.0, 0.0), (30, 30))),))
    fine = render(scene, 32, 32).pixels
    coarse = render(scene, 8, 8, sampling=Sampling(4)).pixels
    assert coarse == pytest.approx(fine.reshape(8, 4, 8, 4, 3).mean(axis=(1, 3)), abs=1e-14)


def test_an_edge_covers_its_part_of_a_pixel() -> None:
    """White from x = 0.3 pixels on: 16 samples a side find the part 0.7 to within 1/32."""
    half = Rectangle((1.0 + 0.3 / 8 * 2 * 0.5, 0.0, -1.0), X, Y, Z, (2.0, 9.0))
    scene = Scene(PINHOLE, surfaces=(Surface(half, Emissive(Constant(WHITE))),))
    row = render(scene, 8, 1, sampling=Sampling(16)).pixels[0, :, 0]
    assert row[4] == pytest.approx(0.7, abs=1 / 32)
    assert (row[:4] == 0).all()
    assert (row[5:] == 1).all()


def test_a_gaussian_blurs_an_edge_as_the_error_function() -> None:
    half = Rectangle((1.0, 0.0, -1.0), X, Y, Z, (2.0, 9.0))
    scene = Scene(PINHOLE, surfaces=(Surface(half, Emissive(Constant(WHITE))),))
    row = render(scene, 8, 1, sampling=Sampling(16, Gaussian(0.5))).pixels[0, :, 0]
    # Pixel centres are half a pixel, one sigma, from the edge. The filter is cut at 4 sigma, where
    # e^-8 is taken away: that is 8 e^-8 / sqrt(2 pi) of its weight, 1.1e-3, before it is rescaled.
    assert row[4] == pytest.approx(0.5 * (1 + math.erf(1 / math.sqrt(2))), abs=1.5e-3)
    assert row[3] + row[4] == pytest.approx(1.0, abs=1e-12)


def test_strips_of_the_film_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(PINHOLE, surfaces=(board(3.0, Checker(WHITE, (0.0, 0.0, 0.0), (30, 30))),))
    for sampling in (Sampling(1), Sampling(2), Sampling(2, Gaussian(0.8))):
        whole = render(scene, 16, 11, sampling=sampling)
        with monkeypatch.context() as patch:
            patch.setattr("tracer.image.STRIP", 16 * 4 * 3)
            strips = render(scene, 16, 11, sampling=sampling)
        assert (whole.pixels == strips.pixels).all()
        assert (whole.closest == strips.closest).all()
        assert whole.rays <= strips.rays  # samples beside a strip are taken again


# --- lenses ---------------------------------------------------------------------------------------


def lens(aperture: float, focus: float, side: int) -> ThinLens:
    return ThinLens((0.0, 0.0, 0.0), *AXES, 0.5, aperture, focus, side)


def test_what_is_in_focus_is_sharp() -> None:
    surfaces = (board(4.0, Checker(WHITE, (0.2, 0.1, 0.0), (40, 40))),)
    pinhole = render(Scene(PINHOLE, surfaces=surfaces), 24, 16).pixels
    through_lens = render(Scene(lens(0.3, 4.0, 5), surfaces=surfaces), 24, 16).pixels
    assert np.abs(through_lens - pinhole).max() <= 1e-12


def test_a_closed_lens_is_a_pinhole() -> None:
    surfaces = (board(4.0, Ramp((0.0, 0.0, 0.0), WHITE)),)
    pinhole = render(Scene(PINHOLE, surfaces=surfaces), 12, 8).pixels
    closed = render(Scene(lens(0.0, 1.0, 3), surfaces=surfaces), 12, 8).pixels
    assert np.abs(closed - pinhole).max() <= 1e-14


def test_a_point_out_of_focus_is_a_disk_of_the_lenses_shape() -> None:
    """Seen through a lens of radius A focused at f, a small light at distance s is blurred to a
    disk of radius A |1/s - 1/f| in units of the tangent: here 0.5 (1 - 1/2) = 0.25 of 0.5, a
    quarter of the film's width. Its light is spread evenly.
    """
    lamp = Disk((0.0, 0.0, -1.0), X, Y, Z, 0.02)
    scene = Scene(lens(0.5, 2.0, 64), surfaces=(Surface(lamp, Emissive(Constant(WHITE))),))
    n = 33
    pixels = render(scene, n, n).pixels[..., 0]
    x = (2 * (np.arange(n) + 0.5) / n - 1) * 0.5
    radius = np.hypot(x[:, None], x)
    # The lamp's own disk softens the edge: in the plane of the lens it is 0.02 f / |f - s| wide.
    edge = 0.02 + 2 * 0.02
    assert (pixels[radius > 0.25 + edge] == 0).all()
    inside = pixels[radius < 0.25 - edge]
    # The part of the lens that sees the lamp is a disk of radius 0.02 f / (f - s) on it, over A^2.
    # It holds some 26 of 4096 regions, counted with an error of about its border in regions.
    part = (0.04 / 0.5) ** 2
    assert inside.mean() == pytest.approx(part, rel=0.05)
    assert inside.std() < 0.25 * part


def test_a_lens_sees_a_ramp_as_a_pinhole_does_at_any_focus() -> None:
    """The points of the lens are symmetric, so what is linear is not changed by blur."""
    surfaces = (board(4.0, Ramp((0.0, 0.0, 0.0), WHITE)),)
    pinhole = render(Scene(PINHOLE, surfaces=surfaces), 12, 8).pixels
    for focus in (2.0, 40.0):
        blurred = render(Scene(lens(0.3, focus, 6), surfaces=surfaces), 12, 8).pixels
        assert np.abs(blurred - pinhole).max() <= 1e-13


def test_images_through_lenses_and_filters_are_the_same_in_every_run() -> None:
    surfaces = (board(4.0, Checker(WHITE, (0.2, 0.1, 0.0), (40, 40))),)
    scene = Scene(lens(0.3, 2.0, 3), surfaces=surfaces)
    sampling = Sampling(3, Gaussian(0.5))
    images = [render(scene, 24, 16, threads, sampling).pixels for threads in (1, 2, 3, 1)]
    assert all((image == images[0]).all() for image in images)


def test_cameras_and_films_without_meaning_are_refused() -> None:
    with pytest.raises(SceneError, match="positive focus"):
        replace(lens(0.1, 1.0, 2), focus=0.0)
    with pytest.raises(SceneError, match="samples a side"):
        lens(0.1, 1.0, 0)
    with pytest.raises(SceneError, match="sigma"):
        Gaussian(0.0)
    with pytest.raises(SceneError, match="samples a side"):
        Sampling(0)
    assert Box().reach == 0.5
