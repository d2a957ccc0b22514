"""Every analytic shape as POV-Ray and our tracer show it: two programs that share no code."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from harness.renderers.tracer import TracerEngine
from harness.scene.resolve import resolve
from harness.scene.resolved import ResolvedScene
from tests.harness.povray_measure import SETTINGS, images, needs_povray, step
from tests.strategies import Document, cases_of

pytestmark = [pytest.mark.povray, needs_povray]

TURNED: Document = {"rotate": [{"axis": [1.0, 0.3, 0.0], "angle": 25.0}]}
LENS: Document = {"type": "lens", "vertex": [0.0, 0.0, 0.3], "diameter": 1.6, **TURNED}
INF = math.inf


def composed(operation: str, *parts: Document) -> Document:
    return {"type": operation, "of": list(parts)}


def ball(radius: float, x: float, y: float, z: float) -> Document:
    return {"type": "sphere", "radius": radius, "center": [x, y, z]}


def block(width: float, height: float, depth: float, z: float = 0.0) -> Document:
    return {"type": "box", "size": [width, height, depth], "center": [0.0, 0.0, z]}


SHAPES: dict[str, Document] = {
    "biconvex": {**LENS, "radii": [1.5, -1.2], "thickness": 0.8, "diameter": 1.2},
    "biconcave": {**LENS, "radii": [-1.5, 1.2], "thickness": 0.2},
    "plano-convex": {**LENS, "radii": [INF, -1.2], "thickness": 0.5},
    "meniscus": {**LENS, "radii": [1.5, 2.2], "thickness": 0.3},
    "rod lens": {**LENS, "vertex": [0.0, 0.0, 1.3], "radii": [0.9, -0.9], "thickness": 2.5},
    "hyperboloid, paraboloid": {
        **LENS, "radii": [-1.5, 1.2], "conics": [-3.0, -1.0], "thickness": 0.2,
    },
    "hyperboloid, ellipsoid": {
        **LENS, "radii": [1.5, -1.2], "conics": [-3.0, 0.4], "thickness": 0.8, "diameter": 1.4,
    },
    "cone": {"type": "cone", "radius": 0.8, "height": 1.2, **TURNED},
    "frustum": {"type": "cone", "radius": 0.8, "top_radius": 0.3, "height": 1.2, **TURNED},
    "wedge": {"type": "wedge", "thickness": 0.5, "angle": 15.0, "size": [1.5, 1.2], **TURNED},
    "moon": composed("difference", ball(1.0, 0.0, 0.0, 0.0), ball(0.7, 0.5, 0.0, 0.6)),
    "drilled": composed(
        "difference",
        {**block(1.4, 1.4, 1.0), **TURNED},
        {"type": "cylinder", "center": [0.2, 0.1, 0.0], "axis": [0.1, 0.2, 1.0], "radius": 0.2,
         "height": 4.0},
    ),
    "parts that touch": composed("union", block(1.0, 1.0, 0.5, 0.25), block(1.4, 1.4, 0.5, -0.25)),
    "parts that overlap": composed("union", block(1.0, 1.0, 1.0, 0.25), ball(0.8, 0.3, 0.0, -0.2)),
    "composed of composed": composed(
        "difference",
        composed("union", block(1.0, 1.0, 1.0, 0.25), ball(0.8, 0.3, 0.0, -0.2)),
        composed("intersection", ball(0.5, 0.0, 0.2, 0.5), block(2.0, 0.8, 2.0)),
    ),
    "half a lens": composed(
        "intersection", {**LENS, "radii": [1.5, -1.2], "thickness": 0.8, "diameter": 1.2},
        {"type": "box", "center": [1.0, 0.0, 0.0], "size": [2.0, 4.0, 4.0]},
    ),
}  # fmt: skip


def glass(shape: Document) -> ResolvedScene:
    """A solid before a ramp, in an image of 128 x 128 that sees it all."""
    wall = {"type": "rectangle", "center": [0.0, 0.0, -3.0], "size": [16.0, 16.0]}
    ramp = {"type": "ramp", "start": [0.9, 0.7, 0.5], "end": [0.1, 0.3, 0.7]}
    document: dict[str, Any] = {
        "format": 1,
        "title": "one solid",
        "family": "shapes",
        "sources": ["made up"],
        "camera": {
            "type": "perspective",
            "origin": [0.3, 0.2, 6.0],
            "target": [0.0, 0.0, 0.0],
            "fov_x": 26.0,
        },
        "film": {"width": 128, "height": 128},
        "media": {"glass": {"ior": 1.5}},
        "solids": [{"name": "solid", "medium": "glass", "shape": shape}],
        "surfaces": [
            {"name": "wall", "shape": wall, "material": {"type": "emissive", "pattern": ramp}}
        ],
        "checks": [{"observable": "max_difference", "against": "renderers"}],
    }
    return resolve(cases_of(document)[0])


def test_both_show_the_same() -> None:
    """To the step of POV-Ray's 16 bits; every leg of every path is in the picture."""
    scenes = {name: glass(shape) for name, shape in SHAPES.items()}
    ours = TracerEngine()
    for (name, scene), theirs in zip(scenes.items(), images(*scenes.values()), strict=True):
        exact = ours.render(scene, SETTINGS).pixels.reshape(-1, 3)
        difference = np.abs(theirs - exact).max()
        # Weights below min_weight are cut, by each in its own way.
        assert difference <= step(scene) + 2 * scene.transport.min_weight, name
