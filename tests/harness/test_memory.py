"""The most memory that a run takes at a time."""

from __future__ import annotations

import subprocess
import sys
import threading

import psutil
import pytest

from harness.running import memory
from harness.running.memory import Look, watched

HOLD = "import sys; held = bytearray(b'x') * (100 * 2**20); print(flush=True); sys.stdin.read()"


def test_the_largest_look_counts() -> None:
    looks, third = iter([3.0, 8.0]), threading.Event()

    def look() -> float:
        found = next(looks, None)
        if found is None:
            third.set()
        return found or 1.0

    with watched(look, period_s=0.001) as peak:
        assert third.wait(10)
    assert peak.mb == 8.0


def test_a_last_look_is_taken_however_short_the_run_was() -> None:
    looks = []
    with watched(lambda: looks.append(1) or float(len(looks)), period_s=60) as peak:
        pass
    assert peak.mb == len(looks) == 2


def test_what_children_hold_counts_until_they_end() -> None:
    look = Look()
    before = look()
    with subprocess.Popen(
        [sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdout is not None
        child.stdout.readline()
        during = look()
    assert during > before + 100
    assert look() < during - 90


def test_pages_are_walked_through_again_where_more_or_less_is_resident(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of 400 MiB resident, others count 100: of 403 as many, of 405 that is not known."""
    resident, walks = [400.0], []

    def walk(_: psutil.Process, resident: int) -> int:
        walks.append(1)
        return resident - 100 * 2**20

    monkeypatch.setattr(psutil.Process, "children", lambda *_, **__: [])
    monkeypatch.setattr(memory, "_resident", lambda _: int(resident[0] * 2**20))
    monkeypatch.setattr(memory, "_walked", walk)
    look = Look()
    for megabytes, walked in [(400.0, 1), (403.0, 1), (405.0, 2), (403.0, 2), (300.0, 3)]:
        resident[0] = megabytes
        assert look() == pytest.approx(megabytes - 100)
        assert len(walks) == walked


def test_a_copy_of_ours_that_is_about_to_be_another_program_does_not_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Between fork and exec a child has our command; who still has it later is no such child."""
    look = Look()
    before = look()
    monkeypatch.setattr(memory, "_command", lambda _: ["ours"])
    with subprocess.Popen(
        [sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdout is not None
        child.stdout.readline()
        assert look() < before + 50
        assert look() > before + 100


def test_what_nobody_may_look_into_counts_as_resident(monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(_: psutil.Process) -> None:
        raise psutil.AccessDenied

    monkeypatch.setattr(psutil.Process, "memory_full_info", denied)
    monkeypatch.setattr(psutil.Process, "children", lambda *_, **__: [])
    assert Look()() == pytest.approx(psutil.Process().memory_info().rss / 2**20, rel=0.05)
