"""Primary rays, from the camera's definition alone (see `harness.scene.resolved.Perspective`).

The harness needs to know where each pixel looks before any renderer has said so.
"""

from __future__ import annotations

import numpy as np

from harness.renderers.base import Rays
from harness.scene.resolved import Orthographic, ResolvedScene


def primary_rays(scene: ResolvedScene) -> Rays:
    """The rays through all pixel centres, row by row from the top left: (H * W, 3) each."""
    camera, width, height = scene.camera, scene.film.width, scene.film.height
    x = 2 * (np.arange(width) + 0.5) / width - 1
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * height / width
    grid_x, grid_y = (a.reshape(-1, 1) for a in np.meshgrid(x, y))
    right, up, forward = (np.array(v) for v in (camera.right, camera.up, camera.forward))
    if isinstance(camera, Orthographic):
        half = camera.width / 2
        origins = np.array(camera.origin) + half * (grid_x * right + grid_y * up)
        return Rays(origins, np.broadcast_to(forward, origins.shape).copy())
    k = camera.tan_half_fov_x
    directions = forward + k * (grid_x * right + grid_y * up)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Rays(np.broadcast_to(np.array(camera.origin), directions.shape).copy(), directions)
