"""Renderers behind an executor: parcels there and back, lost workers, machines that differ."""

from __future__ import annotations

import concurrent.futures
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from harness.cache.entry import Entry
from harness.errors import (
    ConnectionLost,
    InputError,
    RendererFailed,
    RendererMissing,
    RendererUnsupported,
)
from harness.record import Verdict
from harness.renderers import registry
from harness.renderers.base import Image, RayPaths, Renderer, RenderSettings
from harness.run import run
from harness.running import remote
from harness.running.remote import ATTEMPTS, Origin, RemoteRenderer
from harness.scene.resolved import ResolvedScene
from tests.fakes import FakeRenderer
from tests.fakes.student import student
from tests.harness.test_reuse import Remembered
from tests.harness.tiny import checks_of, prepared

SETTINGS = RenderSettings()
SCENE = prepared("snell")[0].scene


class WorkerDied(Exception):
    """As Dask's KilledWorker."""


class Flaky(Executor):
    """Loses the first `losses` jobs of each kind that it is given, after they were under way."""

    def __init__(self, losses: int) -> None:
        self.losses = losses

    def submit(self, fn: Callable[..., bytes], /, *args: bytes) -> Future[bytes]:  # type: ignore[override]
        future: Future[bytes] = Future()
        if self.losses > 0:
            self.losses -= 1
            future.set_exception(WorkerDied())
        else:
            future.set_result(fn(*args))
        return future


class Silent(Executor):
    """Never answers."""

    def submit(self, fn: Callable[..., bytes], /, *args: bytes) -> Future[bytes]:  # type: ignore[override]
        return Future()


@pytest.fixture
def there(monkeypatch: pytest.MonkeyPatch) -> dict[str, Renderer]:
    """What the other side has registered."""
    have: dict[str, Renderer] = {"mine": Remembered("mine"), "helper": Remembered("helper")}

    def create(name: str) -> Renderer:
        if name not in have:
            raise RendererMissing(f"no {name} here")
        return have[name]

    monkeypatch.setattr(registry, "create", create)
    remote._made.cache_clear()
    remote._about.cache_clear()
    yield have  # type: ignore[misc]
    remote._made.cache_clear()
    remote._about.cache_clear()


def far(name: str, executor: Executor | None = None, **more: object) -> RemoteRenderer:
    carrier = executor or Flaky(0)
    return RemoteRenderer(
        name, Origin("registered", name), carrier, concurrency=2, lost=(WorkerDied,), **more
    )  # type: ignore[arg-type]  # fmt: skip


def test_an_image_comes_back_bit_for_bit(there: dict[str, Renderer]) -> None:
    here = Remembered("mine").render(SCENE, SETTINGS)
    one = far("mine")
    image = one.render(SCENE, SETTINGS)
    assert image.pixels.tobytes() == here.pixels.tobytes()
    assert (one.version(), one.fingerprint()) == ("1.0", "1")
    assert one.capabilities == there["mine"].capabilities
    assert isinstance(one, Renderer)


def test_a_whole_run_is_as_one_at_home(there: dict[str, Renderer], tmp_path: Path) -> None:
    cases = prepared()
    home = run(cases, [Remembered("mine")], Remembered("helper"), tmp_path / "home")
    with ThreadPoolExecutor(3) as pool:
        away = run(cases, [far("mine", pool)], far("helper", pool), tmp_path / "away")
    assert away.cases == home.cases
    assert away.exit_code == home.exit_code == 0


@pytest.mark.parametrize("losses", range(ATTEMPTS))
def test_what_a_lost_worker_had_is_done_by_another(losses: int, there: dict[str, Renderer]) -> None:
    one = far("mine", Flaky(losses))
    assert np.isfinite(one.render(SCENE, SETTINGS).pixels).all()
    assert one.retried == losses


def test_retries_are_counted_in_the_summary(there: dict[str, Renderer], tmp_path: Path) -> None:
    summary = run(
        prepared("snell"), [far("mine", Flaky(3))], far("helper", Flaky(2)), tmp_path
    )  # fmt: skip
    assert summary.effort.retried == 5
    assert summary.exit_code == 0


def test_a_job_that_kills_every_worker_is_a_failure(there: dict[str, Renderer]) -> None:
    one = far("mine")
    one.version()
    one._executor = Flaky(ATTEMPTS)
    with pytest.raises(RendererFailed, match="4 workers died over it"):
        one.render(SCENE, SETTINGS)
    assert np.isfinite(one.render(SCENE, SETTINGS).pixels).all()


@pytest.mark.parametrize(
    "error", [RendererFailed("boom", log="line"), RendererUnsupported("no prisms")]
)
def test_a_failure_over_there_is_told_here(error: Exception, there: dict[str, Renderer]) -> None:
    there["mine"] = FakeRenderer("mine", error=error)
    with pytest.raises(type(error), match=str(error)):
        far("mine").render(SCENE, SETTINGS)


def test_what_is_missing_over_there_is_a_skip(there: dict[str, Renderer], tmp_path: Path) -> None:
    summary = run(prepared("snell"), [far("absent")], far("helper"), tmp_path)
    assert {check.status for check in checks_of(summary)} == {Verdict.SKIP}
    assert "no absent here" in summary.renderers["absent"].reason


def test_machines_that_differ_are_not_mixed(there: dict[str, Renderer]) -> None:
    one = far("mine")
    one.version()
    there["mine"] = Remembered("mine", print_="2")
    remote._made.cache_clear()
    remote._about.cache_clear()
    with pytest.raises(RendererFailed, match="machines differ: mine"):
        one.render(SCENE, SETTINGS)


def test_bytes_that_are_no_parcel_are_an_answer_all_the_same() -> None:
    for request in (b"", b"nonsense", Entry("parcel", {"op": "job"}, {}).encode()):
        answered = remote.decode(remote.answer(request), "parcel")
        assert answered.meta["kind"] == "failed"
        assert answered.meta["about"] == {}


def test_a_renderer_that_traces_when_asked_for_an_image(there: dict[str, Renderer]) -> None:
    class Confused(Remembered):
        def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
            n = scene.film.width * scene.film.height
            nothing = np.zeros((n, 3))
            return RayPaths(  # type: ignore[return-value]
                np.zeros(n, np.int8), np.zeros(n, np.int32), nothing, nothing,
                np.zeros(n), np.zeros(n),
            )  # fmt: skip

    there["mine"] = Confused("mine")
    with pytest.raises(RendererFailed):
        far("mine").render(SCENE, SETTINGS)


def test_when_all_machines_are_gone_the_run_ends_with_one_message(
    there: dict[str, Renderer], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(remote, "POLL_S", 0.01)
    with pytest.raises(ConnectionLost, match="lost the machines that mine ran on"):
        run(
            prepared("snell"), [far("mine", Silent(), gone=lambda: True)], student(name="helper"),
            tmp_path,
        )  # fmt: skip
    assert not (tmp_path / "summary.json").exists()


class Closed(Executor):
    """As Dask's, whose futures tell a client of being cancelled that is there no more."""

    def submit(self, fn: Callable[..., bytes], /, *args: bytes) -> Future[bytes]:  # type: ignore[override]
        def told(done: Future[bytes]) -> None:
            raise RuntimeError("IOLoop is closed")

        future: Future[bytes] = Future()
        future.add_done_callback(told)
        return future


def test_nothing_is_logged_of_jobs_that_are_given_up(
    there: dict[str, Renderer], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(remote, "POLL_S", 0.01)
    with pytest.raises(ConnectionLost):
        far("mine", Closed(), gone=lambda: True).version()
    assert caplog.records == []


def test_a_time_out_of_the_future_itself_is_not_waited_for(there: dict[str, Renderer]) -> None:
    class Late(Executor):
        def submit(self, fn: Callable[..., bytes], /, *args: bytes) -> Future[bytes]:  # type: ignore[override]
            future: Future[bytes] = Future()
            future.set_exception(concurrent.futures.CancelledError())
            return future

    with pytest.raises(concurrent.futures.CancelledError):
        far("mine", Late()).version()


@pytest.mark.parametrize("text", ["", "local", "local:0", "local:x", "http://a", "tcp://", "a:1"])
def test_what_is_no_cluster(text: str) -> None:
    from harness.running.cluster import connected

    with pytest.raises(InputError, match="no cluster"), connected(text):
        pass
