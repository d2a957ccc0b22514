"""How often it is looked whether a limit was passed."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import cast

import pytest

from harness.renderers import limits
from harness.renderers.limits import FILES_MB_S, LEAST_S, MEMORY_MB_S, MOST_S, Watch
from harness.renderers.process_tree import ProcessTree


class Tree:
    """One process that holds `resident` MB."""

    def __init__(self, resident: float) -> None:
        self.resident = resident

    def resident_mb(self, listed_s: float) -> float:
        self.listed_s = listed_s
        return self.resident

    def more_than(self, most: int) -> bool:
        return most < 1


def looked_at(resident: float, memory_mb: int, output_mb: int, private: Path) -> Watch:
    """A watch that has just looked and found nothing."""
    watch = Watch(cast(ProcessTree, Tree(resident)), memory_mb, output_mb, private)
    watch._next = -math.inf
    assert watch.passed() == ""
    return watch


@pytest.mark.parametrize("memory_mb", [200, 300, 1000, 100_000])
@pytest.mark.parametrize("output_mb", [1, 200, 100_000])
def test_nobody_overshoots_by_more_than_the_least_time_between_two_looks_lets_them(
    memory_mb: int, output_mb: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(time, "monotonic", lambda: 100.0)
    rest_s = looked_at(200, memory_mb, output_mb, tmp_path).rest_s(math.inf)
    assert LEAST_S - 1e-9 < rest_s < MOST_S + 1e-9
    assert 200 + rest_s * MEMORY_MB_S <= memory_mb + LEAST_S * MEMORY_MB_S + 1e-6
    assert rest_s * FILES_MB_S <= output_mb + LEAST_S * FILES_MB_S + 1e-6


def test_who_is_far_from_every_limit_is_left_alone_for_longest(tmp_path: Path) -> None:
    assert looked_at(100, 100_000, 100_000, tmp_path).rest_s(math.inf) > MOST_S - LEAST_S


def test_who_was_not_listed_yet_may_have_filled_memory_since(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(time, "monotonic", lambda: 100.0)
    left_mb = 0.16 * MEMORY_MB_S
    watch = looked_at(200, 200 + int(left_mb), 100_000, tmp_path)
    tree = cast(Tree, watch.tree)
    for _ in range(3):
        rest_s = watch.rest_s(math.inf)
        assert rest_s > LEAST_S - 1e-9
        assert (rest_s - LEAST_S + tree.listed_s) * MEMORY_MB_S <= left_mb + 1e-6
        watch._next = -math.inf
        assert watch.passed() == ""
        assert abs(tree.listed_s - rest_s / 2) < 1e-9


def test_nobody_rests_beyond_a_deadline(tmp_path: Path) -> None:
    watch = looked_at(100, 100_000, 100_000, tmp_path)
    assert watch.rest_s(time.monotonic() + 0.01) <= 0.01
    assert watch.rest_s(-math.inf) == 0


def test_what_is_passed_is_named(tmp_path: Path) -> None:
    (tmp_path / "large").write_bytes(bytes(2 * 2**20))
    tree = cast(ProcessTree, Tree(100))
    for (memory_mb, output_mb), limit in {
        (99, 10): "99 MB of memory",
        (101, 1): "1 MB of files",
    }.items():
        watch = Watch(tree, memory_mb, output_mb, tmp_path, _next=-math.inf)
        assert limit in watch.passed()


def test_processes_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MOST_PROCESSES", 0)
    watch = Watch(cast(ProcessTree, Tree(1)), 10, 10, tmp_path, _next=-math.inf)
    assert watch.passed() == "started more than 0 processes"
