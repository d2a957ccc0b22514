"""Pixel packs hold what was measured: images to the last bit, rays as a diagram needs them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from harness import imagefile
from harness import record as records
from harness.packing import _solid
from harness.renderers.registry import create
from harness.report import pack
from harness.scene.resolved import Frame, Lens, Solid
from tests.harness.tiny import run_tiny
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


def test_composed_solids_are_drawn_as_closed_triangles() -> None:
    """A biconvex lens, which no other rule of drawing knows: its size is that of the lens."""
    frame = Frame(origin=(1, 2, 3), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
    lens = Lens(frame=frame, thickness=0.6, radii=(2.0, -2.0), conics=(0, 0), aperture=0.8)
    drawn = _solid(Solid(name="lens", shape=lens, medium=1, exterior=0))
    corners = floats(drawn["corners"]["data"]).reshape(-1, 3)
    triangles = np.array(drawn["triangles"]).reshape(-1, 3)
    assert np.ptp(corners, axis=0) == pytest.approx([1.6, 1.6, 0.6], rel=0.05)
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 2).all()
