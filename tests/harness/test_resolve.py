"""From cases to numbers: geometry from its formulas, media from containment."""

from __future__ import annotations

import base64
import itertools
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.errors import InputError
from harness.scene import model, order, resolved
from harness.scene.containment import Relation, bounds, relation, signed_distance
from harness.scene.load import load_cases
from harness.scene.mesh import closed_solid_problems, volume
from harness.scene.pictures import radiance
from harness.scene.resolve import expand_thin_slabs, probe_planes, resolve
from harness.scene.shapes import polygons, solid_shape, surface_shape
from tests.strategies import cases_of, convex_shapes, numbers, points, resolved_scenes, solid_shapes

HERE = Path()
EPS = np.finfo(float).eps
Document = dict[str, Any]


def solid(shape: Document, folder: Path = HERE) -> Any:
    """A shape of a scene file as numbers."""
    data = {"name": "a", "medium": "air", "shape": _tuples(shape)}
    return solid_shape(model.Solid.model_validate(data).shape, folder)


def face(shape: Document) -> Any:
    data = {"name": "a", "shape": _tuples(shape), "material": {"type": "mirror"}}
    return surface_shape(model.Surface.model_validate(data).shape, HERE)


def _tuples(node: Any) -> Any:
    if isinstance(node, dict):
        return {key: _tuples(value) for key, value in node.items()}
    return tuple(map(_tuples, node)) if isinstance(node, list | tuple) else node


def scene(*shapes: Document | tuple[str, Document], **parts: Any) -> Document:
    """A document with solids s0, s1, … of media as given with them, else glass."""
    rows = [shape if isinstance(shape, tuple) else ("glass", shape) for shape in shapes]
    document: Document = {
        "format": 1,
        "title": "made",
        "family": "made",
        "sources": ["made"],
        "camera": {
            "type": "perspective",
            "origin": [0, 0, 20],
            "target": [0, 0, 0],
            "fov_x": 40,
        },
        "media": {"glass": {"ior": 1.5}, "water": {"ior": 1.333}},
        "solids": [
            {"name": f"s{k}", "medium": medium, "shape": shape}
            for k, (medium, shape) in enumerate(rows)
        ],
        "checks": [{"observable": "ssim"}],
    }
    return {**document, **parts}


def resolved_of(document: Document) -> resolved.ResolvedScene:
    return resolve(cases_of(document)[0])


def problems_of(document: Document) -> list[tuple[str, str]]:
    with pytest.raises(InputError) as caught:
        resolved_of(document)
    return [(problem.key, problem.message) for problem in caught.value.problems]


def sphere(radius: float, x: float = 0, y: float = 0, z: float = 0) -> Document:
    return {"type": "sphere", "radius": radius, "center": [x, y, z]}


def box(size: list[float], x: float = 0, y: float = 0, z: float = 0) -> Document:
    return {"type": "box", "size": size, "center": [x, y, z]}


# --- convex solids --------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(convex_shapes())
def test_planes_vertices_and_faces_are_one_solid(shape: Document) -> None:
    convex = solid(shape)
    vertices = np.array(convex.vertices)
    # Coordinates are rounded once, to EPS/2 of the largest; three products add up to this.
    tolerance = 3 * EPS * np.abs(vertices).max()
    for plane, corners in zip(convex.planes, convex.faces, strict=True):
        normal = np.array(plane[:3])
        assert np.linalg.norm(normal) == pytest.approx(1, abs=2 * EPS)
        away = vertices @ normal - plane[3]
        assert np.abs(away[list(corners)]).max() <= tolerance
        others = np.delete(away, list(corners))
        assert others.max() < -tolerance
        around = vertices[list(corners)]
        turn = np.cross(around[1] - around[0], around[2] - around[1])
        assert turn @ normal > 0  # counter-clockwise from outside
    mesh = polygons(convex)
    assert closed_solid_problems(np.array(mesh.vertices), np.array(mesh.triangles)) == []


@settings(max_examples=60, deadline=None)
@given(convex_shapes())
def test_volumes_are_those_of_the_formulas(shape: Document) -> None:
    match shape["type"]:
        case "box":
            expected = math.prod(shape["size"])
        case "slab" | "wedge":  # which is as thick as a slab, on average
            expected = math.prod(shape["size"]) * shape["thickness"]
        case _:
            angle = math.radians(shape["apex_angle"])
            expected = shape["side"] ** 2 * math.sin(angle) / 2 * shape["length"]
    mesh = polygons(solid(shape))
    found = volume(np.array(mesh.vertices), np.array(mesh.triangles))
    # Vertices are off by EPS times coordinates of up to 8, the surface is below 100 square units.
    assert found == pytest.approx(expected, rel=1e-13, abs=100 * 8 * EPS)


@given(
    normal=points(1).filter(lambda v: math.hypot(*v) > 0.1),
    center=points(),
    thickness=numbers(0.01, 5),
)
def test_a_slab_has_its_front_at_its_centre_and_its_back_behind(
    normal: list[float], center: list[float], thickness: float
) -> None:
    slab = solid({"type": "slab", "center": center, "normal": normal, "thickness": thickness})
    unit = np.array(normal) / np.linalg.norm(normal)
    back, front = slab.planes[4], slab.planes[5]
    assert front[:3] == pytest.approx(unit, abs=4 * EPS)
    assert back[:3] == pytest.approx(-unit, abs=4 * EPS)
    # Sizes of 100 units round to 100 EPS.
    assert front[3] == pytest.approx(unit @ center, abs=200 * EPS)
    assert front[3] + back[3] == pytest.approx(thickness, abs=200 * EPS)


def test_a_slab_along_the_axes_is_exact() -> None:
    slab = solid({"type": "slab", "thickness": 0.25, "size": [60, 40], "center": [0, 0, 1]})
    assert slab.planes[4:] == ((0, 0, -1, -0.75), (0, 0, 1, 1))
    assert [bound.tolist() for bound in bounds(slab)] == [[-30, -20, 0.75], [30, 20, 1]]


@pytest.mark.parametrize("angle", [10, 40, 60, 90, 120, 170])
def test_a_prism_opens_from_its_apex(angle: float) -> None:
    prism = solid({"type": "prism", "apex": [1, 2, 3], "apex_angle": angle, "side": 2, "length": 4})
    half = math.radians(angle / 2)
    entry, exit_, base = (np.array(plane) for plane in prism.planes[:3])
    assert entry[:3] == pytest.approx([math.sin(half), 0, math.cos(half)], abs=EPS)
    assert exit_[:3] == pytest.approx([math.sin(half), 0, -math.cos(half)], abs=EPS)
    assert base.tolist() == pytest.approx([-1, 0, 0, 2 * math.cos(half) - 1], abs=4 * EPS)
    for plane in (entry, exit_):
        assert plane[:3] @ [1, 2, 3] == pytest.approx(plane[3], abs=4 * EPS)
    # The angle inside the glass at the apex.
    assert math.pi - math.acos(entry[:3] @ exit_[:3]) == pytest.approx(2 * half, abs=1e-14)
    assert [bound[1] for bound in bounds(prism)] == [0, 4]


def test_quarter_turns_are_exact() -> None:
    turned = solid({**box([2, 4, 6], 1, 1, 1), "rotate": [{"axis": [0, 0, 1], "angle": 90}]})
    assert [bound.tolist() for bound in bounds(turned)] == [[-1, 0, -2], [3, 2, 4]]


def test_turns_are_right_handed() -> None:
    # About x, y turns to z and z to -y; about a diagonal, x turns to y.
    slab = {"type": "slab", "thickness": 1, "size": [2, 2]}
    turned = solid({**slab, "rotate": [{"axis": [3, 0, 0], "angle": 90}]})
    assert turned.planes[5] == (0, -1, 0, 0)
    prism = {"type": "prism", "apex_angle": 60, "side": 1, "length": 1}
    turned = solid({**prism, "rotate": [{"axis": [1, 1, 1], "angle": 120}]})
    assert turned.planes[2][:3] == pytest.approx((0, -1, 0), abs=2 * EPS)


def test_rotations_follow_each_other_about_the_centre() -> None:
    # x to y by the turn about z, then y to z by the turn about x.
    turns = [{"axis": [0, 0, 5], "angle": 90}, {"axis": [1, 0, 0], "angle": 90}]
    turned = solid({**box([6, 2, 4], 1, 1, 1), "rotate": turns})
    assert [bound.tolist() for bound in bounds(turned)] == [[0, -1, -2], [2, 3, 4]]


@settings(max_examples=40, deadline=None)
@given(shape=solid_shapes(), turns=st.integers(1, 5))
def test_full_turns_change_nothing(shape: Document, turns: int) -> None:
    placed = shape["of"] if shape["type"] == "polygons" else shape
    if placed["type"] in ("sphere", "union", "difference"):
        return
    before = bounds(solid(shape))
    step = {"axis": [1, 2, 2], "angle": 360 / turns}
    placed = {**placed, "rotate": [*placed.get("rotate", []), *[step] * turns]}
    turned = {"type": "polygons", "of": placed} if shape["type"] == "polygons" else placed
    assert np.allclose(bounds(solid(turned)), before, rtol=0, atol=1e-13)


# --- faces ----------------------------------------------------------------------------------------


@given(normal=points(1), up=points(1))
def test_frames_are_right_handed_and_upright(normal: list[float], up: list[float]) -> None:
    shape = {"type": "rectangle", "normal": normal, "up": up, "size": [1, 2]}
    lengths = math.hypot(*normal), math.hypot(*up)
    sine = np.linalg.norm(np.cross(normal, up))
    if min(lengths) == 0 or sine <= 1e-5 * math.prod(lengths):
        return
    frame = face(shape).frame
    x, y, z = np.array(frame.x), np.array(frame.y), np.array(frame.z)
    assert np.allclose([x @ x, y @ y, z @ z], 1, rtol=0, atol=4 * EPS)
    # A frame is as precise as the angle between its two given directions is wide.
    assert np.allclose([x @ y, y @ z, z @ x], 0, rtol=0, atol=4 * EPS)
    assert np.allclose(np.cross(x, y), z, rtol=0, atol=4 * EPS)
    assert z @ normal == pytest.approx(lengths[0], rel=4 * EPS)
    assert y @ up > 0


@pytest.mark.parametrize(
    ("shape", "key"),
    [
        ({"type": "rectangle", "size": [1, 1], "normal": [0, 1, 0]}, "normal"),
        ({"type": "rectangle", "size": [1, 1], "up": [0, 0, 2]}, "up"),
        ({"type": "rectangle", "size": [1, 1], "up": [0, 0, 0]}, "up"),
        ({"type": "rectangle", "size": [1, 1], "normal": [0, 0, 0]}, "normal"),
        ({"type": "disk", "radius": 1, "normal": [0, -1, 0]}, "normal"),
        ({"type": "cylinder", "radius": 1, "height": 1, "axis": [0, 0, 0]}, "axis"),
        ({**box([1, 1, 1]), "rotate": [{"axis": [0, 0, 0], "angle": 1}]}, "rotate[0].axis"),
    ],
)
def test_what_has_no_direction_is_a_mistake(shape: Document, key: str) -> None:
    surface = {"name": "f", "shape": shape, "material": {"type": "mirror"}}
    ((found, _),) = problems_of(scene(surfaces=[surface]))
    assert found == f"surfaces[0].shape.{key}"


def test_floors_take_an_up_of_their_own() -> None:
    floor = face({"type": "rectangle", "normal": [0, 1, 0], "up": [0, 0, -1], "size": [2, 3]})
    assert (floor.frame.x, floor.frame.y, floor.frame.z) == ((1, 0, 0), (0, 0, -1), (0, 1, 0))


# --- meshes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("smooth", [False, True])
def test_an_icosphere_lies_on_its_sphere(smooth: bool) -> None:
    errors = []
    for level in range(4):
        shape = {"type": "icosphere", "radius": 2, "center": [1, 2, 3], "subdivisions": level}
        mesh = solid({**shape, "smooth": smooth})
        vertices, triangles = np.array(mesh.vertices), np.array(mesh.triangles)
        assert len(triangles) == 20 * 4**level
        assert len(vertices) == 10 * 4**level + 2  # Euler: V - E + F = 2 with E = 3F/2
        away = np.linalg.norm(vertices - [1, 2, 3], axis=1)
        assert np.abs(away - 2).max() <= 4 * EPS * 5
        assert closed_solid_problems(vertices, triangles) == []
        errors.append(4 / 3 * math.pi * 8 - volume(vertices, triangles))
        if smooth:
            assert np.allclose(mesh.normals, (vertices - [1, 2, 3]) / 2, rtol=0, atol=8 * EPS)
    # The volume nears the sphere's by the square of the edge, which halves.
    assert all(3 < a / b < 4.5 for a, b in itertools.pairwise(errors))


@pytest.mark.parametrize("kind", ["ply", "obj", "stl"])
def test_mesh_files_are_read(tmp_path: Path, kind: str) -> None:
    import trimesh

    mesh = solid({"type": "icosphere", "radius": 1, "subdivisions": 2})
    folder = tmp_path / "meshes"
    folder.mkdir()
    trimesh.Trimesh(mesh.vertices, mesh.triangles).export(folder / f"ball.{kind}")
    shape = {"type": "mesh", "file": f"meshes/ball.{kind}", "scale": 2, "translate": [5, 0, 0]}
    read = solid(shape, tmp_path)
    assert len(read.vertices) == len(mesh.vertices)
    expected = volume(np.array(mesh.vertices), np.array(mesh.triangles))
    # PLY and STL store float32.
    assert volume(np.array(read.vertices), np.array(read.triangles)) == pytest.approx(
        8 * expected, rel=1e-5
    )
    assert np.allclose(np.mean(read.vertices, axis=0), [5, 0, 0], rtol=0, atol=1e-6)


CUBE_OBJ = """\
mtllib ../../secret.mtl
v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 1 5 8 4
"""


def mesh_problem(folder: Path, name: str) -> tuple[str, str]:
    path = folder / "scene.toml"
    path.write_text(f"""\
format = 1
title = "t"
family = "f"
sources = ["s"]
checks = [{{ observable = "radiance" }}]
camera = {{ type = "perspective", origin = [0, 0, 9], target = [0, 0, 0], fov_x = 30 }}
solids = [
  {{ name = "a", medium = "air", shape = {{ type = "mesh", file = '{name}' }} }},
]
""")
    (case,) = load_cases(path)
    with pytest.raises(InputError) as caught:
        resolve(case)
    (problem,) = caught.value.problems
    assert (problem.file, problem.line, problem.key) == (path, 8, "solids[0].shape.file")
    assert str(problem).isprintable()
    return problem.message, problem.suggestion or ""


def test_polygons_of_a_mesh_file_become_triangles(tmp_path: Path) -> None:
    (tmp_path / "cube.obj").write_text(CUBE_OBJ)
    cube = solid({"type": "mesh", "file": "cube.obj"}, tmp_path)
    assert (len(cube.vertices), len(cube.triangles)) == (8, 12)
    assert volume(np.array(cube.vertices), np.array(cube.triangles)) == pytest.approx(8)


def test_bad_mesh_files_are_mistakes(tmp_path: Path) -> None:
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    (scenes / "cube.obj").write_text(CUBE_OBJ)
    (tmp_path / "out.obj").write_text(CUBE_OBJ)
    (scenes / "link.obj").symlink_to(tmp_path / "out.obj")
    (scenes / "loop.obj").symlink_to(scenes / "loop.obj")
    (scenes / "folder.obj").mkdir()
    (scenes / "open.obj").write_text(CUBE_OBJ.rsplit("f", 1)[0])
    (scenes / "junk.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 9\nend_header\n1 2")
    (scenes / "junk.stl").write_bytes(bytes(range(256)) * 9)
    (scenes / "empty.obj").write_text("")
    (scenes / "nan.obj").write_text(CUBE_OBJ.replace("v -1 -1 -1", "v nan -1 -1"))
    (scenes / "far.obj").write_text(CUBE_OBJ.replace("f 1 4 3 2", "f 1 4 3 99"))
    outside = "leads out of the scene's folder"
    assert mesh_problem(scenes, "../out.obj")[0] == outside
    assert mesh_problem(scenes, str(tmp_path / "out.obj"))[0] == outside
    assert mesh_problem(scenes, "C:\\out.obj")[0] == outside
    assert mesh_problem(scenes, "link.obj")[0] == outside
    assert "cannot be read" in mesh_problem(scenes, "loop.obj")[0]
    assert mesh_problem(scenes, "cub.obj") == (
        "cannot be read: No such file or directory",
        "cube.obj",
    )
    assert "Is a directory" in mesh_problem(scenes, "folder.obj")[0]
    assert mesh_problem(scenes, "cube.fbx")[0] == "unknown mesh format"
    assert mesh_problem(scenes, "open.obj")[0].startswith(
        "not the surface of one solid: hole along edge"
    )
    for name in ("junk.ply", "junk.stl", "empty.obj", "nan.obj", "far.obj"):
        assert "not a readable" in mesh_problem(scenes, name)[0], name


def test_a_mesh_with_too_many_triangles_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cube.obj").write_text(CUBE_OBJ)
    monkeypatch.setattr("harness.scene.meshfile.MOST_TRIANGLES", 11)
    assert mesh_problem(tmp_path, "cube.obj")[0] == "12 triangles"
    monkeypatch.setattr("harness.scene.meshfile.LARGEST_FILE", 10)
    assert mesh_problem(tmp_path, "cube.obj")[0] == "larger than 10 bytes"


def test_triangles_written_out_must_be_one_closed_solid() -> None:
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    shape: Document = {"type": "triangles", "vertices": vertices, "triangles": triangles}
    tetrahedron = solid({**shape, "smooth": True})
    # The normal at the origin is the sum of three right angles' faces, outwards.
    assert tetrahedron.normals[0] == pytest.approx([-(3**-0.5)] * 3)
    far = {**shape, "triangles": [*triangles[:3], [0, 3, 4]]}
    flipped = {**shape, "triangles": [*triangles[:3], [0, 2, 3]]}
    assert problems_of(scene(far)) == [("solids[0].shape.triangles[3]", "no such vertex")]
    ((key, message),) = problems_of(scene(flipped))
    assert key == "solids[0].shape.triangles"
    assert "flipped face" in message


# --- pictures -------------------------------------------------------------------------------------


def png(pixels: Any) -> bytes:
    import imagecodecs

    return bytes(imagecodecs.png_encode(np.ascontiguousarray(pixels)))


def picture_scene(folder: Path, name: str, encoding: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(f"""\
format = 1
title = "t"
family = "f"
sources = ["s"]
checks = [{{ observable = "radiance" }}]
camera = {{ type = "perspective", origin = [0, 0, 9], target = [0, 0, 0], fov_x = 30 }}
[[surfaces]]
name = "a"
shape = {{ type = "rectangle", size = [2, 2] }}
material.type = "emissive"
material.pattern = {{ type = "picture", file = '{name}', encoding = "{encoding}" }}
""")
    return path


def read_picture(folder: Path, data: bytes, encoding: str = "linear") -> Any:
    (folder / "a.png").write_bytes(data)
    (case,) = load_cases(picture_scene(folder, "a.png", encoding))
    material = resolve(case).surfaces[0].material
    assert isinstance(material, resolved.Emissive)
    pattern = material.pattern
    assert isinstance(pattern, resolved.Picture)
    values = np.frombuffer(base64.b64decode(pattern.pixels), dtype="<u2")
    return values.reshape(pattern.height, pattern.width, 3)


def test_pictures_become_linear_radiance_row_by_row(tmp_path: Path) -> None:
    eight = np.array([[[0, 1, 255], [2, 3, 4]], [[5, 6, 7], [8, 9, 10]]], dtype=np.uint8)
    assert np.array_equal(read_picture(tmp_path, png(eight)), eight.astype(int) * 257)
    sixteen = eight.astype(np.uint16) * 257 + 1
    sixteen[0, 0, 2] = 65535
    assert np.array_equal(read_picture(tmp_path, png(sixteen)), sixteen)
    grey = read_picture(tmp_path, png(eight[:, :, 0]))
    assert np.array_equal(grey, np.repeat(eight[:, :, :1].astype(int) * 257, 3, axis=2))
    opaque = np.concatenate([eight, np.full((2, 2, 1), 255, np.uint8)], axis=2)
    assert np.array_equal(read_picture(tmp_path, png(opaque)), eight.astype(int) * 257)


@pytest.mark.parametrize("bits", [8, 16])
def test_srgb_is_decoded_as_the_standard_says(bits: int) -> None:
    most = 2**bits - 1
    values = np.arange(most + 1, dtype=f"u{bits // 8}")
    found = radiance(values, "srgb") / 65535
    for k in (0, 1, 10, most // 3, most // 2, most):
        v = k / most
        exact = v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4
        assert found[k] == pytest.approx(exact, abs=0.5 / 65535 + EPS)
    assert found[most] == 1
    assert np.all(np.diff(found) >= 0)


def test_bad_pictures_are_mistakes(tmp_path: Path) -> None:
    image = np.zeros((4, 4, 4), dtype=np.uint8)
    good = png(image[:, :, :3])
    huge = good[:16] + b"\0\0\x40\0\0\0\x40\0" + good[24:]
    for data, message in [
        (b"", "not a PNG picture"),
        (b"GIF89a" + bytes(100), "not a PNG picture"),
        (good[:40], "not a readable PNG"),
        (huge, "16384 × 16384 pixels"),
        (png(image), "is transparent in places"),
    ]:
        with pytest.raises(InputError) as caught:
            read_picture(tmp_path, data)
        (problem,) = caught.value.problems
        assert problem.key == "surfaces[0].material.pattern.file"
        assert problem.line == 11
        assert message in problem.message
    (case,) = load_cases(picture_scene(tmp_path, "../a.png", "srgb"))
    with pytest.raises(InputError, match="leads out of"):
        resolve(case)


# --- media ----------------------------------------------------------------------------------------


def test_air_is_first_and_may_be_defined() -> None:
    plain = resolved_of(scene())
    assert [(medium.name, medium.ior) for medium in plain.media] == [
        ("air", 1), ("glass", 1.5), ("water", 1.333),
    ]  # fmt: skip
    media = {"oil": {"ior": 1.4}, "air": {"ior": 1.000277, "absorption": [0, 0, 1]}}
    own = resolved_of(scene(media=media))
    assert [(medium.name, medium.ior) for medium in own.media] == [("air", 1.000277), ("oil", 1.4)]


NESTED = [
    ("water", sphere(5)),
    ("glass", box([3, 3, 3])),
    ("air", {"type": "cylinder", "radius": 1, "height": 2.5}),
    ("glass", {"type": "icosphere", "radius": 0.5, "subdivisions": 1}),
    ("water", {"type": "prism", "apex": [0.2, 0, 0], "apex_angle": 60, "side": 0.2, "length": 0.2}),
    ("glass", sphere(0.5, 3, 0, 0)),
    ("glass", sphere(1, 8, 0, 0)),
]


@settings(max_examples=20, deadline=None)
@given(st.permutations(range(len(NESTED))))
def test_exteriors_are_the_smallest_solids_around(order: list[int]) -> None:
    # In the order of NESTED: air; water; glass; the air of the cylinder; glass; water; air.
    expected = ["air", "water", "glass", "air", "glass", "water", "air"]
    found = resolved_of(scene(*(NESTED[k] for k in order)))
    names = [medium.name for medium in found.media]
    assert [names[s.exterior] for s in found.solids] == [expected[k] for k in order]


ICO: Document = {"type": "icosphere", "radius": 1, "subdivisions": 2}
ROD: Document = {"type": "cylinder", "radius": 0.5, "height": 4}
PANE: Document = {"type": "slab", "thickness": 0.1, "size": [20, 20]}
SIDEWAYS: Document = {**PANE, "normal": [1, 0, 0], "center": [0.05, 0, 0]}
# Only edges and faces tell that it crosses the pane; no sample point of either is in the other.
CROSSING: Document = {**PANE, "normal": [1, 0, 0], "center": [1.3, 0.7, 0.9]}

# A slab with the normal n = (1, 2, 2) / 3, and a ball 1 - 1e-4 before it, 9 u from its centre
# with u = (2, -2, 1) / 3 across n.
TILTED: Document = {"type": "slab", "normal": [1, 2, 2], "thickness": 1, "size": [50, 50]}
BESIDE = sphere(1, 0.9999 / 3 + 6, 1.9998 / 3 - 6, 1.9998 / 3 + 3)

OVERLAPS = [
    (sphere(1), sphere(1, 1.5)),
    (sphere(1), sphere(1, 1.999999)),
    (sphere(2), sphere(1, 1.5)),
    (sphere(1), sphere(1)),
    (sphere(1, z=1.04), box([50, 50, 0.1])),
    (BESIDE, TILTED),  # through a face, by 1e-4, where no sample point lies
    (sphere(1), box([1.9, 1.9, 1.9])),  # corners stick out of the sphere
    (sphere(1), box([3, 0.5, 0.5])),
    (PANE, SIDEWAYS),
    (PANE, CROSSING),
    ({"type": "polygons", "of": PANE}, CROSSING),
    ({"type": "polygons", "of": PANE}, {"type": "polygons", "of": CROSSING}),
    (box([2, 2, 2]), box([2, 2, 2], 1, 1, 1)),
    (box([2, 2, 2]), box([2, 2, 2])),
    (box([4, 1, 1]), box([1, 4, 1])),
    (box([4, 1, 1]), box([1, 4, 0.5])),
    (ROD, box([1, 1, 1])),
    (ROD, sphere(1)),
    (ROD, {**ROD, "axis": [1, 0, 0]}),
    (ICO, sphere(0.99)),
    (ICO, sphere(1, 1.5)),
    (ICO, box([0.5, 0.5, 3])),
    (ICO, {**ICO, "center": [1, 0.1, 0]}),
    ({"type": "polygons", "of": PANE}, SIDEWAYS),
]
APART = [
    (sphere(1), sphere(1, 2)),  # touching
    (sphere(1), sphere(1, 2.1)),
    (sphere(1), sphere(0.1, 0.9, 0.9, 0.9)),  # apart, though their boxes are not
    (sphere(1, z=1.05), box([50, 50, 0.1])),
    (box([1, 1, 1]), box([1, 1, 1], 1)),
    (box([1, 1, 1]), box([1, 3, 3], 1)),
    (box([1, 1, 1]), box([1, 1, 1], 1, 1)),
    (box([2, 2, 2]), ROD | {"center": [0, 3, 0]}),
    (ICO, sphere(1, 2.1)),
    (ICO, ICO | {"center": [0, 2, 0.5]}),
]
INSIDE = [
    (sphere(1), sphere(2, 1)),  # touching from inside
    (sphere(1), sphere(2, 0.9)),
    (sphere(1), box([2, 2, 2])),
    (sphere(1), ROD | {"radius": 1.1}),
    (box([1, 1, 1]), sphere(0.87)),
    (box([1, 1, 1]), box([2, 1, 1], 0.5)),
    (box([1, 1, 1]), ROD | {"radius": 0.71}),
    (ROD, box([1, 4, 1])),
    (ICO, sphere(1.001)),
    (sphere(0.9), ICO),
    (box([0.5, 0.5, 0.5]), ICO),
    (ICO | {"radius": 0.5}, ICO),
]


@pytest.mark.parametrize(
    ("a", "b", "expected", "reverse"),
    [
        *((a, b, Relation.OVERLAP, Relation.OVERLAP) for a, b in OVERLAPS),
        *((a, b, Relation.APART, Relation.APART) for a, b in APART),
        *((a, b, Relation.INSIDE, Relation.AROUND) for a, b in INSIDE),
    ],
)
def test_relations(a: Document, b: Document, expected: Relation, reverse: Relation) -> None:
    assert relation(solid(a), solid(b), 1e-9) is expected
    assert relation(solid(b), solid(a), 1e-9) is reverse


@given(st.floats(0.01, 5), st.floats(0.01, 5), st.floats(0, 10))
def test_relations_of_spheres_follow_their_distance(a: float, b: float, apart: float) -> None:
    if min(abs(apart - a - b), abs(apart - abs(a - b))) < 1e-6:
        return
    if apart > a + b:
        expected = Relation.APART
    elif apart > abs(a - b):
        expected = Relation.OVERLAP
    else:
        expected = Relation.INSIDE if a < b else Relation.AROUND
    away = apart / 3**0.5
    found = relation(solid(sphere(a)), solid(sphere(b, away, -away, away)), 1e-9)
    assert found is expected


def test_overlaps_name_both_solids() -> None:
    document = scene(sphere(1), sphere(1, 9), sphere(1, 1))
    assert problems_of(document) == [("solids[2].shape", "overlaps solid s0 partly")]


def test_a_scene_full_of_overlaps_is_told_of_some() -> None:
    found = problems_of(scene(*(sphere(1, 0.01 * k) for k in range(60))))
    assert len(found) == order.MOST_FINDINGS
    assert all("overlaps solid" in message for _, message in found)


def test_too_many_near_solids_are_refused_before_any_is_compared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(order, "relation", None)
    ((key, message),) = problems_of(scene(*(sphere(1, 1e-3 * k) for k in range(200))))
    assert key == "solids"
    assert message.startswith(f"more than {order.MOST_PAIRS} pairs of solids overlap")


@settings(max_examples=40, deadline=None)
@given(solid_shapes(), points(4))
def test_signed_distances_agree_with_the_same_solid_as_polygons(
    shape: Document, point: list[float]
) -> None:
    exact = solid(shape)
    if not isinstance(exact, resolved.Convex):
        return
    mesh = polygons(exact)
    place = np.array([point])
    of_planes, of_mesh = signed_distance(exact, place)[0], signed_distance(mesh, place)[0]
    if abs(of_mesh) < 1e-9:
        return
    assert np.sign(of_planes) == np.sign(of_mesh)
    assert abs(of_planes) <= abs(of_mesh) + 1e-12  # a bound outside, equal inside
    if of_mesh < 0:
        assert of_planes == pytest.approx(of_mesh, abs=1e-12)


# --- the camera -----------------------------------------------------------------------------------


@given(origin=points(), target=points())
def test_cameras_are_right_handed_and_look_at_their_target(
    origin: list[float], target: list[float]
) -> None:
    forward = np.subtract(target, origin)
    if np.linalg.norm(np.cross(forward, [0, 1, 0])) < 1e-3 * np.linalg.norm(forward) + 1e-6:
        return
    camera = {"type": "perspective", "origin": origin, "target": target, "fov_x": 90}
    found = resolved_of(scene(camera=camera)).camera
    assert isinstance(found, resolved.Perspective)
    assert found.tan_half_fov_x == pytest.approx(1, abs=2 * EPS)
    assert np.allclose(found.forward, forward / np.linalg.norm(forward), rtol=0, atol=4 * EPS)
    assert np.allclose(np.cross(found.forward, found.up), found.right, rtol=0, atol=1e-12)
    assert found.up[1] > 0
    assert found.right[1] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("camera", "key"),
    [
        ({"target": [0, 0, 20]}, "camera.target"),
        ({"up": [0, 0, 3]}, "camera.up"),
        ({"up": [0, 0, 0]}, "camera.up"),
        ({"origin": [0, 5, 0]}, "camera"),
    ],
)
def test_cameras_without_direction_are_mistakes(camera: Document, key: str) -> None:
    base = scene()["camera"]
    ((found, _),) = problems_of(scene(camera={**base, **camera}))
    assert found == key


def test_a_camera_in_a_solid_says_so() -> None:
    base = scene()["camera"]
    ball = ("water", sphere(30))
    bubble = ("air", sphere(2, 0, 0, 20))

    def medium(said: str | None, *solids: Any) -> str:
        camera = {**base, "medium": said} if said else base
        found = resolved_of(scene(*solids, camera=camera))
        return found.media[found.camera.medium].name

    def message(said: str | None, *solids: Any) -> tuple[str, str]:
        camera = {**base, "medium": said} if said else base
        (found,) = problems_of(scene(*solids, camera=camera))
        return found

    assert medium("water", ball) == "water"
    assert medium("air", ball, bubble) == "air"
    assert medium(None, ball, bubble) == "air"
    assert medium("air", sphere(1)) == "air"
    assert message(None, ball) == ("camera.origin", "the camera stands in water")
    assert message("glass", ball) == ("camera.medium", "the camera stands in water")
    assert message("water", ball, bubble) == ("camera.medium", "the camera stands in air")
    assert message("water", sphere(1)) == ("camera.medium", "the camera stands in air")
    assert message(None, sphere(20)) == ("camera.origin", "stands on the surface of solid s0")


def test_parallel_rays_begin_in_one_medium() -> None:
    camera = {"type": "orthographic", "origin": [0, 0, 2], "target": [0, 0, 0], "width": 4}
    assert resolved_of(scene(sphere(1), camera=camera)).camera.medium == 0
    assert problems_of(scene(sphere(1.1, z=2), camera=camera)) == [
        ("camera", "stands in more than one medium")
    ]


# --- the rest of a scene --------------------------------------------------------------------------


def test_features_that_rounding_would_swallow_are_mistakes() -> None:
    assert problems_of(scene(sphere(1e-9), sphere(1, 5))) == [
        ("solids[0].shape", "too small for a scene of this size")
    ]
    thin = {"type": "slab", "thickness": 1e-8, "size": [1, 1]}
    far = {"name": "f", "shape": {"type": "disk", "radius": 1e3}, "material": {"type": "mirror"}}
    ((key, _),) = problems_of(scene(thin, surfaces=[far]))
    assert key == "solids[0].shape"


def test_patterns_need_a_flat_face() -> None:
    ramp = {"type": "ramp", "start": [0, 0, 0], "end": [1, 1, 1]}
    ball = {"name": "f", "shape": sphere(1), "material": {"type": "emissive", "pattern": ramp}}
    thin = {
        "name": "g",
        "shape": sphere(1, 3),
        "material": {"type": "thin_slab", "medium": "glass", "thickness": 1},
    }
    bright = {
        "name": "h",
        "shape": {"type": "disk", "radius": 1},
        "material": {"type": "translucent", "color": [1, 1, 1], "filter": 0.6, "transmit": 0.6},
    }
    assert problems_of(scene(surfaces=[ball, thin, bright])) == [
        ("surfaces[0].material.pattern.type", "a pattern has no place on a sphere"),
        ("surfaces[1].material.type", "a thin slab is flat"),
        ("surfaces[2].material.transmit", "filter + transmit above 1"),
    ]


def test_all_mistakes_are_reported_at_once() -> None:
    camera = {**scene()["camera"], "up": [0, 0, 1]}
    broken = {**box([1, 1, 1]), "rotate": [{"axis": [0, 0, 0], "angle": 1}]}
    probe = {
        "name": "p",
        "path": "T",
        "planes": [{"type": "rectangle", "up": [0, 0, 1], "size": [1, 1]}],
    }
    found = problems_of(scene(broken, camera=camera, probes=[probe]))
    assert {key for key, _ in found} == {
        "camera.up",
        "solids[0].shape.rotate[0].axis",
        "probes[0].planes[0].up",
    }


def test_thin_slabs_become_real_ones_behind_their_face() -> None:
    def thin(name: str, shape: Document) -> Document:
        material = {"type": "thin_slab", "medium": "glass", "thickness": 0.5}
        return {"name": name, "shape": shape, "material": material}

    square = {"type": "rectangle", "center": [0, 0, 3], "size": [2, 4]}
    round_ = {"type": "disk", "center": [9, 0, 0], "normal": [1, 0, 0], "radius": 2}
    back = {"name": "b", "shape": {**square, "center": [0, 0, -9]}, "material": {"type": "mirror"}}
    surfaces = [thin("s0", square), back, thin("disk", round_)]
    document = scene(("water", sphere(5)), surfaces=surfaces)
    before = resolved_of(document)
    after = expand_thin_slabs(before)
    names = [medium.name for medium in after.media]
    assert [surface.name for surface in after.surfaces] == ["b"]
    assert [(s.name, names[s.medium], names[s.exterior]) for s in after.solids] == [
        ("s0", "water", "air"),
        ("s0-slab", "glass", "water"),
        ("disk", "glass", "air"),
    ]
    pane, coin = after.solids[1].shape, after.solids[2].shape
    assert [bound.tolist() for bound in bounds(pane)] == [[-1, -2, 2.5], [1, 2, 3]]
    assert isinstance(coin, resolved.Cylinder)
    assert (coin.frame.origin, coin.radius, coin.height) == ((8.75, 0, 0), 2, 0.5)
    assert expand_thin_slabs(after) == after


def test_probe_planes_are_rectangles() -> None:
    plane = {"type": "rectangle", "center": [0, 0, -3], "size": [16, 9]}
    probe = {"name": "p", "path": "TT", "planes": [plane, {**plane, "center": [0, 0, -4]}]}
    case = cases_of(scene(probes=[probe]))[0]
    one, two = probe_planes(case.model.probes[0])
    assert (one.frame.origin, two.frame.origin) == ((0, 0, -3), (0, 0, -4))
    assert one.size == (16, 9)


@settings(max_examples=40, deadline=None)
@given(resolved_scenes())
def test_resolved_scenes_survive_their_json(found: resolved.ResolvedScene) -> None:
    assert resolved.ResolvedScene.model_validate_json(found.model_dump_json()) == found


def test_simple_scenes_import_nothing_heavy() -> None:
    code = (
        "import sys; from pathlib import Path; "
        "from harness.scene.load import load_cases; from harness.scene.resolve import resolve; "
        "[resolve(case) for case in load_cases(Path('scenes/slab/offset.toml'))]; "
        "heavy = {'trimesh', 'scipy', 'imagecodecs', 'tree_sitter', 'numba'}; "
        "raise SystemExit(' '.join(heavy & set(sys.modules)) or 0)"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, check=False)
    assert (done.returncode, done.stderr.decode()) == (0, "")
