"""What all benchmarks share: clocks, medians, and the scenes that they look at."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from harness.scene import resolved
from harness.scene.load import load_cases
from harness.scene.resolve import resolve

ROOT = Path(__file__).resolve().parents[2]

Figures = dict[str, float]


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def median(rounds: list[float]) -> float:
    return statistics.median(rounds)


def best(work: Callable[[], object], rounds: int = 3) -> float:
    """Least processor time of a few, of work in one thread: what a curve over sizes wants."""

    def spent() -> float:
        start = time.process_time()
        work()
        return time.process_time() - start

    return min(spent() for _ in range(rounds))


def scene_of(file: str, size: int) -> resolved.ResolvedScene:
    scene = resolve(load_cases(ROOT / "scenes" / file, "normal")[0])
    return scene.model_copy(update={"film": resolved.Film(width=size, height=size)})


def icosphere(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=1.0)
    return np.ascontiguousarray(ball.vertices), np.ascontiguousarray(ball.faces, np.int64)
