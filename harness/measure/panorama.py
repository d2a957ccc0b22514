"""What a panorama shows in a direction: the closed form of `harness.scene.resolved.Panorama`."""

from __future__ import annotations

import numpy as np

from harness.expected import Float
from harness.scene.resolved import Panorama
from harness.translate.texels import radiance_of


def panorama_radiance(panorama: Panorama, directions: Float) -> Float:
    """Radiance (m, 3) along unit `directions` (m, 3)."""
    texels = radiance_of(panorama)
    x, y, z = directions.T
    across = (0.5 + np.arctan2(x, -z) / (2 * np.pi)) * panorama.width - 0.5
    down = np.arccos(np.clip(y, -1, 1)) / np.pi * panorama.height - 0.5
    down = np.clip(down, 0, panorama.height - 1)
    i, j = np.floor(across).astype(int), np.floor(down).astype(int)
    right, below = (across - i)[:, None], (down - j)[:, None]
    j1 = np.minimum(j + 1, panorama.height - 1)
    i, i1 = i % panorama.width, (i + 1) % panorama.width
    upper = (1 - right) * texels[j, i] + right * texels[j, i1]
    lower = (1 - right) * texels[j1, i] + right * texels[j1, i1]
    return np.asarray((1 - below) * upper + below * lower)
