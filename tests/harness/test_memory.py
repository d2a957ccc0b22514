"""The most memory that a run takes at a time."""

from __future__ import annotations

import subprocess
import sys
import threading

import psutil
import pytest

from harness.running import memory
from harness.running.memory import Look, memory_mb, watched

HOLD = "import sys; held = bytearray(b'x') * (100 * 2**20); print(); sys.stdin.read()"


def test_the_largest_look_counts() -> None:
    looks, third = iter([3.0, 8.0]), threading.Event()
    told: list[float] = []

    def look(seen: float) -> float:
        told.append(seen)
        found = next(looks, None)
        if found is None:
            third.set()
        return found or 1.0

    with watched(look, period_s=0.001) as peak:
        assert third.wait(10)
    assert peak.mb == 8.0
    assert told[:3] == [0.0, 3.0, 8.0]


def test_a_last_look_is_taken_however_short_the_run_was() -> None:
    looks = []
    with watched(lambda _: looks.append(1) or float(len(looks)), period_s=60) as peak:
        pass
    assert peak.mb == len(looks) == 2


def test_what_children_hold_counts_until_they_end() -> None:
    before = memory_mb()
    with subprocess.Popen(
        [sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdout is not None
        child.stdout.readline()
        during = memory_mb()
    assert during > before + 100
    assert memory_mb() < during - 90


def test_pages_are_not_walked_through_where_all_that_is_resident_is_no_more_than_was_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def walked(_: psutil.Process) -> None:
        raise AssertionError

    monkeypatch.setattr(psutil.Process, "memory_full_info", walked)
    assert memory_mb(seen=1e6) == 1e6
    with pytest.raises(AssertionError):
        memory_mb()


def test_they_are_walked_through_again_once_more_is_resident_than_sharing_explains(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of 400 MiB resident, 100 were counted twice: 350 need no second walk."""
    resident, walks = [400.0], []

    def walk(_: psutil.Process) -> int:
        walks.append(1)
        return int((resident[0] - 100) * 2**20)

    monkeypatch.setattr(psutil.Process, "children", lambda *_, **__: [])
    monkeypatch.setattr(memory, "_resident", lambda _: int(resident[0] * 2**20))
    monkeypatch.setattr(memory, "_proportional", walk)
    look = Look()
    assert look(0.0) == 300
    assert len(walks) == 1
    resident[0] = 350.0
    assert look(300.0) == 300
    assert len(walks) == 1
    resident[0] = 351.0
    assert look(300.0) == 300
    assert len(walks) == 2
    resident[0] = 450.0
    assert look(300.0) == 350
    assert len(walks) == 3
