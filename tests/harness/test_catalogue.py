"""Every scene of the suite: its truth passes its own checks, and a wrong index does not.

The "renderer" is the closed form itself, of the scene and of one with all indices a thousandth too
large: so nothing is rendered, and what a check sees or is blind to shows for every scene at once.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from harness.data import scenes_root
from harness.judging.judge import CaseJudge
from harness.judging.results import Contender, Result, Results
from harness.measure.observables import (
    ALL_LIGHT_OBSERVABLES,
    IMAGE_OBSERVABLES,
    LIGHT_OBSERVABLES,
    TRUTH_OBSERVABLES,
    Observable,
)
from harness.measure.statistics import SUITE_CHECKS
from harness.measure.truths import QUANTITIES, TRUTHS, Quantity, page
from harness.plan import Form, PreparedCase, light_role, prepare, trace_role
from harness.preflight import FLOAT32, FLOAT64, Preflight
from harness.record import Check, Verdict
from harness.renderers import registry
from harness.renderers.base import Capability, Image, RayPaths, Status
from harness.renderers.mitsuba import StockEngine
from harness.renderers.needs import needs
from harness.renderers.povray import PovRayRenderer, StockPovRayRenderer
from harness.report.mathml import typeset
from harness.scene import model
from harness.scene.load import LoadedCase, load_cases, scene_files
from harness.scene.resolve import expand_thin_slabs
from harness.scene.resolved import ResolvedScene
from harness.truth.camera import primary_rays
from harness.truth.paths import ClosedForm
from harness.truth.tree import light_on

TRUTH = Contender(
    "truth", "1", frozenset({Capability.RAYS, Capability.DOUBLE, Capability.DOUBLE_DATA}),
    Preflight(FLOAT32, 4095, 0.0, FLOAT64, None),
)  # fmt: skip
# Directions behind faces that are parallel, or are when unfolded, do not depend on the index, nor
# does a prism's reversibility; a total reflection is total.
BLIND = {Observable.FOLDED_DIRECTION, Observable.REVERSIBILITY}
PLATES = (
    "slab",
    "findings-hit-floor",
    "stack",
    "thin-face",
    "immersed-slab",
    "tir-prism",
    "retroreflector",
    "light-pipe",
)
# What the renderers claim of which a scene documents anything.
CLAIMED = {
    "mitsuba": StockEngine.capabilities,
    "povray": PovRayRenderer.capabilities,
    "povray-stock": StockPovRayRenderer.capabilities,
}


@cache
def first_cases() -> dict[str, LoadedCase]:
    """The first permutation of every scene file."""
    return {case.case: case for path in scene_files(scenes_root()) for case in load_cases(path)[:1]}


def measured_by_truth(case: PreparedCase, change: float) -> dict[tuple[str, str], Result]:
    """What the closed form of the case shows when all indices are off by `change`, relatively."""
    results: dict[tuple[str, str], Result] = {}
    for form in case.forms:
        scene = _changed(expand_thin_slabs(form.scene), change)
        for probe in case.loaded.model.probes:
            role = trace_role if probe.measure == "position" else light_role
            results["truth", role(probe, form.name)] = _result(scene, probe, form)
    return results


def _changed(scene: ResolvedScene, change: float) -> ResolvedScene:
    media = [m.model_copy(update={"ior": m.ior * (1 + change)}) for m in scene.media[1:]]
    return scene.model_copy(update={"media": (scene.media[0], *media)})


def _result(scene: ResolvedScene, probe: model.Probe, form: Form) -> Result:
    exact, rays = ClosedForm(scene), primary_rays(scene)
    plane = form.planes[probe.name][0]
    if probe.measure != "position":
        depth = len(probe.path) + 1 if probe.measure == "light" else scene.transport.max_depth
        least = 0.0 if probe.measure == "light" else scene.transport.min_weight
        level = light_on(exact, rays, plane, depth, least).level
        return Image(level.reshape(scene.film.height, scene.film.width, 3).astype(np.float32))
    paths = exact.follow(rays, probe.path)
    landing = exact.land(paths, plane)
    stations = np.concatenate(
        [rays.origins[:, None], paths.interface, landing.point[:, None]], axis=1
    )
    way = np.linalg.norm(np.diff(stations, axis=1), axis=2)
    first = scene.media[scene.camera.medium].ior
    ior = first / np.cumprod(np.insert(paths.eta_i_over_t, 0, 1.0, axis=1), axis=1)
    status = landing.status.copy()
    surface = np.where(status == Status.HIT, 0, -1).astype(np.int32)
    return RayPaths(
        status, surface, landing.point, paths.direction, paths.weight, (ior * way).sum(axis=1)
    )


def verdicts(case: PreparedCase, change: float) -> list[Check]:
    film = case.scene.film
    checks = [
        c.model_copy(update={"known": ()})
        for c in case.loaded.model.checks
        if Observable(c.observable) not in IMAGE_OBSERVABLES | {Observable.RAY_AGREEMENT}
    ]
    loaded = case.loaded
    slim = loaded.model.model_copy(update={"checks": tuple(checks)})
    again = PreparedCase(
        LoadedCase(loaded.id, loaded.case, loaded.file, loaded.parameters, slim), case.scene,
        case.variants,
    )  # fmt: skip
    results = Results(measured_by_truth(case, change), film.width, film.height)
    return CaseJudge(again, [TRUTH], results, "truth").judge().checks


@pytest.mark.parametrize("name", list(first_cases()))
def test_the_truth_passes_and_a_wrong_index_does_not(name: str) -> None:
    case = prepare(first_cases()[name])
    right = verdicts(case, 0.0)
    assert {c.status for c in right} <= {Verdict.PASS}, [
        (c.id, c.reason) for c in right if c.status is not Verdict.PASS
    ]
    # Each says how sensitive it is to the indices.
    assert all(_conditions(c) for c in right), [c.id for c in right if not _conditions(c)]
    for check in verdicts(case, 1e-3):
        blind = Observable(check.observable) in BLIND or check.against == "variant"
        plate = name.startswith(PLATES) and check.observable == Observable.EXIT_DIRECTION
        if not blind and not plate:
            assert check.status in (Verdict.FAIL, Verdict.ERROR), (check.id, check.value)


def _conditions(check: Check) -> list[float]:
    """Those that the check tells, all of which must be numbers."""
    told = [v for k, v in check.detail.items() if k.startswith("condition_")]
    return [v for v in told if isinstance(v, float) and np.isfinite(v) and v >= 0]


@pytest.mark.parametrize("name", list(first_cases()))
def test_every_case_names_its_truth_and_its_sources(name: str) -> None:
    """A closed form with derivation and domain, or an oracle: another renderer by its name.

    The record tells that renderer's version. A picture of colours has no other truth.
    """
    case = first_cases()[name].model
    assert typeset(case.formula) is not None
    assert all(source.strip() for source in case.sources)
    assert case.checks
    for check in case.checks:
        if check.against == "truth":
            truth = TRUTHS[Observable(check.observable)]
            assert all((truth.form, truth.derived, truth.domain, truth.condition))
        else:
            assert Observable(check.observable) not in TRUTHS
            assert check.against == "renderers" or check.against in registry.available()


@pytest.mark.parametrize("name", list(first_cases()))
def test_what_is_documented_of_a_renderer_it_can_be_asked_for(name: str) -> None:
    """Or nobody has ever measured it, and it would excuse what comes one day."""
    case = prepare(first_cases()[name])
    for known in (known for check in case.loaded.model.checks for known in check.known):
        claimed = CLAIMED[known.renderer]
        scenes = (expand_thin_slabs(form.scene) for form in case.forms)
        assert any(needs(scene) <= claimed for scene in scenes), known


@pytest.mark.parametrize("quantity", QUANTITIES, ids=lambda q: q.name)
def test_every_quantity_is_asked_for_where_the_page_says(quantity: Quantity) -> None:
    assert quantity.scenes
    for name in quantity.scenes:
        asked = {check.observable for check in first_cases()[name].model.checks}
        assert quantity.observable in asked


def test_no_observable_of_the_truth_is_left_out_of_the_quantities() -> None:
    """But for what all scenes ask for, or a renderer's two ways of telling the same."""
    everywhere = {
        Observable.EXIT_DIRECTION, Observable.VARIANT_AGREEMENT, Observable.RAY_AGREEMENT
    }  # fmt: skip
    assert {q.observable for q in QUANTITIES} == TRUTH_OBSERVABLES - everywhere


def test_the_page_of_truths_is_made_of_them() -> None:
    """Of every observable that has a truth. Write it with `print(truths.page(), end="")`."""
    assert set(TRUTHS) == TRUTH_OBSERVABLES
    document = scenes_root().parent / "docs" / "truths.md"
    assert document.read_text(encoding="utf-8") == page()


def test_the_catalogue_is_as_large_as_it_says() -> None:
    cases = [case for path in scene_files(scenes_root()) for case in load_cases(path)]
    assert len(cases) >= 80
    assert len({case.model.family for case in cases}) >= 18
    assert len(scene_files(scenes_root())) >= 40


def test_the_level_of_a_suite_is_that_of_the_whole_catalogue() -> None:
    """It allows for so many sampled checks; any of light or of a picture may be one."""
    sampled = IMAGE_OBSERVABLES | LIGHT_OBSERVABLES | ALL_LIGHT_OBSERVABLES
    cases = [case for path in scene_files(scenes_root()) for case in load_cases(path)]
    checks = [check for case in cases for check in case.model.checks]
    assert 0 < sum(Observable(check.observable) in sampled for check in checks) <= SUITE_CHECKS
