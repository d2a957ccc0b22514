"""What a scene is, as one short text that is the same on every machine.

`scene.json` holds floats that went through sine, square root and matrix products. Mathematics
libraries differ in the last bit of these, so a hash of the exact text says that the scene has
changed when only the machine has. Here floats count to ten digits, which is a thousandth of the
smallest change of an index or an angle that any check resolves.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator

from pydantic import BaseModel

from harness.scene.resolved import ResolvedScene

DIGITS = 10
# Below this a coordinate is the rounding error of one that is zero. Scenes are a few units large.
NOTHING = 1e-13


def fingerprint(scene: ResolvedScene) -> str:
    """The SHA-256, in hex, of the scene with its floats to ten significant digits.

    What has its default value is left out, so that a scene stays the same when the format learns
    something new; but for the types of shapes, cameras, materials and patterns, which are defaults.
    """
    text = scene.model_dump_json(exclude_defaults=True)
    rounded = json.loads(text, parse_float=_rounded)
    content = {"scene": rounded, "types": list(_types(scene))}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _types(value: object) -> Iterator[str]:
    """What tells variants of one thing apart, in the order of the document."""
    if isinstance(value, BaseModel):
        if isinstance(kind := getattr(value, "type", None), str):
            yield kind
        for name in type(value).model_fields:
            yield from _types(getattr(value, name))
    elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
        for part in value:
            yield from _types(part)


def _rounded(text: str) -> str:
    value = float(text)
    return f"{value:.{DIGITS}g}" if abs(value) > NOTHING else "0"
