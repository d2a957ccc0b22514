"""An outside renderer, broken by one fault at a time: what is seen by which class of images."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from harness import cli
from harness.expected import Float
from harness.probe.chart import srgb_decode, srgb_encode
from harness.record import Check, Verdict
from harness.renderers import registry
from harness.renderers.base import Capability
from harness.scene.resolved import ResolvedScene
from tests.fakes.student import CAPABILITIES, SOURCE, Fault, student, with_faults
from tests.harness.tiny import SCENES, checks_of, run_tiny

SQUARE = "    square = (ior_t - ior_i) * (ior_t + ior_i) / ior_t**2 + (mu * cos_i) ** 2\n"
COS_T = "    cos_t = np.sqrt(np.maximum(square, 0))\n"
RETURNED = "return unit(bent), np.where(square > 0, (r_s**2 + r_p**2) / 2, 1)"

# theta_t = 2/3 theta_i, as the lecture's table has it, and mu = sin theta_t / sin theta_i.
PRINTED_TABLE: Fault = (
    COS_T,
    "    cos_t = np.cos(2 / 3 * np.arccos(np.clip(cos_i, 0, 1)))\n"
    "    mu = np.sqrt((1 - cos_t**2) / np.maximum(1 - cos_i**2, 1e-30))\n",
)


# --- the lecture's printed table ------------------------------------------------------------------


def test_a_renderer_that_follows_the_lectures_table_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As an executable of somebody's own, on the command line."""
    monkeypatch.setattr(registry, "create", lambda name: student(name=name))
    monkeypatch.chdir(tmp_path)
    source = SOURCE.read_text(encoding="utf-8")
    Path("table.py").write_text(with_faults(source, PRINTED_TABLE), encoding="utf-8")
    Path("right.py").write_text(source, encoding="utf-8")
    commands = [
        part
        for name in ("table", "right")
        for part in ("--renderer-command", f"{sys.executable} {name}.py {{scene}} {{output.npy}}")
    ]
    result = CliRunner().invoke(
        cli.main,
        ["run", "snell", "-r", "tracer", "--scenes", str(SCENES), "--out", "out", *commands],
    )
    assert result.exit_code == 1, result.output
    (case,) = json.loads(Path("out/summary.json").read_text())["cases"]
    status = {check["renderer"]: check["status"] for check in case["checks"]}
    assert status == {"tracer": "pass", "table": "fail", "right": "pass"}
    check = next(check for check in case["checks"] if check["renderer"] == "table")
    # The last pixel looks 44.5 degrees and almost half of 86 more from the normal, and up or down
    # by a 32nd of the image, which adds a thousandth of that.
    theta = np.radians(44.5) + np.arctan(15 / 16 * np.tan(np.radians(43)))
    off = np.degrees(2 / 3 * theta - np.arcsin(np.sin(theta) / 1.5))
    assert check["detail"]["max"] == pytest.approx(off, abs=0.01)


# --- faults in an optical law ---------------------------------------------------------------------


def red(fault: Fault, *cases: str, folder: Path) -> set[str]:
    """The observables that are not green with `fault`; without it all must be."""
    clean = run_tiny(folder / "clean", student(), cases=cases)
    assert {c.status for c in checks_of(clean)} == {Verdict.PASS}
    summary = run_tiny(folder / "broken", student(fault), cases=cases)
    return {c.observable for c in checks_of(summary) if c.status is not Verdict.PASS}


EVERYTHING = {"internal_angle", "slab_offset", "exit_point", "exit_direction"}
LAWS: dict[str, tuple[Fault, tuple[str, ...], set[str]]] = {
    "eta is not squared": (
        (SQUARE, "    square = 1 - mu * (1 - cos_i**2)\n"),
        ("snell", "slab"),
        EVERYTHING,
    ),
    "mu is swapped": (
        ("    mu = ior_i / ior_t\n", "    mu = ior_t / ior_i\n"),
        ("snell", "slab"),
        EVERYTHING,
    ),
    "small angles: theta_t = theta_i / n": (
        (COS_T, "    cos_t = np.cos(np.arccos(np.clip(cos_i, 0, 1)) * ior_i / ior_t)\n"),
        ("snell", "slab"),
        EVERYTHING,
    ),
    "the ray goes straight on": (
        (RETURNED, RETURNED.replace("unit(bent)", "directions")),
        ("snell", "slab"),
        EVERYTHING,  # directions too: rays that are too steep inside never leave
    ),
    "Schlick in place of Fresnel": (
        (
            RETURNED,
            "r0 = ((ior_i - ior_t) / (ior_i + ior_t)) ** 2\n"
            "    return unit(bent), np.where(square > 0, r0 + (1 - r0) * (1 - cos_i) ** 5, 1)",
        ),
        ("fresnel", "snell"),
        {"reflectance", "transmittance"},
    ),
    "only one polarisation": (
        (RETURNED, RETURNED.replace("(r_s**2 + r_p**2) / 2", "r_s**2")),
        ("fresnel", "snell"),
        {"reflectance", "transmittance"},
    ),
    "no total internal reflection": (
        ("return unit(bent), np.where(square > 0,", "return unit(bent), np.where(square > -9,"),
        ("tir",),
        set(),  # r_s = r_p = 1 where cos_t = 0: the same light, by another way
    ),
    "total internal reflection leaks": (
        (COS_T, "    cos_t = np.sqrt(np.abs(square))\n    square = np.abs(square)\n"),
        ("tir",),
        {"tir", "critical_angle"},
    ),
    "the critical angle at theta_i = asin(1 / n^2)": (
        (RETURNED, RETURNED.replace("square > 0", "square > 0.5")),
        ("tir",),
        {"tir", "critical_angle"},
    ),
}


@pytest.mark.parametrize("name", LAWS)
def test_a_wrong_law_is_seen_where_it_acts(name: str, tmp_path: Path) -> None:
    fault, cases, wanted = LAWS[name]
    assert red(fault, *cases, folder=tmp_path) == wanted


# --- how fine: an index that is a little off ------------------------------------------------------


@dataclass(frozen=True)
class Class:
    """What a renderer's images and arithmetic are like."""

    shows: Callable[[Float], Float] = lambda pixels: pixels
    capabilities: frozenset[Capability] = CAPABILITIES


CLASSES = {
    "float64, float images": Class(),
    "float32, float images": Class(
        capabilities=CAPABILITIES - {Capability.DOUBLE, Capability.DOUBLE_DATA}
    ),
    "float64, 16 bits": Class(lambda p: np.round(p * 65535) / 65535),
    "float64, 8 bits sRGB": Class(lambda p: srgb_decode(np.round(srgb_encode(p) * 255) / 255)),
}

# The relative error of the index that a class must show, and the one that it cannot. Of the angle
# inside, d theta_t / dn = tan(theta_t) / n is 0.6 at most; a landing point one unit below moves by
# up to 1.1 of that, on a plane of 32 units. A float image tells it to 2 eps 32 / (0.9 * 4095) =
# 2e-9 units, 16 bits to 64 times as much, 8 bits (with 8 cells and 0.45% of error) to 0.04 units.
# Single precision itself moves it by about 1e-6.
SEEN = {
    "float64, float images": (1e-7, 1e-10),
    "float32, float images": (1e-4, 1e-8),
    "float64, 16 bits": (1e-6, 1e-8),
    "float64, 8 bits sRGB": (0.2, 1e-4),
}


def off_by(relative: float) -> Callable[[ResolvedScene], ResolvedScene]:
    def sees(scene: ResolvedScene) -> ResolvedScene:
        media = [
            m.model_copy(update={"ior": m.ior * (1 + relative)}) if k else m
            for k, m in enumerate(scene.media)
        ]
        return scene.model_copy(update={"media": tuple(media)})

    return sees


def snell(kind: Class, relative: float, folder: Path) -> Check:
    renderer = student(sees=off_by(relative), shows=kind.shows, capabilities=kind.capabilities)
    (check,) = checks_of(run_tiny(folder, renderer, cases=["snell"]))
    return check


@pytest.mark.parametrize("name", CLASSES)
def test_how_small_an_error_of_the_index_is_seen(name: str, tmp_path: Path) -> None:
    kind, (seen, unseen) = CLASSES[name], SEEN[name]
    assert snell(kind, 0.0, tmp_path / "right").status is Verdict.PASS
    assert snell(kind, seen, tmp_path / "seen").status is Verdict.FAIL
    assert snell(kind, -seen, tmp_path / "below").status is Verdict.FAIL
    assert snell(kind, unseen, tmp_path / "unseen").status is Verdict.PASS


@pytest.mark.parametrize(
    ("relative", "classes"),
    [
        (1e-4, {"float64, float images", "float32, float images", "float64, 16 bits"}),
        (1e-6, {"float64, float images", "float64, 16 bits"}),
    ],
)
def test_which_classes_see_an_index_off_by(
    relative: float, classes: set[str], tmp_path: Path
) -> None:
    found = {
        name
        for name, kind in CLASSES.items()
        if snell(kind, relative, tmp_path / name).status is Verdict.FAIL
    }
    assert found == classes


def test_the_reported_tolerance_is_about_what_decides(tmp_path: Path) -> None:
    """Just within it passes, twice beyond it fails: the tolerance is neither idle nor too tight."""
    kind = CLASSES["float64, float images"]
    right = snell(kind, 0.0, tmp_path / "right")
    assert right.tolerance is not None
    # d theta_t / dn * n in degrees, at the angle where the tolerance is of that size
    slope = np.degrees(np.tan(np.arcsin(1 / 1.5)))
    assert snell(kind, 0.1 * right.tolerance / slope, tmp_path / "in").status is Verdict.PASS
    assert snell(kind, 10 * right.tolerance / slope, tmp_path / "out").status is Verdict.FAIL
