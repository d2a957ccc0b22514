"""The benchmarks as one picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

OURS, GOAL, OTHER = "#0b62c4", "#8a94a0", "#c4480b"


def draw(
    figures: Mapping[str, Any], goals: Mapping[str, float], curves: Mapping[str, Any], file: Path
) -> None:
    """Writes an SVG with ratios beside their goals, and cost over sizes."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    style = {"svg.hashsalt": "snellcheck", "font.size": 9, "axes.spines.top": False}
    with mpl.rc_context({**style, "axes.spines.right": False, "axes.titlesize": 10}):
        figure, axes = plt.subplots(2, 3, figsize=(13, 7), layout="constrained")
        _ratios(axes[0, 0], figures, goals)
        _curve(axes[0, 1], curves["pixels"], "pixels", "s", "Pixels: linear", linear=True)
        _curve(axes[0, 2], curves["depth"], "max_depth", "s", "Depth: linear", linear=True)
        title = "Wavelengths: cheaper, the more there are"
        _curve(axes[1, 0], curves["wavelengths"], "wavelengths", "s per wavelength", title)
        title = "Triangles: logarithmic"
        _curve(axes[1, 1], curves["triangles"], "triangles", "s per ray", title)
        _convergence(axes[1, 2], curves["convergence"])
        figure.savefig(file, metadata={"Date": None})
        plt.close(figure)


def _ratios(axes: Any, figures: Mapping[str, Any], goals: Mapping[str, float]) -> None:
    names = [name for name in goals if name in figures]
    places = range(len(names))
    axes.barh(places, [figures[n]["ratio"] for n in names], color=OURS, height=0.5)
    for place, name in zip(places, names, strict=True):
        axes.plot([goals[name]] * 2, [place - 0.4, place + 0.4], color=GOAL, linewidth=3)
        ratio = figures[name]["ratio"]
        axes.annotate(f"  {_shown(ratio)}", (max(ratio, goals[name]), place), va="center")
    axes.set_yticks(places, [name.replace("_", " ").replace(".", "\n") for name in names])
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.margins(x=0.2)
    axes.set_title("Ratios; grey: the goals")


def _shown(ratio: float) -> str:
    """With three digits that count, and never as a power of ten."""
    return f"{ratio:,.0f}" if ratio >= 1000.0 else f"{ratio:.3g}"


def _curve(
    axes: Any,
    curve: Sequence[Sequence[float]],
    x: str,
    y: str,
    title: str,
    linear: bool = False,
) -> None:
    """A measured curve over a logarithmic axis, or a linear one with a grey line for comparison."""
    xs, ys = zip(*curve, strict=True)
    axes.plot(xs, ys, "o-", color=OURS)
    if not linear:
        axes.set_xscale("log")
    else:
        axes.plot([0, xs[-1]], [0, ys[-1]], "--", color=GOAL)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_ylim(bottom=0)
    axes.set_title(title)


def _convergence(axes: Any, curves: Mapping[str, Sequence[Sequence[float]]]) -> None:
    for (name, curve), colour, power in zip(curves.items(), (OTHER, OURS), (-0.5, -1), strict=True):
        xs, ys = zip(*curve, strict=True)
        axes.loglog(xs, ys, "o-", color=colour, label=name)
        axes.loglog(xs, [ys[-1] * (v / xs[-1]) ** power for v in xs], "--", color=GOAL)
    axes.set_xlabel("triangles of a glass ball")
    axes.set_ylabel("RMS error of the exit direction, rad")
    axes.legend(frameon=False)
    axes.set_title("Polygons: order 1 flat, order 2 smooth")
