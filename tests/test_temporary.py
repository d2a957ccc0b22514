"""Nothing that a killed process has left behind outlives the start of the next one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from harness import temporary

ROOT = Path(__file__).resolve().parents[1]
# Makes a folder with a file in it, starts a program as renderers are started, and waits.
OWNER = """
import os, subprocess, sys, time
from harness.temporary import TOKEN, make_folder, new_token
folder = make_folder()
(folder / "image").write_bytes(b"half")
orphan = subprocess.Popen(["sleep", "600"], env={**os.environ, TOKEN: new_token()},
                          start_new_session=True, stdout=subprocess.DEVNULL)
print(folder, orphan.pid, flush=True)
sys.stdin.read()
"""


class Owner:
    """A process with a room."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", OWNER], cwd=ROOT, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        assert self.process.stdout is not None
        folder, pid = self.process.stdout.readline().split()
        self.folder, self.orphan = Path(folder), psutil.Process(int(pid))

    def end(self, number: int) -> None:
        self.process.send_signal(number)
        self.process.communicate()

    def has_orphan(self) -> bool:
        deadline = time.monotonic() + 5
        while self.orphan.is_running() and self.orphan.status() != psutil.STATUS_ZOMBIE:
            if time.monotonic() > deadline:
                return True
            time.sleep(0.01)
        return False


@pytest.fixture
def tmpdir_(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


@pytest.fixture
def owner(tmpdir_: Path) -> Iterator[Owner]:
    found = Owner()
    assert found.folder.is_relative_to(tmpdir_)
    yield found
    if found.process.poll() is None:
        found.end(signal.SIGKILL)
    if found.orphan.is_running():
        found.orphan.kill()


def test_what_a_killed_process_left_is_removed_and_its_programs_are_ended(owner: Owner) -> None:
    owner.end(signal.SIGKILL)
    assert (owner.folder / "image").exists()
    temporary.clear_abandoned()
    assert not owner.folder.parent.exists()
    assert not owner.has_orphan()


def test_what_a_living_process_has_stays(owner: Owner) -> None:
    temporary.clear_abandoned()
    assert (owner.folder / "image").exists()
    assert owner.orphan.is_running()


def test_who_ends_tidies_up(owner: Owner) -> None:
    owner.process.communicate("")
    assert not owner.folder.parent.exists()


def test_a_new_process_clears_before_it_begins(owner: Owner, tmpdir_: Path) -> None:
    owner.end(signal.SIGKILL)
    later = Owner()
    try:
        assert [path.name for path in tmpdir_.iterdir()] == [later.folder.parent.name]
    finally:
        later.orphan.kill()
        later.end(signal.SIGKILL)


def test_nothing_of_others_is_touched(
    owner: Owner, tmpdir_: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    owner.end(signal.SIGKILL)
    elsewhere = tmpdir_ / "elsewhere"
    (elsewhere / "kept").mkdir(parents=True)
    (tmpdir_ / "snellcheck-main").mkdir()
    (tmpdir_ / f"{temporary.PREFIX}notes").mkdir()
    (tmpdir_ / f"{temporary.PREFIX}12345678").symlink_to(elsewhere)
    with monkeypatch.context() as patch:
        patch.setattr(os, "geteuid", lambda: owner.folder.stat().st_uid + 1)
        temporary.clear_abandoned()
    assert (owner.folder / "image").exists()
    temporary.clear_abandoned()
    assert sorted(path.name for path in tmpdir_.iterdir()) == [
        "elsewhere", "snellcheck-main", f"{temporary.PREFIX}12345678", f"{temporary.PREFIX}notes",
    ]  # fmt: skip
    assert (elsewhere / "kept").is_dir()


def test_a_fork_has_a_room_of_its_own(tmpdir_: Path) -> None:
    code = (
        "import os\n"
        "from harness.temporary import make_folder\n"
        "mine = make_folder()\n"
        "if os.fork() == 0:\n"
        "    theirs = make_folder()\n"
        "    assert theirs.parent != mine.parent\n"
        "    raise SystemExit\n"
        "assert os.waitstatus_to_exitcode(os.wait()[1]) == 0\n"
        "assert mine.is_dir()\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
    assert list(tmpdir_.iterdir()) == []
