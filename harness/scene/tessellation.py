"""Triangle meshes: spheres made of triangles, normals of smooth ones, distances to them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from harness.scene.vectors import Matrix

Points = NDArray[np.float64]  # (n, 3)
Triangles = NDArray[np.int64]  # (m, 3)

MOST_AT_ONCE = 100_000  # points x triangles


def placed(points: Points, turn: Matrix, origin: tuple[float, float, float]) -> Points:
    """Origin + turn · p for every point; without BLAS, whose rounding depends on the machine."""
    columns = [
        points[:, 0] * row[0] + points[:, 1] * row[1] + points[:, 2] * row[2] + shift
        for row, shift in zip(turn, origin, strict=True)
    ]
    return np.stack(columns, axis=1)


def icosphere(subdivisions: int) -> tuple[Points, Triangles]:
    """An icosahedron's faces split into four `subdivisions` times; vertices of unit length."""
    vertices, triangles = _icosahedron()
    for _ in range(subdivisions):
        vertices, triangles = _subdivided(vertices, triangles)
    return vertices, triangles


def _icosahedron() -> tuple[Points, Triangles]:
    golden = (1 + math.sqrt(5)) / 2
    corners = [(0, s, t * golden) for t in (1, -1) for s in (1, -1)]
    vertices = np.array([c[k:] + c[:k] for k in range(3) for c in corners], dtype=np.float64)
    # Neighbours are 2 apart; a face is any three that are neighbours of each other.
    near = np.abs(np.linalg.norm(vertices[:, None] - vertices[None], axis=2) - 2) < 1e-9
    faces = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    outward = [f if np.linalg.det(vertices[list(f)]) > 0 else (f[0], f[2], f[1]) for f in faces]
    return _unit(vertices), np.array(outward, dtype=np.int64)


def _subdivided(vertices: Points, triangles: Triangles) -> tuple[Points, Triangles]:
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    # Both ends in one number: sorting pairs is many times slower, and gives the same order.
    keys, inverse = np.unique(edges[:, 0] * len(vertices) + edges[:, 1], return_inverse=True)
    middles = _unit(vertices[keys // len(vertices)] + vertices[keys % len(vertices)])
    ab, bc, ca = (inverse.reshape(-1, 3) + len(vertices)).T
    a, b, c = triangles.T
    corners = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    split = np.stack([np.stack(corner, axis=1) for corner in corners], axis=1)
    return np.concatenate([vertices, middles]), split.reshape(-1, 3)


def _unit(vectors: Points) -> Points:
    return np.asarray(vectors / np.sqrt(np.sum(vectors * vectors, axis=1, keepdims=True)))


def vertex_normals(vertices: Points, triangles: Triangles) -> Points:
    """Unit normals of a smooth surface: face normals weighted by the angle at the vertex.

    G. Thürmer and C. Wüthrich, "Computing vertex normals from polygonal facets", Journal of
    Graphics Tools 3 (1998). They do not depend on how faces are split into triangles.
    """
    corners = vertices[triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face = _unit(face)
    total = np.zeros_like(vertices)
    for k in range(3):
        one = corners[:, (k + 1) % 3] - corners[:, k]
        other = corners[:, (k + 2) % 3] - corners[:, k]
        sine = np.linalg.norm(np.cross(one, other), axis=1)
        angle = np.arctan2(sine, np.sum(one * other, axis=1))
        np.add.at(total, triangles[:, k], angle[:, None] * face)
    used = np.any(total != 0, axis=1, keepdims=True)
    return _unit(np.where(used, total, [0.0, 0.0, 1.0]))  # vertices of no face get any


def winding(points: Points, vertices: Points, triangles: Triangles) -> NDArray[np.float64]:
    """How often a closed mesh encloses each point: 1 inside, 0 outside; (n,).

    Sum of the solid angles of its triangles: A. van Oosterom and J. Strackee, "The solid angle
    of a plane triangle", IEEE Trans. Biomed. Eng. 30 (1983).
    """
    corners = vertices[triangles]
    return _by_parts(points, len(triangles), lambda part: _winding(part, corners))


def _winding(points: Points, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    a, b, c = (corners[None, :, k] - points[:, None] for k in range(3))
    la, lb, lc = (np.sqrt(_dot(v, v)) for v in (a, b, c))
    spanned = _dot(a, np.cross(b, c))
    cosines = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
    return np.asarray(np.sum(np.arctan2(spanned, cosines), axis=1) / (2 * np.pi))


def distance(points: Points, vertices: Points, triangles: Triangles) -> NDArray[np.float64]:
    """Distance of each point to the nearest triangle; (n,)."""
    corners = vertices[triangles]
    return _by_parts(points, len(triangles), lambda part: _distance(part, corners))


def _distance(points: Points, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    size = np.sqrt(_dot(normal, normal))[:, None]
    normal = normal / np.where(size > 0, size, 1.0)
    nearest = np.full((len(points), len(corners)), np.inf)
    within = np.broadcast_to(size[:, 0] > 0, nearest.shape)
    for start, end in ((a, b), (b, c), (c, a)):
        side = end - start
        away = points[:, None] - start
        share = _dot(away, side) / np.maximum(_dot(side, side), np.finfo(float).tiny)
        rest = away - np.clip(share, 0, 1)[..., None] * side
        nearest = np.minimum(nearest, np.sqrt(_dot(rest, rest)))
        within = within & (_dot(away, np.cross(normal, side)) >= 0)
    height = np.abs(_dot(points[:, None] - a, normal))
    return np.asarray(np.min(np.where(within, height, nearest), axis=1))


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.einsum("...k,...k->...", a, b))


def _by_parts(
    points: Points, triangles: int, measure: Callable[[Points], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Measures some points at a time, so that memory stays bounded."""
    step = max(1, MOST_AT_ONCE // triangles)
    parts = [measure(points[k : k + step]) for k in range(0, len(points), step)]
    return np.concatenate(parts) if parts else np.zeros(0)
