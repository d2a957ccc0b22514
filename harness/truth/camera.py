"""Primary rays, from the camera's definition alone (see `harness.scene.resolved.Perspective`).

The harness needs to know where each pixel looks before any renderer has said so.
"""

from __future__ import annotations

import numpy as np

from harness.expected import Float
from harness.renderers.base import Rays
from harness.scene.resolved import Orthographic, ResolvedScene


def primary_rays(scene: ResolvedScene) -> Rays:
    """The rays through all pixel centres, row by row from the top left: (H * W, 3) each."""
    across, down = np.meshgrid(
        np.arange(scene.film.width) + 0.5, np.arange(scene.film.height) + 0.5
    )
    return rays_through(scene, across.ravel(), down.ravel())


def rays_through(scene: ResolvedScene, across: Float, down: Float) -> Rays:
    """The rays through m places of the film, in pixels from its left and its top, (m,) each."""
    camera, width, height = scene.camera, scene.film.width, scene.film.height
    x = (2 * across / width - 1)[:, None]
    y = ((1 - 2 * down / height) * height / width)[:, None]
    right, up, forward = (np.array(v) for v in (camera.right, camera.up, camera.forward))
    if isinstance(camera, Orthographic):
        half = camera.width / 2
        origins = np.array(camera.origin) + half * (x * right + y * up)
        return Rays(origins, np.broadcast_to(forward, origins.shape).copy())
    k = camera.tan_half_fov_x
    directions = forward + k * (x * right + y * up)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Rays(np.broadcast_to(np.array(camera.origin), directions.shape).copy(), directions)
