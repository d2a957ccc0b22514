"""Pictures in the colours of the spectrum: from monochromatic parts to one picture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harness import plan
from harness.errors import RendererError, RendererFailed
from harness.judging import spectral
from harness.judging.results import Result
from harness.plan import PreparedCase
from harness.renderers.base import Capability, Image, RenderSettings
from harness.renderers.tracer import TracerEngine
from harness.running.lanes import perform
from harness.scene.load import load_cases

SCENES = Path(__file__).parents[2] / "scenes"
EVEN = tuple(float(w) for w in range(420, 690, 20))
SETTINGS = RenderSettings(threads=1)


def rainbow() -> PreparedCase:
    return plan.prepare(load_cases(SCENES / "dispersion" / "prism-rainbow.toml", "draft")[0])


def image(value: float, **more: object) -> Image:
    return Image(np.full((2, 3, 3), value, np.float32), **more)  # type: ignore[arg-type]


# --- matrices -------------------------------------------------------------------------------------


@pytest.mark.parametrize("wavelengths", [EVEN, (410.0, 450.0, 520.0, 560.0, 610.0, 690.0)])
def test_matrices_add_up_to_the_identity(wavelengths: tuple[float, ...]) -> None:
    total = spectral.matrices(wavelengths).sum(axis=0)
    assert total == pytest.approx(np.eye(3), abs=1e-14)


def test_one_wavelength_has_the_colour_of_its_light() -> None:
    """The direction in linear sRGB of what the standard observer sees, by colour-science."""
    import colour

    for wavelength, matrix in zip(EVEN, spectral.matrices(EVEN), strict=True):
        xyz = colour.wavelength_to_XYZ(wavelength)
        expected = colour.XYZ_to_RGB(xyz, "sRGB", apply_cctf_encoding=False)
        # Chromatic adaptation is not asked for: both have the white of D65.
        found = matrix @ np.ones(3)
        cosine = found @ expected / np.linalg.norm(found) / np.linalg.norm(expected)
        assert cosine == pytest.approx(1, abs=1e-6)


def test_white_light_is_daylight() -> None:
    """An emitter of equal red, green and blue has the spectrum of D65."""
    import colour

    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    daylight = colour.SDS_ILLUMINANTS["D65"]
    fine = tuple(float(w) for w in range(400, 701, 5))
    luminance = spectral.matrices(fine).sum(axis=2) @ [0.2126, 0.7152, 0.0722]
    expected = np.array([observer[w][1] * daylight[w] for w in fine])
    # Half weight at both ends, and a correction of the primaries for the bands that are used.
    inner = slice(1, -1)
    shape = luminance[inner] / luminance.sum() - expected[inner] / expected.sum()
    assert np.abs(shape).max() < 0.02 * (expected / expected.sum()).max()


def test_too_few_bands_have_no_colours() -> None:
    with pytest.raises(ValueError, match="too few visible"):
        spectral.matrices((800.0, 900.0, 1000.0))


def test_gain_bounds_what_errors_do() -> None:
    rng = np.random.default_rng(1)
    matrices = spectral.matrices(EVEN)
    errors = rng.choice([-1.0, 1.0], (1000, len(EVEN), 3))
    found = np.abs(np.einsum("nij,enj->ei", matrices, errors)).max()
    assert found <= spectral.gain(EVEN)
    assert spectral.gain(()) == 1.0
    # The bound is reached where every error has the sign of its coefficient.
    row = int(np.abs(matrices).sum(axis=(0, 2)).argmax())
    worst = np.sign(matrices[:, row, :])
    assert (matrices[:, row, :] * worst).sum() == pytest.approx(spectral.gain(EVEN), rel=1e-12)


# --- parts of a picture ---------------------------------------------------------------------------


def parts(renderer: str, values: list[Result]) -> dict[tuple[str, str], Result]:
    roles = [plan.pass_role(plan.IMAGE, w) for w in EVEN]
    return {(renderer, role): value for role, value in zip(roles, values, strict=True)}


def test_what_does_not_disperse_keeps_its_picture() -> None:
    results = parts("a", [image(0.25, cut=0.1, seconds=1.0) for _ in EVEN])
    whole = spectral.gathered(results, EVEN)
    assert list(whole) == [("a", plan.IMAGE)]
    picture = whole["a", plan.IMAGE]
    assert isinstance(picture, Image)
    assert picture.pixels == pytest.approx(image(0.25).pixels, abs=1e-7)
    assert picture.cut == 0.1
    assert picture.seconds == len(EVEN)


def test_a_missing_or_failed_part_is_no_picture() -> None:
    values: list[Result] = [image(1.0) for _ in EVEN]
    values[3] = RendererFailed("crashed")
    found = spectral.gathered(parts("a", values), EVEN)["a", plan.IMAGE]
    assert found is values[3]
    values[3] = Image(np.zeros((1, 1, 3), np.float32))
    found = spectral.gathered(parts("a", values), EVEN)["a", plan.IMAGE]
    assert isinstance(found, RendererError)
    some = parts("a", [image(1.0) for _ in EVEN])
    del some["a", plan.pass_role(plan.IMAGE, EVEN[-1])]
    found = spectral.gathered(some, EVEN)["a", plan.IMAGE]
    assert "was not rendered" in str(found)


def test_noise_of_the_parts_is_noise_of_the_picture() -> None:
    rng = np.random.default_rng(2)
    noisy = [
        Image(rng.normal(0, 0.1, (80, 80, 3)).astype(np.float32), np.full((80, 80, 3), 0.01, "f4"))
        for _ in EVEN
    ]
    picture = spectral.combined(noisy, spectral.matrices(EVEN))
    assert picture.variance is not None
    # Channels are independent here, which they need not be, so the estimate is an upper bound.
    spread = picture.pixels.reshape(-1, 3).var(axis=0)
    assert (spread <= picture.variance[0, 0] * 1.1).all()
    assert (spread >= picture.variance[0, 0] / 3).all()


def test_pictures_without_a_spectrum_are_left_alone() -> None:
    results: dict[tuple[str, str], Result] = {("a", plan.IMAGE): image(1.0)}
    assert spectral.gathered(results, ()) == results


# --- a rainbow ------------------------------------------------------------------------------------


def test_a_case_with_a_spectrum_has_a_job_per_wavelength() -> None:
    case = rainbow()
    claims = frozenset({Capability.PIXEL_CENTRES})
    jobs = plan.auxiliary_jobs(case, "helper", 1e-6, True, SETTINGS)
    assert len(jobs) == 6 * len(case.wavelengths)
    iors = {job.scene.media[-1].ior for job in jobs}
    assert len(iors) == len(case.wavelengths)
    assert claims


def test_a_prism_bends_blue_most_and_the_picture_has_all_colours() -> None:
    """Each part shows the slit where its deviation says; together they are a rainbow."""
    case, engine = rainbow(), TracerEngine()
    case = replace(case, passes=case.passes[::2])
    results: dict[tuple[str, str], Result] = {}
    columns = []
    for wavelength, media in case.passes:
        scene = case.scene.model_copy(update={"media": media})
        job = plan.Job("tracer", plan.pass_role(plan.IMAGE, wavelength), scene, SETTINGS)
        found = perform(engine, job)
        assert isinstance(found, Image)
        results["tracer", job.role] = found
        row = found.pixels[found.pixels.shape[0] // 2, :, 0]
        bright = np.where(row > 0.5, row, 0)
        columns.append(float(bright @ np.arange(len(row)) / bright.sum()))
    assert (np.diff(columns) < -0.3).all()  # from violet to red, each further to the left
    whole = spectral.gathered(results, case.wavelengths)["tracer", plan.IMAGE]
    assert isinstance(whole, Image)
    row = whole.pixels[whole.pixels.shape[0] // 2]
    strongest = [int(row[round(c)].argmax()) for c in columns]
    assert strongest == sorted(strongest, reverse=True)  # blue, green, red
    assert set(strongest) == {0, 1, 2}


def test_the_tracer_tells_what_it_cut() -> None:
    case = rainbow()
    shallow = case.scene.model_copy(
        update={"transport": case.scene.transport.model_copy(update={"max_depth": 2})}
    )
    found = TracerEngine().render(shallow, SETTINGS)
    assert found.cut is not None
    assert 0 < found.cut < 1
