"""How fast a ball of triangles becomes a ball: ``python -m tests.bench.convergence``.

Draws it into docs/images/mesh-convergence.svg. tests/tracer/test_shapes.py requires the orders.
"""

from __future__ import annotations

import sys

import numpy as np

import tracer
from harness.translate.tracer import translate
from tests.bench.measuring import ROOT, icosphere, scene_of
from tests.bench.plot import draw_convergence
from tracer.mesh import Mesh
from tracer.patterns import Constant
from tracer.scene import Emissive, Medium, Scene, Solid, Surface
from tracer.shapes import Sphere

Curve = list[tuple[float, float]]


def mesh_convergence() -> dict[str, Curve]:
    """RMS angle, in radians, between rays through a ball of triangles and through a true ball, over
    the mean length of an edge in radii. Of order 1 with flat faces, 2 with smooth normals.
    """
    rng = np.random.default_rng(2)
    origins = np.column_stack([rng.uniform(-0.55, 0.55, (20_000, 2)), np.full(20_000, 3.0)])
    directions = np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    camera = translate(scene_of("ball/checkerboard.toml", 8)).camera
    lamp = Surface(Sphere((0.0, 0.0, 0.0), 50.0), Emissive(Constant((1.0, 1.0, 1.0))))
    glass = Medium(1.5)

    def leaving(shape: Sphere | Mesh) -> np.ndarray:
        scene = Scene(camera, (Solid(shape, glass),), (lamp,))
        return tracer.follow(scene, origins, directions, "TT").direction

    true = leaving(Sphere((0.0, 0.0, 0.0), 1.0))
    curves: dict[str, Curve] = {"flat": [], "smooth": []}
    for subdivisions in range(1, 8):
        vertices, triangles = icosphere(subdivisions)
        normals = vertices / np.linalg.norm(vertices, axis=1)[:, None]
        for name, own in (("flat", None), ("smooth", normals)):
            across = np.linalg.norm(np.cross(leaving(Mesh(vertices, triangles, own)), true), axis=1)
            rms = float(np.sqrt(np.nanmean(np.arcsin(np.clip(across, 0, 1)) ** 2)))
            curves[name].append((_edge(vertices[triangles]), rms))
    return curves


def _edge(corners: np.ndarray) -> float:
    """The mean length of edges; `corners` (T, 3, 3)."""
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean())


def order(curve: Curve) -> float:
    """With which power of the edges the error falls, between the finest two meshes."""
    (coarse, more), (fine, less) = curve[-2:]
    return float(np.log(more / less) / np.log(coarse / fine))


def main() -> None:
    curves = mesh_convergence()
    file = ROOT / "docs" / "images" / "mesh-convergence.svg"
    draw_convergence(curves, {name: order(curve) for name, curve in curves.items()}, file)
    for name, curve in curves.items():
        sys.stdout.write(f"{name}: order {order(curve):.3f}\n")
    sys.stdout.write(f"written: {file.relative_to(ROOT)}\n")


if __name__ == "__main__":
    main()
