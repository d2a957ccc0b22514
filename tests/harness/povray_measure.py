"""What POV-Ray's images tell, and how exactly.

Tolerances. An image is 16 bits: after the exposure is undone a pixel is off by at most half a step
of 1 / (65535 exposure), plus single precision rounding on the way (`SINGLE`, a few of its 6e-8
relative steps). A position is (cell + fine) / cells with fine = green / blue, so an error q of
both channels moves it by at most q (1 + fine) / blue / cells of the plane's size: see `located`.
Indices, and ratios of indices of nested media, are single precision in POV-Ray: the ones that the
tests use are exact, or rounded alike.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray

from harness.renderers.base import RenderSettings
from harness.renderers.povray import INSTALL, PovRayRenderer
from harness.scene import resolved as rs
from harness.translate.povray import translate
from tests.harness.povray_scenes import Array, on_plane

needs_povray = pytest.mark.skipif(
    shutil.which("povray") is None, reason=f"needs POV-Ray: {INSTALL}"
)

Mask = NDArray[np.bool_]
SETTINGS = RenderSettings(threads=1)
SINGLE = 4e-7  # of the brightest radiance: six roundings to single precision
CELLS = 1000


def images(*scenes: rs.ResolvedScene) -> list[Array]:
    """All at the same time, since a POV-Ray process sleeps most of its life. (H * W, 3) each."""
    renderer = PovRayRenderer()
    with ThreadPoolExecutor(8) as pool:
        done = list(pool.map(lambda scene: renderer.render(scene, SETTINGS), scenes))
    logs = [image.log for image in done if image.log]
    assert not logs, logs  # said here, since pytest does not take assertions of helpers apart
    return [image.pixels.reshape(-1, 3).astype(np.float64) for image in done]


def step(scene: rs.ResolvedScene) -> float:
    """How far a pixel may be from what it should be."""
    return (0.5 / 65535 + SINGLE) / translate(scene).exposure


def assert_image(scene: rs.ResolvedScene, expected: Array, where: Mask | None = None) -> None:
    assert_images([(scene, expected)], where)


def assert_images(pairs: Sequence[tuple[rs.ResolvedScene, Array]], where: Mask | None) -> None:
    """Each scene looks as expected, at the pixels `where`, to a step of its 16 bits."""
    for (scene, expected), pixels in zip(pairs, images(*(s for s, _ in pairs)), strict=True):
        difference = np.abs(pixels - expected)[slice(None) if where is None else where]
        assert difference.size > 0
        assert difference.max() <= step(scene)


def with_transport(scene: rs.ResolvedScene, **change: object) -> rs.ResolvedScene:
    return scene.model_copy(update={"transport": scene.transport.model_copy(update=change)})


def coded(scene: rs.ResolvedScene, plane: rs.Rectangle, axis: str, path: str) -> rs.ResolvedScene:
    """`scene` with nothing luminous but a position code, deep enough for `path` alone."""
    code = rs.PositionCode.model_validate({"axis": axis, "cells": CELLS, "amplitude": 1.0})
    kept = tuple(s for s in scene.surfaces if isinstance(s.material, rs.Mirror))
    face = rs.Surface(name="code", shape=plane, material=rs.Emissive(pattern=code))
    lobes = {"reflection": "R" in path, "transmission": "T" in path or not path}
    dark = scene.model_copy(update={"surfaces": (*kept, face), "background": (0.0, 0.0, 0.0)})
    return with_transport(dark, max_depth=len(path) + 1, min_weight=0.0, **lobes)


def located(scene: rs.ResolvedScene, plane: rs.Rectangle, path: str) -> tuple[Array, Array, Array]:
    """Where rays land on `plane` in its frame, and by how much that may be wrong; NaN if dark."""
    found, allowed = [], []
    q = 0.5 / 65535 + SINGLE
    for pixels, size in zip(
        images(*(coded(scene, plane, axis, path) for axis in "uv")), plane.size, strict=True
    ):
        red, green, blue = np.where(pixels[:, 2:] > 1e-3, pixels, np.nan).T
        fine = green / blue
        cell = np.round(red / blue * CELLS - fine)
        found.append(((cell + fine) / CELLS - 0.5) * size)
        allowed.append(q * (1 + fine) / blue / CELLS * size)
    return found[0], found[1], np.maximum(*allowed)


def assert_landed(
    scene: rs.ResolvedScene, plane: rs.Rectangle, path: str, origins: Array, directions: Array
) -> None:
    """All rays that leave towards `plane` were located on it, within what 16 bits allow."""
    x, y, distance = on_plane(origins, directions, plane.frame)
    inside = (np.abs(x) < plane.size[0] / 2) & (np.abs(y) < plane.size[1] / 2) & (distance > 0)
    assert inside.sum() > 500
    found_x, found_y, allowed = located(scene, plane, path)
    error = np.maximum(np.abs(found_x - x), np.abs(found_y - y))[inside]
    assert np.isfinite(error).all()
    assert (error <= allowed[inside]).all()
