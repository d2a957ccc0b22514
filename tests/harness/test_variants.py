"""Variants of a case: the same scene in another form, of which a renderer must show the same."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from harness.data import scenes_root
from harness.errors import InputError
from harness.judging.judge import CaseJudge
from harness.judging.results import Results
from harness.plan import Form, PreparedCase, prepare, trace_role
from harness.record import Check, Verdict
from harness.renderers.base import RayPaths
from harness.scene import resolved as rs
from harness.scene.load import load_cases
from tests.harness.test_catalogue import TRUTH, measured_by_truth

WEDGE = scenes_root() / "wedge" / "thin.toml"


def wedge() -> PreparedCase:
    return prepare(load_cases(WEDGE)[0])


def form(case: PreparedCase, name: str) -> Form:
    return next(f for f in case.forms if f.name == name)


def judged(case: PreparedCase, shift: float = 0.0, of: str = "turned") -> list[Check]:
    """Checks of the truth as a renderer, whose landing points in one form are `shift` aside."""
    results = measured_by_truth(case, 0.0)
    key = ("truth", trace_role(case.probe("through"), of))
    paths = results[key]
    assert isinstance(paths, RayPaths)
    axis = np.array(form(case, of).planes["through"][0].frame.x)
    moved = RayPaths(
        paths.status, paths.surface, paths.point + shift * axis, paths.direction, paths.weight,
        paths.optical_length,
    )  # fmt: skip
    film = case.scene.film
    whole = Results({**results, key: moved}, film.width, film.height)
    return CaseJudge(case, [TRUTH], whole, "truth").judge().checks


def test_each_form_has_its_own_checks_and_agrees() -> None:
    case = wedge()
    assert [f.name for f in case.forms] == ["", "polygons", "turned"]
    checks = judged(case)
    # Two forms more than the case itself, for each of its three checks, and two agreements.
    assert Counter(c.observable for c in checks) == {
        "deviation": 3, "exit_direction": 3, "exit_point": 3, "variant_agreement": 2,
    }  # fmt: skip
    assert len({c.id for c in checks}) == len(checks)
    assert {c.status for c in checks} == {Verdict.PASS}
    assert {c.against for c in checks if c.observable == "variant_agreement"} == {"variant"}


def test_a_form_that_shows_something_else_does_not_agree() -> None:
    bad = {c.id: c for c in judged(wedge(), shift=1e-6) if c.status is not Verdict.PASS}
    assert set(bad) == {
        "exit_point(through~turned)/truth/truth",
        "variant_agreement(through~turned)/truth/variant",
    }
    agreement = bad["variant_agreement(through~turned)/truth/variant"]
    assert agreement.status is Verdict.FAIL
    assert agreement.value == pytest.approx(1e-6, rel=1e-3)


def test_polygons_are_a_mesh_and_a_turned_scene_is_turned() -> None:
    case = wedge()
    assert isinstance(form(case, "polygons").scene.solids[0].shape, rs.Mesh)
    turned = form(case, "turned").scene.camera
    base = case.scene.camera
    rotation = np.array([turned.right, turned.up, turned.forward]).T @ np.array(
        [base.right, base.up, base.forward]
    )
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() <= 1e-15
    assert np.abs(rotation @ np.array(base.origin) - np.array(turned.origin)).max() <= 4e-15
    # 40 degrees about (1, 2, 3): trace = 1 + 2 cos.
    assert np.trace(rotation) == pytest.approx(1 + 2 * np.cos(np.radians(40)), abs=1e-14)
    assert np.abs(rotation @ [1, 2, 3] - np.array([1, 2, 3])).max() <= 4e-15


def test_scale_applies_to_all_lengths() -> None:
    case = prepare(load_cases(scenes_root() / "ball" / "focus.toml")[0])
    huge = form(case, "huge")
    assert huge.scale == 1000
    assert huge.planes["through"][0].size == (4000, 4000)
    assert huge.scene.camera.origin == (0, 0, 4000)
    assert isinstance(huge.scene.solids[0].shape, rs.Sphere)
    assert huge.scene.solids[0].shape.radius == 1000


def test_a_variant_of_a_solid_that_is_not_there_is_an_error(tmp_path: object) -> None:
    from pathlib import Path

    path = Path(str(tmp_path)) / "thin.toml"
    path.write_text(WEDGE.read_text().replace("shapes = { wedge =", "shapes = { edge ="))
    with pytest.raises(InputError, match="did you mean wedge"):
        load_cases(path)
