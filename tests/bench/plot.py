"""The benchmarks as one picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

OURS, GOAL, OTHER = "#0b62c4", "#8a94a0", "#c4480b"
STYLE = {
    "svg.hashsalt": "snellcheck",
    "svg.fonttype": "none",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10,
}


def draw(
    figures: Mapping[str, Any], goals: Mapping[str, float], curves: Mapping[str, Any], file: Path
) -> None:
    """Writes an SVG with ratios beside their goals, and cost over sizes."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    with mpl.rc_context(STYLE):
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


def draw_convergence(
    curves: Mapping[str, Sequence[Sequence[float]]], orders: Mapping[str, float], file: Path
) -> None:
    """As an SVG by itself, with the orders that were measured between the finest two meshes."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    with mpl.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
        named = {f"{name}, order {orders[name]:.2f}": curve for name, curve in curves.items()}
        _convergence(axes, named)
        figure.savefig(file, metadata={"Date": None})
        plt.close(figure)


def _convergence(axes: Any, curves: Mapping[str, Sequence[Sequence[float]]]) -> None:
    """Flat and smooth, each with a grey line of slope 1 or 2 through its finest mesh."""
    for (name, curve), colour, power in zip(curves.items(), (OTHER, OURS), (1, 2), strict=True):
        xs, ys = zip(*curve, strict=True)
        line = [ys[-1] * (x / xs[-1]) ** power for x in xs]
        axes.loglog(xs, line, "--", color=GOAL)
        axes.loglog(xs, ys, "o-", color=colour, label=name)
        beside = {"xytext": (8, -8), "textcoords": "offset points", "color": GOAL}
        axes.annotate(f"slope {power}", (xs[2], line[2]), **beside)
    axes.set_xlabel("mean edge of a glass ball's triangles, in radii")
    axes.set_ylabel("RMS error of the exit direction, rad")
    axes.legend(frameon=False)
    axes.set_title("Polygons: order 1 flat, order 2 smooth")
