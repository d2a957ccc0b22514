"""Pixel packs hold what was measured: images to the last bit, rays as a diagram needs them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from harness import imagefile
from harness import record as records
from harness.data import scenes_root
from harness.packing_solids import drawn_solid
from harness.packing_ways import MIRRORED, TOTAL, TRANSMITTED, happened, onward, unusable
from harness.plan import prepare, scene_of_ways, wavelength_of_ways
from harness.record import Verdict
from harness.renderers.base import Capability, RayPaths, Status
from harness.renderers.registry import create
from harness.report import pack
from harness.scene.load import find
from harness.scene.resolved import Frame, Lens, Solid
from tests.fakes.student import CAPABILITIES, student
from tests.harness.tiny import passes_at, run_tiny
from tests.harness.unpack import floats, pixels, read_pack

ANY = st.floats(width=32, allow_nan=True, allow_infinity=True)


@given(arrays(np.float32, (3, 5, 3), elements=ANY), arrays(np.float32, (3, 5, 3), elements=ANY))
def test_images_come_back_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory, first: np.ndarray, second: np.ndarray
) -> None:
    one = pack.image("a", "image", first)
    two = pack.image("b", "image", second, one)
    path = pack.write(tmp_path_factory.mktemp("pack") / "x.js", "case", [one, two])
    found = read_pack(path)
    assert pixels(found, 0).tobytes() == first.tobytes()
    assert pixels(found, 1).tobytes() == second.tobytes()


def test_images_of_another_size_stand_for_themselves() -> None:
    one = pack.image("a", "image", np.ones((2, 2, 3), np.float32))
    two = pack.image("b", "image", np.ones((3, 2, 3), np.float32), one)
    assert "like" not in two.entry({one: 0, two: 1})


@given(arrays(np.float32, 8, elements=ANY), st.integers(4, 23))
def test_rounding_keeps_the_bits_it_promises(values: np.ndarray, bits: int) -> None:
    found = pack.rounded(values, bits)
    normal = np.isfinite(values) & (np.abs(values) > 1e-37) & (np.abs(values) < 1e37)
    error = np.abs(found[normal].astype(float) - values[normal])
    assert (error <= 2.0**-bits * np.abs(values[normal].astype(float))).all()
    assert (np.isnan(found) == np.isnan(values)).all()
    assert (found[np.isinf(values)] == values[np.isinf(values)]).all()


def test_nothing_in_a_pack_can_end_a_script(tmp_path: Path) -> None:
    path = pack.write(tmp_path / "x.js", "</script><script>alert(1)//\u2028", [])
    text = path.read_text("ascii")
    assert "<" not in text
    assert read_pack(path)["case"] == "</script><script>alert(1)//\u2028"


def test_a_run_leaves_packs_that_equal_its_images(tmp_path: Path) -> None:
    tracer = create("tracer")
    run_tiny(tmp_path, tracer, helper=tracer)
    for path in (tmp_path / "records").glob("*.json"):
        record = records.read_case(path)
        assert record.pack is not None
        found = read_pack(tmp_path / record.pack)
        assert found["case"] == record.id
        stored = [image for run in record.runs for image in run.images]
        assert [entry["role"] for entry in found["images"]] == [i.role for i in stored]
        for k, image in enumerate(stored):
            linear, _ = imagefile.read(tmp_path / image.path)
            assert pixels(found, k).tobytes() == linear.tobytes()


def test_rays_know_their_error_and_their_way(tmp_path: Path) -> None:
    """The tracer is right to the last bits; its rays go through the vertices that physics names."""
    tracer = create("tracer")
    run_tiny(tmp_path, tracer, cases=["slab*"], helper=tracer)
    (path, *_) = sorted((tmp_path / "data").glob("*.js"))
    (probe, *_) = read_pack(path)["probes"]
    (renderer,) = probe["renderers"]
    assert renderer["name"] == "tracer"
    error = floats(renderer["error"]["data"])
    assert np.nanmax(error) < 1e-6  # µrad
    vertices = floats(probe["vertices"]["data"]).reshape(probe["vertices"]["shape"])
    assert len(vertices) == len(probe["path"]) + 2
    # A slab gives the ray its direction back: first and last segment are parallel.
    first, last = vertices[1] - vertices[0], vertices[-1] - vertices[-2]
    first, last = (v / np.linalg.norm(v, axis=0) for v in (first, last))
    landed = ~np.isnan(last[0])
    assert landed.any()
    assert np.abs(first - last)[:, landed].max() < 1e-3


@pytest.mark.parametrize(
    ("name", "epsilon"),
    [("tracer", 2.0**-53), pytest.param("mitsuba-exact", 2.0**-24, marks=pytest.mark.mitsuba)],
)
def test_the_rays_of_a_picture_are_refracted_as_by_a_ball(
    name: str, epsilon: float, tmp_path: Path
) -> None:
    """By the closed form of a unit ball: a ray that passes its centre at b meets it at asin(b).

    The stored angles have 20 significant bits. Origins are up to 8 units away, where the renderer
    rounds by 8 epsilon: as much in each of the six numbers of a ray adds up to 48 epsilon in b, to
    which asin has the slope 1 / sqrt(1 - b^2). The second interface is met with the first one's
    error and its own.
    """
    renderer = create(name)
    run_tiny(tmp_path, renderer, cases=["ball"], helper=create("tracer"))
    (path,) = (tmp_path / "data").glob("*.js")
    ways = read_pack(path)["ways"]
    (rays,) = ways["rays"]
    assert (rays["name"], ways["silent"]) == (name, [])
    across, down = np.meshgrid(
        np.arange(0, rays["width"], rays["step"]), np.arange(0, rays["height"], rays["step"])
    )
    (ball,) = rays["solids"]
    assert (ball["center"], ball["radius"]) == ([0, 0, 0], 1)
    (scene,) = (tmp_path / "scenes").glob("*.json")
    camera = json.loads(scene.read_text("utf-8"))["camera"]
    b = passes_at(camera, across.ravel(), down.ravel(), rays["width"], rays["height"])
    meets = b < 1
    assert 0.1 < meets.mean() < 0.9
    theta_i, theta_t, events = (
        floats(rays[key]["data"]).reshape(rays[key]["shape"])
        for key in ("thetaI", "thetaT", "events")
    )
    first = np.degrees(np.arcsin(b[meets]))
    inner = np.degrees(np.arcsin(b[meets] / rays["media"][1]["ior"]))
    bits = 2.0**-19
    for seen, expected in zip((*theta_i, *theta_t), (first, inner, inner, first), strict=True):
        rounding = np.degrees(2 * 48 * epsilon / np.sqrt(1 - b[meets] ** 2))
        assert (np.abs(seen[meets] - expected) < expected * bits + rounding).all()
        assert np.isnan(seen[~meets]).all()
    assert (events[:, meets] == TRANSMITTED).all()


def test_with_a_spectrum_rays_are_followed_at_the_wavelength_that_is_told() -> None:
    case = prepare(find(["dispersion-ball-fringes"], scenes_root())[0])
    nm = wavelength_of_ways(case)
    assert nm in case.wavelengths
    assert scene_of_ways(case, CAPABILITIES).media == dict(case.passes)[nm]
    plain = prepare(find(["ball-checkerboard"], scenes_root())[0])
    assert wavelength_of_ways(plain) is None


def way(direction: tuple[float, float, float], meeting: tuple[float, float, float]) -> RayPaths:
    """Comes down the diagonal, meets a level face at the origin, and leaves the scene."""
    vertices = np.array([[[-1.0, 1, 0], [0, 0, 0]]])
    meetings = np.full((1, 2, 3), np.nan)
    meetings[0, 1] = meeting
    return RayPaths(
        status=np.array([Status.MISS], np.int8), surface=np.array([-1], np.int32),
        point=np.full((1, 3), np.nan), direction=np.array([direction]) / np.sqrt(2),
        weight=np.ones(1), optical_length=np.ones(1), vertices=vertices, meetings=meetings,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("direction", "meeting", "event"),
    [
        ((1, -1, 0), (0.5**0.5, 0.5**0.5, 0), TRANSMITTED),
        ((1, -1, 0), (0.5**0.5, np.nan, np.nan), TRANSMITTED),  # by what is no interface
        ((1, 1, 0), (0.5**0.5, np.nan, 1), TOTAL),
        ((1, 1, 0), (0.5**0.5, np.nan, np.nan), MIRRORED),
    ],
)
def test_what_happened_to_a_ray(
    direction: tuple[float, float, float], meeting: tuple[float, float, float], event: float
) -> None:
    paths = way(direction, meeting)
    vertices = onward(paths)
    assert paths.meetings is not None
    assert happened(vertices, paths.meetings).tolist() == [[event]]
    assert vertices[0, 2] == pytest.approx(np.array(direction))  # as far as it came


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"vertices": None}, "but not their ways"),
        ({"meetings": np.zeros((1, 3, 3))}, "meetings (1, 3, 3) of 1 rays"),
        ({"vertices": np.zeros((2, 2, 3)), "meetings": np.zeros((2, 2, 3))}, "of 1 rays"),
        ({"vertices": np.zeros((1, 0, 3)), "meetings": np.zeros((1, 0, 3))}, "0 vertices"),
        ({"vertices": np.full((1, 2, 3), np.nan)}, "begin nowhere"),
        ({"status": np.zeros(0, np.int8)}, "begin nowhere"),
    ],
)
def test_ways_that_cannot_be_drawn_are_not(change: dict[str, Any], reason: str) -> None:
    paths = way((1, 1, 0), (0.5**0.5, np.nan, 1))
    assert unusable(paths, 1) == ""
    assert reason in unusable(replace(paths, **change), 1)


def test_ways_that_fail_cost_the_diagram_alone(tmp_path: Path) -> None:
    """A renderer that claims to tell its rays' ways, but cannot."""
    boasts = student(capabilities=CAPABILITIES | {Capability.MAIN_WAY})
    summary = run_tiny(tmp_path, boasts, student(name="other"), cases=["ball"])
    assert summary.exit_code == 0
    (path,) = (tmp_path / "records").glob("*.json")
    run, _ = records.read_case(path).runs
    assert (run.status, run.reason) == (Verdict.PASS, "")
    (path,) = (tmp_path / "data").glob("*.js")
    assert read_pack(path)["ways"] == {
        "rays": [],
        "silent": [
            {"name": "student", "reason": "student claims to trace rays but cannot"},
            {"name": "other", "reason": "it does not tell where its rays go"},
        ],
    }


def test_composed_solids_are_drawn_as_closed_triangles() -> None:
    """A biconvex lens, which no other rule of drawing knows: its size is that of the lens."""
    frame = Frame(origin=(1, 2, 3), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
    lens = Lens(frame=frame, thickness=0.6, radii=(2.0, -2.0), conics=(0, 0), aperture=0.8)
    drawn = drawn_solid(Solid(name="lens", shape=lens, medium=1, exterior=0))
    corners = floats(drawn["corners"]["data"]).reshape(-1, 3)
    triangles = np.array(drawn["triangles"]).reshape(-1, 3)
    assert np.ptp(corners, axis=0) == pytest.approx([1.6, 1.6, 0.6], rel=0.05)
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 2).all()
