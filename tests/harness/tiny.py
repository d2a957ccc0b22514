"""Runs of the tiny scenes in tests/data/scenes: a few dozen rays each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from harness.plan import PreparedCase, prepare
from harness.record import Check, Summary
from harness.renderers.base import Renderer
from harness.renderers.registry import create
from harness.report import write_report
from harness.run import run
from harness.scene.load import find
from tests.fakes.student import student

SCENES = Path(__file__).parents[1] / "data" / "scenes"


def prepared(*selection: str, root: Path = SCENES) -> list[PreparedCase]:
    """The selected tiny cases, all of them by default."""
    return [prepare(case) for case in find(selection, root)]


def run_tiny(
    out: Path, *renderers: Renderer, cases: Sequence[str] = (), helper: Renderer | None = None
) -> Summary:
    """A run of the selected tiny cases, with the student as helper."""
    return run(prepared(*cases), list(renderers), helper or student(name="helper"), out)


def report_of_dense_glass(out: Path, *cases: str) -> Path:
    """The report of tiny cases by the tracer and by a student whose glass is too dense.

    Returns `out`.
    """
    tracer = create("tracer")
    dense = ("mu = ior_i / ior_t", "mu = ior_i / (1.01 * ior_t)")
    run_tiny(out, tracer, student(dense), cases=cases, helper=tracer)
    write_report(out)
    return out


def passes_at(camera: Mapping[str, Any], x: Any, y: Any, width: int, height: int) -> Any:
    """How far from the world's origin the rays of pixels (x, y) of a perspective camera pass."""
    right, up, forward, origin = (np.array(camera[k]) for k in ("right", "up", "forward", "origin"))
    side = camera["tan_half_fov_x"] * (2 * (np.asarray(x) + 0.5) / width - 1)
    rise = camera["tan_half_fov_x"] * (1 - 2 * (np.asarray(y) + 0.5) / height) * height / width
    d = forward + np.multiply.outer(side, right) + np.multiply.outer(rise, up)
    return np.linalg.norm(np.cross(origin, d), axis=-1) / np.linalg.norm(d, axis=-1)


def checks_of(summary: Summary, renderer: str | None = None) -> list[Check]:
    """All checks, or those of one renderer."""
    return [
        check
        for case in summary.cases
        for check in case.checks
        if renderer is None or check.renderer == renderer
    ]
