"""The tracer against renderers that are compared with it: POV-Ray, Mitsuba, Embree."""

from __future__ import annotations

import re
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tracer
from harness.renderers.base import RenderSettings
from harness.renderers.mitsuba import StockEngine
from harness.renderers.povray import PovRayRenderer
from harness.scene import resolved
from harness.translate.tracer import translate
from tests.bench import by_hand
from tests.bench.measuring import Figures, icosphere, median, scene_of, seconds
from tracer.arrays import flatten
from tracer.mesh import Mesh
from tracer.patterns import Constant
from tracer.scene import Emissive, Scene, Surface

SETTINGS = RenderSettings(threads=2)
Array = NDArray[np.float32] | NDArray[np.float64]
ROUNDS, REPEATS = 3, 5  # a picture of ours takes some hundredths of a second
EQUAL = 1e-4  # of linear radiance
NEAR = 1e-6  # units; POV-Ray keeps triangles' normals, too, in single precision


def scenes(size: int) -> dict[str, resolved.ResolvedScene]:
    """What is rendered by both: a ball of glass, the complete package, a ball of triangles."""
    return {
        "ball": scene_of("ball/checkerboard.toml", size),
        "complete_package": scene_of("package/complete.toml", size),
        "glass_mesh": glass_mesh(size),
    }


def glass_mesh(size: int) -> resolved.ResolvedScene:
    """The ball scene with its ball made of 100,488 triangles.

    POV-Ray keeps vertices in single precision. These are exact in it, so both see the same mesh.
    The ball is turned a little, lest rays of a hundred pixels go through edges exactly, where
    POV-Ray shows neither of the two triangles.
    """
    import trimesh

    ball = trimesh.creation.uv_sphere(radius=1.0, count=(158, 160))
    ball.apply_transform(trimesh.transformations.rotation_matrix(0.01, (1, 2, 3)))
    vertices = ball.vertices.astype(np.float32).astype(float)
    mesh = resolved.Mesh(vertices=vertices.tolist(), triangles=ball.faces.tolist())
    scene = scene_of("ball/checkerboard.toml", size)
    solid = scene.solids[0].model_copy(update={"shape": mesh})
    return scene.model_copy(update={"solids": (solid,)})


def against_povray(size: int = 1024) -> dict[str, Figures]:
    """POV-Ray's own trace time over ours for each scene, two threads each.

    `difference_max` is of linear radiance over all pixels, `pixels_apart` the number of those whose
    difference is above `EQUAL`, and `pixels_apart_unless_moved` of those that stay apart where the
    camera moves by `NEAR`: the others are at edges, where pictures jump. `by_hand_ratio` is that of
    a loop that is written for the ball alone, one ray at a time.
    """
    figures = {name: _against_povray(scene) for name, scene in scenes(size).items()}
    figures["ball"] |= _by_hand(size, figures["ball"])
    return figures


def _against_povray(scene: resolved.ResolvedScene) -> Figures:
    povray, ours = PovRayRenderer(), translate(scene)
    width, height = scene.film.width, scene.film.height
    image = tracer.render(ours, width, height, 2)
    mine, theirs, apart = [], [], np.empty(0)
    for _ in range(ROUNDS):
        mine += [seconds(lambda: tracer.render(ours, width, height, 2)) for _ in range(REPEATS)]
        other = povray.render(scene, SETTINGS)
        theirs.append(other.seconds)
        apart = np.abs(other.pixels - image.pixels).max(axis=2)
    rays, their_rays = image.rays, rays_of_povray(scene)
    return {
        "ratio": median(theirs) / median(mine),
        "povray_s": median(theirs),
        "tracer_s": median(mine),
        "povray_rays": float(their_rays),
        "tracer_rays": float(rays),
        "povray_ns_per_ray": SETTINGS.threads * median(theirs) / their_rays * 1e9,
        "tracer_ns_per_ray": SETTINGS.threads * median(mine) / rays * 1e9,
        "difference_max": float(apart.max()),
        "pixels_apart": float((apart > EQUAL).sum()),
        "pixels_apart_unless_moved": float(_apart_unless_moved(ours, image.pixels, other.pixels)),
    }


def _apart_unless_moved(scene: Scene, mine: Array, theirs: Array) -> int:
    """Of how many pixels `theirs` is outside what is seen from around the camera, by `EQUAL`."""
    low, high = mine.copy(), mine.copy()
    camera = scene.camera
    assert isinstance(camera, tracer.Perspective)
    for angle in np.arange(8) * np.pi / 4:
        aside = np.cos(angle) * np.asarray(camera.right) + np.sin(angle) * np.asarray(camera.up)
        origin = tuple(np.asarray(camera.origin) + NEAR * aside)
        moved = replace(scene, camera=replace(camera, origin=origin))
        seen = tracer.render(moved, mine.shape[1], mine.shape[0], 2).pixels
        low, high = np.minimum(low, seen), np.maximum(high, seen)
    outside = (theirs < low - EQUAL) | (theirs > high + EQUAL)
    return int(outside.any(axis=2).sum())


def rays_of_povray(scene: resolved.ResolvedScene) -> int:
    """How many it follows for the scene, by its own count; those that it cuts it calls saved."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        PovRayRenderer().emit(scene, folder)
        subprocess.run(["povray", "scene.ini"], cwd=folder, capture_output=True, check=True)
        statistics = (folder / "statistics.txt").read_text(encoding="utf-8")
    found = re.search(r"^Rays: +(\d+) +Saved: +(\d+)", statistics, re.MULTILINE)
    assert found, statistics
    return int(found[1]) - int(found[2])


def _by_hand(size: int, figures: Figures) -> Figures:
    """What the same picture of the ball takes by hand, once it is known to be the same."""
    scene = translate(scenes(size)["ball"])
    image = tracer.render(scene, size, size, 2)
    shares, rays = by_hand.render(size, 2)
    pixels = shares @ np.array([[0.1, 0.3, 0.9], [0.9, 0.6, 0.2]])
    assert rays == image.rays
    assert float(np.abs(pixels - image.pixels).max()) < 1e-9
    mine, by_hands = [], []
    for _ in range(ROUNDS):
        mine += [seconds(lambda: tracer.render(scene, size, size, 2)) for _ in range(REPEATS)]
        by_hands += [seconds(lambda: by_hand.render(size, 2)) for _ in range(REPEATS)]
    faster = median(mine) / median(by_hands)
    return {
        "by_hand_ratio": figures["ratio"] * faster,
        "by_hand_ns_per_ray": figures["tracer_ns_per_ray"] / faster,
    }


def against_mitsuba() -> Figures:
    """Mitsuba's `path` time to an RMSE of 1e-3, extrapolated by 1 / sqrt(samples), over ours."""
    scene = scene_of("ball/checkerboard.toml", 256)
    smooth = resolved.Ramp(start=(0.1, 0.3, 0.9), end=(0.9, 0.6, 0.2), axis="u")
    face = scene.surfaces[0].model_copy(update={"material": resolved.Emissive(pattern=smooth)})
    scene = scene.model_copy(update={"surfaces": (face,)})
    ours, engine = translate(scene), StockEngine()
    image = tracer.render(ours, 256, 256, 2)
    mine = median([seconds(lambda: tracer.render(ours, 256, 256, 2)) for _ in range(ROUNDS)])
    # What it converges to is not our image, for it averages over the pixel: compare its own seeds.
    points = []
    for samples in (16, 64, 256):
        runs = [
            engine.render(scene, RenderSettings(samples=samples, seed=seed)) for seed in (1, 2, 3)
        ]
        noise = float(np.sqrt(np.mean((runs[1].pixels - runs[2].pixels) ** 2) / 2))
        points.append((median([run.seconds for run in runs[1:]]), noise))
    wall, noise = points[-1]
    needed = wall * (noise / 1e-3) ** 2
    return {
        "ratio": needed / mine,
        "mitsuba_s_to_1e-3": needed,
        "tracer_s": mine,
        "rmse_16": points[0][1],
        "rmse_64": points[1][1],
        "rmse_256": noise,
        "mean": float(image.pixels.mean()),
    }


def against_embree() -> Figures:
    """Closest hits per second of random rays on 1.3 million triangles, over Mitsuba's Embree."""
    import drjit
    import mitsuba

    engine = StockEngine()
    engine.version()
    vertices, triangles = icosphere(8)
    rng = np.random.default_rng(1)
    origins = rng.uniform(-1.5, 1.5, (1_000_000, 3))
    directions = rng.normal(size=origins.shape)
    directions /= np.linalg.norm(directions, axis=1)[:, None]

    lamp = Surface(Mesh(vertices, triangles), Emissive(Constant((1.0, 1.0, 1.0))))
    camera = translate(scene_of("ball/checkerboard.toml", 8)).camera
    scene = Scene(camera, surfaces=(lamp,))
    build = seconds(lambda: flatten(scene))
    arrays = flatten(scene)
    stored = sum(a.nbytes for a in (arrays.nodes, arrays.triangles, arrays.normals))

    mitsuba.set_variant("llvm_ad_rgb")
    mesh = mitsuba.Mesh("ball", len(vertices), len(triangles))
    parameters = mitsuba.traverse(mesh)
    parameters["vertex_positions"] = vertices.ravel().astype(np.float32)
    parameters["faces"] = triangles.ravel().astype(np.uint32)
    parameters.update()
    world = mitsuba.load_dict({"type": "scene", "ball": mesh})
    single = origins.T.astype(np.float32), directions.T.astype(np.float32)
    rays = mitsuba.Ray3f(mitsuba.Point3f(single[0]), mitsuba.Vector3f(single[1]))
    drjit.eval(rays)

    def embree() -> None:
        hit = world.ray_intersect_preliminary(rays, coherent=False)
        drjit.eval(hit.t)
        drjit.sync_thread()

    def ours() -> None:
        tracer.follow(scene, origins, directions, "", threads=2)

    embree(), ours()
    theirs, mine = [], []
    for _ in range(2 * ROUNDS):
        theirs.append(seconds(embree))
        mine.append(seconds(ours))
    return {
        "ratio": median(theirs) / median(mine),
        "embree_mrays_s": len(origins) / median(theirs) / 1e6,
        "tracer_mrays_s": len(origins) / median(mine) / 1e6,
        "build_s": build,
        "bytes_per_triangle": stored / len(triangles),
    }
