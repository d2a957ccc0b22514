"""An independent renderer with a known fault is told which fault it has, and how large it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harness.data import scenes_root
from harness.diagnosis.choose import diagnose
from harness.diagnosis.evidence import Evidence, Landings, Levels, Setting
from harness.diagnosis.hypothesis import plus_minus
from harness.diagnosis.library import BY_ID, LIBRARY
from harness.diagnosis.whole_run import Witness, diagnose_run
from harness.diagnosis.worlds import World, misfit
from harness.plan import prepare
from harness.record import Diagnosis, Summary
from harness.renderers.base import Rays, Status
from harness.scene.load import find
from harness.scene.resolve import expand_thin_slabs
from harness.truth.camera import primary_rays
from harness.truth.paths import ClosedForm
from tests.fakes.student import Fault, student
from tests.harness.tiny import SCENES, run_tiny
from tests.mutants.test_outside_mutants import LAWS, PRINTED_TABLE, off_by


def only(summary: Summary) -> Diagnosis:
    (found,) = summary.diagnoses
    return found


def broken(folder: Path, *faults: Fault, cases: Sequence[str]) -> Diagnosis:
    return only(run_tiny(folder, student(*faults), cases=cases))


# --- an outside renderer --------------------------------------------------------------------------


def test_a_right_renderer_gets_no_diagnosis(tmp_path: Path) -> None:
    summary = run_tiny(tmp_path, student())
    assert summary.diagnoses == []
    assert all(case.diagnoses == [] for case in summary.cases)


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("eta is not squared", "unsquared"),
        ("the ray goes straight on", "straight-on-but-total"),
        ("Schlick in place of Fresnel", "schlick"),
        ("only one polarisation", "polarisation"),
    ],
)
def test_a_wrong_law_is_named(name: str, cause: str, tmp_path: Path) -> None:
    fault, cases, _ = LAWS[name]
    found = broken(tmp_path, fault, cases=cases)
    assert found.cause is not None
    assert found.cause.id == cause
    assert found.cause.residual < 1
    assert found.unexplained == []
    assert found.sentence.startswith("student ")


def test_the_lectures_table_is_named(tmp_path: Path) -> None:
    found = broken(tmp_path, PRINTED_TABLE, cases=("snell", "slab"))
    assert found.cause is not None
    assert found.cause.id == "table-but-total"


@pytest.mark.parametrize("relative", [1e-6, -0.01, 0.2])
def test_a_wrong_index_is_measured(relative: float, tmp_path: Path) -> None:
    found = only(run_tiny(tmp_path, student(sees=off_by(relative))))
    cause = found.cause
    assert cause is not None
    assert cause.id == "index"
    assert cause.value is not None
    assert cause.uncertainty is not None
    assert abs(cause.value - relative) <= cause.uncertainty
    assert cause.uncertainty < 1e-6
    assert "refracts as if n = 1." in found.sentence
    assert "the scene says 1.5" in found.sentence


def test_a_fault_that_nobody_thought_of_is_said_to_be_none_of_the_known(tmp_path: Path) -> None:
    fault, cases, _ = LAWS["small angles: theta_t = theta_i / n"]
    found = broken(tmp_path, fault, cases=cases)
    assert found.cause is None
    assert "none of the known causes fits" in found.sentence
    assert set(found.unexplained) == {"snell-sweep", "slab-offset[thickness=0.25]",
                                      "slab-offset[thickness=1]"}  # fmt: skip


def test_summary_and_records_survive_being_written(tmp_path: Path) -> None:
    from harness.record import read_case, read_summary

    summary = run_tiny(tmp_path, student(sees=off_by(0.01)), cases=["snell"])
    assert read_summary(tmp_path / "summary.json") == summary
    (file,) = (tmp_path / "records").iterdir()
    assert read_case(file).diagnoses == summary.cases[0].diagnoses


# --- every hypothesis knows itself ----------------------------------------------------------------


def setting(case: str, probe: int = 0, scenes: Path = SCENES, count: int = 96) -> Setting:
    prepared = prepare(find([case], scenes)[0])
    chosen = prepared.loaded.model.probes[probe]
    scene = expand_thin_slabs(prepared.scene)
    rays = primary_rays(scene)
    rows = np.linspace(0, len(rays.origins) - 1, count).astype(int)
    form = ClosedForm(scene)
    some = Rays(rays.origins[rows], rays.directions[rows])
    paths = form.follow(some, chosen.path)
    on = [form.land(paths, plane) for plane in prepared.planes(chosen)]
    lands = np.all([landing.status == Status.HIT for landing in on], axis=0)
    rows = rows[lands | (paths.status == Status.TIR)]
    return Setting(
        scene, Rays(rays.origins[rows], rays.directions[rows]), rows, chosen.path,
        prepared.planes(chosen), thin=case == "thin-face",
    )  # fmt: skip


def form_of(world: World) -> ClosedForm:
    return ClosedForm(world.scene, world.law)


def shown_by(world: World, light: bool, noise: np.random.Generator) -> Evidence:
    """What a renderer of that world shows, with errors spread over the tolerances."""
    asked = world.setting
    form = form_of(world)
    paths = world.finish(world.rays, form.follow(world.rays, asked.path))
    on = [form.land(paths, plane) for plane in asked.planes]
    lands = np.all([landing.status == Status.HIT for landing in on], axis=0)
    size = (len(lands), 3)
    if light:
        level = np.where(lands[:, None], paths.weight[:, None] * on[0].transmission, 0.0)
        off = noise.uniform(-1, 1, size) * 1e-6
        return Levels(asked, world.shown(level) + off, np.full(size, 1e-6))
    point = on[0].point + noise.uniform(-0.5, 0.5, size) * 1e-7
    direction = paths.direction if len(asked.planes) == 2 else None
    one = np.full(len(lands), 1e-7)
    return Landings(asked, point, direction, lands, one, one)


SAID = {
    "index": ("snell", 0, (-0.01,)),
    "straight-on": ("snell", 0, ()),
    "offset": ("thin-face", 0, (1.5,)),
    "spawn-normal": ("slab-offset*0.25*", 0, (2e-4,)),
    "exit-straight": ("slab-offset*0.25*", 0, ()),
    "pixel-shift": ("snell", 0, (0.5, 0.5)),
    "polarisation": ("fresnel", 0, (0.7,)),
    "constant-reflectance": ("fresnel", 0, (0.04,)),
    "gain": ("fresnel", 1, (1.1,)),
}


@pytest.mark.parametrize("name", SAID)
def test_what_a_hypothesis_shows_is_taken_for_it_with_its_parameter(name: str) -> None:
    case, probe, values = SAID[name]
    asked = setting(case, probe)
    world = BY_ID[name].world(World.right(asked), values)
    light = prepare(find([case], SCENES)[0]).loaded.model.probes[probe].measure == "light"
    found = diagnose("it", [shown_by(world, light, np.random.default_rng(7))])
    assert found is not None
    assert found.cause is not None
    named = {found.cause.id, found.runner_up.id if found.runner_up else ""}
    assert name in named, found.sentence
    if name == found.cause.id and values:
        assert found.cause.value is not None
        assert found.cause.uncertainty is not None
        assert abs(found.cause.value - values[0]) <= 1.5 * found.cause.uncertainty


def test_uncertainties_cover_the_true_parameter() -> None:
    """Two standard errors: of 60 trials at least 50 (with 95% each, fewer in 1 of 1,000 tests)."""
    asked = setting("snell")
    world = BY_ID["index"].world(World.right(asked), (-0.01,))
    noise, covered = np.random.default_rng(11), 0
    from harness.diagnosis.fit import fit

    for _ in range(60):
        found = fit(BY_ID["index"], [shown_by(world, False, noise)])
        assert found is not None
        covered += abs(found.values[0] + 0.01) <= found.errors[0]
    assert covered >= 50


def test_ids_are_unique() -> None:
    assert len(BY_ID) == len(LIBRARY) >= 40


# --- a run ----------------------------------------------------------------------------------------


def test_a_case_without_deviation_speaks_against_a_cause() -> None:
    """No refraction on the way in, and none at all, look the same until a ray leaves the glass."""
    snell, slab = setting("snell"), setting("slab-offset*0.25*")
    noise = np.random.default_rng(3)
    straight = BY_ID["straight-on"].world(World.right(snell), ())
    diagnosed = diagnose("it", [shown_by(straight, False, noise)])
    assert diagnosed is not None
    (alone,) = diagnose_run("it", {"face": diagnosed}, [])
    assert alone.cause is not None
    assert alone.cause.id == "straight-on-but-total"  # on the way in the same
    right = Witness("slab", (shown_by(World.right(slab), False, noise),))
    (doubted,) = diagnose_run("it", {"face": diagnosed}, [right])
    assert doubted.cause is None
    assert doubted.runner_up is not None
    assert doubted.runner_up.id == "straight-on-but-total"
    assert "would explain 1 of 1, but slab, where it would show, is right" in doubted.sentence


@pytest.mark.parametrize("name", ["index", "index-of-solids"])
def test_water_in_water_tells_whether_surroundings_are_as_wrong_as_solids(name: str) -> None:
    """Every index too small leaves their ratio, and that of solids alone does not."""
    noise = np.random.default_rng(8)
    asked = {"snell": setting("snell"), "water": setting("identity*1.333*", scenes=scenes_root())}
    shown = {
        case: shown_by(BY_ID[name].world(World.right(one), (-0.01,)), False, noise)
        for case, one in asked.items()
    }
    by_case = {case: diagnose("it", [evidence]) for case, evidence in shown.items()}
    known = {case: d for case, d in by_case.items() if d is not None}
    assert ("water" in known) is (name == "index-of-solids")
    right = [Witness(case, (shown[case],)) for case in shown if case not in known]
    (found,) = diagnose_run("it", known, right)
    assert found.cause is not None
    assert found.cause.id == name
    assert found.unexplained == []


def test_rays_that_do_not_get_in_are_expected_where_they_are_reflected_to() -> None:
    """A ball that should not be there, but is a little thinner than air, reflects at its rim."""
    asked = setting("identity*=1]", scenes=scenes_root(), count=64**2)
    wrong = BY_ID["index"].world(World.right(asked), (-0.01,))
    right = form_of(wrong).follow(wrong.rays, asked.path)
    back = form_of(wrong).follow(wrong.rays, "R")
    rim = right.status == Status.TIR
    assert rim.sum() > 3
    shown = shown_by(wrong, False, np.random.default_rng(9))
    assert isinstance(shown, Landings)
    on = [form_of(wrong).land(back, plane) for plane in asked.planes]
    there = np.all([landing.status == Status.HIT for landing in on], axis=0) & rim
    assert there.any()
    point = np.where(there[:, None], on[0].point, shown.point)
    direction = np.where(there[:, None], back.direction, shown.direction)
    seen = replace(shown, point=point, direction=direction, seen=shown.seen | there)
    found = diagnose("it", [seen])
    assert found is not None
    assert found.cause is not None
    assert found.cause.id == "index"
    assert found.cause.value == pytest.approx(-0.01, abs=1e-7)
    assert abs(misfit(wrong, seen)).max() < 1


@pytest.mark.parametrize("dark", [False, True])
def test_a_wrong_direction_is_named_whether_or_not_its_rays_have_light(dark: bool) -> None:
    """Some renderers weigh light by the angles that they have wrong, some by the right ones."""
    asked = setting("slab-offset*0.25*")
    wrong = BY_ID["ratio-inverted"].world(World.right(asked), ())
    weight = form_of(wrong).follow(wrong.rays, asked.path).weight
    shown = shown_by(wrong, False, np.random.default_rng(10))
    assert isinstance(shown, Landings)
    assert (shown.seen & (weight == 0)).sum() > len(weight) / 10
    seen = shown.seen & (weight > 0) if dark else shown.seen
    found = diagnose("it", [replace(shown, seen=seen)])
    assert found is not None
    assert found.cause is not None
    assert found.cause.id == "ratio-inverted"


def test_two_faults_are_two_diagnoses() -> None:
    noise = np.random.default_rng(5)
    slab, light = setting("slab-offset*0.25*"), setting("fresnel")
    off = BY_ID["exit-straight"].world(World.right(slab), ())
    pale = BY_ID["polarisation"].world(World.right(light), (1.0,))
    by_case = {
        "slab": diagnose("it", [shown_by(off, False, noise)]),
        "light": diagnose("it", [shown_by(pale, True, noise)]),
    }
    known = {case: d for case, d in by_case.items() if d is not None}
    found = diagnose_run("it", known, [])
    assert {d.cause.id for d in found if d.cause} == {"exit-straight", "polarisation"}
    assert {tuple(d.cases) for d in found} == {("slab",), ("light",)}


def test_an_uncertainty_that_no_ray_tells_is_not_told() -> None:
    noise = np.random.default_rng(7)
    world = BY_ID["index"].world(World.right(setting("snell")), (-0.01,))
    known = diagnose("it", [shown_by(world, False, noise)])
    assert known is not None
    fits = [f.model_copy(update={"information": 0.0}) for f in known.fits]
    (found,) = diagnose_run("it", {"snell": known.model_copy(update={"fits": fits})}, [])
    assert found.cause is not None
    assert found.cause.uncertainty is None
    assert "±" not in found.sentence


def test_a_case_that_knows_another_size_sharply_does_not_spoil_the_common_one() -> None:
    noise = np.random.default_rng(6)
    sizes = {"snell": -0.01, "slab-offset*0.25*": -0.01, "slab-offset*=1*": 0.02}
    by_case = {}
    for case, size in sizes.items():
        asked = setting(case)
        wrong = BY_ID["index"].world(World.right(asked), (size,))
        by_case[case] = diagnose("it", [shown_by(wrong, False, noise)])
    known = {case: d for case, d in by_case.items() if d is not None}
    (sharp,) = (f for f in known["slab-offset*=1*"].fits if f.id == "index")
    sharper = sharp.model_copy(update={"information": 1e6 * sharp.information})
    fits = [sharper if f.id == "index" else f for f in known["slab-offset*=1*"].fits]
    known["slab-offset*=1*"] = known["slab-offset*=1*"].model_copy(update={"fits": fits})
    (found,) = diagnose_run("it", known, [])
    assert found.cause is not None
    assert found.cause.value == pytest.approx(-0.01, abs=1e-6)
    assert found.cases == list(sizes)
    assert "explains 2 of 3 cases that are off, and with a size of their own 1 more" in (
        found.sentence
    )


# --- words ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "error", "said"),
    [
        (1.48731, 0.00021, "1.4873 ± 0.0002"),
        (8.94e-5, 3.1e-6, "8.94e-05 ± 3e-06"),
        (2.0, 0.0, "2"),
        (250.0, 20.0, "250 ± 2e+01"),
    ],
)
def test_as_many_digits_as_are_known(value: float, error: float, said: str) -> None:
    assert plus_minus(value, error) == said
