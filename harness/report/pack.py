"""Pixel packs: numbers in a script, which a page opened from a file may load; it may not fetch.

A pack is one call, ``snellcheckPack({...})``. Arrays in it are planar little-endian float32 whose
bytes are shuffled (all first bytes, then all second ones, …), deflated and written as base64. An
array may be given as the bitwise difference from an earlier one, which for renderers that agree
leaves few bits. Images are lossless; what only draws diagrams is rounded to fewer bits, which then
take no room. Why float32: docs/decisions/0010-pixel-packs.md.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.record import write_text

SCHEMA = "snellcheck-pack/1"
FULL = 24  # significant bits of a float32
FOR_DRAWING = 14  # six hundredths of a pixel in a thousand


class Image:
    """An image on its way into a pack: planar (3, H, W)."""

    def __init__(
        self, name: str, role: str, planes: NDArray[np.float32], like: Image | None
    ) -> None:
        self.name, self.role, self.planes = name, role, planes
        self.like = like if like is not None and like.planes.shape == planes.shape else None

    def entry(self, position: Mapping[Image, int]) -> dict[str, Any]:
        """What the pack holds of it; `position` tells where the earlier images stand in it."""
        _, height, width = self.planes.shape
        found = {"name": self.name, "role": self.role, "width": width, "height": height}
        if self.like is None:
            return {**found, "data": squeezed(self.planes)}
        bits = self.planes.view("<u4") ^ self.like.planes.view("<u4")
        return {**found, "like": position[self.like], "data": squeezed(bits)}


def image(name: str, role: str, pixels: NDArray[np.float32], like: Image | None = None) -> Image:
    """An image (H, W, 3); with `like` of the same size only the difference from it is stored."""
    return Image(name, role, np.ascontiguousarray(pixels.transpose(2, 0, 1), "<f4"), like)


def rounded(values: NDArray[np.floating], bits: int = FOR_DRAWING) -> NDArray[np.float32]:
    """`values` as float32 with `bits` significant bits; NaN and infinities stay what they are."""
    exact = np.ascontiguousarray(values, "<f4")
    drop = FULL - bits
    pattern = exact.view("<u4")
    nearest = (pattern + np.uint32(1 << (drop - 1))) & np.uint32(0xFFFFFFFF << drop & 0xFFFFFFFF)
    return np.where(np.isfinite(exact), nearest.view("<f4"), exact)


def squeezed(values: NDArray[Any]) -> str:
    """Base64 of the deflated, shuffled bytes of an array of 4-byte items."""
    import imagecodecs  # libdeflate takes a third of zlib's time, and a little less room

    shuffled = values.reshape(-1).view(np.uint8).reshape(-1, 4).T.tobytes()
    deflated = imagecodecs.deflate_encode(shuffled, level=6, raw=False)
    return base64.b64encode(deflated).decode("ascii")


def array(values: NDArray[np.floating], bits: int = FOR_DRAWING) -> dict[str, Any]:
    """An array of any shape, rounded to `bits` significant bits."""
    stored = rounded(values, bits) if bits < FULL else np.ascontiguousarray(values, "<f4")
    return {"shape": list(values.shape), "data": squeezed(stored)}


def write(
    path: Path,
    case_id: str,
    images: Sequence[Image],
    probes: Sequence[Any] = (),
    ways: Mapping[str, Any] | None = None,
) -> Path:
    """Writes the pack of a case. The same data give the same bytes. Returns `path`."""
    position = {entry: k for k, entry in enumerate(images)}
    pack = {
        "schema": SCHEMA,
        "case": case_id,
        "images": [entry.entry(position) for entry in images],
        "probes": list(probes),
        **({"ways": ways} if ways else {}),
    }
    # JSON is JavaScript; "<" never stands in it, so that it may also be put into a page.
    text = json.dumps(pack, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    write_text(path, f"snellcheckPack({text});\n")
    return path
