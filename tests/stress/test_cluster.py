"""A real Dask scheduler with worker processes, some of which are killed."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.harness.tiny import SCENES
from tests.stress.figures import FOLDER, count, note

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
STUDENT = ROOT / "docs" / "bring-your-own-renderer" / "student.py"
CASES = ["snell*", "slab*", "tir*"]
LOGGING = """
import os, runpy, sys
os.environ["OPENBLAS_NUM_THREADS"] = "1"
runpy.run_path({student!r}, run_name="__main__")
os.write(os.open({log!r}, os.O_WRONLY | os.O_APPEND | os.O_CREAT), b"one\\n")
"""


class Dask:
    """A scheduler and its workers, each a process that a test may kill."""

    def __init__(self, folder: Path, workers: int) -> None:
        self.folder = folder
        file = folder / "scheduler.json"
        self.scheduler = self._start(
            "scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)
        )
        while not file.exists() or "}" not in file.read_text():
            assert self.scheduler.poll() is None
            time.sleep(0.02)
        self.address = str(json.loads(file.read_text())["address"])
        self.workers = [self.add() for _ in range(workers)]

    def add(self) -> subprocess.Popen[bytes]:
        return self._start(
            "worker", self.address, "--no-nanny", "--no-dashboard", "--nthreads", "1",
            "--local-directory", str(self.folder),
        )  # fmt: skip

    def _start(self, what: str, *arguments: str) -> subprocess.Popen[bytes]:
        code = f"from distributed.cli.dask_{what} import main; main()"
        with (self.folder / f"{what}.log").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-c", code, *arguments], cwd=ROOT, stdout=log, stderr=log
            )

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            if process.poll() is None:
                os.kill(process.pid, signal.SIGKILL)
            process.wait()


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[Dask]:
    made = Dask(tmp_path, 2)
    yield made
    made.close()


class Run:
    """`snellcheck run` in a process of its own, with a student that logs what it has done."""

    def __init__(self, folder: Path, name: str) -> None:
        self.out, self.log = folder / name, folder / f"{name}.log"
        script = folder / f"student-{name}.py"
        script.write_text(LOGGING.format(student=str(STUDENT), log=str(self.log)))
        self.log.touch()  # confined, it may write to this and its image
        self.config = folder / f"student-{name}.toml"
        self.config.write_text(
            f'[renderer]\nname = "student-{name}"\nformat = "npy"\nwritable = ["{self.log.name}"]\n'
            f'command = "{{python}} {script.name} {{scene}} {{output}}"\n'
        )

    def start(self, *more: str) -> subprocess.Popen[str]:
        code = "from harness.cli import main; main()"
        arguments = [
            "run", *CASES, "-r", "tracer", "--renderer-config", str(self.config), "--scenes",
            str(SCENES), "--out", str(self.out), "--no-cache", "--no-stored", *more,
        ]  # fmt: skip
        return subprocess.Popen(
            [sys.executable, "-c", code, *arguments],
            cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip

    def images(self) -> int:
        return len(self.log.read_text().splitlines())

    def wait_for(self, images: int, process: subprocess.Popen[str]) -> None:
        while self.images() < images and process.poll() is None:
            time.sleep(0.01)

    def verdicts(self) -> dict[str, list[tuple[str, str, float]]]:
        cases = json.loads((self.out / "summary.json").read_text())["cases"]
        return {
            case["id"]: [
                (re.sub(r"student-\w+", "student", c["id"]), c["status"], c["value"])
                for c in case["checks"]
            ]
            for case in cases
        }


@pytest.mark.skipif(not FOLDER, reason="half a minute; make stress does it")
def test_a_cluster_says_what_this_machine_says(dask: Dask, tmp_path: Path) -> None:
    here, there = Run(tmp_path, "here"), Run(tmp_path, "there")
    process = here.start()
    said, _ = process.communicate()
    assert process.returncode == 0, said
    process = there.start("--cluster", dask.address)
    said, _ = process.communicate()
    assert process.returncode == 0, said
    assert there.verdicts() == here.verdicts()
    assert there.images() == here.images()


def killing(dask: Dask, run: Run, kills: int, kill: Callable[[], None]) -> str:
    """A run on `dask` during which `kill` is called some times; returns what it said."""
    process = run.start("--cluster", dask.address)
    dice = random.Random(kills)
    for k in range(kills):
        run.wait_for(9 + k % 8, process)  # four calibrate, the rest are kept as results
        time.sleep(dice.random() * 0.3)
        if process.poll() is None:
            kill()
    said, _ = process.communicate(timeout=400)
    return f"exit code {process.returncode}\n{said}"


def test_killed_workers_lose_nothing(dask: Dask, tmp_path: Path) -> None:
    kills = count(1, 12)

    def kill() -> None:
        victim = dask.workers.pop(0)
        os.kill(victim.pid, signal.SIGKILL)
        victim.wait()
        dask.workers.append(dask.add())

    run = Run(tmp_path, "run")
    said = killing(dask, run, kills, kill)
    assert said.startswith("exit code 0"), said
    assert {status for checks in run.verdicts().values() for _, status, _ in checks} == {"pass"}
    note(
        "Cluster", "kill -9 of a worker in the middle of a run", kills,
        "all checks passed as without; what the worker had under way was done by another",
    )  # fmt: skip


def test_without_a_scheduler_the_run_ends_and_goes_on_later(dask: Dask, tmp_path: Path) -> None:
    run = Run(tmp_path, "run")
    said = killing(dask, run, 1, lambda: os.kill(dask.scheduler.pid, signal.SIGKILL))
    assert said.startswith("exit code 3"), said
    assert "lost the machines" in said
    assert "Traceback" not in said
    done = run.images()
    process = run.start()
    said, _ = process.communicate()
    assert process.returncode == 0, said
    assert re.search(r"[1-9]\d* reused", said), said
    assert run.images() - done < 30
    note(
        "Cluster", "kill -9 of the scheduler in the middle of a run", 1,
        "one message and exit code 3; the same command without a cluster went on and passed",
    )  # fmt: skip


def test_nobody_answers(tmp_path: Path) -> None:
    process = Run(tmp_path, "run").start("--cluster", "tcp://127.0.0.1:9")
    said, _ = process.communicate()
    assert process.returncode == 3
    assert "no scheduler answers at tcp://127.0.0.1:9" in said
    assert "Traceback" not in said
