"""What Mitsuba is given, without Mitsuba: dimensions, names, files."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness import imagefile
from harness.errors import RendererUnsupported
from harness.scene import resolved as rs
from harness.translate.mitsuba import describe
from harness.translate.mitsuba_scale import THICKEST, THINNEST, length_scale, scaled
from harness.translate.mitsuba_shapes import round_mesh
from harness.translate.mitsuba_xml import write
from tests.harness.povray_scenes import (
    AIR,
    GLASS,
    box,
    camera,
    frame,
    glow,
    make_scene,
    rays,
    rectangle,
)

VIEW = camera((0.3, 0.4, 6), (0.5, -0.2, -3), 33)
BALL = rs.Sphere(center=(0, 0, 0), radius=1)
TINTED = rs.Medium(name="tinted", ior=1.5, absorption=(0.1, 0.2, 0.4))
GREY = rs.Medium(name="grey", ior=1.5, absorption=(0.3, 0.3, 0.3))


def everything() -> rs.ResolvedScene:
    """One of each shape, material, pattern and light."""
    lit = frame((0, 0, -3))
    picture = rs.Picture(width=1, height=2, pixels="AAAAAAAA////////")
    faces: list[tuple[rs.SurfaceShape, rs.Material]] = [
        (rs.Rectangle(frame=lit, size=(6, 4)), rs.Emissive(pattern=picture)),
        (
            rs.Disk(frame=lit, radius=2),
            rs.Emissive(pattern=rs.Ramp(start=(0, 0, 0), end=(1, 2, 3), axis="v")),
        ),
        (rs.Disk(frame=lit, radius=1), glow(1, 2, 3)),
        (box((3, 3, 3), (4, 4, 4)), rs.Diffuse(reflectance=(0.1, 0.2, 0.3))),
        (BALL, rs.Mirror(reflectance=(0.9, 0.8, 0.7))),
        (
            rs.Rectangle(frame=lit, size=(1, 1)),
            rs.Translucent(color=(0.9, 0.5, 0.2), filter=0.3, transmit=0.2),
        ),
    ]
    return make_scene(
        VIEW,
        solids=[
            (BALL, 1, 0),
            (rs.Cylinder(frame=frame((3, 0, 0)), radius=0.5, height=2), 1, 0),
            (box((-3, -2, -2.5), (3, 2, -2)), 2, 0),
        ],
        surfaces=faces,
        media=(AIR, TINTED, GLASS),
        lights=(rs.PointLight(position=(0, 0, 9), intensity=(1, 2, 3)),),
        background=(0.1, 0.1, 0.1),
    )


# --- what is described ----------------------------------------------------------------------------


def test_indices_are_said_on_both_sides() -> None:
    """Also of air, which is 1.000277 to Mitsuba where nothing is said; and of nested solids."""
    media = (AIR, rs.Medium(name="water", ior=1.33), GLASS)
    small = rs.Sphere(center=(0, 0, 0), radius=0.5)
    node = describe(make_scene(VIEW, solids=[(BALL, 1, 0), (small, 2, 1)], media=media))
    assert node["solid_0"]["bsdf"] == {"type": "dielectric", "int_ior": 1.33, "ext_ior": 1.0}
    assert node["solid_1"]["bsdf"] == {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.33}


@pytest.mark.parametrize(
    ("medium", "kind"), [(GLASS, "path"), (GREY, "volpath"), (TINTED, "volpathmis")]
)
def test_the_integrator_knows_of_media_that_absorb(medium: rs.Medium, kind: str) -> None:
    scene = make_scene(VIEW, solids=[(BALL, 1, 0)], media=(AIR, medium), depth=12)
    assert describe(scene)["integrator"] == {"type": kind, "max_depth": 12, "rr_depth": 1000}


def test_russian_roulette_never_begins() -> None:
    node = describe(make_scene(VIEW, depth=5000))
    assert node["integrator"]["rr_depth"] > 5000


def test_absorption_is_a_colour_times_a_scale() -> None:
    scene = make_scene(VIEW, solids=[(BALL, 1, 0)], media=(AIR, TINTED))
    medium = describe(scene)["medium_1"]
    sigma = np.array(medium["sigma_t"]["value"]) * medium["scale"]
    assert sigma == pytest.approx(TINTED.absorption)
    assert max(medium["sigma_t"]["value"]) <= 1
    assert describe(scene)["solid_0"]["interior"] == {"type": "ref", "id": "medium_1"}
    assert "exterior" not in describe(scene)["solid_0"]


def test_a_camera_stands_in_the_medium_that_absorbs() -> None:
    view = camera((0, 0, 0), (0, 0, -1), 40, medium=1)
    scene = make_scene(view, solids=[(BALL, 1, 0)], media=(AIR, TINTED))
    assert describe(scene)["sensor"]["medium"] == {"type": "ref", "id": "medium_1"}


def test_the_sensor_sees_the_definitions_rays() -> None:
    """Mitsuba's pixel ray: through (1 - 2 x, 1 - 2 y) k of a frame whose x points left."""
    scene = make_scene(VIEW)
    sensor = describe(scene)["sensor"]
    matrix = np.array(sensor["to_world"])
    k = math.tan(math.radians(sensor["fov"]) / 2)
    width, height = scene.film.width, scene.film.height
    j, i = (a.ravel() for a in np.mgrid[0:height, 0:width])
    x, y = (i + 0.5) / width, (j + 0.5) / height
    local = np.stack([(1 - 2 * x) * k, (1 - 2 * y) * k * height / width, np.ones(len(x))])
    directions = (matrix[:3, :3] @ local).T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert directions == pytest.approx(rays(scene)[1], abs=1e-12)
    assert matrix[:3, 3] == pytest.approx(VIEW.origin)
    assert np.linalg.det(matrix) == pytest.approx(1)


def test_translucence_is_split_exactly() -> None:
    """What the blend passes is filter * color + transmit; what it scatters is the rest."""
    color = np.array((0.9, 0.5, 0.2))
    sheet = rs.Translucent(color=(0.9, 0.5, 0.2), filter=0.3, transmit=0.2)
    scene = make_scene(VIEW, surfaces=[(rectangle((0, 0, 0), (1, 1)), sheet)])
    blend = describe(scene)["surface_0"]["bsdf"]
    passed = blend["weight"] * np.array(blend["tint"]["specular_transmittance"]["value"])
    scattered = (1 - blend["weight"]) * np.array(blend["diffuse"]["bsdf"]["reflectance"]["value"])
    assert passed == pytest.approx(0.3 * color + 0.2)
    assert scattered == pytest.approx(0.5 * color)
    assert blend["tint"]["int_ior"] == blend["tint"]["ext_ior"]


def test_a_position_code_is_a_texture_that_xml_cannot_hold(tmp_path: Path) -> None:
    code = rs.PositionCode(axis="v", cells=100, amplitude=0.9)
    scene = make_scene(VIEW, surfaces=[(rectangle((0, 0, 0), (1, 1)), rs.Emissive(pattern=code))])
    radiance = describe(scene)["surface_0"]["emitter"]["radiance"]
    assert (radiance["cells"], radiance["amplitude"], radiance["axis"]) == (100, 0.9, 1)
    with pytest.raises(RendererUnsupported, match="position codes"):
        write(scene, tmp_path)


def test_a_round_mesh_is_a_disk() -> None:
    """Of the right area, facing to the front, without slivers, and flat in its texture."""
    disk = rs.Disk(frame=frame((1, 2, 3), z=(0.3, -0.2, 1)), radius=2)
    mesh = round_mesh(disk)
    points = mesh["vertices"].astype(float)
    corners = points[mesh["triangles"]]
    sides = np.stack([corners[:, (k + 1) % 3] - corners[:, k] for k in range(3)])
    normals = np.cross(sides[0], sides[1])
    area = np.linalg.norm(normals, axis=1) / 2
    longest = np.linalg.norm(sides, axis=2).max(axis=0)
    assert area.sum() == pytest.approx(math.pi * 4, rel=1e-5)
    assert (normals @ np.array(disk.frame.z) > 0).all()
    assert (2 * area / longest > 0.15 * longest).all()
    local = points - np.array(disk.frame.origin)
    u, v = local @ np.array(disk.frame.x), local @ np.array(disk.frame.y)
    expected = np.stack([u, v], axis=1) / 4 + 0.5
    assert mesh["texcoords"].astype(float) == pytest.approx(expected, abs=1e-6)


def test_what_mitsuba_cannot_do_is_refused() -> None:
    thin = rs.ThinSlab(medium=1, exterior=0, thickness=0.1)
    with pytest.raises(RendererUnsupported, match=r"'surface0'.*offsets the ray"):
        describe(make_scene(VIEW, surfaces=[(rectangle((0, 0, 0), (1, 1)), thin)]))
    code = rs.PositionCode(axis="u", cells=10, amplitude=1)
    on_ball = rs.Emissive(pattern=rs.Ramp(start=(0, 0, 0), end=(1, 1, 1), axis="u"))
    for shape, look in (
        (rs.Disk(frame=frame(), radius=1), rs.Emissive(pattern=code)),
        (BALL, on_ball),
    ):
        with pytest.raises(RendererUnsupported, match=r"'surface0'"):
            describe(make_scene(VIEW, surfaces=[(shape, look)]))


def test_describing_does_not_load_mitsuba() -> None:
    script = (
        "import sys, harness.renderers.mitsuba, harness.translate.mitsuba_xml;"
        "print(any(name in sys.modules for name in ('mitsuba', 'drjit')))"
    )
    child = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert child.stdout.strip() == "False", child.stderr


# --- sizes ----------------------------------------------------------------------------------------


def test_scenes_of_ordinary_size_are_left_alone() -> None:
    scene = make_scene(VIEW, solids=[(BALL, 1, 0), (box((-9, -9, -0.25), (9, 9, 0)), 1, 0)])
    assert length_scale(scene) == 1
    assert scaled(scene, 1.0) is scene
    assert length_scale(make_scene(VIEW)) == 1


@given(st.floats(1e-6, 1e6))
def test_the_thinnest_solid_gets_a_size_that_mitsuba_can_handle(thickness: float) -> None:
    scene = make_scene(VIEW, solids=[(box((-1e7, -1e7, -thickness), (1e7, 1e7, 0)), 1, 0)])
    factor = length_scale(scene)
    assert math.log2(factor) == round(math.log2(factor))
    # As a difference of coordinates the thickness itself is known to 1e-16 of 1e7 at best.
    assert THINNEST * (1 - 1e-3) <= thickness * factor <= THICKEST * (1 + 1e-3)


def test_scaling_and_back_changes_nothing() -> None:
    scene = everything()
    assert scaled(scaled(scene, 1 / 1024), 1024) == scene


def test_scaling_keeps_angles_light_and_absorption() -> None:
    """Optical depths, irradiances and directions stay; lengths are multiplied."""
    scene, small = everything(), scaled(everything(), 1 / 4)
    light, near = scene.lights[0], small.lights[0]
    assert near.position == pytest.approx(np.array(light.position) / 4)
    fall = np.array(light.intensity) / np.linalg.norm(light.position) ** 2
    assert np.array(near.intensity) / np.linalg.norm(near.position) ** 2 == pytest.approx(fall)
    assert np.array(small.media[1].absorption) / 4 == pytest.approx(TINTED.absorption)
    assert rays(small)[1] == pytest.approx(rays(scene)[1])
    cylinder, thin = scene.solids[1].shape, small.solids[1].shape
    assert isinstance(cylinder, rs.Cylinder)
    assert isinstance(thin, rs.Cylinder)
    assert (thin.radius, thin.height) == (cylinder.radius / 4, cylinder.height / 4)


# --- files ----------------------------------------------------------------------------------------


@pytest.fixture
def written(tmp_path: Path) -> tuple[Path, ET.Element]:
    path = write(everything(), tmp_path / "new", samples=16)
    return path.parent, ET.parse(path).getroot()


def test_xml_refers_to_what_is_there(written: tuple[Path, ET.Element]) -> None:
    folder, root = written
    ids = [element.get("id") for element in root if element.get("id")]
    assert len(ids) == len(set(ids))
    for place, element in enumerate(root):
        for reference in element.iter("ref"):
            assert reference.get("id") in ids[:place]
    files = [e.get("value") for e in root.iter("string") if e.get("name") == "filename"]
    assert len(files) == 5
    assert all((folder / str(file)).is_file() for file in files)


def test_no_word_of_the_scene_reaches_the_files(tmp_path: Path) -> None:
    """Names are words of the scene's author; ours are numbered."""
    scene = everything()
    mark = "Zebra"
    renamed = scene.model_copy(
        update={
            "solids": tuple(s.model_copy(update={"name": mark}) for s in scene.solids),
            "surfaces": tuple(s.model_copy(update={"name": mark}) for s in scene.surfaces),
            "media": tuple(m.model_copy(update={"name": mark}) for m in scene.media),
        }
    )
    write(renamed, tmp_path)
    for file in tmp_path.iterdir():
        assert mark.encode() not in file.read_bytes()
        assert mark not in file.name


def test_numbers_survive_the_file(written: tuple[Path, ET.Element]) -> None:
    _, root = written
    sensor = root.find("sensor")
    assert sensor is not None
    (matrix,) = (e.get("value", "") for e in sensor.iter("matrix"))
    assert [float(x) for x in matrix.split()] == np.ravel(
        describe(everything())["sensor"]["to_world"]
    ).tolist()
    counts = [e.get("value") for e in sensor.iter("integer") if e.get("name") == "sample_count"]
    assert counts == ["16"]


def test_pictures_are_written_bottom_row_first(written: tuple[Path, ET.Element]) -> None:
    """In memory row 0 is v = 0; so it is in the file."""
    folder, _ = written
    pixels, _ = imagefile.read(folder / "surface_0-emitter-radiance.exr")
    assert pixels[:, 0, 0].tolist() == [1.0, 0.0]


def test_meshes_come_back_from_their_file(written: tuple[Path, ET.Element]) -> None:
    import trimesh

    folder, _ = written
    node: dict[str, Any] = describe(everything())["solid_2"]
    mesh = trimesh.load(folder / "solid_2.ply", process=False)
    assert np.array(mesh.vertices) == pytest.approx(node["vertices"])
    assert (np.array(mesh.faces) == node["triangles"]).all()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(6 * 4 * 0.5)
