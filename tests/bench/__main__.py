"""How fast the tracer is, as ratios within one run: ``make bench``.

Writes reports/bench.json, for each name its `ratio` and the medians that it is made of, and
reports/bench.svg. Runs of both sides take turns, so that a busy machine slows both. No test looks
at these numbers. With names as arguments, only those are measured.
"""

from __future__ import annotations

import json
import platform
import sys
from collections.abc import Callable, Mapping
from typing import Any

from harness.record import write_text
from tests.bench import costs, rivals
from tests.bench.convergence import mesh_convergence
from tests.bench.measuring import ROOT, Figures
from tests.bench.plot import draw

# Of one figure by itself, or of one per scene.
BENCHES: dict[str, Callable[[], Figures | dict[str, Figures]]] = {
    "tracer_vs_povray_wall": rivals.against_povray,
    "tracer_vs_mitsuba_equal_error": rivals.against_mitsuba,
    "mesh_rays_vs_embree": rivals.against_embree,
    "threads_speedup": costs.threads_speedup,
}
# What each `ratio` should reach, and what other figures should not exceed.
GOALS = {
    "tracer_vs_povray_wall.ball": 10.0,
    "tracer_vs_povray_wall.complete_package": 10.0,
    "tracer_vs_povray_wall.glass_mesh": 3.0,
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
    measured: dict[str, Any] = {}
    for name in names or list(BENCHES):
        measured[name] = BENCHES[name]()
        _say(name, measured[name])
    if names:
        return
    for name, found in costs.start().items():
        measured[name] = found
        _say(name, found)
    curves: dict[str, Any] = {
        "pixels": costs.over_pixels(),
        "depth": costs.over_depth(),
        "wavelengths": costs.over_wavelengths(),
        "triangles": costs.over_triangles(),
        "convergence": mesh_convergence(),
    }
    document = {
        **measured,
        "machine": {"processor": platform.processor() or platform.machine()},
        "goals": GOALS,
        "limits": MOST,
        "curves": curves,
    }
    write_text(ROOT / "reports" / "bench.json", json.dumps(document, indent=1) + "\n")
    figures = _flat(measured)
    draw(figures, GOALS, curves, ROOT / "reports" / "bench.svg")
    _conclude(figures)


def _flat(measured: Mapping[str, Any]) -> dict[str, Figures]:
    """One line per figure, those of scenes as "name.scene"."""
    flat: dict[str, Figures] = {}
    for name, found in measured.items():
        if any(isinstance(part, dict) for part in found.values()):
            flat |= {f"{name}.{scene}": part for scene, part in found.items()}
        else:
            flat[name] = found
    return flat


def _say(name: str, found: Figures | dict[str, Figures]) -> None:
    for line, figures in _flat({name: found}).items():
        shown = "  ".join(f"{key} {value:.4g}" for key, value in figures.items())
        sys.stdout.write(f"{line:38s} {shown}\n")
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
