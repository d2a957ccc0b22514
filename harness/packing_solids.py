"""Solids and rectangles as the page's diagrams of rays draw them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from harness.expected import Float
from harness.report import pack
from harness.scene.containment import bounds, signed_distance
from harness.scene.resolved import (
    Convex,
    Cylinder,
    Mesh,
    Rectangle,
    Solid,
    SolidShape,
    Sphere,
)

MOST_TRIANGLES = 6000  # of one solid; larger ones are not outlined
ROUND = 96  # corners that stand for a circle
GRID = 40  # points per side of the box in which a composed solid is contoured


def drawn_plane(plane: Rectangle) -> dict[str, Any]:
    frame = plane.frame
    return {"origin": frame.origin, "x": frame.x, "y": frame.y, "size": plane.size}


def drawn_solid(solid: Solid) -> dict[str, Any]:
    """A solid for drawing: a sphere as such, others as closed triangles; null where too fine."""
    found: dict[str, Any] = {"name": solid.name, "medium": solid.medium}
    match solid.shape:
        case Sphere() as sphere:
            return {**found, "center": sphere.center, "radius": sphere.radius}
        case Convex() as convex:
            corners = np.array(convex.vertices)
            triangles = list(_fans(convex.faces))
        case Cylinder() as cylinder:
            corners, triangles = _cylinder(cylinder)
        case Mesh() as mesh if len(mesh.triangles) <= MOST_TRIANGLES:
            corners, triangles = np.array(mesh.vertices), list(mesh.triangles)
        case Mesh():
            return found
        case shape:
            corners, triangles = _contoured(shape)
    flat = [corner for triangle in triangles for corner in triangle]
    return {**found, "corners": pack.array(corners, 20), "triangles": flat}


def _contoured(shape: SolidShape) -> tuple[Float, list[tuple[int, int, int]]]:
    """Triangles of any solid that has a signed distance: lenses, cones, composed ones."""
    from skimage.measure import marching_cubes

    box = np.array(bounds(shape), np.float64)
    low, high = box.min(axis=0), box.max(axis=0)
    margin = 0.02 * (high - low).max()
    low, high = low - margin, high + margin
    axes = [np.linspace(low[k], high[k], GRID) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    field = np.asarray(signed_distance(shape, points)).reshape(GRID, GRID, GRID)
    if not field.min() < 0 < field.max():  # thinner than the grid can see
        return np.zeros((0, 3)), []
    corners, triangles, *_ = marching_cubes(
        field, 0.0, spacing=tuple((high - low) / (GRID - 1)), allow_degenerate=False
    )  # type: ignore[no-untyped-call]
    return np.asarray(corners + low), [(int(i), int(j), int(k)) for i, j, k in triangles]


def _fans(faces: Iterable[Sequence[int]]) -> Iterable[tuple[int, int, int]]:
    for face in faces:
        for k in range(1, len(face) - 1):
            yield face[0], face[k], face[k + 1]


def _cylinder(cylinder: Cylinder) -> tuple[Float, list[tuple[int, int, int]]]:
    frame = cylinder.frame
    turn = 2 * np.pi * np.arange(ROUND) / ROUND
    across = cylinder.radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    ring = across @ np.array([frame.x, frame.y]) + np.array(frame.origin)
    half = cylinder.height / 2 * np.array(frame.z)
    sides = [(k, (k + 1) % ROUND, k + ROUND) for k in range(ROUND)]
    sides += [((k + 1) % ROUND, (k + 1) % ROUND + ROUND, k + ROUND) for k in range(ROUND)]
    caps = list(_fans([range(ROUND), range(ROUND, 2 * ROUND)]))
    return np.concatenate([ring - half, ring + half]), sides + caps
