"""Pictures as patterns: PNG files of 8 or 16 bits, as linear radiance."""

from __future__ import annotations

import base64
import struct
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from harness.scene import resolved
from harness.scene.files import KEY, read_beside
from harness.scene.findings import Finding, SceneInvalid, quoted

LARGEST_FILE = 64 * 2**20  # bytes
MOST_PIXELS = 2048 * 2048  # 8 bytes each in scene.json
SIGNATURE = b"\x89PNG\r\n\x1a\n"


def read_picture(folder: Path, name: str, encoding: Literal["srgb", "linear"]) -> resolved.Picture:
    """The picture `name` beside a scene file. Raises SceneInvalid at the key ``file``.

    Radiance 1 is the file's white. `encoding` alone says how values are meant; what the file
    says of its gamma is ignored. Grey becomes equal red, green and blue.
    """
    data = read_beside(folder, name, LARGEST_FILE)
    width, height = _size(data, name)
    try:
        import imagecodecs

        pixels = imagecodecs.png_decode(data)
    except Exception as error:  # of the codec's own kinds
        message = f"not a readable PNG picture: {error}"
        raise SceneInvalid(Finding(KEY, message[:200], quoted(name))) from error
    linear = radiance(_rgb(pixels, name), encoding)
    encoded = base64.b64encode(linear.astype("<u2").tobytes()).decode("ascii")
    return resolved.Picture(width=width, height=height, pixels=encoded)


def radiance(pixels: NDArray[Any], encoding: Literal["srgb", "linear"]) -> NDArray[np.uint16]:
    """Integer pixels of 8 or 16 bits as radiance, where 65535 is 1.

    sRGB by IEC 61966-2-1. 8-bit linear values are exact: 255 · 257 = 65535.
    """
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"pixels of {pixels.dtype}")
    most = int(np.iinfo(pixels.dtype).max)
    if encoding == "linear":
        return (pixels.astype(np.uint32) * (65535 // most)).astype(np.uint16)
    value = np.arange(most + 1) / most
    decoded = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    table = np.rint(65535 * decoded).astype(np.uint16)
    return np.asarray(table[pixels])


def _size(data: bytes, name: str) -> tuple[int, int]:
    """Width and height from the header, before a decoder is trusted with the rest."""
    if len(data) < 24 or not data.startswith(SIGNATURE) or data[12:16] != b"IHDR":
        raise SceneInvalid(Finding(KEY, "not a PNG picture", quoted(name), "a PNG file"))
    width, height = struct.unpack(">II", data[16:24])
    if width * height > MOST_PIXELS or not width * height:
        message = f"{width} × {height} pixels"
        raise SceneInvalid(Finding(KEY, message, quoted(name), f"1 to {MOST_PIXELS}"))
    return width, height


def _rgb(pixels: NDArray[Any], name: str) -> NDArray[Any]:
    if pixels.ndim == 2:
        pixels = pixels[:, :, None]
    if pixels.shape[2] in (2, 4):
        if (pixels[:, :, -1] != np.iinfo(pixels.dtype).max).any():
            expected = "an opaque picture"
            raise SceneInvalid(Finding(KEY, "is transparent in places", quoted(name), expected))
        pixels = pixels[:, :, :-1]
    return np.broadcast_to(pixels, (*pixels.shape[:2], 3))
