"""What a scene is, as one short text that is the same on every machine.

`scene.json` holds floats that went through sine, square root and matrix products. Mathematics
libraries differ in the last bit of these, so a hash of the exact text says that the scene has
changed when only the machine has. Here floats count to ten digits, which is a thousandth of the
smallest change of an index or an angle that any check resolves.
"""

from __future__ import annotations

import hashlib
import json

from harness.scene.resolved import ResolvedScene

DIGITS = 10
# Below this a coordinate is the rounding error of one that is zero. Scenes are a few units large.
NOTHING = 1e-13


def fingerprint(scene: ResolvedScene) -> str:
    """The SHA-256, in hex, of the scene with its floats to ten significant digits."""
    rounded = json.loads(scene.model_dump_json(), parse_float=_rounded)
    text = json.dumps(rounded, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _rounded(text: str) -> str:
    value = float(text)
    return f"{value:.{DIGITS}g}" if abs(value) > NOTHING else "0"
