"""Mesh files of several solids: every face belongs to one of them, or the file is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from harness.errors import InputError
from harness.scene import resolved as rs
from harness.scene.load import load_cases
from harness.scene.mesh import volume
from harness.scene.resolve import resolve

# A cube of edge 2 and a tetrahedron beside it; corners from 1, faces of three and four corners.
CUBE = "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 1 5 8 4\n"
TETRAHEDRON = "f -4 -2 -3\nf -4 -3 -1\nf -3 -2 -1\nf -4 -1 -2\n"
CORNERS = """\
v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
v 4 0 0\nv 5 0 0\nv 4 1 0\nv 4 0 1
"""
OBJ = f"{CORNERS}o cube\n{CUBE}g solids tetra\n{TETRAHEDRON}"
FILE = OBJ.replace("g solids tetra", "o tetra")
SOLIDS = ("cube", "tetra")


def ply(solid: Callable[[int], int], prop: str = "solid") -> str:
    """The same as PLY, whose faces are of solid 0 and 1."""
    faces = [line[2:].split() for line in (CUBE + TETRAHEDRON).splitlines()]
    rows = [[int(k) - 1 if int(k) > 0 else 12 + int(k) for k in face] for face in faces]
    lines = [f"{len(r)} {' '.join(map(str, r))} {solid(k)}" for k, r in enumerate(rows)]
    corners = CORNERS.replace("v ", "")
    return (
        "ply\nformat ascii 1.0\nelement vertex 12\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(rows)}\nproperty list uchar int vertex_indices\n"
        f"property int {prop}\nend_header\n{corners}" + "\n".join(lines) + "\n"
    )


def resolved_with(folder: Path, name: str, content: str, *parts: str | None) -> rs.ResolvedScene:
    (folder / name).write_text(content)
    said = [f', part = "{part}"' if part else "" for part in parts]
    solids = "".join(
        f'  {{ name = "s{k}", medium = "air", shape = {{ type = "mesh", file = "{name}"{p} }} }},\n'
        for k, p in enumerate(said)
    )
    (folder / "scene.toml").write_text(f"""\
format = 1
title = "t"
family = "f"
sources = ["s"]
checks = [{{ observable = "radiance" }}]
camera = {{ type = "perspective", origin = [0, 0, 9], target = [0, 0, 0], fov_x = 30 }}
solids = [
{solids}]
""")
    (case,) = load_cases(folder / "scene.toml")
    return resolve(case)


def problem(folder: Path, name: str, content: str, *parts: str | None) -> str:
    with pytest.raises(InputError) as caught:
        resolved_with(folder, name, content, *parts)
    (only,) = caught.value.problems
    return str(only).removeprefix(str(folder / "scene.toml"))


@pytest.mark.parametrize(
    ("name", "content", "parts"),
    [
        ("two.obj", FILE, SOLIDS),
        ("two.obj", FILE.replace("o ", "g "), SOLIDS),
        ("two.ply", ply(lambda k: int(k >= 6)), ("0", "1")),
    ],
    ids=["objects", "groups", "property"],
)
def test_one_file_is_several_solids(
    tmp_path: Path, name: str, content: str, parts: tuple[str, str]
) -> None:
    scene = resolved_with(tmp_path, name, content, *parts)
    meshes = [solid.shape for solid in scene.solids if isinstance(solid.shape, rs.Mesh)]
    volumes = [volume(np.array(m.vertices), np.array(m.triangles)) for m in meshes]
    assert volumes == pytest.approx([8, 1 / 6], rel=1e-12)
    assert [len(m.vertices) for m in meshes] == [8, 4]


def test_a_part_that_there_is_not(tmp_path: Path) -> None:
    assert problem(tmp_path, "two.obj", FILE, "cub", "tetra") == (
        ':8: solids[0].shape.part: no such part; got "cub"; expected cube, tetra; '
        "did you mean cube?"
    )
    for name, content in (("one.stl", "solid a\nendsolid a\n"), ("two.ply", ply(int, "other"))):
        message = problem(tmp_path, name, content, "0")
        assert "solids[0].shape.part: no such part" in message or "not a readable" in message


def test_faces_of_no_solid_are_named(tmp_path: Path) -> None:
    tagged = FILE.replace("o cube\n", "").replace("f 2 3 7 6", "o cube\nf 2 3 7 6")
    assert problem(tmp_path, "two.obj", tagged, "tetra").startswith(
        ":8: solids[0].shape.part: 4 faces belong to no solid: "
        "0 (line 13), 1 (line 14), 2 (line 15), and 1 more; expected all faces of the file below"
    )
    untagged = ply(lambda k: (0, -1)[k == 7] if k < 8 else 1)
    assert "1 face belongs to no solid: 7; expected" in problem(tmp_path, "two.ply", untagged, "0")


def test_parts_that_nobody_has_are_a_mistake(tmp_path: Path) -> None:
    assert problem(tmp_path, "two.obj", FILE, "cube") == (
        ':8: solids[0].shape.file: no solid or surface has its part "tetra"; got "two.obj"; '
        'expected one with part = "tetra"'
    )


def test_a_whole_file_of_several_solids_is_told_of_its_parts(tmp_path: Path) -> None:
    message = problem(tmp_path, "two.obj", FILE, None)
    assert "2 separate solids in one mesh" in message
    assert message.endswith("expected `part`, one of cube, tetra")
