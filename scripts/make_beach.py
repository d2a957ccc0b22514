"""Draws scenes/ball/beach.png: sand, sea and sky, for the ball lens that turns them upside down."""

from __future__ import annotations

from pathlib import Path

import imagecodecs
import numpy as np

SIZE = 512
HORIZON = 0.5  # of the picture's height: the ball looks straight at it
SHORE = 0.62


def beach() -> np.ndarray:
    """(SIZE, SIZE, 3) sRGB bytes, row 0 at the top."""
    y, x = np.mgrid[:SIZE, :SIZE] / SIZE
    sky = np.stack([0.42 + 0.5 * y, 0.62 + 0.42 * y, 0.86 + 0.16 * y], axis=-1)
    glow = np.exp(-((x - 0.68) ** 2 + (y - 0.27) ** 2) / 0.012)[..., None]
    sky = sky + glow * np.array([0.5, 0.4, 0.15])
    sun = (x - 0.68) ** 2 + (y - 0.27) ** 2 < 0.045**2
    sky[sun] = [1.0, 0.96, 0.82]
    ripple = 0.05 * np.sin(260 * (y - HORIZON) ** 0.7 * np.sign(y - HORIZON) + 9 * np.sin(7 * x))
    depth = ((y - HORIZON) / (SHORE - HORIZON))[..., None]
    sea = np.array([0.05, 0.28, 0.45]) + depth * np.array([0.15, 0.32, 0.25])
    sea = sea + np.nan_to_num(ripple)[..., None]
    wave = SHORE + 0.012 * np.sin(14 * x) + 0.006 * np.sin(37 * x + 1)
    foam = np.abs(y - wave) < 0.008
    sand = np.array([0.80, 0.68, 0.47]) - ((y - SHORE) * 0.5)[..., None] * np.array([0.5, 0.5, 0.4])
    dunes = 0.03 * np.sin(40 * x + 60 * y + 4 * np.sin(11 * x))
    picture = np.where((y < HORIZON)[..., None], sky, sea)
    picture = np.where((y > wave)[..., None], sand + dunes[..., None], picture)
    picture[foam] = [0.95, 0.97, 0.96]
    return np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8)


if __name__ == "__main__":
    target = Path(__file__).parents[1] / "scenes" / "ball" / "beach.png"
    target.write_bytes(imagecodecs.png_encode(beach(), level=9))
