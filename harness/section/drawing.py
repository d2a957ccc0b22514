"""From a resolved scene and ray paths to the text of an SVG image; a pure function.

Which plane, which part of it, and what is worth a label is decided here; `canvas` draws.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from harness.record import RayPath
from harness.scene.resolved import Emissive, ResolvedScene, Vec3
from harness.section.canvas import RAY, Canvas
from harness.section.outline import Cut, Points, Window, outline

NARROWEST = 0.45  # height over width of a drawing; it is never taller than wide
MARGIN = 0.3  # around what matters, in parts of its size
# A solid is shown whole if it is at most so many times as large as the stretch of its rays.
WHOLE = 4.0


# --- the plane and the window ---------------------------------------------------------------------


def plane_of(paths: Sequence[RayPath], up: Vec3 = (0.0, 1.0, 0.0)) -> Cut:
    """The plane that lies nearest to all vertices, upright as `up`, rays running to the right.

    Paths in one line leave the plane open: then it is the one through them and `up`.
    """
    points = np.concatenate([np.array(path.vertices) for path in paths])
    first = np.array(paths[0].vertices)
    onward = first[-1] - first[0] if len(first) == 2 else first[1] - first[0]
    _, sizes, axes = np.linalg.svd(points - points.mean(axis=0))
    n = axes[2]
    if len(sizes) < 2 or sizes[1] < 1e-9 * sizes[0]:
        n = np.cross(onward, up)
        if np.linalg.norm(n) < 1e-9 * np.linalg.norm(onward):
            n = np.array([0.0, 0.0, 1.0])
    n = n / np.linalg.norm(n)
    y = np.array(up) - (np.array(up) @ n) * n
    if np.linalg.norm(y) < 0.1:  # the plane is level: what is ahead is up
        y = np.array([0.0, 0.0, -1.0]) - (-n[2]) * n
    y = y / np.linalg.norm(y)
    x = np.cross(y, n)
    if x @ onward < 0:
        x = -x
    return Cut(points.mean(axis=0), x, y)


def window_of(scene: ResolvedScene, paths: Sequence[RayPath], cut: Cut) -> Window:
    """What matters: where rays bend, and the solids around, unless these are much larger."""
    bends = [cut.project(np.array(path.vertices[1:-1])) for path in paths if len(path.angles)]
    ends = np.concatenate([cut.project(np.array(path.vertices)) for path in paths])
    points = np.concatenate(bends) if bends else ends
    low, high = points.min(axis=0), points.max(axis=0)
    size = float((high - low).max())
    if bends and size < 1e-9 * float(np.ptp(ends, axis=0).max()):
        size = float(np.ptp(ends, axis=0).max()) / 4
        low, high = low - size / 2, high + size / 2
    far = Window(low[0] - 3 * size, low[1] - 3 * size, high[0] + 3 * size, high[1] + 3 * size)
    for solid in scene.solids:
        for loop in outline(solid.shape, cut, far):
            if np.ptp(loop, axis=0).max() <= WHOLE * size:
                low, high = np.minimum(low, loop.min(axis=0)), np.maximum(high, loop.max(axis=0))
    width, height = high - low
    margin = MARGIN * max(width, height)
    width, height = width + 2 * margin, height + 2 * margin
    width = max(width, height)
    height = max(height, NARROWEST * width)
    x, y = (low + high) / 2
    return Window(x - width / 2, y - height / 2, x + width / 2, y + height / 2)


# --- drawing --------------------------------------------------------------------------------------


def draw(
    scene: ResolvedScene,
    paths: Sequence[RayPath],
    *,
    cut: Cut | None = None,
    window: Window | None = None,
    labels: int = 6,
    colours: Sequence[str] = (),
    title: str = "",
    standalone: bool = True,
) -> str:
    """The section as SVG text.

    Without `cut` the plane is fitted to the paths, and without `window` it shows where they bend.
    The `labels` heaviest interfaces are labelled with their angles. With `colours`, each path has
    its own, as CSS writes colours: light of that wavelength. A drawing that is not
    `standalone` goes into an HTML page and takes its colours from there.
    """
    if cut is None:
        if not paths:
            raise ValueError("a section without rays needs a plane")
        cut = plane_of(paths, scene.camera.up)
    if window is None:
        if not paths:
            raise ValueError("a section without rays needs a window")
        window = window_of(scene, paths, cut)
    canvas = Canvas(cut, window)
    for solid in sorted(scene.solids, key=lambda s: s.exterior != 0):
        canvas.solid(scene, solid)
    for surface in scene.surfaces:
        canvas.face(surface.shape, glows=isinstance(surface.material, Emissive))
    pairs = zip(paths, colours or [RAY] * len(paths), strict=True)
    for path, colour in sorted(pairs, key=lambda pair: pair[0].weights[-1]):
        canvas.ray(path, colour)
    bends = [(path.weights[k], path, k) for path in paths for k in range(len(path.angles))]
    bends.sort(key=lambda bend: -bend[0])
    seen: list[Points] = []
    for _, path, k in bends:
        here = np.array(path.vertices[k + 1])
        if len(seen) < labels and all(np.linalg.norm(here - o) > 1e-9 * window.width for o in seen):
            seen.append(here)
            canvas.angles(path, k)
    canvas.ruler()
    return canvas.text(title, standalone)
