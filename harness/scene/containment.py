"""What lies inside what: which solid contains a point or another solid, and forbidden overlaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness.scene import resolved

Points = NDArray[np.float64]  # (n, 3)


def signed_distance(shape: resolved.SolidShape, points: Points) -> NDArray[np.float64]:
    """Negative inside, positive outside, 0 on the surface; (n,) in scene units.

    A lower bound of the distance outside edges of convex solids and cylinders, exact elsewhere.
    """
    match shape:
        case resolved.Sphere():
            return np.linalg.norm(points - np.array(shape.center), axis=1) - shape.radius
        case resolved.Convex():
            planes = np.array(shape.planes)
            return np.max(points @ planes[:, :3].T - planes[:, 3], axis=1)
        case resolved.Cylinder():
            local = points - np.array(shape.frame.origin)
            along = local @ np.array(shape.frame.z)
            across = np.linalg.norm(local - along[:, None] * np.array(shape.frame.z), axis=1)
            return np.maximum(across - shape.radius, np.abs(along) - shape.height / 2)
        case resolved.Mesh():
            from harness.scene.mesh import signed_distance as mesh_distance

            return mesh_distance(shape, points)
