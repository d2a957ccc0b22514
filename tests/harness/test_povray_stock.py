"""POV-Ray as its users write it: the same geometry, its own defaults."""

from __future__ import annotations

import math
import re

import pytest

from harness.cli.options import chosen_renderers, named_by
from harness.data import scenes_root
from harness.plan import asks, prepare
from harness.renderers import registry
from harness.scene.load import load_cases
from harness.scene.model import CheckSpec
from harness.translate.povray import translate
from harness.translate.povray_stock import translate as translate_stock
from tests.harness.scenes import scene, slab


def test_limits_are_the_defaults_but_where_a_scene_asks_for_less() -> None:
    deep = scene((slab(0, -1), 1, 0)).model_copy(
        update={"transport": scene().transport.model_copy(update={"max_depth": 60})}
    )
    assert "max_trace_level 5\n" in translate_stock(deep).sdl
    assert "max_trace_level 60\n" in translate(deep).sdl
    shallow = deep.model_copy(
        update={"transport": deep.transport.model_copy(update={"max_depth": 3})}
    )
    assert "max_trace_level 3\n" in translate_stock(shallow).sdl


def test_absorption_fades_as_beer_and_lambert_say() -> None:
    """T = exp(-(1 - c) L / d), by POV-Ray's manual, for each channel."""
    absorption = (0.2, 0.7, 1.5)
    sdl = translate_stock(scene((slab(0, -1), 1, 0), absorption=absorption)).sdl
    found = re.search(r"fade_power 1001 fade_distance (\S+) fade_color rgb <(.*?)>", sdl)
    assert found is not None
    distance, color = float(found[1]), [float(c) for c in found[2].split(",")]
    for c, sigma in zip(color, absorption, strict=True):
        assert math.isclose((1 - c) / distance, sigma, rel_tol=1e-12)


@pytest.mark.parametrize(("ior", "abbe"), [(1.5168, 64.17), (1.7847, 25.7)])
def test_dispersion_spreads_the_lines_f_and_c_as_the_abbe_number_says(
    ior: float, abbe: float
) -> None:
    """By POV-Ray's law, n(wavelength) = n dispersion^((555 - wavelength) / 350)."""
    bare = scene((slab(0, -1), 1, 0), ior=(ior,))
    assert "dispersion" not in translate_stock(bare).sdl
    glass = bare.media[1].model_copy(update={"abbe": abbe})
    sdl = translate_stock(bare.model_copy(update={"media": (bare.media[0], glass)})).sdl
    found = re.search(r" dispersion (\S+)", sdl)
    assert found is not None
    n_f, n_c = (ior * float(found[1]) ** ((555 - line) / 350) for line in (486.1327, 656.2725))
    # To first order in the spread of the indices.
    assert math.isclose((ior - 1) / (n_f - n_c), abbe, rel_tol=(n_f - n_c) / ior)


def test_lengths_are_the_scene_s_own() -> None:
    thin = scene((slab(0, -8e-5, 4), 1, 0))
    assert translate_stock(thin).length_scale == 1
    assert translate(thin).length_scale > 1


def test_it_is_asked_only_where_it_is_named() -> None:
    everyone, named = CheckSpec(observable="radiance"), CheckSpec(
        observable="radiance", renderers=("povray-stock",)
    )  # fmt: skip
    assert not asks(everyone, "povray-stock")
    assert asks(named, "povray-stock")
    assert asks(everyone, "povray")
    assert not asks(named, "povray")
    assert "povray-stock" in registry.available()
    assert "povray-stock" not in {r.name for r in chosen_renderers((), (), ())}
    cases = [prepare(load_cases(scenes_root() / "furnace" / "ball.toml")[0])]
    assert [r.name for r in named_by(cases)] == ["povray-stock"]
    assert named_by([prepare(load_cases(scenes_root() / "slab" / "offset.toml")[0])]) == []
