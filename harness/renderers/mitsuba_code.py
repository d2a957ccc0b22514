"""The position code as a texture of Mitsuba's, so that a code plane is one rectangle.

Cut into a strip per cell it could do with Mitsuba's own bitmaps, but single precision lets some
rays slip through between strips.

Imported only in the process that hosts Mitsuba, after its variant was chosen.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from harness.translate.mitsuba_textures import CODE_TEXTURE


class CodeTexture(mi.Texture):
    """amplitude * (c, frac(cells c), 1) with c = u where `axis` is 0, and v where it is 1."""

    def __init__(self, properties: Any) -> None:
        super().__init__(properties)
        # Opaque: no other kernel for other numbers.
        self.cells = dr.opaque(mi.Float, properties["cells"])
        self.amplitude = dr.opaque(mi.Float, properties["amplitude"])
        self.axis = properties["axis"]

    def eval(self, si: Any, active: Any = True) -> Any:  # noqa: ARG002  (Mitsuba's signature)
        coordinate = si.uv[self.axis]
        scaled = coordinate * self.cells
        code: Any = mi.Color3f(coordinate, scaled - dr.floor(scaled), 1.0)
        return code * self.amplitude

    def is_spatially_varying(self) -> bool:
        return True

    def to_string(self) -> str:
        return f"{CODE_TEXTURE}[axis={self.axis}]"


def register() -> None:
    """Makes the texture known to Mitsuba's current variant."""
    mi.register_texture(CODE_TEXTURE, CodeTexture)
