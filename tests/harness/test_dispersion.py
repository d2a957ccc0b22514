"""Media that disperse: indices as published, relative to the air that the scene has."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import tracer.spectrum
from harness.data import scenes_root
from harness.errors import InputError
from harness.renderers.base import Capability
from harness.renderers.needs import needs
from harness.scene import dispersion
from harness.scene.load import load_cases
from harness.scene.media_model import Abbe, Cauchy, Medium, Sellmeier
from harness.scene.resolve import resolve, spectral_media

# nF, nd, nC and Vd to 16 digits, computed with mpmath from the published coefficients.
PUBLISHED = {
    "N-BK7": (1.522376289731229, 1.516800034500588, 1.514322347261375, 64.16733623749898),
    "SF11": (1.806454385470879, 1.784719845855929, 1.775987679010179, 25.75663525915333),
    "N-SF11": (1.806512744005563, 1.78471994231005, 1.775955111277192, 25.67999783509036),
    "fused silica": (1.463126484747024, 1.458463687137226, 1.456366620295137, 67.82143198289505),
    "water": (1.337491856054589, 1.333403336198941, 1.331512603741075, 55.76003799762608),
}
LINES = (dispersion.LINE_F, dispersion.LINE_D, dispersion.LINE_C)
EPS = 2.0**-52


def ior(wavelength: float, air: float = 1.0, **medium: object) -> float:
    return dispersion.index(Medium.model_validate(medium), wavelength, air)


@pytest.mark.parametrize("name", PUBLISHED)
def test_glasses_have_their_published_indices(name: str) -> None:
    *indices, abbe = PUBLISHED[name]
    found = [ior(line, glass=name) for line in LINES]
    # Three to four terms of n^2, each a few roundings of numbers up to 3.
    assert found == pytest.approx(indices, rel=16 * EPS)
    n_f, n_d, n_c = found
    assert (n_d - 1) / (n_f - n_c) == pytest.approx(abbe, rel=64 * EPS / (n_f - n_c))


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_tracer_knows_the_same_glasses(name: str) -> None:
    """Two implementations, written apart: the tracer's serves those who use it alone."""
    for wavelength in (400.0, 555.0, 700.0, 1064.0):
        own = tracer.spectrum.GLASSES[name].ior(wavelength)
        assert ior(wavelength, glass=name) == pytest.approx(own, rel=8 * EPS)


def test_a_glass_of_two_numbers_has_these() -> None:
    n_f, n_d, n_c = (ior(line, abbe={"nd": 1.62004, "vd": 36.37}) for line in LINES)
    assert n_d == pytest.approx(1.62004, rel=4 * EPS)
    assert (n_d - 1) / (n_f - n_c) == pytest.approx(36.37, rel=1e-12)
    flint = dispersion.of_abbe(Abbe(nd=1.62004, vd=36.37))
    other = tracer.spectrum.from_abbe(1.62004, 36.37)
    assert pytest.approx((other.A, other.B), rel=1e-12) == (flint.A, flint.B)


def test_only_who_is_to_disperse_is_told_how_strongly(tmp_path: Path) -> None:
    """Schott gives N-BK7's Abbe number as 64.17; what does not disperse has none."""
    file = tmp_path / "furnace" / "own.toml"
    file.parent.mkdir()
    text = (scenes_root() / "findings" / "dispersion-energy.toml").read_text()
    file.write_text(text.replace('abbe = { nd = 1.7847, vd = "=vd" }', 'glass = "N-BK7"'))
    scene = resolve(load_cases(file)[0])
    assert [m.abbe for m in scene.media] == [None, pytest.approx(64.17, abs=0.005)]
    assert Capability.DISPERSION in needs(scene)
    file.write_text(file.read_text().replace("dispersion = true", ""))
    alike = resolve(load_cases(file)[0])
    assert [m.abbe for m in alike.media] == [None, None]
    assert Capability.DISPERSION not in needs(alike)


def test_formulas_are_those_of_the_textbook() -> None:
    assert ior(500.0, cauchy={"A": 1.5, "B": 0.004, "C": 1e-4}) == pytest.approx(
        1.5 + 0.004 / 0.25 + 1e-4 / 0.0625, rel=4 * EPS
    )
    one_term = {"B": (1.0,), "C": (0.01,)}
    assert ior(500.0, sellmeier=one_term) == pytest.approx(math.sqrt(1 + 0.25 / 0.24), rel=4 * EPS)


def test_air_has_its_index() -> None:
    """Against E. Peck, K. Reeder 1972 as colour-science has it, for 300 ppm CO2 where Ciddor's has
    450: that is 1.5e-4 ppm CO2 x 0.534e-6 of n - 1 (Ciddor, equation 2), 2e-8 relative.
    """
    from colour.phenomena.rayleigh import air_refraction_index_Peck1972

    for wavelength in (400.0, 555.0, 633.0, 700.0):
        other = float(air_refraction_index_Peck1972(wavelength / 1000))
        assert dispersion.air_index(wavelength) == pytest.approx(other, abs=3e-8)


def test_glass_is_relative_to_air_and_air_to_vacuum() -> None:
    """Where the scene says that it is air, the ratio at the interface is the catalogue's."""
    air = ior(550.0, glass="air")
    assert air > 1.00027
    assert ior(550.0, air, glass="SF11") / air == pytest.approx(ior(550.0, glass="SF11"), rel=EPS)
    assert ior(550.0, air, ior=1.5) == 1.5  # absolute is absolute


def test_all_ways_to_say_an_index_are_known_to_the_model() -> None:
    assert set(dispersion.WAYS) == set(Medium.model_fields) - {"absorption"}
    assert set(dispersion.GLASSES) == set(PUBLISHED)
    assert isinstance(dispersion.GLASSES["SF11"], Sellmeier)
    assert isinstance(dispersion.of_abbe(Abbe(nd=1.5, vd=60)), Cauchy)


# --- scene files ----------------------------------------------------------------------------------

HEAD = """\
format = 1
title = "A ball"
family = "ball"
sources = ["a book"]
{top}

[camera]
type = "perspective"
origin = [0, 0, 6]
target = [0, 0, 0]
fov_x = 30

[[checks]]
observable = "ssim"
against = "renderers"

[media]
glass = {medium}
{more}
"""


def case(folder: Path, medium: str, more: str = "", top: str = "") -> object:
    path = folder / "ball" / "plain.toml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(HEAD.format(medium=medium, more=more, top=top), encoding="utf-8")
    return load_cases(path, "normal")[0]


def test_a_scene_has_its_media_at_its_wavelength(tmp_path: Path) -> None:
    at_d = resolve(case(tmp_path, '{ glass = "SF11" }'))  # type: ignore[arg-type]
    assert at_d.media[1].ior == pytest.approx(PUBLISHED["SF11"][1], rel=16 * EPS)
    blue = resolve(case(tmp_path, '{ glass = "SF11" }', top="wavelength = 486.1327"))  # type: ignore[arg-type]
    assert blue.media[1].ior == pytest.approx(PUBLISHED["SF11"][0], rel=16 * EPS)


def test_a_spectrum_has_the_media_at_each_wavelength(tmp_path: Path) -> None:
    span = "[spectrum]\nstart = 400\nstop = 700\ncount = 7"
    loaded = case(tmp_path, '{ glass = "N-BK7" }\nair = { glass = "air" }', span)
    passes = spectral_media(loaded)  # type: ignore[arg-type]
    assert [w for w, _ in passes] == [400, 450, 500, 550, 600, 650, 700]
    names = [m.name for m in passes[0][1]]
    for wavelength, media in passes:
        air, glass = media[names.index("air")].ior, media[names.index("glass")].ior
        assert air == dispersion.air_index(wavelength)
        assert glass == ior(wavelength, air, glass="N-BK7")
    assert spectral_media(case(tmp_path, "{ ior = 1.5 }")) == ()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("medium", "more", "message"),
    [
        (
            "{ }",
            "",
            "media.glass.ior: missing; expected a number ≥ 0.001 and ≤ 1000, or one of glass",
        ),
        ('{ ior = 1.5, glass = "SF11" }', "", "media.glass.glass: the index is said twice"),
        ('{ glass = "SF-11" }', "", "media.glass.glass"),
        ("{ sellmeier = { B = [1, 2], C = [0.1] } }", "", "coefficients go in pairs"),
        ("{ cauchy = { A = -2, B = 0 } }", "", "no index of refraction at 587.562 nm"),
        ("{ sellmeier = { B = [-3], C = [0.1] } }", "", "no index of refraction at 587.562 nm"),
        (
            "{ abbe = { nd = 1.5, vd = 1e-320 } }",
            "",
            "media.glass.abbe.vd: out of range; got 1e-320",
        ),  # B = inf
        ("{ ior = 1.5 }", "[spectrum]\nstart = 400", "spectrum: says no wavelengths"),
        ("{ ior = 1.5 }", "[spectrum]\nwavelengths = [400, 700]\ncount = 3", "said twice"),
        ("{ ior = 1.5 }", "[spectrum]\nwavelengths = [500, 400]", "must rise"),
        ("{ ior = 1.5 }", "[spectrum]\nwavelengths = [500, 900]", "too few visible wavelengths"),
        ("{ ior = 1.5 }", "[spectrum]\nstart = 40\nstop = 700\ncount = 9", "spectrum.start"),
    ],
)
def test_media_without_meaning_are_refused(
    tmp_path: Path, medium: str, more: str, message: str
) -> None:
    def prepared() -> None:
        loaded = case(tmp_path, medium, more)
        resolve(loaded)  # type: ignore[arg-type]
        spectral_media(loaded)  # type: ignore[arg-type]

    with pytest.raises(InputError) as error:
        prepared()
    assert message in str(error.value)
    assert "plain.toml:" in str(error.value)
