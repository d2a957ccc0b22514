"""What is away from what: where a ray need not look for what it cannot meet.

Objects are taken for the spheres around them, rows of (center, squared radius); solids come first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tracer.shapes import Disk, Plane, Rectangle

Floats = NDArray[np.float64]
OpenShape = Rectangle | Disk | Plane
WELL = 1.0 + 1e-6  # times the sum of their radii, solids are well apart from each other
TOUCHING = 1.0 - 1e-9  # times its radius, nothing is in a ball; a floor that it lies on is not


def apart(balls: Sequence[Sequence[float]], solids: int) -> bool:
    """Whether solids are well apart from each other."""
    table = np.array(balls[:solids]).reshape(-1, 4)
    return all(bool(_well_apart(table[k + 1 :], table[k]).all()) for k in range(solids))


def alone(
    balls: Sequence[Sequence[float]], solids: int, faces: Mapping[int, OpenShape]
) -> list[bool]:
    """Of each solid, whether other solids are well apart from it, and nothing else is within.

    `faces` are the objects that have no sphere around them.
    """
    table = np.array(balls).reshape(-1, 4)
    found = []
    for k in range(solids):
        away = _well_apart(table[:solids], table[k])
        away[k] = True
        begin = _distances(table, table[k]) - np.sqrt(table[:, 3])
        for other, face in faces.items():
            begin[other] = _distance(face, table[k, :3])
        free = begin[solids:] >= math.sqrt(table[k, 3]) * TOUCHING
        found.append(bool(away.all() and free.all()))
    return found


def _distances(balls: Floats, ball: Floats) -> Floats:
    return np.asarray(np.linalg.norm(balls[:, :3] - ball[:3], axis=1))


def _well_apart(balls: Floats, ball: Floats) -> NDArray[np.bool_]:
    reach = np.sqrt(balls[:, 3]) + math.sqrt(ball[3])
    return np.asarray(_distances(balls, ball) > reach * WELL)


def _distance(face: OpenShape, p: Floats) -> float:
    if isinstance(face, Plane):
        return abs(float(p @ np.array(face.normal)) - face.offset)
    x, y, z = (np.array([face.x, face.y, face.z]) @ (p - face.origin)).tolist()
    if isinstance(face, Disk):
        return math.hypot(max(0.0, math.hypot(x, y) - face.radius), z)
    width, height = face.size
    return math.hypot(max(0.0, abs(x) - width / 2.0), max(0.0, abs(y) - height / 2.0), z)
