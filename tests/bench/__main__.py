"""How fast the tracer is, as ratios within one run: ``make bench``.

Writes reports/bench.json, for each name its `ratio` and the medians that it is made of, and
reports/bench.svg. Runs of both sides take turns, so that a busy machine slows both. No test looks
at these numbers. With names as arguments, only those are measured.
"""

from __future__ import annotations

import json
import platform
import sys
from collections.abc import Callable
from typing import Any

from harness.record import write_text
from tests.bench import costs, rivals
from tests.bench.measuring import ROOT, Figures, scene_of
from tests.bench.plot import draw

BENCHES: dict[str, Callable[[], Figures]] = {
    "tracer_vs_povray_wall_ball": lambda: rivals.against_povray(
        scene_of("ball/checkerboard.toml", 1024)
    ),
    "tracer_vs_povray_wall_package": lambda: rivals.against_povray(
        scene_of("package/complete.toml", 1024)
    ),
    "tracer_vs_povray_wall_mesh": lambda: rivals.against_povray(rivals.glass_mesh(1024)),
    "tracer_vs_mitsuba_equal_error": rivals.against_mitsuba,
    "mesh_rays_vs_embree": rivals.against_embree,
    "threads_speedup": costs.threads_speedup,
}
GOALS = {
    "tracer_vs_povray_wall_ball": 10.0,
    "tracer_vs_povray_wall_package": 10.0,
    "tracer_vs_povray_wall_mesh": 3.0,
    "tracer_vs_mitsuba_equal_error": 1000.0,
    "mesh_rays_vs_embree": 0.5,
    "threads_speedup": 1.8,
}
MOST = {
    "build_s": 5.0,
    "bytes_per_triangle": 300.0,
    "cold_s": 20.0,
    "cached_s": 1.0,
    "import_s": 0.5,
}


def main(names: list[str]) -> None:
    figures: dict[str, Figures] = {}
    for name in names or list(BENCHES):
        figures[name] = BENCHES[name]()
        _say(name, figures[name])
    if names:
        return
    for name, found in costs.start().items():
        figures[name] = found
        _say(name, found)
    curves: dict[str, Any] = {
        "pixels": costs.over_pixels(),
        "depth": costs.over_depth(),
        "wavelengths": costs.over_wavelengths(),
        "triangles": costs.over_triangles(),
        "convergence": costs.mesh_convergence(),
    }
    document = {
        "machine": {"processor": platform.processor() or platform.machine()},
        "figures": figures,
        "goals": GOALS,
        "limits": MOST,
        "curves": curves,
    }
    write_text(ROOT / "reports" / "bench.json", json.dumps(document, indent=1) + "\n")
    draw(document, ROOT / "reports" / "bench.svg")
    _conclude(figures)


def _say(name: str, found: Figures) -> None:
    shown = "  ".join(f"{key} {value:.4g}" for key, value in found.items())
    sys.stdout.write(f"{name:32s} {shown}\n")
    sys.stdout.flush()


def _conclude(figures: dict[str, Figures]) -> None:
    missed = [
        f"{name} is {figures[name]['ratio']:.3g}, the goal {goal:g}"
        for name, goal in GOALS.items()
        if figures[name]["ratio"] < goal
    ]
    missed += [
        f"{key} of {name} is {value:.3g}, the limit {MOST[key]:g}"
        for name, found in figures.items()
        for key, value in found.items()
        if value > MOST.get(key, float("inf"))
    ]
    sys.stdout.write("written: reports/bench.json, reports/bench.svg\n")
    sys.stdout.write("".join(f"missed: {line}\n" for line in missed) or "all goals are met\n")


if __name__ == "__main__":
    main(sys.argv[1:])
