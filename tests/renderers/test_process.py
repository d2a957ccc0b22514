"""Programs end within their limits, whatever they do, and take nothing else with them."""

from __future__ import annotations

import errno
import io
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import psutil
import pytest
from rich.console import Console

from harness import show
from harness.errors import RendererFailed, RendererMissing
from harness.renderers.command import CommandRenderer, Template
from harness.renderers.confinement import Confinement
from harness.renderers.process import Finished, run_limited, tail
from harness.renderers.process_tree import Running, belong_to, spawn
from tests.harness.tiny import run_tiny

MISBEHAVE = Path(__file__).parents[1] / "fakes" / "misbehave.py"


def run(mode: str, folder: Path, **limits: float) -> Finished:
    scene = folder / "scene.json"
    scene.write_text(json.dumps({"film": {"width": 8, "height": 6}}))
    settings = {"timeout_s": 20.0, "memory_mb": 512, "output_mb": 16} | limits
    argv = [sys.executable, str(MISBEHAVE), mode, str(scene), str(folder / "image.npy")]
    return run_limited(argv, cwd=folder, **settings)  # type: ignore[arg-type]


def python(code: str, folder: Path, stdin: bytes | None = None) -> Finished:
    argv = [sys.executable, "-c", code]
    return run_limited(argv, cwd=folder, timeout_s=20, memory_mb=512, stdin=stdin)


def test_output_exit_code_and_times(tmp_path: Path) -> None:
    code = "import sys; sys.stderr.write('to err'); print('to out'); sys.exit(7)"
    done = python(code, tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (7, "to out\n", "to err")
    assert done.wall_s > 0
    assert done.cpu_s > 0


@pytest.mark.skipif(sys.platform != "linux", reason="processor time is limited on Linux alone")
def test_threads_that_burn_processor_time_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A limit beside that of wall time, for what more threads than cores may take in it.

    With a tenth of a core it is 2 s for 20 s of wall time, and two threads are there in one or two.
    """
    monkeypatch.setattr(os, "cpu_count", lambda: 0.1)
    code = (
        "import hashlib, threading\n"
        "data = bytes(2**26)\n"  # hashed without the interpreter's lock
        "def burn():\n"
        "    while True: hashlib.sha256(data)\n"
        "for _ in range(2): threading.Thread(target=burn).start()\n"
    )
    with pytest.raises(RendererFailed, match="used more than 2 s of processor time"):
        run_limited([sys.executable, "-c", code], cwd=tmp_path, timeout_s=20, memory_mb=512)


def test_stdin_larger_than_a_pipe_arrives_whole(tmp_path: Path) -> None:
    code = "import sys; data = sys.stdin.buffer.read(); print(len(data), data[-1])"
    assert python(code, tmp_path, bytes(3_000_000) + b"\x07").stdout == "3000001 7\n"


def test_a_program_that_does_not_read_its_stdin(tmp_path: Path) -> None:
    assert python("print('bye')", tmp_path, bytes(3_000_000)).stdout == "bye\n"


def test_no_shell(tmp_path: Path) -> None:
    argv = [sys.executable, "-c", "import sys; print(sys.argv[1:])", "$(touch gone); `id`", "*"]
    done = run_limited(argv, cwd=tmp_path, timeout_s=20, memory_mb=512)
    assert done.stdout == "['$(touch gone); `id`', '*']\n"


def test_environment_is_replaced(tmp_path: Path) -> None:
    argv = [sys.executable, "-c", "import os; print(os.environ.get('HOME'), os.environ['A'])"]
    done = run_limited(argv, cwd=tmp_path, timeout_s=20, memory_mb=512, env={"A": "b"})
    assert done.stdout == "None b\n"


@pytest.mark.parametrize("program", ["snellcheck-no-such-program", "./none", "/"])
def test_missing(program: str, tmp_path: Path) -> None:
    with pytest.raises(RendererMissing, match=program):
        run_limited([program], cwd=tmp_path, timeout_s=20, memory_mb=512)


def test_a_file_that_is_no_program(tmp_path: Path) -> None:
    (tmp_path / "data").write_bytes(b"\x00\x01\x02")
    (tmp_path / "data").chmod(0o755)
    with pytest.raises(RendererFailed, match=r"cannot start '\./data'"):
        run_limited(["./data"], cwd=tmp_path, timeout_s=20, memory_mb=512)


@pytest.fixture
def crowded(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[int]]:
    """Makes the next attempts to start something fail with these numbers; returns those left."""
    started = subprocess.Popen

    def crowd(*numbers: int) -> list[int]:
        left = list(numbers)

        def start(*arguments: Any, **more: Any) -> Any:
            if left:
                raise OSError(left[0], os.strerror(left.pop(0)))
            return started(*arguments, **more)

        monkeypatch.setattr("harness.renderers.process_tree.subprocess.Popen", start)
        return left

    monkeypatch.setattr("harness.renderers.process_tree.PAUSES_S", (0.001, 0.001, 0.001))
    return crowd


@pytest.mark.parametrize("confined", [None, Confinement()])
def test_no_room_for_a_process_is_tried_again_and_counted(
    confined: Confinement | None, crowded: Callable[..., list[int]], tmp_path: Path
) -> None:
    running = Running()
    crowded(errno.EAGAIN, errno.ENOMEM, errno.ETXTBSY)

    def attempt() -> Finished:
        belong_to(running)
        argv = [sys.executable, "-c", "print('well')"]
        return run_limited(argv, cwd=tmp_path, timeout_s=20, memory_mb=512, confinement=confined)

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(attempt).result().stdout == "well\n"
    assert running.retried == 3


def test_what_was_tried_again_is_told_at_the_end_of_a_run(
    crowded: Callable[..., list[int]], tmp_path: Path
) -> None:
    template = Template((sys.executable, str(MISBEHAVE), "good", "{scene}", "{output}"))
    outside = CommandRenderer("odd", template, tmp_path, image_format="npy")
    crowded(errno.EAGAIN, errno.EAGAIN)
    summary = run_tiny(tmp_path, outside, cases=["snell"])
    assert summary.effort.retried == 2
    console = Console(file=io.StringIO(), width=200)
    show._effort(summary, console)
    assert ", 2 tried again, " in console.file.getvalue()  # type: ignore[attr-defined]


def test_what_does_not_pass_ends_as_an_error(
    crowded: Callable[..., list[int]], tmp_path: Path
) -> None:
    left = crowded(*[errno.EAGAIN] * 5)
    with pytest.raises(RendererFailed, match=r"cannot start.*temporarily unavailable"):
        python("", tmp_path)
    assert len(left) == 1  # four attempts


def test_a_fault_of_the_program_is_not_tried_again(
    crowded: Callable[..., list[int]], tmp_path: Path
) -> None:
    left = crowded(errno.ENOEXEC, errno.ENOEXEC)
    with pytest.raises(RendererFailed, match="Exec format error"):
        python("", tmp_path)
    assert len(left) == 1


def test_missing_folder_is_not_a_missing_program(tmp_path: Path) -> None:
    with pytest.raises(RendererFailed, match="no folder"):
        run_limited([sys.executable], cwd=tmp_path / "no", timeout_s=20, memory_mb=512)


def test_abort_tells_the_signal_and_the_log(tmp_path: Path) -> None:
    with pytest.raises(RendererFailed, match="SIGABRT") as caught:
        run("abort", tmp_path)
    assert "Cannot select: fminimum" in caught.value.log


def test_crash_is_the_callers_to_judge(tmp_path: Path) -> None:
    done = run("crash", tmp_path)
    assert done.returncode == 3
    assert "very wrong" in done.stderr


def test_hang_ends_at_its_time(tmp_path: Path) -> None:
    started = time.monotonic()
    with pytest.raises(RendererFailed, match="not done after 1 s") as caught:
        run("hang", tmp_path, timeout_s=1)
    assert time.monotonic() - started < 3  # a limit holds within 2 s
    assert caught.value.log == "thinking"
    assert remaining(tmp_path) == []


@pytest.mark.parametrize("mode", ["leak", "leak-in-child"])
def test_leak(mode: str, tmp_path: Path) -> None:
    with pytest.raises(RendererFailed, match="more than 200 MB of memory"):
        run(mode, tmp_path, memory_mb=200)
    assert remaining(tmp_path) == []


def test_children_left_behind_end_too(tmp_path: Path) -> None:
    run("fork", tmp_path)
    for pid in json.loads((tmp_path / "left.json").read_text()):
        assert not psutil.pid_exists(pid) or is_zombie(pid)


def test_flood_of_output(tmp_path: Path) -> None:
    with pytest.raises(RendererFailed, match="too much to stdout") as caught:
        run("flood", tmp_path)
    assert len(caught.value.log) < 5000


@pytest.mark.skipif(sys.platform != "linux", reason="file size limits are set on Linux only")
def test_flood_of_a_file(tmp_path: Path) -> None:
    with pytest.raises(RendererFailed, match="wrote a file larger than 16 MB"):
        run("flood-file", tmp_path)
    assert (tmp_path / "image.npy").stat().st_size <= 16 * 2**20


def test_others_are_left_alone(tmp_path: Path) -> None:
    bystander = psutil.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    try:
        with pytest.raises(RendererFailed):
            run("hang", tmp_path, timeout_s=0.5)
        assert bystander.poll() is None
    finally:
        bystander.kill()
        bystander.wait()


def test_an_environment_is_read_once_for_all_who_watch(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    read: list[int] = []
    environ = psutil.Process.environ

    def counted(process: psutil.Process) -> dict[str, str]:
        read.append(process.pid)
        return environ(process)

    monkeypatch.setattr(psutil.Process, "environ", counted)
    pipe, sleep = subprocess.PIPE, [sys.executable, "-c", "import time; time.sleep(60)"]
    trees = [
        spawn(sleep, cwd=tmp_path, env=None, stdin=pipe, stdout=pipe, stderr=pipe, output_mb=1)
        for _ in range(2)
    ]
    stranger = subprocess.Popen(sleep)
    try:
        for tree in trees * 2:
            assert tree.resident_mb() > 0
        assert read.count(stranger.pid) == 1
    finally:
        stranger.kill()
        stranger.wait()
        for tree in trees:
            tree.kill()
            tree.process.communicate()


def test_tail_starts_with_a_line() -> None:
    assert tail(" short \n") == "short"
    assert tail("a" * 20 + "\nlast line\n", 15) == "… last line"
    assert tail("a" * 20, 15) == "… " + "a" * 15


def is_zombie(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def remaining(folder: Path) -> list[int]:
    """Live processes that were started for `folder`."""
    return [
        process.pid
        for process in psutil.process_iter(["cmdline"])
        if any(str(folder) in part for part in process.info["cmdline"] or [])
        and not is_zombie(process.pid)
    ]


def test_too_many_processes(tmp_path: Path) -> None:
    with pytest.raises(RendererFailed, match="started more than 256 processes"):
        run("fork-bomb", tmp_path, memory_mb=1_000_000)


def test_many_files_that_are_small_enough_each(tmp_path: Path) -> None:
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps({"film": {"width": 8, "height": 6}}))
    argv = [sys.executable, str(MISBEHAVE), "many-files", str(scene), str(tmp_path / "image.npy")]
    with pytest.raises(RendererFailed, match="wrote more than 16 MB of files"):
        run_limited(
            argv, cwd=tmp_path, timeout_s=20, memory_mb=512, output_mb=16, private=tmp_path
        )  # fmt: skip
