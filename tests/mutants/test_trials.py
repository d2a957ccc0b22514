"""Some of the wrong renderers, each by the whole of snellcheck: seen, named, measured.

All of them, and how small a fault may be: `make detection` and docs/detection.md.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from harness.data import scenes_root
from harness.diagnosis.library import BY_ID
from harness.plan import prepare
from harness.record import Verdict
from harness.renderers import registry
from harness.run import run
from harness.scene.load import find
from tests.mutants.mutants import CLEAN, CONTROLS, MUTANTS, UNLISTED, Mutant, outside_renderer
from tests.mutants.trial import cases, trial


def test_there_are_enough_of_them() -> None:
    """Every class of real bugs, several sizes of what is continuous, and some on no list."""
    wrong = (*MUTANTS, *UNLISTED)
    assert len({m.fault for m in wrong}) >= 45
    classes = {int(n) for m in MUTANTS for n in re.findall(r"\bP(\d+)\b", m.source)}
    assert classes == set(range(1, 28))
    assert len(UNLISTED) >= 5
    assert len(CONTROLS) >= 4


def test_every_named_cause_is_in_the_library() -> None:
    named = {cause for m in MUTANTS for cause in m.causes if cause != "preflight"}
    assert named <= set(BY_ID)


@pytest.mark.parametrize(
    ("shows", "float32"), [("float", False), ("float", True), ("16bit", False), ("8bit", False)]
)
def test_a_right_renderer_of_any_class_is_not_accused(
    shows: str, float32: bool, tmp_path: Path
) -> None:
    found = trial(CLEAN, cases(), tmp_path, shows=shows, float32=float32)
    assert found.red == ()
    assert found.sentence == ""


@pytest.mark.parametrize("mutant", CONTROLS, ids=str)
def test_what_only_looks_wrong_is_not_accused(mutant: Mutant, tmp_path: Path) -> None:
    assert trial(mutant, cases(), tmp_path).red == ()


# One of each kind, with cases that tell it from its neighbours.
SOME = {
    "ambient-air=1": ("snell*",),
    "index-off=1e-06": ("snell-immersed*1.5*", "slab-offset*0.5*"),
    "side-ignored=1": ("slab-offset*0.5*", "ball-view*"),
    "normal-nudge=0.001": ("slab-offset*0.5*", "ball-view*"),
    "thin-offset=0": ("thin-face*", "slab-offset*0.5*"),
    "fresnel-swapped=1": ("fresnel-outside*1.5*", "fresnel-slab*"),
    "nan-at-normal=1e-12": ("fresnel-upright*",),
    "absorption-depth=1": ("absorption-slab*thickness=0.5*",),
    "depth-capped=3": ("stack*", "fresnel-slab*"),
    "mesh-leaks=0.02": ("polygon*", "prism*"),
    "fov-of-portrait=1": ("ball*",),
    "mirrored=1": ("ball-view*",),
}


@pytest.mark.parametrize("name", SOME)
def test_a_wrong_renderer_is_seen_and_its_fault_named(name: str, tmp_path: Path) -> None:
    (mutant,) = (m for m in MUTANTS if m.name == name)
    found = trial(mutant, cases(*SOME[name]), tmp_path)
    assert found.caught
    assert found.cause in mutant.causes, found.sentence


@pytest.mark.parametrize(
    ("name", "selection"),
    [("twisted=0.05", ("snell-immersed*", "ball-view*")), ("fresnel-squared=1", ("fresnel-*",))],
)
def test_a_fault_on_no_list_is_seen_and_not_named(
    name: str, selection: tuple[str, ...], tmp_path: Path
) -> None:
    (mutant,) = (m for m in UNLISTED if m.name == name)
    found = trial(mutant, cases(*selection), tmp_path)
    assert found.caught
    assert found.cause is None
    assert "none of the known causes fits" in found.sentence


def test_the_picture_shows_what_mixed_rays_at_a_rim_do_not(tmp_path: Path) -> None:
    """`RIM_LINES` of the document: rays that graze a ball meet its far side first."""
    wrong = outside_renderer(Mutant("far-root", 0.1, (None,)), tmp_path)
    chosen = [prepare(c) for c in find(["ball-checkerboard"], scenes_root(), "draft")]
    tracer = registry.create("tracer")
    summary = run(chosen, [wrong, tracer], tracer, tmp_path / "out", quality="draft")
    of_it = [c for case in summary.cases for c in case.checks if c.renderer == "mutant"]
    status = {c.observable: c.status for c in of_it}
    assert status["exit_point"] is Verdict.PASS
    assert status["max_difference"] is Verdict.FAIL
    off = next(c for c in of_it if c.observable == "max_difference")
    assert off.value is not None
    assert off.tolerance is not None
    assert off.value > 100 * off.tolerance
