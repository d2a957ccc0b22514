"""The published JSON Schemas say what the loader says."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings

from harness.scene.load import scene_files
from harness.scene.resolve import resolve
from harness.scene.resolved import ResolvedScene
from harness.scene.schema import case_schema, scene_schema
from tests.strategies import cases_of, documents, resolved_scenes

SCENES = Path(__file__).parents[2] / "scenes"
CASE = jsonschema.Draft202012Validator(case_schema())
SCENE = jsonschema.Draft202012Validator(scene_schema())


def plain() -> dict[str, Any]:
    return {
        "format": 1,
        "title": "t",
        "family": "f",
        "sources": ["s"],
        "camera": {
            "type": "perspective",
            "origin": [0, 0, 6],
            "target": [0, 0, 0],
            "fov_x": "=a * 2",
        },
        "media": {"glass": {"ior": "=n"}},
        "solids": [
            {"name": "a", "medium": "=kind", "shape": {"type": "sphere", "radius": "=a"}},
        ],
        "parameters": {"a": 3, "b": "=a / 2"},
        "axes": {
            "n": [1.5, "=sqrt(2)"],
            "kind": ["glass", "air"],
            "s": {"start": 0, "stop": 1, "count": 3},
        },
        "checks": [{"observable": "ssim"}],
    }


def test_both_schemas_are_schemas() -> None:
    for schema in (case_schema(), scene_schema()):
        jsonschema.Draft202012Validator.check_schema(schema)
        assert schema["$schema"].endswith("2020-12/schema")


@pytest.mark.parametrize("path", scene_files(SCENES), ids=lambda path: path.stem)
def test_the_suites_scenes_follow_it(path: Path) -> None:
    CASE.validate(tomllib.loads(path.read_text(encoding="utf-8")))


@settings(max_examples=40, deadline=None)
@given(documents())
def test_valid_documents_follow_it(document: dict[str, Any]) -> None:
    CASE.validate(document)


def test_expressions_stand_for_numbers_and_words() -> None:
    CASE.validate(plain())
    assert len(cases_of(plain())) == 12


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("titel", "x"),
        ("format", 2),
        ("metres_per_unit", "1"),
        ("metres_per_unit", -1),
        ("camera", {"type": "fisheye"}),
        ("axes", {"n": []}),
        ("axes", {"n": {"start": 0, "stop": 1}}),
        ("axes", {"n": ["two words"]}),
        ("parameters", {"a": "3"}),
        ("checks", []),
        ("solids", [{"name": "a", "medium": "glass", "shape": {"type": "sphere"}}]),
        ("solids", [{"name": "a b", "medium": "glass", "shape": {"type": "sphere", "radius": 1}}]),
    ],
)
def test_what_the_loader_refuses_the_schema_refuses(key: str, value: object) -> None:
    with pytest.raises(jsonschema.ValidationError):
        CASE.validate({**plain(), key: value})


@settings(max_examples=40, deadline=None)
@given(resolved_scenes())
def test_resolved_scenes_follow_theirs(scene: ResolvedScene) -> None:
    SCENE.validate(scene.model_dump(mode="json"))


def test_the_scene_schema_is_strict() -> None:
    document = resolve(cases_of(plain())[0]).model_dump(mode="json")
    SCENE.validate(document)
    for wrong in ({**document, "extra": 1}, {**document, "version": 2}, {"format": "x"}):
        with pytest.raises(jsonschema.ValidationError):
            SCENE.validate(wrong)
