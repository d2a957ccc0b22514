"""The tracer, broken in its source by one fault at a time: the suite must turn red.

The faulty copy is put before the real package and run by the command line itself, with interpreted
kernels, because a few dozen rays are not worth compiling for.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import tracer
from tests.fakes.student import Fault, with_faults
from tests.harness.tiny import SCENES

ROOT = Path(__file__).parents[2]
CASES = ("fresnel", "slab", "snell", "thin-face", "tir")
# The checks of all these cases by case, so that what a fault leaves alone is known, too.
CHECKS = {
    "fresnel-outside": {"reflectance", "transmittance"},
    "slab-offset[thickness=0.25]": {"slab_offset", "exit_direction", "exit_point"},
    "slab-offset[thickness=1]": {"slab_offset", "exit_direction", "exit_point"},
    "snell-sweep": {"internal_angle"},
    "thin-face-offset": {"slab_offset"},
    "tir-critical": {"tir", "critical_angle"},
}


@dataclass(frozen=True)
class Mutant:
    """One fault in one file of the tracer, and the cases that must turn red and that must not.

    Red is FAIL, or ERROR where no ray is left to be measured.
    """

    name: str
    file: str
    fault: Fault
    red: frozenset[str]
    green: frozenset[str] = frozenset()

    def __str__(self) -> str:
        return self.name


SLABS = frozenset({"slab-offset[thickness=0.25]", "slab-offset[thickness=1]"})
EVERY_REFRACTION = frozenset({"snell-sweep", "thin-face-offset"}) | SLABS

MUTANTS = (
    Mutant(
        "mu is swapped",
        "optics.py",
        (
            "    b = mu * cos_theta_i - cos_theta_t\n",
            "    mu = 1.0 / mu\n    b = mu * cos_theta_i - cos_theta_t\n",
        ),
        EVERY_REFRACTION,
        green=frozenset({"fresnel-outside"}),
    ),
    Mutant(
        # T is still of unit length then: an erratum of the lecture.
        "W is taken as the travel direction",
        "optics.py",
        ("b * n[0] - mu * wi[0], b * n[1] - mu * wi[1], b * n[2] - mu * wi[2]",
         "b * n[0] + mu * wi[0], b * n[1] + mu * wi[1], b * n[2] + mu * wi[2]"),
        EVERY_REFRACTION | {"tir-critical", "fresnel-outside"},
    ),
    Mutant(
        "the thin face's offset is dropped",
        "surface.py",
        ("along(along(p, -back, d), inside, wt), inside, back", "p, inside, back"),
        frozenset({"thin-face-offset"}),
        green=frozenset({"snell-sweep", "fresnel-outside", "tir-critical"}) | SLABS,
    ),
    Mutant(
        "the normal is flipped",
        "hit.py",
        ("side = 1.0 if entering else -1.0", "side = -1.0 if entering else 1.0"),
        EVERY_REFRACTION | {"tir-critical", "fresnel-outside"},
    ),
    Mutant(
        "total internal reflection is clamped away",
        "optics.py",
        ("    return q >= 0.0, math.sqrt(max(q, 0.0))", "    return True, math.sqrt(max(q, 0.0))"),
        frozenset({"tir-critical"}),
        green=frozenset({"snell-sweep", "fresnel-outside", "thin-face-offset"}) | SLABS,
    ),
    Mutant(
        "4% are reflected at every angle",
        "optics.py",
        ("    return 0.5 * (\n        fresnel_s(", "    return 0.04 + 0.0 * (\n        fresnel_s("),
        frozenset({"fresnel-outside"}),
        green=frozenset({"snell-sweep", "thin-face-offset"}) | SLABS,
    ),
    Mutant(
        "the index is off by 1e-9",
        "surface.py",
        ("    cos_theta_i = max(0.0, dot(wi, n))\n",
         "    cos_theta_i = max(0.0, dot(wi, n))\n    ior_t = ior_t * (1.0 + 1e-9)\n"),
        EVERY_REFRACTION,
        green=frozenset({"fresnel-outside"}),
    ),
)  # fmt: skip


def run(folder: Path, mutant: Mutant | None) -> tuple[int, dict[str, Any]]:
    """The exit code and the summary of a run with a copy of the tracer."""
    copy = folder / "packages" / "tracer"
    source = Path(tracer.__file__).parent
    shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
    marked = copy / "__init__.py"
    version = f'__version__ = "{tracer.__version__}"'
    marked.write_text(
        with_faults(marked.read_text(), (version, '__version__ = "copy"')), encoding="utf-8"
    )
    if mutant is not None:
        file = copy / mutant.file
        file.write_text(with_faults(file.read_text(), mutant.fault), encoding="utf-8")
    places = [str(copy.parent), str(ROOT)]
    done = subprocess.run(
        [sys.executable, "-c", "from harness.cli import main; main()",
         "run", *CASES, "-r", "tracer", "--scenes", str(SCENES), "--out", str(folder / "out"),
         "--jobs", "1"],
        cwd=folder, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(places), "NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    assert "Traceback" not in done.stderr, done.stderr
    summary = json.loads((folder / "out" / "summary.json").read_text())
    # Otherwise it was another tracer that ran.
    assert summary["renderers"]["tracer"]["version"] == "copy"
    return done.returncode, summary


def by_case(summary: dict[str, Any]) -> dict[str, str]:
    return {case["id"]: case["status"] for case in summary["cases"]}


def test_an_unbroken_copy_is_green(tmp_path: Path) -> None:
    code, summary = run(tmp_path, None)
    assert code == 0
    assert {c["id"]: {k["observable"] for k in c["checks"]} for c in summary["cases"]} == CHECKS
    assert set(by_case(summary).values()) == {"pass"}


@pytest.mark.parametrize("mutant", MUTANTS, ids=str)
def test_a_broken_tracer_turns_the_suite_red(mutant: Mutant, tmp_path: Path) -> None:
    code, summary = run(tmp_path, mutant)
    assert code == 1
    status = by_case(summary)
    assert {case for case in mutant.red if status[case] not in ("fail", "error")} == set()
    # What the fault does not touch stays green: the suite says where it is.
    assert {case for case in mutant.green if status[case] != "pass"} == set()
