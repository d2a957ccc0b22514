"""What scenes document of a renderer is not blamed on anything else, and hides nothing new."""

from __future__ import annotations

from pathlib import Path

import pytest

from harness.data import scenes_root
from harness.judging.documented import is_documented, known_here, known_in_run
from harness.judging.explain import _measuring, explain_run, unfitted
from harness.plan import prepare
from harness.record import Check, Diagnosis, SummaryCase, Verdict
from harness.run import run
from harness.scene.load import find, load_cases, scene_files
from tests.fakes.student import student
from tests.harness.tiny import SCENES
from tests.mutants.test_outside_mutants import off_by

BESIDE = "rays start beside the surface"
LOST = "the last face does not reflect"


def check(status: Verdict, cause: str = "", value: float = 3.0, renderer: str = "ember") -> Check:
    return Check(
        id=f"exit_point(through)/{renderer}/truth", renderer=renderer, against="truth",
        observable="exit_point", value=value, expected=0.0, tolerance=1.0, unit="units",
        status=status, reason="", cause=cause,
    )  # fmt: skip


def case(name: str, *checks: Check, diagnoses: tuple[Diagnosis, ...] = ()) -> SummaryCase:
    return SummaryCase(
        id=name, family="f", status=Verdict.KNOWN, checks=list(checks), diagnoses=list(diagnoses)
    )


def test_a_case_whose_deviations_are_all_known_says_their_causes_once() -> None:
    found = known_here(
        "ember",
        [check(Verdict.KNOWN, BESIDE, 3), check(Verdict.KNOWN, LOST, -4), check(Verdict.PASS, LOST),
         check(Verdict.KNOWN, BESIDE), check(Verdict.FAIL, renderer="other")],
    )  # fmt: skip
    assert found is not None
    assert found.sentence == f"ember deviates as the scene documents: {BESIDE}; {LOST}"
    assert found.deviation == pytest.approx(((9 + 16 + 9) / 3) ** 0.5)
    assert is_documented(found)


@pytest.mark.parametrize("new", [Verdict.FAIL, Verdict.ERROR])
def test_a_case_with_anything_new_is_not_documented(new: Verdict) -> None:
    assert known_here("ember", [check(Verdict.KNOWN, BESIDE), check(new, BESIDE)]) is None


def test_nothing_off_is_nothing_documented() -> None:
    assert known_here("ember", [check(Verdict.PASS, BESIDE)]) is None
    assert list(known_in_run("ember", [case("a", check(Verdict.FAIL, BESIDE))])) == []


def test_a_run_lists_each_cause_with_its_cases() -> None:
    judged = [
        case("a", check(Verdict.KNOWN, LOST)),
        case("b", check(Verdict.KNOWN, BESIDE), check(Verdict.KNOWN, LOST)),
        case("c", check(Verdict.KNOWN, LOST), check(Verdict.FAIL)),
        case("d", check(Verdict.PASS, BESIDE)),
    ]
    found = list(known_in_run("ember", judged))
    assert [(d.sentence, d.cases) for d in found] == [
        (f"ember deviates in 3 cases as documented: {LOST}", ["a", "b", "c"]),
        (f"ember deviates in 1 case as documented: {BESIDE}", ["b"]),
    ]


def test_a_run_of_known_deviations_blames_nothing_else() -> None:
    here = known_here("ember", [check(Verdict.KNOWN, BESIDE)])
    assert here is not None
    judged = [case("a", check(Verdict.KNOWN, BESIDE), diagnoses=(here,))]
    (found,) = explain_run([], judged, {"ember": ""})
    assert found.sentence == f"ember deviates in 1 case as documented: {BESIDE}"


def test_what_is_new_is_told_apart_from_what_is_documented(tmp_path: Path) -> None:
    """The index is off everywhere; one scene documents what it does there."""
    scenes = tmp_path / "scenes"
    for source in SCENES.rglob("*.toml"):
        copy = scenes / source.relative_to(SCENES)
        copy.parent.mkdir(parents=True, exist_ok=True)
        text = source.read_text(encoding="utf-8")
        if source.parent.name == "slab":
            known = f'{{ renderer = "student", at_least = 0, at_most = 1e6, cause = "{LOST}" }}'
            text = text.replace("[[checks]]\n", f"[[checks]]\nknown = [{known}]\n")
        copy.write_text(text, encoding="utf-8")
    cases = [prepare(c) for c in find(("slab", "snell"), scenes, renderers=("student",))]
    sees = student(sees=off_by(0.01))
    found = run(cases, [sees], student(name="helper"), tmp_path / "out").diagnoses
    assert [d.cause.id if d.cause else "" for d in found] == ["index", "documented"]
    assert found[0].cases == ["snell-sweep"]
    assert all(name.startswith("slab-offset") for name in found[1].cases)
    assert found[1].sentence.startswith("student deviates in ")
    assert found[1].sentence.endswith(f" as documented: {LOST}")


def test_what_no_single_ray_shows_is_said_to_have_no_cause_fitted() -> None:
    off = check(Verdict.FAIL)
    dim = off.model_copy(update={"observable": "transmittance"})
    alone = unfitted("ember", [off, dim, check(Verdict.PASS), check(Verdict.ERROR)])
    assert alone is not None
    assert alone.cause is None
    assert alone.sentence.startswith("ember is off in exit_point, transmittance, and no single")
    assert unfitted("ember", [check(Verdict.PASS), check(Verdict.ERROR)]) is None
    (found,) = explain_run([], [case("a", off, diagnoses=(alone,))], {"ember": ""})
    assert found.sentence.startswith("ember is off in exit_point, and no single")
    assert found.unexplained == ["a"]


def test_no_documented_cause_can_vanish_unseen() -> None:
    """Each has a check that FAILs when it is gone: a least size above 0 in some permutation."""
    strict: dict[tuple[str, str], bool] = {}
    for path in scene_files(scenes_root()):
        for loaded in load_cases(path):
            for known in (k for spec in loaded.model.checks for k in spec.known):
                cause = (known.renderer, known.cause)
                strict[cause] = strict.get(cause, False) or known.at_least > 0
    assert [cause for cause, held in strict.items() if not held] == []
    assert len(strict) >= 8


@pytest.mark.parametrize(
    ("name", "probes"),
    [
        ("slab-offset[thickness=0.25,ior=1.5]", ["through"]),
        ("identity-matched[ior=1.333]", ["through", "light"]),
        # An angle is the same on both sides of the normal, and this one is looked at alone.
        ("brewster-angle[ior=1.333]", []),
    ],
)
def test_a_case_speaks_against_a_cause_by_probes_of_which_every_ray_is_checked(
    name: str, probes: list[str]
) -> None:
    (case,) = find([name], scenes_root())
    assert [probe.name for probe in _measuring(prepare(case))] == probes
