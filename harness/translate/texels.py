"""Texels of pictures and panoramas as arrays."""

from __future__ import annotations

import base64

import numpy as np
from numpy.typing import NDArray

from harness.scene import resolved as rs


def levels_of(picture: rs.Picture | rs.Panorama) -> NDArray[np.uint16]:
    """(height, width, 3), row 0 at the top, 65535 is radiance 1."""
    levels = np.frombuffer(base64.b64decode(picture.pixels), "<u2")
    return levels.reshape(picture.height, picture.width, 3)


def radiance_of(picture: rs.Picture | rs.Panorama) -> NDArray[np.float64]:
    """(height, width, 3), row 0 at the top."""
    return np.asarray(levels_of(picture) / np.float64(65535))


def knots_of(panorama: rs.Panorama) -> NDArray[np.float64]:
    """(2 height + 1, width, 3): a panorama at every multiple of half a texel from top to bottom.

    Linear between these it is the panorama itself, also for who takes the first and the last row
    to lie at the poles.
    """
    texels = radiance_of(panorama)
    rows = np.concatenate([texels[:1], texels, texels[-1:]])
    knots = np.empty((2 * panorama.height + 1, panorama.width, 3))
    knots[1::2], knots[::2] = texels, (rows[:-1] + rows[1:]) / 2
    return knots
