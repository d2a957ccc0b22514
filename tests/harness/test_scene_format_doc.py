"""docs/scene-format.md is true: its blocks load, its messages appear, its tables are complete."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from harness.errors import InputError
from harness.measure.observables import (
    ALL_LIGHT_OBSERVABLES,
    IMAGE_OBSERVABLES,
    IMPLIED_OBSERVABLES,
    LIGHT_OBSERVABLES,
    RAY_API_OBSERVABLES,
    TRUTH_OBSERVABLES,
    Observable,
)
from harness.scene import model
from harness.scene.expressions import CONSTANTS, FUNCTIONS
from harness.scene.load import load_cases
from harness.scene.resolve import resolve
from tests.harness.test_mesh_parts import FILE as TWO
from tests.strategies import to_toml

TEXT = (Path(__file__).parents[2] / "docs" / "scene-format.md").read_text(encoding="utf-8")
BLOCKS = {
    TEXT.count("\n", 0, match.start()) + 1: (match[1], match[2])
    for match in re.finditer(r"^```(.*)\n((?:.*\n)*?)^```$", TEXT, re.MULTILINE)
}

TETRAHEDRON = """\
ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 1 2 3
3 0 3 2
"""
# What the blocks that show only a part leave out.
REST: dict[str, Any] = {
    "format": 1,
    "title": "t",
    "family": "f",
    "sources": ["s"],
    "camera": {
        "type": "perspective",
        "origin": [0, 5, 40],
        "target": [0, 0, 0],
        "fov_x": 40,
    },
    "checks": [{"observable": "ssim", "against": "renderers"}],
}


@pytest.mark.parametrize("line", [line for line, (kind, _) in BLOCKS.items() if kind == "toml"])
def test_blocks_load(tmp_path: Path, line: int) -> None:
    import imagecodecs

    white = np.full((4, 4, 3), 255, dtype=np.uint8)
    (tmp_path / "photograph.png").write_bytes(imagecodecs.png_encode(white))
    (tmp_path / "tetrahedron.ply").write_text(TETRAHEDRON)
    (tmp_path / "two.obj").write_text(TWO)
    block = tomllib.loads(BLOCKS[line][1])
    path = tmp_path / "scene.toml"
    path.write_text(to_toml(block if "format" in block else {**REST, **block}), encoding="utf-8")
    for case in load_cases(path)[:10]:
        resolve(case)


def test_mistakes_are_reported_as_shown(tmp_path: Path) -> None:
    (mistakes,) = (text for kind, text in BLOCKS.values() if kind == "toml mistakes")
    (messages,) = (text for kind, text in BLOCKS.values() if kind == "text messages")
    path = tmp_path / "scene.toml"
    path.write_text(mistakes, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_cases(path)
    assert str(caught.value).replace(str(path), "scene.toml") == messages.rstrip("\n")


def test_every_observable_is_listed() -> None:
    def needs(observable: Observable) -> str:
        if observable in IMPLIED_OBSERVABLES:
            return "variants"
        if observable in ALL_LIGHT_OBSERVABLES:
            return "a probe of all light"
        if observable in LIGHT_OBSERVABLES:
            return "a probe of light"
        if observable in RAY_API_OBSERVABLES:
            return "a ray API"
        if observable not in IMAGE_OBSERVABLES:
            return "a probe"
        return "a picture" if observable in TRUTH_OBSERVABLES else "two pictures"

    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \| ([^|]*) \| ([^|]*) \|$", TEXT, re.MULTILINE)
    listed = [tuple(cell.strip() for cell in row) for row in rows]
    assert listed == [(o.value, o.unit, needs(o), o.meaning) for o in Observable]


def test_every_key_word_and_function_is_named() -> None:
    words = set(re.findall(r"[A-Za-z_]\w*", TEXT))
    models = [
        value
        for value in vars(model).values()
        if isinstance(value, type) and issubclass(value, BaseModel)
    ]
    keys = {key for one in models for key in one.model_fields}
    tags = {one.model_fields["type"].annotation for one in models if "type" in one.model_fields}
    types = {tag for annotation in tags for tag in getattr(annotation, "__args__", ())}
    assert keys - words == set()
    assert types - words == set()
    assert {*FUNCTIONS, *CONSTANTS} - words == set()
