"""Cameras: the ray through a point of the film."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracer.compiled import inlined
from tracer.vector import Vec, along, normalise

PERSPECTIVE, ORTHOGRAPHIC = 0.0, 1.0


@dataclass(frozen=True)
class Perspective:
    """A pinhole at `origin`; `right`, `up`, `forward` are orthonormal."""

    origin: Vec
    right: Vec
    up: Vec
    forward: Vec
    tan_half_fov_x: float


@dataclass(frozen=True)
class Orthographic:
    """Parallel rays along `forward`, from a film of `width` units around `origin`."""

    origin: Vec
    right: Vec
    up: Vec
    forward: Vec
    width: float


def camera_row(camera: Perspective | Orthographic, width: int, height: int) -> NDArray[np.float64]:
    """Kind, origin, forward, and the film's half axes, right and up."""
    if isinstance(camera, Perspective):
        kind, half = PERSPECTIVE, camera.tan_half_fov_x
    else:
        kind, half = ORTHOGRAPHIC, camera.width / 2.0
    right = half * np.array(camera.right)
    up = half * height / width * np.array(camera.up)
    return np.array([kind, *camera.origin, *camera.forward, *right, *up])


@inlined
def primary_ray(row: NDArray[np.float64], x: float, y: float) -> tuple[Vec, Vec]:
    """(origin, direction) through the film at x, y in [-1, 1], x to the right and y up."""
    origin = (row[1], row[2], row[3])
    forward = (row[4], row[5], row[6])
    right = (row[7], row[8], row[9])
    up = (row[10], row[11], row[12])
    if row[0] == ORTHOGRAPHIC:
        return along(along(origin, x, right), y, up), forward
    return origin, normalise(along(along(forward, x, right), y, up))


@inlined
def pixel_centre(i: int, j: int, width: int, height: int) -> tuple[float, float]:
    """Film coordinates of the centre of the pixel in column i, row j; row 0 is at the top."""
    return 2.0 * (i + 0.5) / width - 1.0, 1.0 - 2.0 * (j + 0.5) / height
