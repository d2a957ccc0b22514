"""How a probe looks, for people: the codes that its rays saw, with cells coarse enough to see.

Nothing is rendered for it and nothing is measured on it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness.probe.scenes import AMPLITUDE
from harness.renderers.base import RayPaths, Status
from harness.scene.resolved import Film, Rectangle

CELLS = 8
Pixels = NDArray[np.float32]


def view_of_codes(coded: Pixels) -> Pixels:
    """From a picture (H, W, 3) of a fine code along u; NaN where the picture is not finite."""
    finite = np.isfinite(coded).all(axis=-1, keepdims=True)
    level = np.where(finite, coded[..., 2:], 0.0)
    coarse = np.divide(coded[..., :1], level, out=np.zeros_like(level), where=level > 0)
    return np.where(finite, _colours(coarse, level), np.float32(np.nan))


def view_of_rays(paths: RayPaths, plane: Rectangle, film: Film) -> Pixels | None:
    """From where the rays of all pixels landed on `plane`; None unless each pixel has one ray."""
    if len(paths.status) != film.width * film.height:
        return None
    along = (paths.point - np.array(plane.frame.origin)) @ np.array(plane.frame.x)
    landed = (paths.status == Status.HIT).reshape(film.height, film.width, 1)
    coarse = (along / plane.size[0] + 0.5).reshape(film.height, film.width, 1)
    return _colours(np.where(landed, coarse, 0.0), np.where(landed, AMPLITUDE, 0.0))


def _colours(coarse: NDArray[np.floating], level: NDArray[np.floating]) -> Pixels:
    code = np.concatenate([coarse, np.mod(CELLS * coarse, 1), np.ones_like(coarse)], axis=-1)
    return np.asarray(level * code, np.float32)
