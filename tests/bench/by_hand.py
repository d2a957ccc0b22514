"""How fast a tracer could be: the ball scene in a loop that is written for nothing else.

One ball of glass around the origin, a checkerboard behind it, one camera, all of them constants;
no recursion, as the rays of a ball come one after the other. It follows the same rays as `tracer`,
with the same formulas, to the same image. What it takes is what one ray at a time can reach, in
the same language on the same machine.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from tracer.threads import Work, for_bands

_numba: Any = numba
Floats = NDArray[np.float64]

IOR, FAR, BOARD, HALF, CELLS = 1.5, 6.0, -3.0, 8.0, 16  # of scenes/ball/checkerboard.toml
TAN_HALF_FOV = math.tan(math.radians(15.0))
MOST_SEGMENTS, LEAST_WEIGHT = 40, 1e-6
_options: Any = {"error_model": "numpy", "nogil": True, "forceinline": True}


@_numba.njit(**_options)
def _board(x: float, y: float, z: float, dx: float, dy: float, dz: float) -> int:
    """Which colour of the checkerboard a ray meets that meets no ball; -1 for none."""
    if dz >= 0.0:
        return -1
    t = (BOARD - z) / dz
    u, v = x + t * dx, y + t * dy
    if abs(u) > HALF or abs(v) > HALF:
        return -1
    i = min(int((u + HALF) * (CELLS / (2.0 * HALF))), CELLS - 1)
    j = min(int((v + HALF) * (CELLS / (2.0 * HALF))), CELLS - 1)
    return (i + j) & 1


@_numba.njit(**_options)
def _fresnel(cos_i: float, cos_t: float, ior_i: float, ior_t: float) -> float:
    s = (ior_i * cos_i - ior_t * cos_t) / (ior_i * cos_i + ior_t * cos_t)
    p = (ior_t * cos_i - ior_i * cos_t) / (ior_t * cos_i + ior_i * cos_t)
    return 0.5 * (s * s + p * p)


@_numba.njit(**_options)
def _pixel(dx: float, dy: float, dz: float, shares: Floats) -> int:
    """Fills `shares`, the weights of the board's two colours; how many rays that took."""
    shares[0] = shares[1] = 0.0
    near = -FAR * dz
    hx, hy, hz = near * dx, near * dy, FAR + near * dz
    half_squared = 1.0 - (hx * hx + hy * hy + hz * hz)
    if half_squared < 0.0:
        colour = _board(0.0, 0.0, FAR, dx, dy, dz)
        if colour >= 0:
            shares[colour] = 1.0
        return 1
    t = near - math.sqrt(half_squared)
    x, y, z = t * dx, t * dy, FAR + t * dz
    weight, rays, segments = 1.0, 1, 1
    ior_i, ior_t, side = 1.0, IOR, 1.0
    while True:  # at a point of the ball, from outside or from inside
        onto = 1.5 - 0.5 * (x * x + y * y + z * z)  # or errors would grow sevenfold each time
        x, y, z = onto * x, onto * y, onto * z
        nx, ny, nz = side * x, side * y, side * z
        cos_i = -(dx * nx + dy * ny + dz * nz)
        mu = ior_i / ior_t
        cos_t = math.sqrt((ior_t - ior_i) * (ior_t + ior_i) / (ior_t * ior_t) + mu * mu * cos_i**2)
        R = _fresnel(cos_i, cos_t, ior_i, ior_t)
        b = mu * cos_i - cos_t
        wx, wy, wz = b * nx + mu * dx, b * ny + mu * dy, b * nz + mu * dz
        rx, ry, rz = dx + 2.0 * cos_i * nx, dy + 2.0 * cos_i * ny, dz + 2.0 * cos_i * nz
        outside, inside = (1.0 - R) * weight, R * weight
        if side > 0.0:
            outside, inside = inside, outside
            wx, wy, wz, rx, ry, rz = rx, ry, rz, wx, wy, wz
        segments += 1
        if segments > MOST_SEGMENTS:
            return rays
        if outside >= LEAST_WEIGHT:
            rays += 1
            colour = _board(x, y, z, wx, wy, wz)
            if colour >= 0:
                shares[colour] += outside
        if inside < LEAST_WEIGHT:
            return rays
        rays += 1
        dx, dy, dz, weight = rx, ry, rz, inside
        t = -2.0 * (x * dx + y * dy + z * dz)
        x, y, z = x + t * dx, y + t * dy, z + t * dz
        ior_i, ior_t, side = IOR, 1.0, -1.0


@_numba.njit(**(_options | {"forceinline": False}))
def _rows(shares: Floats, begin: int, end: int) -> int:
    rays, size = 0, shares.shape[1]
    for j in range(begin, end):
        y = TAN_HALF_FOV * (1.0 - 2.0 * (j + 0.5) / size)
        for i in range(size):
            x = TAN_HALF_FOV * (2.0 * (i + 0.5) / size - 1.0)
            length = math.sqrt(x * x + y * y + 1.0)
            rays += _pixel(x / length, y / length, -1.0 / length, shares[j, i])
    return rays


def render(size: int, threads: int) -> tuple[Floats, int]:
    """(size, size, 2), the weights of the board's colours in each pixel; and how many rays."""
    shares, rays = np.empty((size, size, 2)), []

    def worker() -> Work:
        return lambda begin, end: rays.append(_rows(shares, begin, end))

    for_bands(worker, size, 4, threads)
    return shares, sum(rays)
