"""Dispersion: formulas against published indices, and images at many wavelengths at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tracer import Perspective, Scene, SceneError, Solid, Surface, render, render_spectrum
from tracer.patterns import Checker
from tracer.scene import Emissive, Medium
from tracer.shapes import Rectangle, Sphere
from tracer.spectrum import (
    GLASSES,
    LINE_C,
    LINE_D,
    LINE_F,
    Cauchy,
    Sellmeier,
    abbe_number,
    from_abbe,
)

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

# nd and Vd as printed by Schott (data sheets, rounded to 5 and 2 decimals), for fused silica as in
# I. Malitson 1965, for water at 20 C as in M. Daimon, A. Masumura 2007.
PUBLISHED = {
    "N-BK7": (1.51680, 64.17),
    "SF11": (1.78472, 25.76),
    "N-SF11": (1.78472, 25.68),
    "fused silica": (1.45846, 67.82),
    "water": (1.33336, 55.8),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_glasses_have_their_published_index_and_abbe_number(name: str) -> None:
    index, abbe = PUBLISHED[name]
    assert GLASSES[name].ior(LINE_D) == pytest.approx(index, abs=6e-6 if name != "water" else 2e-4)
    assert abbe_number(GLASSES[name]) == pytest.approx(abbe, abs=0.006 if name != "water" else 0.15)


def test_sf11_is_not_n_sf11() -> None:
    assert abs(GLASSES["SF11"].ior(LINE_F) - GLASSES["N-SF11"].ior(LINE_F)) > 5e-5


@pytest.mark.parametrize(("index", "abbe"), [(1.5168, 64.17), (1.78472, 25.68)])
def test_a_glass_of_two_numbers_has_these(index: float, abbe: float) -> None:
    glass = from_abbe(index, abbe)
    assert glass.ior(LINE_D) == pytest.approx(index, abs=1e-15)
    assert abbe_number(glass) == pytest.approx(abbe, rel=1e-12)
    assert glass.ior(LINE_F) > glass.ior(LINE_D) > glass.ior(LINE_C)


def test_formulas_without_an_index_are_refused() -> None:
    with pytest.raises(SceneError, match="no index of refraction at 500"):
        Cauchy(-1.0, 0.0).ior(500.0)
    with pytest.raises(SceneError, match="no index of refraction"):
        Sellmeier((-3.0,), (0.01,)).ior(600.0)
    with pytest.raises(SceneError, match="absorbs"):
        Sellmeier((1.0,), (0.25,)).ior(500.0)


# --- images ---------------------------------------------------------------------------------------

BOARD = Surface(
    Rectangle((0.0, 0.0, -3.0), X, Y, Z, (16.0, 16.0)),
    Emissive(Checker((0.1, 0.3, 0.9), (0.9, 0.6, 0.2), (16, 16))),
)
CAMERA = Perspective((0.0, 0.0, 6.0), X, Y, (0.0, 0.0, -1.0), 0.5)
FLINT = Solid(Sphere((-0.9, 0.0, 0.0), 0.8), Medium(GLASSES["SF11"]))
CLEAR = Solid(Sphere((1.1, 0.0, 0.0), 0.8), Medium(1.5))
SCENE = Scene(CAMERA, (FLINT, CLEAR), (BOARD,))
WAVELENGTHS = (400.0, 550.0, 700.0)


def test_a_spectrum_is_one_render_per_wavelength() -> None:
    """Although most of it is traced only once. A pixel's light is the sum of the same rays, at most
    200 of weights that make 1; which come first depends on the others in their waves: 200 eps / 2.
    """
    together = render_spectrum(SCENE, 40, 30, WAVELENGTHS)
    for wavelength, image in zip(WAVELENGTHS, together, strict=True):
        alone = render(replace(SCENE, wavelength=wavelength), 40, 30)
        np.testing.assert_allclose(image.pixels, alone.pixels, rtol=0.0, atol=100 * 2.0**-52)
        np.testing.assert_allclose(image.cut, alone.cut, rtol=0.0, atol=100 * 2.0**-52)


def test_a_wavelength_has_the_image_of_its_index() -> None:
    index = GLASSES["SF11"].ior(450.0)
    fixed = replace(FLINT, medium=Medium(index))
    found = render(replace(SCENE, wavelength=450.0), 40, 30).pixels
    assert (found == render(replace(SCENE, solids=(fixed, CLEAR)), 40, 30).pixels).all()


def test_only_what_disperses_is_traced_again() -> None:
    first, *others = render_spectrum(SCENE, 40, 30, WAVELENGTHS)
    assert all(0 < image.rays < first.rays for image in others)
    still = render_spectrum(replace(SCENE, solids=(CLEAR,)), 40, 30, WAVELENGTHS)
    assert [image.rays for image in still[1:]] == [0, 0]
    assert (still[1].pixels == still[0].pixels).all()


def test_colours_part_at_a_dispersing_ball_alone() -> None:
    blue, _, red = render_spectrum(SCENE, 40, 30, WAVELENGTHS)
    differs = np.abs(blue.pixels - red.pixels).max(axis=2) > 1e-3
    flint, nothing = differs[11:19, 9:15], differs[:5]
    assert flint.mean() > 0.2
    assert not nothing.any()
