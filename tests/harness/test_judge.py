"""The judge gives every check of every renderer a verdict, whatever came back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harness import plan
from harness.errors import RendererFailed, RendererMissing, RendererUnsupported
from harness.judging.judge import CaseJudge, Judgement
from harness.judging.results import Contender, Result, Results
from harness.measure.observables import (
    IMPLIED_OBSERVABLES,
    RAY_API_OBSERVABLES,
    Observable,
)
from harness.plan import PreparedCase, prepare
from harness.record import Verdict
from harness.renderers.base import Capability, RenderSettings
from harness.running.lanes import calibrate, perform
from harness.scene.load import load_cases
from harness.scene.model import CheckSpec
from tests.fakes import FakeRenderer
from tests.fakes.student import CAPABILITIES, student
from tests.harness.tiny import SCENES, prepared

SETTINGS = RenderSettings()
SNELL = prepared("snell")[0]
Roles = dict[tuple[str, str], Result]


def delivered(case: PreparedCase, renderer: FakeRenderer) -> tuple[Contender, Roles]:
    """The renderer as the judge sees it, and all that it renders for `case`."""
    contender = calibrate(renderer, SETTINGS)
    assert contender.preflight is not None
    jobs = plan.jobs_of(
        case, renderer.name, contender.capabilities, contender.preflight, SETTINGS
    )  # fmt: skip
    return contender, {(renderer.name, job.role): perform(renderer, job) for job in jobs}


def judged(case: PreparedCase, contenders: list[Contender], by_role: Roles) -> Judgement:
    film = case.scene.film
    return CaseJudge(case, contenders, Results(by_role, film.width, film.height), "helper").judge()


def absent(status: Verdict, name: str = "absent") -> Contender:
    return Contender(name, "", frozenset(), None, status, "not installed")


def test_without_results_nothing_passes() -> None:
    contender = calibrate(student(), SETTINGS)
    for case in prepared():
        judgement = judged(case, [contender], {})
        assert len(judgement.checks) == len(case.loaded.model.checks)
        assert {c.status for c in judgement.checks} == {Verdict.ERROR}
        assert "was not rendered by student" in judgement.checks[0].reason
        assert judgement.curves == []


@pytest.mark.parametrize("status", [Verdict.SKIP, Verdict.ERROR])
def test_an_absent_renderer_has_a_verdict_in_every_check(status: Verdict) -> None:
    for case in prepared():
        judgement = judged(case, [absent(status)], {})
        assert [c.observable for c in judgement.checks] == [
            spec.observable for spec in case.loaded.model.checks
        ]
        assert {(c.status, c.reason) for c in judgement.checks} == {(status, "not installed")}


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (RendererFailed("it crashed"), Verdict.ERROR),
        (RendererUnsupported("no glass here"), Verdict.SKIP),
        (RendererMissing("gone since"), Verdict.SKIP),
    ],
)
def test_a_result_that_is_an_error_becomes_the_verdict(error: Exception, status: Verdict) -> None:
    contender, roles = delivered(SNELL, student())
    broken = dict.fromkeys(roles, error)
    (check,) = judged(SNELL, [contender], broken).checks  # type: ignore[arg-type]
    assert (check.status, check.reason) == (status, str(error))


def test_one_missing_image_of_a_probe_is_enough() -> None:
    contender, roles = delivered(SNELL, student())
    assert judged(SNELL, [contender], roles).checks[0].status is Verdict.PASS
    for lost in [key for key in roles if "plane" in key[1]]:
        rest = {key: result for key, result in roles.items() if key != lost}
        assert judged(SNELL, [contender], rest).checks[0].status is Verdict.ERROR


def test_checks_come_in_the_order_of_the_scene_and_of_the_renderers() -> None:
    (case,) = prepared("slab-offset[thickness=1]")
    contenders = [absent(Verdict.SKIP, name) for name in ("b", "a")]
    assert [(c.observable, c.renderer) for c in judged(case, contenders, {}).checks] == [
        (observable, name)
        for observable in ("slab_offset", "exit_direction", "exit_point")
        for name in ("b", "a")
    ]


def test_a_check_for_some_renderers_leaves_the_others_alone() -> None:
    model = SNELL.loaded.model.model_copy(
        update={
            "checks": (
                CheckSpec(observable="internal_angle", probe="inside", renderers=("a", "c")),
            )
        }
    )
    case = PreparedCase(replace(SNELL.loaded, model=model), SNELL.scene)
    contenders = [absent(Verdict.SKIP, name) for name in "abc"]
    assert [c.renderer for c in judged(case, contenders, {}).checks] == ["a", "c"]


# --- curves ---------------------------------------------------------------------------------------


def test_a_chart_has_its_truth_once_and_a_line_per_renderer() -> None:
    first, roles = delivered(SNELL, student(name="a"))
    second, more = delivered(
        SNELL, student(("mu = ior_i / ior_t", "mu = ior_t / ior_i"), name="b")
    )  # fmt: skip
    judgement = judged(SNELL, [first, absent(Verdict.SKIP), second], roles | more)
    assert [c.status for c in judgement.checks] == [Verdict.PASS, Verdict.SKIP, Verdict.FAIL]
    (curve,) = judgement.curves
    assert curve.id == "internal_angle-inside"
    assert [s.renderer for s in curve.series] == ["truth", "a", "b"]
    assert [s.renderer for s in curve.residuals] == ["a", "b"]
    assert len(curve.tolerance) == len(curve.residuals[0].x)
    right, wrong = (np.abs(s.y) for s in curve.residuals)
    assert (right <= curve.tolerance).all()
    assert wrong.max() > 10  # degrees


def test_the_band_is_the_widest_of_the_renderers() -> None:
    exact, roles = delivered(SNELL, student(name="a"))
    coarse, more = delivered(
        SNELL, student(name="b", shows=lambda p: np.round(p * 65535) / 65535)
    )  # fmt: skip
    (curve,) = judged(SNELL, [exact, coarse], roles | more).curves
    (alone,) = judged(SNELL, [exact], roles).curves
    assert (np.array(curve.tolerance) > 10 * np.array(alone.tolerance)).all()


# --- what has no truth ----------------------------------------------------------------------------


def test_a_scene_without_closed_form_is_an_error_and_says_so(tmp_path: Path) -> None:
    text = (SCENES / "snell" / "sweep.toml").read_text()
    old = 'shape = { type = "slab", thickness = 3, size = [80, 80] }'
    assert old in text
    smooth = (
        'shape = { type = "icosphere", center = [0, 0, -9], radius = 9, subdivisions = 2, '
        "smooth = true }"
    )
    file = tmp_path / "smooth.toml"
    file.write_text(text.replace(old, smooth))
    case = prepare(load_cases(file)[0])
    contender = Contender(
        "fake", "1", CAPABILITIES | {Capability.MESH, Capability.SMOOTH_MESH},
        calibrate(student(), SETTINGS).preflight,
    )  # fmt: skip
    (check,) = judged(case, [contender], {}).checks
    assert check.status is Verdict.ERROR
    assert "no closed form" in check.reason


def test_every_observable_has_a_way_to_be_judged() -> None:
    """A scene that asks for any of them gets a verdict and no surprise."""
    contender = calibrate(student(), SETTINGS)
    model = SNELL.loaded.model
    for observable in set(Observable) - RAY_API_OBSERVABLES - IMPLIED_OBSERVABLES:
        spec = CheckSpec(observable=observable.value, probe="inside")
        case = PreparedCase(
            replace(SNELL.loaded, model=model.model_copy(update={"checks": (spec,)})), SNELL.scene
        )
        (check,) = judged(case, [contender], {}).checks
        assert check.status is Verdict.ERROR
        assert check.reason
