"""A renderer that does wrong in one case: that is an ERROR which says so, and all else stands."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from harness.errors import RendererFailed
from harness.record import Check, Verdict
from harness.renderers import landlock, seccomp
from harness.renderers.base import Image, Renderer, RenderSettings
from harness.renderers.command import CommandRenderer, Template
from harness.renderers.persistent import Program, WorkerRenderer
from harness.run import run
from harness.scene.resolved import ResolvedScene
from tests.fakes import MISBEHAVE, FakeRenderer
from tests.fakes.student import CAPABILITIES, student
from tests.harness.tiny import checks_of, prepared
from tests.stress.figures import note

TIMEOUT_S, MEMORY_MB = 2.0, 200
LATE_S = 2.0  # by how much a limit may be passed
PATIENCE_S = 60.0  # where another limit is to be met first, however busy the machine

ONE_SHOT = {
    "crash": "ended with exit code 3",
    "abort": "ended by signal SIGABRT",
    "hang": "not done after 2 s",
    "leak": "used more than 200 MB",
    "leak-in-child": "used more than 200 MB",
    "flood": "wrote too much to stdout and stderr",
    "flood-file": "512 MB",  # by the system, or by our own look at the folder, which may be first
    "fork-bomb": "used more than 200 MB",
    "many-files": "wrote more than",
    "truncated": "the image is truncated",
    "huge": "wrong image size; got 1000000 x 1000000",
    "wrong-size": "wrong image size; got 17 x 2",
    "nan": "wrote NaN or infinity in 1 pixels",
    "wrong-type": "wrong type of values; got object",
    "text": "not an image",
    "pipe": "something else than a file",
    "link": "something else than a file",
    "none": "wrote no image",
}
# What only some systems can refuse, and what it takes.
REFUSED = {
    "write-outside": landlock.version() > 0,
    "connect": seccomp.available(),
    "signal-parent": landlock.version() >= landlock.SINCE_SCOPES,
}
ONE_SHOT |= dict.fromkeys(REFUSED, "writes to its private folder alone and uses no network")
PERSISTENT = {
    "crash": "ended with exit code 3",
    "abort": "SIGABRT",
    "hang": "did not answer within 2 s",
    "leak": "used more than 200 MB",
    "leak-in-child": "used more than 200 MB",
    "flood": "answered 'All work",
    "flood-file": "512 MB",
    "fork-bomb": "used more than 200 MB",
    "many-files": "wrote more than",
    "truncated": "the image is truncated",
    "huge": "wrong image size; got 1000000 x 1000000",
    "wrong-size": "wrong image size; got 17 x 2",
    "nan": "wrote NaN or infinity in 1 pixels",
    "wrong-type": "wrong type of values; got object",
    "text": "not an image",
    "pipe": "something else than a file",
    "link": "something else than a file",
    "none": "answered 'done",
    "babble": "answered 'Rendering, 10%",
    "other-id": "answered request",
}
PERSISTENT |= dict.fromkeys(REFUSED, "writes to its private folder alone and uses no network")


def one_shot(mode: str) -> Renderer:
    template = Template((sys.executable, str(MISBEHAVE), mode, "{scene}", "{output}"))
    return CommandRenderer("odd", template, Path.cwd(), image_format="npy")


def persistent(mode: str) -> Renderer:
    program = Program((sys.executable, str(MISBEHAVE), "--persistent", mode))
    return WorkerRenderer("odd", program, capabilities=CAPABILITIES)


class Odd(FakeRenderer):
    """The student, but for one case that it gives to a program that does wrong."""

    def __init__(self, outside: Renderer) -> None:
        right = student()
        super().__init__(
            "odd", lambda scene: right.render(scene, RenderSettings()).pixels,
            capabilities=CAPABILITIES,
        )  # fmt: skip
        self.outside = outside
        self.slowest = 0.0

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        if not (scene.solids and scene.film.height == 2):
            return super().render(scene, settings)
        started = time.monotonic()
        try:
            return self.outside.render(scene, settings)
        finally:
            self.slowest = max(self.slowest, time.monotonic() - started)

    def close(self) -> None:
        close: Callable[[], None] = getattr(self.outside, "close", lambda: None)
        close()


@pytest.mark.parametrize(
    ("way", "mode"),
    [*((one_shot, mode) for mode in ONE_SHOT), *((persistent, mode) for mode in PERSISTENT)],
)
def test_one_fault_costs_one_result(
    way: Callable[[str], Renderer], mode: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not REFUSED.get(mode, True):
        pytest.skip("this system cannot refuse it")
    monkeypatch.setenv("MISBEHAVE_OUTSIDE", str(tmp_path / "escaped"))
    odd, right = Odd(way(mode)), student(name="right")
    cases = prepared("snell", "slab")
    timeout_s = TIMEOUT_S if mode == "hang" else PATIENCE_S
    summary = run(
        cases, [odd, right], student(name="helper"), tmp_path,
        timeout_s=timeout_s, memory_mb=MEMORY_MB,
    )  # fmt: skip
    expected = (ONE_SHOT if way is one_shot else PERSISTENT)[mode]
    (failed,) = [c for c in checks_of(summary, "odd") if c.status is not Verdict.PASS]
    assert failed.status is Verdict.ERROR
    assert expected in failed.reason
    assert case_of(failed, summary.cases) == "snell-sweep"
    assert {c.status for c in checks_of(summary, "right")} == {Verdict.PASS}
    assert summary.exit_code == 3
    assert not list(tmp_path.rglob("unpickled"))
    assert not (tmp_path / "escaped").exists()
    assert odd.slowest < timeout_s + LATE_S
    kind = "run for each image" if way is one_shot else "kept alive"
    outcome = f"ERROR “{expected}”, all other results stand; the slowest took {odd.slowest:.2f} s"
    note(f"A program {kind}", mode, 1, outcome)


def case_of(check: Check, cases) -> str:  # type: ignore[no-untyped-def]
    return str(next(case.id for case in cases if check in case.checks))


def test_what_is_said_of_a_failure_reaches_the_record(tmp_path: Path) -> None:
    summary = run(
        prepared("snell"), [Odd(one_shot("crash"))], student(name="helper"), tmp_path
    )  # fmt: skip
    (path,) = (tmp_path / "records").glob("*.json")
    assert "something is very wrong" in path.read_text()
    assert summary.exit_code == 3


def test_a_good_program_is_no_fault() -> None:
    """Or everything above would pass with a renderer that never works."""
    for way in (one_shot, persistent):
        renderer = way("good")
        scene = prepared("snell")[0].scene
        assert renderer.render(scene, RenderSettings()).pixels[0, 0, 0] == 0.25
        with pytest.raises(RendererFailed):
            way("crash").render(scene, RenderSettings())
