"""Where POV-Ray's camera looks, and what it sees there: patterns to the pixel."""

from __future__ import annotations

import base64
from collections.abc import Callable

import numpy as np
import pytest

from harness.scene import resolved as rs
from tests.harness.povray_measure import assert_image, images, needs_povray, step
from tests.harness.povray_scenes import PERSPECTIVE, TILTED, Array, make_scene, on_plane, rays

pytestmark = [pytest.mark.povray, needs_povray]

PARALLEL = rs.Orthographic(
    origin=(-5.5, 0.2, 5), right=(0.8, 0, 0.6), up=(0, 1, 0), forward=(0.6, 0, -0.8), width=7
)
TEXELS = np.random.default_rng(1).integers(0, 65536, (37, 53, 3)).astype("<u2")
PICTURE = rs.Picture(width=53, height=37, pixels=base64.b64encode(TEXELS.tobytes()).decode())


def picture_at(u: Array, v: Array) -> Array:
    return np.asarray(TEXELS[((1 - v) * 37).astype(int), (u * 53).astype(int)] / 65535)


def checker_at(u: Array, v: Array) -> Array:
    even = (np.floor(u * 31) + np.floor(v * 17)) % 2 == 0
    return np.where(even[:, None], (0.1, 0.3, 0.9), (0.9, 0.6, 0.2))


def ramp_at(u: Array, v: Array) -> Array:
    return np.array((0.1, 2, 0.5)) + v[:, None] * (np.array((3, 0.2, 0.5)) - (0.1, 2, 0.5))


PATTERNS: list[tuple[rs.Pattern, Callable[[Array, Array], Array]]] = [
    (PICTURE, picture_at),
    (rs.Checker(a=(0.1, 0.3, 0.9), b=(0.9, 0.6, 0.2), cells=(31, 17)), checker_at),
    (rs.Ramp(start=(0.1, 2, 0.5), end=(3, 0.2, 0.5), axis="v"), ramp_at),
]


@pytest.mark.parametrize(("pattern", "at"), PATTERNS, ids=["picture", "checker", "ramp"])
def test_patterns_lie_where_they_should(
    pattern: rs.Pattern, at: Callable[[Array, Array], Array]
) -> None:
    """A picture of noise is as asymmetric as can be: it tells every mirror image and shift."""
    faces = (TILTED, rs.Disk(frame=TILTED.frame, radius=2))
    scenes = [
        make_scene(view, surfaces=[(face, rs.Emissive(pattern=pattern))])
        for view in (PERSPECTIVE, PARALLEL)
        for face in faces
    ]
    for scene, face, pixels in zip(scenes, faces * 2, images(*scenes), strict=True):
        x, y, _ = on_plane(*rays(scene), TILTED.frame)
        if isinstance(face, rs.Disk):
            u, v, inside = x / 4 + 0.5, y / 4 + 0.5, np.hypot(x, y) < 2
        else:
            u, v = x / 6 + 0.5, y / 4 + 0.5
            inside = (np.abs(x) < 3) & (np.abs(y) < 2)
        assert 0.2 < inside.mean() < 1
        seen = at(np.clip(u, 0, 1 - 1e-9), np.clip(v, 1e-9, 1))
        assert np.abs(pixels - np.where(inside[:, None], seen, 0)).max() <= step(scene)


def test_texels_come_back_to_the_bit() -> None:
    scene = make_scene(PERSPECTIVE, surfaces=[(TILTED, rs.Emissive(pattern=PICTURE))])
    (pixels,) = images(scene)
    values = pixels * 65535
    assert np.abs(values - np.round(values)).max() < 0.01
    assert set(np.round(values[:, 0])) <= {0, *TEXELS[..., 0].ravel().tolist()}


@pytest.mark.parametrize("axis", ["u", "v"])
def test_position_codes_of_many_cells(axis: str) -> None:
    """16384 cells are as exact as 1000: within a cell, a place is known to 1 / 65535 of it."""
    code = rs.PositionCode.model_validate({"axis": axis, "cells": 16384, "amplitude": 1.0})
    scene = make_scene(PERSPECTIVE, surfaces=[(TILTED, rs.Emissive(pattern=code))])
    x, y, _ = on_plane(*rays(scene), TILTED.frame)
    c = x / 6 + 0.5 if axis == "u" else y / 4 + 0.5
    inside = (np.abs(x) < 3) & (np.abs(y) < 2)
    fine = c * 16384 % 1
    inside &= (fine > 1e-6) & (fine < 1 - 1e-6)  # where a cell ends no rounding is right
    expected = np.stack([c, fine, np.ones_like(c)], axis=1)
    assert_image(scene, expected, where=inside)
