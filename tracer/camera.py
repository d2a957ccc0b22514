"""Cameras: the ray through a point of the film, and through a point of the lens if there is one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracer.compiled import inlined
from tracer.errors import SceneError
from tracer.vector import Vec, along, normalise, sub

PERSPECTIVE, ORTHOGRAPHIC, THIN_LENS = 0.0, 1.0, 2.0
SIDE = 20  # column of camera_row


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


@dataclass(frozen=True)
class ThinLens:
    """A perfect lens around `origin`, of radius `aperture`: what is `focus` units ahead is sharp.

    The rest is blurred: a point of the film sees the mean through `side` x `side` points of the
    lens, the middles of regions of equal area. With an aperture of 0 it is a pinhole.
    """

    origin: Vec
    right: Vec
    up: Vec
    forward: Vec
    tan_half_fov_x: float
    aperture: float
    focus: float
    side: int = 4

    def __post_init__(self) -> None:
        if not (0.0 <= self.aperture < math.inf and 0.0 < self.focus < math.inf):
            raise SceneError(
                "a lens needs an aperture of at least 0 and a positive focus, "
                f"not {self.aperture} and {self.focus}"
            )
        if not 1 <= self.side <= 256:
            raise SceneError(f"a lens has 1 to 256 samples a side, not {self.side}")


Camera = Perspective | Orthographic | ThinLens


def camera_row(camera: Camera, width: int, height: int) -> NDArray[np.float64]:
    """Kind, origin, forward, the film's half axes, right and up, the lens's, its focus and side."""
    kind, half, aperture, focus, side = PERSPECTIVE, 0.0, 0.0, 1.0, 1
    match camera:
        case Perspective():
            half = camera.tan_half_fov_x
        case Orthographic():
            kind, half = ORTHOGRAPHIC, camera.width / 2.0
        case ThinLens():
            kind, half = THIN_LENS, camera.tan_half_fov_x
            aperture, focus, side = camera.aperture, camera.focus, camera.side
    right, up = np.array(camera.right), np.array(camera.up)
    film = (*(half * right), *(half * height / width * up))
    lens = (*(aperture * right), *(aperture * up))
    return np.array([kind, *camera.origin, *camera.forward, *film, *lens, focus, side])


@inlined
def primary_ray(
    row: NDArray[np.float64], x: float, y: float, u: float, v: float
) -> tuple[Vec, Vec]:
    """(origin, direction) through the film at x, y in [-1, 1], x to the right and y up.

    `u`, `v` in the unit disk say through which point of the lens, where there is one.
    """
    origin = (row[1], row[2], row[3])
    forward = (row[4], row[5], row[6])
    right = (row[7], row[8], row[9])
    up = (row[10], row[11], row[12])
    if row[0] == ORTHOGRAPHIC:
        return along(along(origin, x, right), y, up), forward
    through = along(along(forward, x, right), y, up)
    if row[0] == THIN_LENS:
        start = along(along(origin, u, (row[13], row[14], row[15])), v, (row[16], row[17], row[18]))
        return start, normalise(sub(along(origin, row[19], through), start))
    return origin, normalise(through)


@inlined
def lens_point(k: int, side: int) -> tuple[float, float]:
    """The middle of the k-th of `side` x `side` regions of equal area of the unit disk.

    P. Shirley, K. Chiu, A low distortion map between disk and square, J. Graphics Tools 2, 1997.
    """
    a = 2.0 * (k % side + 0.5) / side - 1.0
    b = 2.0 * (k // side + 0.5) / side - 1.0
    if a == 0.0 and b == 0.0:
        return 0.0, 0.0
    if abs(a) > abs(b):
        r, phi = a, math.pi / 4.0 * b / a
    else:
        r, phi = b, math.pi / 2.0 - math.pi / 4.0 * a / b
    return r * math.cos(phi), r * math.sin(phi)


@inlined
def pixel_centre(i: int, j: int, width: int, height: int) -> tuple[float, float]:
    """Film coordinates of the centre of the pixel in column i, row j; row 0 is at the top."""
    return 2.0 * (i + 0.5) / width - 1.0, 1.0 - 2.0 * (j + 0.5) / height
