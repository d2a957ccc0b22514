"""How near to an edge of its triangle a ray meets a mesh."""

from __future__ import annotations

import numpy as np

from harness.expected import Float
from harness.scene.resolved import Mesh, ResolvedScene


def nearness(scene: ResolvedScene, points: Float) -> Float:
    """(m, k) the smallest barycentric coordinate of points (m, k, 3) in the triangle they lie on.

    Infinite for points on no mesh: 0 is an edge, 1/3 the middle of a triangle.
    """
    flat = points.reshape(-1, 3)
    nearest = np.full(len(flat), np.inf)
    for solid in scene.solids:
        if isinstance(solid.shape, Mesh):
            nearest = np.minimum(nearest, _in_mesh(solid.shape, flat))
    return np.asarray(nearest.reshape(points.shape[:2]))


def _in_mesh(mesh: Mesh, points: Float) -> Float:
    vertices, triangles = np.array(mesh.vertices), np.array(mesh.triangles)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    n /= np.einsum("ij,ij->i", n, n)[:, None]
    from_a = points[:, None] - a[None]
    height = np.abs(np.einsum("ptk,tk->pt", from_a, n)) * np.ptp(vertices)
    v = np.einsum("ptk,tk->pt", np.cross(from_a, (c - a)[None]), n)
    w = np.einsum("ptk,tk->pt", np.cross((b - a)[None], from_a), n)
    smallest = np.minimum(np.minimum(v, w), 1 - v - w)
    # Of the triangles whose plane the point lies in, the one that it is inside of.
    inside = np.where((height < 1e-6) & (smallest > -1e-6), smallest, -np.inf).max(axis=1)
    return np.where(np.isfinite(inside), np.maximum(inside, 0.0), np.inf)
