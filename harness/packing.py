"""What the report's pages may show of a case beyond its record: pixels and rays, as numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from harness.expected import Float
from harness.measure.images import Pixels
from harness.measure.raymap import ProbeRays, angles, measured_direction, ray_error
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

# Rays that can be clicked per side of the film, and rays in the map of errors.
MOST_PATHS = 64
MOST_ERRORS = 256
MOST_TRIANGLES = 6000  # of one solid; larger ones are not outlined
ROUND = 96  # corners that stand for a circle
GRID = 40  # points per side of the box in which a composed solid is contoured


def write_pack(
    path: Path,
    case_id: str,
    pictures: Mapping[tuple[str, str], Pixels],
    rays: Sequence[ProbeRays],
) -> Path:
    """Writes the pack of a case; `pictures` by renderer and role. Returns `path`."""
    images: list[pack.Image] = []
    for (renderer, role), pixels in pictures.items():
        like = next((i for i in images if i.planes.shape[1:] == pixels.shape[:2]), None)
        images.append(pack.image(renderer, role, pixels, like))
    return pack.write(path, case_id, images, [_probe(probe) for probe in rays])


def _probe(probe: ProbeRays) -> dict[str, Any]:
    truth = probe.truth
    film, scene = truth.scene.film, truth.scene
    step = -(-max(film.width, film.height) // MOST_PATHS)
    fine = -(-max(film.width, film.height) // MOST_ERRORS)
    paths, errors = _grid(film.width, film.height, step), _grid(film.width, film.height, fine)
    theta_i, theta_t = angles(truth)
    vertices = np.concatenate(
        [truth.rays.origins[:, None], truth.paths.interface, truth.landings[0].point[:, None]],
        axis=1,
    )
    return {
        "name": probe.name,
        "path": truth.path,
        "width": film.width,
        "height": film.height,
        "step": step,
        "errorStep": fine,
        "media": [{"name": medium.name, "ior": medium.ior} for medium in scene.media],
        "solids": [_solid(solid) for solid in scene.solids],
        "planes": [_plane(plane) for plane in truth.planes],
        "vertices": pack.array(vertices[paths].transpose(1, 2, 0), 18),
        "thetaI": pack.array(theta_i[paths].T, 20),
        "thetaT": pack.array(theta_t[paths].T, 20),
        "status": pack.array(truth.paths.status[paths].astype(np.float32)),
        "weight": pack.array(truth.paths.weight[paths]),
        "renderers": [
            {
                "name": name,
                "method": rays.method,
                "error": pack.array(ray_error(truth, rays)[errors], 11),
                "shift": pack.array((rays.point - truth.landings[0].point)[paths].T),
                "turn": pack.array(_turn(probe, name)[paths].T),
            }
            for name, rays in probe.measured.items()
        ],
    }


def _turn(probe: ProbeRays, name: str) -> Float:
    """(m, 3) measured minus true direction."""
    truth = probe.truth
    return measured_direction(truth, probe.measured[name]) - truth.paths.direction


def _grid(width: int, height: int, step: int) -> Any:
    """Indices of every `step`-th pixel of every `step`-th row."""
    return np.arange(height * width).reshape(height, width)[::step, ::step].reshape(-1)


def _plane(plane: Rectangle) -> dict[str, Any]:
    frame = plane.frame
    return {"origin": frame.origin, "x": frame.x, "y": frame.y, "size": plane.size}


def _solid(solid: Solid) -> dict[str, Any]:
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
