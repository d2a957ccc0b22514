"""Workers answer, and when they die, hang or babble, that costs one request and no more."""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest

from harness.errors import RendererError, RendererFailed, RendererMissing, RendererUnsupported
from harness.renderers.base import Capability, Rays, RayTracingRenderer, Renderer, RenderSettings
from harness.renderers.persistent import Program, WorkerRenderer
from harness.renderers.proof import proof_scene
from harness.scene import resolved
from tests.fakes import MISBEHAVE

ALL = frozenset(Capability)
SCENE = proof_scene(ALL)
SEED_1 = RenderSettings(seed=100)


@pytest.fixture
def make() -> Iterator[object]:
    """Makes renderers, and closes them at the end."""
    made: list[WorkerRenderer] = []

    def make(engine: str | Program, **more: object) -> WorkerRenderer:
        if isinstance(engine, str):
            engine = f"tests.fakes.engine:{engine}"
        made.append(WorkerRenderer("fake", engine, **more))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for renderer in made:
        renderer.close()


@pytest.fixture(scope="module")
def bystander() -> Iterator[WorkerRenderer]:
    """A worker that nothing may happen to."""
    renderer = WorkerRenderer("bystander", "tests.fakes.engine:Plain")
    renderer.version()
    yield renderer
    renderer.close()


def misbehave(mode: str) -> Program:
    return Program((sys.executable, str(MISBEHAVE), "--persistent", mode))


def pid(renderer: WorkerRenderer) -> int:
    assert renderer._child is not None
    return renderer._child._tree.process.pid


# --- what works -----------------------------------------------------------------------------------


def test_is_a_renderer(make) -> None:
    renderer = make("Plain")
    assert renderer.name == "fake"
    assert renderer._child is None  # started lazily
    assert isinstance(renderer, Renderer)
    assert isinstance(renderer, RayTracingRenderer)
    assert renderer.version() == "1.2.3"
    assert renderer.capabilities == {"image", "sphere", "fresnel"}


def test_one_worker_serves_many_requests(make) -> None:
    renderer = make("Plain")
    first, second = (renderer.render(SCENE, RenderSettings()) for _ in range(2))
    assert first.pixels[0, 0, 0] == second.pixels[0, 0, 0] == pid(renderer) != os.getpid()
    assert renderer.render(SCENE, SEED_1).pixels.tolist() == np.ones((8, 8, 3)).tolist()
    assert first.seconds > 0


def test_everything_that_an_image_says_arrives(make) -> None:
    image = make("Full").render(SCENE, RenderSettings())
    assert image.pixels[3, 4].tolist() == [0.25, 0.5, 0.75]
    assert np.array_equal(image.variance, image.pixels / np.float32(100))
    assert (image.seconds, image.log, image.command) == (0.125, "fine", "full --go")


def test_rays_arrive_exactly(make) -> None:
    random = np.random.default_rng(1)
    rays = Rays(random.normal(size=(5, 3)), random.normal(size=(5, 3)))
    paths = make("Full").trace(SCENE, rays, "TRT", RenderSettings())
    assert paths.status.tolist() == [0, 1, 1, 1, 1]
    assert paths.status.dtype == np.int8
    assert paths.surface.tolist() == [0, -1, -1, -1, -1]
    assert np.array_equal(paths.point[0], rays.origins[0] + 1)
    assert np.isnan(paths.point[1:]).all()
    assert np.array_equal(paths.direction, rays.directions)
    assert paths.weight.tolist() == [3.0] * 5
    assert paths.optical_length.tolist() == [0, 1, 2, 3, 4]
    assert paths.vertices is not None
    assert np.array_equal(paths.vertices[:, 0], rays.origins)


def test_no_ray_api(make) -> None:
    rays = Rays(np.zeros((1, 3)), np.ones((1, 3)))
    with pytest.raises(RendererUnsupported, match="no ray API"):
        make("Plain").trace(SCENE, rays, "", RenderSettings())


def test_prints_do_not_reach_the_protocol(make) -> None:
    image = make("Chatty").render(SCENE, SEED_1)
    assert image.pixels[0, 0, 0] == 1
    assert set(image.log.splitlines()) == {"from Python", "from C", "from a child"}


def test_the_log_is_that_of_the_request(make) -> None:
    renderer = make("Chatty")
    logs = [renderer.render(SCENE, SEED_1).log for _ in range(2)]
    assert logs[0].count("from C") == logs[1].count("from C") == 1


def test_emit(make, tmp_path: Path) -> None:
    assert make("Full").emit(SCENE, tmp_path / "a").read_text() == "8"
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["scene.txt"]
    file = make("Plain").emit(SCENE, tmp_path / "b")
    assert resolved.ResolvedScene.model_validate_json(file.read_bytes()) == SCENE


def test_unsupported_scenes_are_not_sent(make) -> None:
    renderer = make("Plain", capabilities=frozenset({Capability.FRESNEL}))
    with pytest.raises(RendererUnsupported, match=r"does not claim sphere \(solid 'ball' is a sph"):
        renderer.render(SCENE, RenderSettings())
    assert renderer._child is None


def test_environment_is_asked_for_at_the_start(make) -> None:
    calls = []

    def environment() -> dict[str, str]:
        calls.append(1)
        return {"SNELLCHECK_TEST": "1"}

    renderer = make("Plain", env=environment)
    assert calls == []
    renderer.version()
    assert psutil.Process(pid(renderer)).environ()["SNELLCHECK_TEST"] == "1"
    assert calls == [1]


def test_threads_wait_for_each_other(make) -> None:
    renderer = make("Plain")
    seen: dict[int, float] = {}

    def render(seed: int) -> None:
        image = renderer.render(SCENE, RenderSettings(seed=seed))
        seen[seed] = float(image.pixels[0, 0, 0])

    threads = [threading.Thread(target=render, args=(seed,)) for seed in range(1, 9)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert seen == {seed: np.float32(seed / 100) for seed in range(1, 9)}


# --- what goes wrong ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("seed", "limits", "message", "log"),
    [
        (1, {}, "fake ended by signal SIGABRT", "about to abort"),
        (2, {"timeout_s": 1.0}, "fake did not answer within 1 s", "about to hang"),
        (3, {"memory_mb": 400}, "fake used more than 400 MB of memory", ""),
        (4, {}, "fake ended with exit code 7", ""),
        (5, {}, "ZeroDivisionError: by nothing", "engine.py"),
        (7, {}, "it went wrong", "line 2"),
        (8, {}, "wrong image size; got 1 x 1; expected 8 x 8", ""),
        (9, {}, "NaN or infinity in 1 pixels", ""),
    ],
)
def test_a_fault_costs_one_request(
    seed: int, limits: dict[str, float], message: str, log: str, make
) -> None:
    renderer = make("Faulty")
    with pytest.raises(RendererFailed) as caught:
        renderer.render(SCENE, RenderSettings(seed=seed, **limits))
    assert message in str(caught.value)
    assert log in caught.value.log
    assert renderer.render(SCENE, SEED_1).pixels[0, 0, 0] == 1


def test_unsupported_by_the_engine(make) -> None:
    with pytest.raises(RendererUnsupported, match="no prisms here"):
        make("Faulty").render(SCENE, RenderSettings(seed=6))


def test_killed_between_requests(make) -> None:
    renderer = make("Plain")
    renderer.version()
    psutil.Process(pid(renderer)).kill()
    psutil.Process(pid(renderer)).wait(5)
    assert renderer.render(SCENE, SEED_1).pixels[0, 0, 0] == 1


@pytest.mark.parametrize(
    ("engine", "kind", "message"),
    [
        ("Missing", RendererMissing, "no such engine here; install it with: do this"),
        ("NotInstalled", RendererMissing, "No module named 'snellcheck_no_such_module'; install"),
        ("AbortsAtStart", RendererFailed, "fake ended by signal SIGABRT"),
        ("NoSuchClass", RendererFailed, "AttributeError"),
    ],
)
def test_engines_that_do_not_start(
    engine: str, kind: type[RendererError], message: str, make
) -> None:
    renderer = make(engine, remedy="do this")
    for ask in (renderer.version, lambda: renderer.render(SCENE, RenderSettings())):
        with pytest.raises(kind) as caught:
            ask()
        assert message in str(caught.value)
    assert renderer.capabilities == frozenset()
    assert renderer._child is None
    health = renderer.health()
    assert not health.usable
    assert health.remedy == "do this"


def test_what_mends_it_is_told_once_and_by_who_knows_it(make) -> None:
    def environment() -> dict[str, str]:
        raise RendererMissing("no atoms: do that", log="no atoms", remedy="do that")

    renderer = make("Plain", env=environment, remedy="do this")
    with pytest.raises(RendererMissing) as caught:
        renderer.version()
    assert str(caught.value) == "no atoms: do that"
    health = renderer.health()
    assert (health.detail, health.remedy) == ("no atoms: do that", "do that")


def test_a_program_that_is_not_there(make) -> None:
    with pytest.raises(RendererMissing, match="snellcheck-no-such-program"):
        make(Program(("snellcheck-no-such-program",))).version()


@pytest.mark.parametrize(
    ("mode", "kind", "message"),
    [
        ("refuse", RendererUnsupported, "no prisms"),
        ("babble", RendererFailed, "fake answered 'Rendering, 10%'"),
        ("other-id", RendererFailed, "fake answered request 3 instead of 2"),
        ("crash", RendererFailed, "fake ended with exit code 3"),
        ("flood", RendererFailed, "fake answered 'All work and no play"),
        ("leak-in-child", RendererFailed, "more than 200 MB"),
        ("truncated", RendererFailed, "wrote an unusable image: the image is truncated"),
        ("huge", RendererFailed, "wrote an unusable image: wrong image size"),
        ("wrong-size", RendererFailed, "got 9 x 8; expected 8 x 8"),
        ("wrong-type", RendererFailed, "wrong type of values; got object"),
        ("text", RendererFailed, "not an image"),
        ("pipe", RendererFailed, "something else than a file"),
        ("nan", RendererFailed, "NaN or infinity in 1 pixels"),
        ("none", RendererFailed, "fake answered 'done'"),
    ],
)
def test_outside_workers(
    mode: str, kind: type[RendererError], message: str, make, bystander: WorkerRenderer
) -> None:
    renderer = make(misbehave(mode), capabilities=ALL)
    for _ in range(2):
        with pytest.raises(kind) as caught:
            renderer.render(SCENE, RenderSettings(memory_mb=200, timeout_s=20))
        assert message in str(caught.value)
    assert bystander._child.usable()


def test_a_good_outside_worker_that_leaves_children(make) -> None:
    renderer = make(misbehave("fork"), capabilities=ALL)
    assert renderer.render(SCENE, RenderSettings()).pixels[0, 0, 0] == 0.25
    members = renderer._child._tree
    members._find_members()
    assert len(members._members) == 4
    renderer.close()
    assert not any(is_running(pid) for pid in members._members)


def is_running(number: int) -> bool:
    try:
        return psutil.Process(number).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


# --- its place among other processes --------------------------------------------------------------


def test_close_ends_the_process_and_its_files(make) -> None:
    renderer = make("Plain")
    renderer.version()
    process, private = psutil.Process(pid(renderer)), renderer._child._private
    renderer.close()
    assert not process.is_running()
    assert not private.exists()
    assert renderer.version() == "1.2.3"  # cached
    renderer.render(SCENE, SEED_1)  # starts another


def test_forgotten_renderers_end_their_workers() -> None:
    renderer = WorkerRenderer("fake", "tests.fakes.engine:Plain")
    renderer.version()
    process = psutil.Process(pid(renderer))
    del renderer
    assert not process.is_running()


def _render_in_fork(renderer: WorkerRenderer, results: multiprocessing.Queue) -> None:
    image = renderer.render(SCENE, RenderSettings())
    results.put(int(image.pixels[0, 0, 0]))
    renderer.close()


@pytest.mark.filterwarnings("ignore:This process.*is multi-threaded:DeprecationWarning")
def test_a_fork_has_a_worker_of_its_own(make) -> None:
    renderer = make("Plain")
    mine = int(renderer.render(SCENE, RenderSettings()).pixels[0, 0, 0])
    context = multiprocessing.get_context("fork")
    results = context.Queue()
    fork = context.Process(target=_render_in_fork, args=(renderer, results))
    fork.start()
    theirs = results.get(timeout=60)
    fork.join(60)
    assert theirs != mine
    assert int(renderer.render(SCENE, RenderSettings()).pixels[0, 0, 0]) == mine


@pytest.mark.parametrize("busy", [False, True])
def test_a_worker_does_not_outlive_a_killed_parent(busy: bool, tmp_path: Path) -> None:
    code = f"""
import os, signal, threading, time
from harness.renderers.base import RenderSettings
from harness.renderers.persistent import WorkerRenderer
from harness.renderers.proof import proof_scene
r = WorkerRenderer("fake", "tests.fakes.engine:Faulty")
r.version()
if {busy}:
    hang = RenderSettings(seed=2, timeout_s=600)
    threading.Thread(target=r.render, args=(proof_scene(r.capabilities), hang)).start()
    while not r._child.log():
        time.sleep(0.01)
open({str(tmp_path / "pid")!r}, "w").write(str(r._child._tree.process.pid))
os.kill(os.getpid(), signal.SIGKILL)
"""
    psutil.Popen([sys.executable, "-c", code], cwd=Path(__file__).parents[2]).wait(60)
    worker = int((tmp_path / "pid").read_text())
    deadline = time.monotonic() + 10
    while is_running(worker) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not is_running(worker)


def test_health(make) -> None:
    health = make("Full").health()
    assert (health.usable, health.version, health.detail) == (True, "1.2.3", "well")
    assert (health.path, health.facts) == ("/opt/full", {"variants": "1"})
    unwell = make("Plain").health()  # renders grey of its pid
    assert not unwell.usable
    assert "a test image came out wrong" in unwell.detail
