"""What the report's pages may show of a case beyond its record: pixels and rays, as numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from harness.expected import Float
from harness.measure.images import Pixels
from harness.measure.raymap import ProbeRays, angles, measured_direction, ray_error
from harness.packing_solids import drawn_plane, drawn_solid
from harness.packing_ways import PictureWays, told
from harness.report import pack

# Rays that can be clicked per side of the film, and rays in the map of errors.
MOST_PATHS = 64
MOST_ERRORS = 256


def write_pack(
    path: Path,
    case_id: str,
    pictures: Mapping[tuple[str, str], Pixels],
    rays: Sequence[ProbeRays],
    ways: Sequence[PictureWays] = (),
    silent: Mapping[str, str] | None = None,
) -> Path:
    """Writes the pack of a case; `pictures` by renderer and role. Returns `path`.

    `ways` are those of the pictures' rays, `silent` says of other renderers why theirs are missing.
    """
    images: list[pack.Image] = []
    for (renderer, role), pixels in pictures.items():
        like = next((i for i in images if i.planes.shape[1:] == pixels.shape[:2]), None)
        images.append(pack.image(renderer, role, pixels, like))
    return pack.write(
        path, case_id, images, [_probe(probe) for probe in rays], told(ways, silent or {})
    )


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
        "solids": [drawn_solid(solid) for solid in scene.solids],
        "planes": [drawn_plane(plane) for plane in truth.planes],
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
