"""What is away from what: where a ray need not look for what it cannot meet.

Objects are taken for the spheres around them, rows of (center, squared radius); solids come first.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tracer.shapes import INF, Disk, Plane, Rectangle, Sphere
from tracer.solids import Cell

Floats = NDArray[np.float64]
OpenShape = Rectangle | Disk | Plane
CROWD, BALL, FLAT = range(3)  # a ball or a cell between planes is alone, or none of these
WELL = 1.0 + 1e-6  # times the sum of their radii, solids are well apart from each other
TOUCHING = 1.0 - 1e-9  # times its radius, nothing is in a ball; a floor that it lies on is not
FEW = 12  # planes of a cell whose corners are looked for


def apart(balls: Sequence[Sequence[float]], solids: int) -> bool:
    """Whether solids are well apart from each other."""
    table = np.array(balls[:solids]).reshape(-1, 4)
    return all(bool(_well_apart(table[k + 1 :], table[k]).all()) for k in range(solids))


def alone(
    shapes: Sequence[object], balls: Sequence[Sequence[float]], faces: Mapping[int, OpenShape]
) -> list[int]:
    """Which solids are alone: others are well apart, and nothing else is within.

    `shapes` are those of the solids, `faces` the objects that have no sphere around them.
    """
    table, solids, found = np.array(balls).reshape(-1, 4), len(shapes), []
    for k, shape in enumerate(shapes):
        corners = None
        if isinstance(shape, Cell) and len(shape.bounds) <= FEW:
            planes = [bound for bound in shape.bounds if isinstance(bound, Plane)]
            corners = _corners(planes) if len(planes) == len(shape.bounds) else None
        away = _well_apart(table[:solids], table[k])
        away[k] = True
        begin, radius = _distances(table, table[k]) - np.sqrt(table[:, 3]), math.sqrt(table[k, 3])
        for other, face in faces.items():
            begin[other] = _distance(face, table[k, :3])
            if corners is not None and _passes_by(face, corners, radius):
                begin[other] = INF
        free = away.all() and (begin[solids:] >= radius * TOUCHING).all()
        kind = BALL if isinstance(shape, Sphere) else CROWD if corners is None else FLAT
        found.append(kind if free else CROWD)
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


def _corners(planes: Sequence[Plane]) -> Floats:
    """(n, 3) where three of the planes meet, behind all others."""
    normals, offsets = np.array([p.normal for p in planes]), np.array([p.offset for p in planes])
    threes = np.array(list(itertools.combinations(range(len(planes)), 3))).reshape(-1, 3)
    threes = threes[np.abs(np.linalg.det(normals[threes])) > 1e-12]
    points = np.linalg.solve(normals[threes], offsets[threes][:, :, None])[:, :, 0]
    behind = points @ normals.T <= offsets + 1e-9 * np.abs(points).max(initial=1.0)
    return np.asarray(points[behind.all(axis=1)])


def _passes_by(face: OpenShape, corners: Floats, radius: float) -> bool:
    """Whether the plane of a face is well on one side of a solid."""
    if isinstance(face, Plane):
        heights = corners @ np.array(face.normal) - face.offset
    else:
        heights = (corners - face.origin) @ np.array(face.z)
    least = (WELL - 1.0) * radius
    return bool((heights > least).all() or (heights < -least).all())
