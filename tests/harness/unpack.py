"""Reads pixel packs back, by another way than the pages do: for tests."""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def read_pack(path: Path) -> dict[str, Any]:
    """The one argument of the one call in the file."""
    text = path.read_text("ascii")
    assert text.startswith("snellcheckPack(")
    assert text.endswith(");\n")
    return json.loads(text.removeprefix("snellcheckPack(").removesuffix(");\n"))


def floats(data: str) -> NDArray[np.float32]:
    return _bytes(data).view("<f4")


def pixels(pack: dict[str, Any], index: int) -> NDArray[np.float32]:
    """(H, W, 3) of one image."""
    entry = pack["images"][index]
    bits = _bytes(entry["data"]).view("<u4")
    if "like" in entry:
        bits = bits ^ _bytes(pack["images"][entry["like"]]["data"]).view("<u4")
    return bits.view("<f4").reshape(3, entry["height"], entry["width"]).transpose(1, 2, 0)


def _bytes(data: str) -> NDArray[np.uint8]:
    shuffled = zlib.decompress(base64.b64decode(data))
    return np.frombuffer(shuffled, np.uint8).reshape(4, -1).T.copy().reshape(-1)
