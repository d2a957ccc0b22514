"""Patterns of the resolved scene as Mitsuba's textures: small float32 bitmaps, taken raw.

Mitsuba's own checkerboard refuses radiance above 1, and its colours go through a reflectance model.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from harness.scene import resolved as rs
from harness.translate.mitsuba_shapes import Matrix, Node, affine
from harness.translate.texels import knots_of, radiance_of

CODE_TEXTURE = "snellcheck_position_code"


def texture(pattern: rs.Checker | rs.Ramp | rs.Picture) -> Node:
    """The pattern over (u, v)."""
    match pattern:
        case rs.Checker():
            # 2 x 2 texels, repeated
            x, y = pattern.cells
            texels = [[pattern.a, pattern.b], [pattern.b, pattern.a]]
            return _bitmap(texels, "nearest", "repeat", _uv_map((x / 2, y / 2), (0, 0)))
        case rs.Ramp(axis="u"):
            return _ramp([[pattern.start, pattern.end], [pattern.start, pattern.end]])
        case rs.Ramp():
            return _ramp([[pattern.start, pattern.start], [pattern.end, pattern.end]])
        case rs.Picture():
            return _bitmap(radiance_of(pattern)[::-1], "nearest", "clamp", _uv_map((1, 1), (0, 0)))


def _bitmap(pixels: Any, filter_type: str, wrap_mode: str, to_uv: Matrix) -> Node:
    return {
        "type": "bitmap",
        "pixels": np.ascontiguousarray(pixels, np.float32),
        "raw": True,
        "format": "variant",
        "filter_type": filter_type,
        "wrap_mode": wrap_mode,
        "to_uv": to_uv,
    }


def _ramp(texels: Any) -> Node:
    """Bilinear between four texels, whose centres are at 1/4 and 3/4: [0, 1] is taken there."""
    return _bitmap(texels, "bilinear", "clamp", _uv_map((0.5, 0.5), (0.25, 0.25)))


def _uv_map(scale: tuple[float, float], offset: tuple[float, float]) -> Matrix:
    return affine((scale[0], 0, 0), (0, scale[1], 0), (0, 0, 1), (*offset, 0))


def environment(panorama: rs.Panorama) -> Node:
    """Mitsuba's panorama begins at -z, where ours has its middle, and its rows at the poles."""
    return {
        "type": "envmap",
        "pixels": np.ascontiguousarray(knots_of(panorama), np.float32),
        "to_world": affine((-1, 0, 0), (0, 1, 0), (0, 0, -1), (0, 0, 0)),
    }


def code_texture(code: rs.PositionCode) -> Node:
    """The code, as the texture of ours that `harness.renderers.mitsuba_code` registers."""
    return {
        "type": CODE_TEXTURE,
        "cells": float(code.cells),
        "amplitude": code.amplitude,
        "axis": "uv".index(code.axis),
    }
