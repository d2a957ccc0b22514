"""Whole files of every kind that snellcheck reads, and how each is read."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from harness.baseline.approve import read_choices
from harness.baseline.document import baseline_text, parse_baseline
from harness.plan import prepare
from harness.record import Verdict, read_case, read_summary
from harness.renderers.command_file import renderer_from_file
from harness.scene.load import load_cases
from tests.baseline.documents import approval, baseline, check, record, stored_image

ROOT = Path(__file__).parents[2]
LARGEST_SEED = 20_000  # bytes
# Of a case with many permutations only so many are resolved.
MOST_RESOLVED = 2


@dataclass(frozen=True)
class Kind:
    """One kind of file: its whole examples, the name it is read under, and the reader."""

    name: str
    file: str
    seeds: tuple[bytes, ...]
    read: Callable[[Path], object]


def read_scene(path: Path) -> None:
    """As `snellcheck run` does before it renders."""
    for case in load_cases(path)[:MOST_RESOLVED]:
        prepare(case)


def read_beside(path: Path) -> None:
    """A mesh or picture, through the scene file that names it."""
    read_scene(path.with_name("scene.toml"))


MESH_SCENE = b"""format = 1
title = "A mesh"
family = "fuzz"
sources = ["none"]

[camera]
type = "perspective"
origin = [0, 0, 6]
target = [0, 0, 0]
fov_x = 40

[media.glass]
ior = 1.5

[[solids]]
name = "thing"
medium = "glass"
shape = { type = "mesh", file = "FILE" }

[[surfaces]]
name = "backdrop"
shape = { type = "rectangle", center = [0, 0, -9], size = [90, 90] }
material = { type = "emissive", pattern = { type = "ramp", start = [0, 0, 0], end = [1, 1, 1] } }

[[checks]]
observable = "rmse"
against = "renderers"
"""
OBJ = b"""v -1 -1 -1\nv 1 -1 -1\nv 0 1 -1\nv 0 0 1
f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4
"""
PLY = b"""ply\nformat ascii 1.0\nelement vertex 4
property float x\nproperty float y\nproperty float z
element face 4\nproperty list uchar int vertex_indices\nend_header
-1 -1 -1\n1 -1 -1\n0 1 -1\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3
"""
STL = b"solid x\n" + b"".join(
    b"facet normal 0 0 0\nouter loop\n"
    + b"".join(b"vertex %s\n" % v for v in (a, b, c))
    + b"endloop\nendfacet\n"
    for a, b, c in (
        (b"-1 -1 -1", b"0 1 -1", b"1 -1 -1"),
        (b"-1 -1 -1", b"1 -1 -1", b"0 0 1"),
        (b"1 -1 -1", b"0 1 -1", b"0 0 1"),
        (b"0 1 -1", b"-1 -1 -1", b"0 0 1"),
    )
) + b"endsolid x\n"  # fmt: skip


def kinds() -> tuple[Kind, ...]:
    """All kinds; the examples of each are valid."""
    scenes = [path.read_bytes() for path in sorted((ROOT / "scenes").rglob("*.toml"))]
    small = tuple(data for data in scenes if len(data) < LARGEST_SEED and b"file =" not in data)
    checks = [check(), check(status=Verdict.FAIL, observable="exit_direction")]
    approved = baseline(checks, images=[stored_image()], earlier=[approval()])
    case = record(checks).model_dump_json(by_alias=True, indent=1).encode()
    summary = {
        "schema": "snellcheck-summary/1", "snellcheck_version": "0", "started": "now", "wall_s": 1,
        "quality": "draft", "exit_code": 0, "counts": {"pass": 1},
        "renderers": {"fake": {"version": "1", "status": "ok", "cases": 1, "render_s": 1}},
        "cases": [{"id": "a", "family": "b", "status": "pass",
                   "checks": [json.loads(c.model_dump_json()) for c in checks]}],
    }  # fmt: skip
    choices = {
        "schema": "snellcheck-approvals/1",
        "approve": [{"case": "a", "renderer": "b", "reason": "c"}, {"case": "d", "renderer": "b"}],
    }
    examples = ROOT / "docs" / "bring-your-own-renderer"
    configs = tuple(path.read_bytes() for path in sorted(examples.glob("*.toml")))
    text = baseline_text(approved).encode()
    return (
        Kind("scene", "scene.toml", small, read_scene),
        Kind("mesh (OBJ)", "mesh.obj", (OBJ,), read_beside),
        Kind("mesh (PLY)", "mesh.ply", (PLY,), read_beside),
        Kind("mesh (STL)", "mesh.stl", (STL,), read_beside),
        Kind("baseline", "b.json", (text,), lambda p: parse_baseline(p.read_bytes(), p)),
        Kind("record", "r.json", (case,), read_case),
        Kind("summary", "summary.json", (json.dumps(summary).encode(),), read_summary),
        Kind("choices", "choices.json", (json.dumps(choices, indent=1).encode(),), read_choices),
        Kind("renderer config", "snellcheck-renderer.toml", configs, renderer_from_file),
    )


def prepare_folder(kind: Kind, folder: Path) -> None:
    """What has to lie beside the file for it to be read."""
    if kind.read is read_beside:
        scene = MESH_SCENE.replace(b"FILE", kind.file.encode())
        (folder / "scene.toml").write_bytes(scene)
