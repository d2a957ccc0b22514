"""Rays as plain data: vertices, and the angles at which they were seen to meet surfaces."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from harness.record import RayPath
from harness.scene.containment import signed_distance
from harness.scene.resolved import Disk, Plane, Rectangle, ResolvedScene, SurfaceShape, Vec3
from harness.section.outline import Points


def ray_path(
    scene: ResolvedScene, vertices: Sequence[Vec3], weights: Sequence[float] = (), label: str = ""
) -> RayPath:
    """The ray with these vertices, with its angles at the solids and faces that it meets.

    `vertices` are k + 1 points from the ray's origin to its end; NaN rows after the last one are
    dropped. `weights` say what each of the k legs carries, 1 where they are not given. Angles are
    measured against the normal of the surface that is there, not against what the ray ought to
    have done. Raises ValueError where there are no two vertices, or no surface to bend at.
    """
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 2:
        raise ValueError(f"a ray needs two vertices or more, not {len(points)}")
    if weights and len(weights) != len(points) - 1:
        raise ValueError(f"{len(points) - 1} legs, but {len(weights)} weights")
    legs = np.diff(points, axis=0)
    legs = legs / np.maximum(np.linalg.norm(legs, axis=1, keepdims=True), 1e-300)
    step = 1e-5 * float(np.ptp(points, axis=0).max())
    angles = []
    for k, vertex in enumerate(points[1:-1]):
        n = _normal_at(scene, vertex, step)
        angles.append((_angle(legs[k], n), _angle(legs[k + 1], n)))
    return RayPath(
        label=label,
        vertices=[(float(x), float(y), float(z)) for x, y, z in points],
        angles=angles,
        weights=[float(w) for w in weights] or [1.0] * len(legs),
    )


def _angle(direction: Points, n: Points) -> float:
    """Between a line and a normal, in degrees; by atan2, which is exact for small angles too."""
    across = float(np.linalg.norm(np.cross(direction, n)))
    return math.degrees(math.atan2(across, abs(float(direction @ n))))


def _normal_at(scene: ResolvedScene, point: Points, step: float) -> Points:
    """Unit normal of the surface nearest to `point`."""
    shapes = [solid.shape for solid in scene.solids] + [s.shape for s in scene.surfaces]
    if not shapes:
        raise ValueError("a ray bends where there is no surface")
    return min((_near(shape, point, step) for shape in shapes), key=lambda pair: pair[0])[1]


def _near(shape: SurfaceShape, point: Points, step: float) -> tuple[float, Points]:
    """(distance, unit normal); the gradient of the distance is the normal of what is closed."""
    if isinstance(shape, Plane):
        normal = np.array(shape.normal)
        return abs(float(normal @ point) - shape.offset), normal
    if isinstance(shape, Rectangle | Disk):
        local = point - np.array(shape.frame.origin)
        axes = shape.frame.x, shape.frame.y, shape.frame.z
        x, y, z = (float(local @ np.array(axis)) for axis in axes)
        if isinstance(shape, Disk):
            beyond = max(math.hypot(x, y) - shape.radius, 0.0)
        else:
            beyond = max(abs(x) - shape.size[0] / 2, abs(y) - shape.size[1] / 2, 0.0)
        return math.hypot(z, beyond), np.array(shape.frame.z)
    around = np.concatenate([point[None], point + step * np.eye(3), point - step * np.eye(3)])
    distance = signed_distance(shape, around)
    slope = distance[1:4] - distance[4:]
    return abs(float(distance[0])), np.asarray(slope / max(float(np.linalg.norm(slope)), 1e-300))
