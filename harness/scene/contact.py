"""Which solids share a face: what is on the other side of it is no one medium."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from harness.scene import resolved
from harness.scene.containment import MOST_WORK, bounds, signed_distance, surface_points
from harness.scene.regions import Region, Side, depth, region

FEWEST = 4  # points that tell a face from a chance touch in a point or along a line


def share_a_face(a: resolved.SolidShape, b: resolved.SolidShape, tolerance: float) -> bool:
    """Whether a face of one solid lies in a surface of the other.

    Told by points of the faces; also true of faces in one plane, or on one sphere, that are beside
    each other while the solids' boxes meet.
    """
    (a_low, a_high), (b_low, b_high) = bounds(a), bounds(b)
    if np.any(a_low > b_high + tolerance) or np.any(b_low > a_high + tolerance):
        return False
    return _lies_in(a, b, tolerance) or _lies_in(b, a, tolerance)


def _lies_in(a: resolved.SolidShape, b: resolved.SolidShape, tolerance: float) -> bool:
    if isinstance(a, resolved.Mesh):
        return _triangle_lies_in(a, b, tolerance)
    points = surface_points(a)
    for own in sides(region(a)):
        face = points[np.abs(depth(own, points)) <= tolerance]
        if len(face) < FEWEST:
            continue
        if isinstance(b, resolved.Mesh):
            if np.sum(np.abs(signed_distance(b, face)) <= tolerance) >= FEWEST:
                return True
        elif any(np.all(np.abs(depth(side, face)) <= tolerance) for side in sides(region(b))):
            return True
    return False


def _triangle_lies_in(a: resolved.Mesh, b: resolved.SolidShape, tolerance: float) -> bool:
    """Whether all corners and the middle of any triangle are on the surface of `b`."""
    corners = np.array(a.vertices)[np.array(a.triangles)]
    low, high = bounds(b)
    near = np.all((corners >= low - tolerance) & (corners <= high + tolerance), axis=(1, 2))
    corners = corners[near]
    if isinstance(b, resolved.Mesh):
        corners = corners[: MOST_WORK // len(b.triangles)]
    for corner in (None, 0, 1, 2):
        at = corners.mean(axis=1) if corner is None else corners[:, corner]
        corners = corners[np.abs(signed_distance(b, at)) <= tolerance]
    return len(corners) > 0


def sides(where: Region) -> Iterator[Side]:
    """All bounds of a region."""
    if isinstance(where, Side):
        yield where
        return
    for part in where.parts:
        yield from sides(part)
