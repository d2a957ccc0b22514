"""Parcels lose nothing: not a bit of an array, not a character of a log."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from harness.errors import (
    ImageNotFinite,
    RendererError,
    RendererFailed,
    RendererMissing,
    RendererUnsupported,
)
from harness.judging.results import Contender
from harness.plan import Job, jobs_of
from harness.preflight import Preflight
from harness.record import Verdict
from harness.renderers.base import Capability, Image, RayPaths, RenderSettings
from harness.running.parcel import (
    Parcel,
    job_key,
    pack_contender,
    pack_job,
    pack_result,
    unpack_contender,
    unpack_job,
    unpack_result,
)
from tests.harness.tiny import prepared

SETTINGS = RenderSettings()
SIZES = st.tuples(st.integers(1, 5), st.integers(1, 5), st.just(3))
# NaNs with their payloads, infinities, and zeros of both signs included.
FLOATS = arrays.arrays(np.float32, SIZES, elements=st.floats(width=32))


def same(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray):
        assert isinstance(b, np.ndarray)
        assert b.flags.writeable
        return (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
    return a == b


def through_json(parcel: Parcel) -> Parcel:
    return Parcel(json.loads(json.dumps(parcel.meta)), parcel.blocks)


@given(FLOATS, st.none() | FLOATS, st.floats(0, 1e9), st.text(), st.text())
def test_images(
    pixels: np.ndarray, variance: np.ndarray | None, seconds: float, log: str, command: str
) -> None:
    image = Image(pixels, variance, seconds, log, command, pixels[..., 0])
    back = unpack_result(through_json(pack_result(image)))
    for field in dataclasses.fields(image):
        assert same(getattr(image, field.name), getattr(back, field.name))


@pytest.mark.parametrize("n", [1, 7])
@pytest.mark.parametrize("vertices", [True, False])
def test_ray_paths(n: int, vertices: bool) -> None:
    rng = np.random.default_rng(n)
    paths = RayPaths(
        status=rng.integers(0, 4, n).astype(np.int8),
        surface=rng.integers(-1, 4, n).astype(np.int32),
        point=np.where(rng.random((n, 3)) < 0.5, np.nan, rng.random((n, 3))),
        direction=rng.random((n, 3)),
        weight=rng.random(n),
        optical_length=rng.random(n),
        vertices=rng.random((n, 4, 3)) if vertices else None,
        meetings=rng.random((n, 4, 3)) if vertices else None,
    )
    back = unpack_result(through_json(pack_result(paths)))
    for field in dataclasses.fields(paths):
        assert same(getattr(paths, field.name), getattr(back, field.name))


@pytest.mark.parametrize("kind", [RendererFailed, RendererMissing, RendererUnsupported])
def test_errors(kind: type[RendererError]) -> None:
    back = unpack_result(through_json(pack_result(kind("why", log="line\nline"))))
    assert type(back) is kind
    assert (str(back), back.log) == ("why", "line\nline")


def test_an_image_that_is_not_finite_keeps_where() -> None:
    seen = np.array([1.0, np.nan, np.inf], np.float32)
    sent = ImageNotFinite([7, 9], width=4, log="x", image=seen)
    back = unpack_result(through_json(pack_result(sent)))
    assert isinstance(back, ImageNotFinite)
    assert same(back.image, seen)
    without = unpack_result(through_json(pack_result(ImageNotFinite([7, 9], width=4))))
    assert isinstance(without, ImageNotFinite)
    assert without.image is None
    assert (back.pixels, back.width, back.log) == ((7, 9), 4, "x")
    assert str(back) == str(ImageNotFinite([7, 9], width=4))


@pytest.mark.parametrize("case", prepared(), ids=lambda case: case.loaded.id)
def test_jobs_travel_with_their_scene(case) -> None:  # type: ignore[no-untyped-def]
    found = Preflight(1e-6, 64, 0.0, 1e-7, 16)
    for claims in (frozenset(Capability), frozenset(Capability) - {Capability.RAYS}):
        for job in jobs_of(case, "mine", claims, found, SETTINGS):
            back = unpack_job(through_json(pack_job(job)))
            assert back == job
            assert job_key(back, "1") == job_key(job, "1")


@pytest.mark.parametrize(
    "contender",
    [
        Contender("a", "1", frozenset({Capability.RAYS}), Preflight(1e-6, 64, 0.1, 1e-7, None)),
        Contender("b", "2", frozenset(), Preflight(1e-6, 64, 0.1, 1e-7, 16, ("mirrored",))),
        Contender("c", "", frozenset(), None, Verdict.SKIP, "not installed"),
    ],
)
def test_calibrations(contender: Contender) -> None:
    assert unpack_contender(json.loads(json.dumps(pack_contender(contender)))) == contender


def job() -> Job:
    (case,) = prepared("snell")
    return Job("mine", "image", case.scene, SETTINGS)


def test_a_key_changes_with_all_that_determines_a_result() -> None:
    one = job()
    film = one.scene.film.model_copy(update={"width": one.scene.film.width + 1})
    others = [
        dataclasses.replace(one, renderer="other"),
        dataclasses.replace(one, path="TT"),
        dataclasses.replace(one, scene=one.scene.model_copy(update={"film": film})),
        dataclasses.replace(one, settings=dataclasses.replace(SETTINGS, samples=65)),
        dataclasses.replace(one, settings=dataclasses.replace(SETTINGS, seed=1)),
    ]
    keys = [job_key(one, "1"), job_key(one, "2"), *(job_key(other, "1") for other in others)]
    assert len(set(keys)) == len(keys)


def test_a_key_does_not_change_with_anything_else() -> None:
    """Neither how a result is called nor under which limits it is made."""
    one = job()
    limits = dataclasses.replace(SETTINGS, threads=9, timeout_s=1.0, memory_mb=1)
    for other in (
        dataclasses.replace(one, role="second"), dataclasses.replace(one, settings=limits)
    ):  # fmt: skip
        assert job_key(other, "1") == job_key(one, "1")
