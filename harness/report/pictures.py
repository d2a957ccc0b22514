"""Pictures for people, made at record time: what a browser can show of linear float images.

The measurements stay in the EXR files; nothing is ever measured on these. Files end in ``.png`` or
``.webp`` (lossless), and are written whole or not at all.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harness.errors import InputError
from harness.record import write_bytes
from harness.report.colours import BEYOND, NOT_FINITE, SCALE

Floats = NDArray[np.floating]
Bytes = NDArray[np.uint8]


def srgb_encode(linear: Floats) -> Floats:
    """IEC 61966-2-1, for `linear` of any shape; values are clipped to 0 … 1 first."""
    x = np.clip(linear, 0.0, 1.0)
    curve = 1.055 * np.power(x, 1 / 2.4) - 0.055
    return np.where(x <= 0.0031308, 12.92 * x, curve)


def display(pixels: Floats, white: float = 1.0) -> Bytes:
    """Linear radiance (H, W, 3) as sRGB bytes (H, W, 3).

    `white` is the radiance shown as white; more is clipped. A pixel with a NaN or an infinity in
    any channel is magenta, so that it is seen.
    """
    linear = _rgb(pixels)
    finite = np.asarray(np.isfinite(linear).all(axis=-1))
    encoded = srgb_encode(np.where(finite[..., None], linear / white, 0.0))
    shown = np.rint(255 * encoded).astype(np.uint8)
    shown[~finite] = NOT_FINITE
    return shown


def shrink(pixels: Floats, longest: int) -> Floats:
    """(H, W, C) averaged over whole blocks of pixels until neither side exceeds `longest`.

    Averaging is done on linear values, as an eye at a distance does. Rows and columns left over
    at the bottom and right edge go into smaller blocks. NaN in a block makes its average NaN.
    """
    height, width = pixels.shape[:2]
    step = max(1, -(-max(height, width) // longest))
    if step == 1:
        return pixels
    rows = np.arange(0, height, step)
    columns = np.arange(0, width, step)
    with np.errstate(invalid="ignore"):  # inf - inf is NaN, which is what it should be
        sums = np.add.reduceat(np.add.reduceat(pixels, rows, axis=0), columns, axis=1)
    heights = np.diff(np.append(rows, height))
    widths = np.diff(np.append(columns, width))
    return sums / np.multiply.outer(heights, widths)[..., None]


def write_picture(pixels: Floats, path: Path, *, white: float = 1.0) -> Path:
    """Writes linear radiance (H, W, 3) at full size. Returns `path`."""
    return _write(display(pixels, white), path)


def write_thumbnail(pixels: Floats, path: Path, *, longest: int = 192, white: float = 1.0) -> Path:
    """Writes linear radiance (H, W, 3) with no side longer than `longest`. Returns `path`."""
    return _write(display(shrink(_rgb(pixels), longest), white), path)


def difference_colours(a: Floats, b: Floats, limit: float, low: float = 0.0) -> Bytes:
    """|a - b| of two linear images (H, W, 3) as colours (H, W, 3); see `colours.SCALE`.

    Of a pixel's three channels the largest difference counts. The scale is logarithmic from `low`,
    which is the colour of all that is less, to `limit`; with `low` 0 it is linear from 0. What
    exceeds `limit` is `colours.BEYOND`, and what is not finite in either image is
    `colours.NOT_FINITE`. Raises InputError where the sizes differ.
    """
    if a.shape != b.shape:
        raise InputError.of(
            "images of different size cannot be compared",
            value=f"{a.shape[1]} x {a.shape[0]} and {b.shape[1]} x {b.shape[0]}",
        )
    if not (np.isfinite(limit) and limit > 0):
        raise InputError.of("limit of a difference map", value=repr(limit), expected="> 0")
    if not 0 <= low < limit:
        raise InputError.of("least difference of a map", value=repr(low), expected=f"0 … {limit:g}")
    with np.errstate(invalid="ignore"):
        off = np.abs(_rgb(a) - _rgb(b)).max(axis=-1)
    finite = np.isfinite(off)
    known = np.where(finite, off, 0.0)
    share: Floats = known / limit
    if low:
        share = np.log(np.maximum(known, low) / low) / np.log(limit / low)
    knots = np.linspace(0.0, 1.0, len(SCALE))
    table = np.asarray(SCALE, dtype=np.float64)
    channels = [np.interp(share, knots, table[:, channel]) for channel in range(3)]
    shown = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    shown[share > 1.0] = BEYOND
    shown[~finite] = NOT_FINITE
    return shown


def write_difference(a: Floats, b: Floats, limit: float, path: Path, low: float = 0.0) -> Path:
    """Writes the map of `difference_colours` at full size. Returns `path`."""
    return _write(difference_colours(a, b, limit, low), path)


def _rgb(pixels: Floats) -> NDArray[np.float64]:
    if pixels.ndim != 3 or pixels.shape[2] != 3:
        raise InputError.of("not an RGB image", value=str(pixels.shape), expected="(H, W, 3)")
    return pixels.astype(np.float64)


def _write(shown: Bytes, path: Path) -> Path:
    import imagecodecs  # here, because it takes a quarter of a second

    contiguous = np.ascontiguousarray(shown)
    if path.suffix == ".png":
        data = imagecodecs.png_encode(contiguous, level=6)
    elif path.suffix == ".webp":
        data = imagecodecs.webp_encode(contiguous, lossless=True, method=0)
    else:
        raise InputError.of("picture's file type", file=path, expected=".png or .webp")
    write_bytes(path, bytes(data))
    return path
