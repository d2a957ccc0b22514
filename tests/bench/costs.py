"""What the tracer costs by itself: threads, sizes, compilation, import."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import replace

import numpy as np

import tracer
from harness.translate.tracer import translate
from tests.bench.measuring import ROOT, Figures, best, icosphere, median, scene_of, seconds
from tracer.mesh import Mesh
from tracer.patterns import Constant
from tracer.scene import Emissive, Medium, Scene, Surface, Transport
from tracer.spectrum import GLASSES

Curve = list[tuple[float, float]]

ROUNDS = 5


def threads_speedup() -> Figures:
    """One thread over two; both take turns, with a picture that takes them a second and half of
    one: of a seventh of a second, single rounds are off by a half.
    """
    scene, size = translate(scene_of("package/complete.toml", 2048)), 2048
    tracer.render(scene, 8, 8)
    one, two = [], []
    for _ in range(ROUNDS):
        one.append(seconds(lambda: tracer.render(scene, size, size, 1)))
        two.append(seconds(lambda: tracer.render(scene, size, size, 2)))
    return {"ratio": median(one) / median(two), "one_s": median(one), "two_s": median(two)}


# --- curves ---------------------------------------------------------------------------------------


def over_pixels() -> Curve:
    """Seconds over pixels, the complete package: linear."""
    scene = translate(scene_of("package/complete.toml", 8))
    tracer.render(scene, 8, 8)
    sizes = (64, 128, 256, 512, 1024)
    return [(n * n, best(lambda n=n: tracer.render(scene, n, n, 1))) for n in sizes]  # type: ignore[misc]


def over_depth() -> Curve:
    """Seconds over max_depth with nothing cut by weight, a glass ball: linear."""
    scene = translate(scene_of("ball/checkerboard.toml", 8))
    tracer.render(scene, 8, 8)
    curve = []
    for depth in (2, 5, 10, 20, 40, 80):
        deep = replace(scene, transport=Transport(depth, 0.0))
        curve.append((float(depth), best(lambda deep=deep: tracer.render(deep, 256, 256, 1))))  # type: ignore[misc]
    return curve


def over_wavelengths() -> Curve:
    """Seconds per wavelength over their number, the package with a prism that disperses: falls."""
    scene = translate(scene_of("package/complete.toml", 8))
    flint = Medium(GLASSES["SF11"])
    solids = [replace(s, medium=flint) if s.name == "prism" else s for s in scene.solids]
    scene = replace(scene, solids=tuple(solids))
    tracer.render(scene, 8, 8)
    curve = []
    for count in (1, 2, 4, 8, 16, 32):
        bands = np.linspace(400, 700, count + 1)[1:]
        spent = best(lambda bands=bands: tracer.render_spectrum(scene, 256, 256, bands, 1))  # type: ignore[misc]
        curve.append((float(count), spent / count))
    return curve


def over_triangles() -> Curve:
    """Seconds per ray over triangles, random rays on a ball: logarithmic."""
    rng = np.random.default_rng(1)
    origins = rng.uniform(-1.5, 1.5, (100_000, 3))
    directions = rng.normal(size=origins.shape)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    camera = translate(scene_of("ball/checkerboard.toml", 8)).camera
    curve = []
    for subdivisions in range(1, 9):
        mesh = Mesh(*icosphere(subdivisions))
        scene = Scene(camera, surfaces=(Surface(mesh, Emissive(Constant((1.0, 1.0, 1.0)))),))
        tracer.follow(scene, origins[:10], directions[:10], "")
        spent = best(lambda s=scene: tracer.follow(s, origins, directions, "", threads=1))  # type: ignore[misc]
        curve.append((float(len(mesh.triangles)), spent / len(origins)))
    return curve


# --- before the first picture ---------------------------------------------------------------------

FIRST_CALLS = """
import time
began = time.perf_counter()
import tracer
imported = time.perf_counter()
import numpy as np
from tracer import Mesh, Scene, Solid, Surface, follow, render
from tracer.scene import Emissive, Medium
from tracer.patterns import Constant
loaded, spent = time.perf_counter(), time.process_time()
corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
camera = tracer.Perspective((0.2, 0.2, 5.0), (1.0, 0, 0), (0, 1.0, 0), (0, 0, -1.0), 0.3)
lamp = Surface(tracer.scene.Sphere((0.0, 0.0, 0.0), 9.0), Emissive(Constant((1.0, 1.0, 1.0))))
scene = Scene(camera, (Solid(Mesh(corners, faces), Medium(1.5)),), (lamp,))
render(scene, 8, 8)
follow(scene, [[0.2, 0.2, 5.0]], [[0.0, 0.0, -1.0]], "TT")
import json
print(json.dumps({
    "import_s": imported - began,
    "import_with_kernels_s": loaded - began,
    "first_calls_s": time.perf_counter() - loaded,
    "first_calls_cpu_s": time.process_time() - spent,
}))
"""


def start() -> dict[str, Figures]:
    """Import, and the first image and paths: compiled for the first time, and from the cache."""
    found = {}
    with tempfile.TemporaryDirectory() as cache:
        for name in ("cold", "cached", "cached again"):
            environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
            done = subprocess.run(
                [sys.executable, "-c", FIRST_CALLS],
                cwd=ROOT, env=environment, capture_output=True, text=True, check=True,
            )  # fmt: skip
            found[name] = json.loads(done.stdout)
    cached = [found["cached"], found["cached again"]]
    return {
        "compile": {
            "cold_s": found["cold"]["first_calls_s"],
            "cold_cpu_s": found["cold"]["first_calls_cpu_s"],
            "cached_s": min(c["first_calls_s"] for c in cached),
            "cached_cpu_s": min(c["first_calls_cpu_s"] for c in cached),
        },
        "import": {
            "import_s": min(c["import_s"] for c in cached),
            "with_kernels_s": min(c["import_with_kernels_s"] for c in cached),
        },
    }
