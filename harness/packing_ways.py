"""The ways of a picture's rays, as a renderer told them, as the page's diagrams draw them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.expected import Float
from harness.packing_solids import drawn_plane, drawn_solid
from harness.renderers.base import RayPaths, Status
from harness.report import pack
from harness.scene.resolved import Frame, Plane, Rectangle, ResolvedScene, Vec3

TRANSMITTED, TOTAL, MIRRORED = 0.0, 1.0, 2.0  # what happens where a ray meets something
MOST_VERTICES = 256
ENDLESS = 1e4  # as wide is a plane drawn
ALIKE = 1e-3  # of unit vectors: far above single precision; what only grazes may be taken for it


@dataclass(frozen=True)
class PictureWays:
    """The main ways, with vertices and meetings, of the rays of every `step`-th pixel.

    `nm` is the wavelength whose indices they have seen, None where all have the same.
    """

    renderer: str
    scene: ResolvedScene
    step: int
    paths: RayPaths
    nm: float | None = None


def told(ways: Sequence[PictureWays], silent: Mapping[str, str]) -> dict[str, Any] | None:
    """What a pack holds of the ways of all renderers; None where there is no picture at all."""
    if not ways and not silent:
        return None
    why = [{"name": name, "reason": reason} for name, reason in silent.items()]
    return {"rays": [_of_renderer(one) for one in ways], "silent": why}


def _of_renderer(ways: PictureWays) -> dict[str, Any]:
    """As a probe's rays, but with what happened at each meeting instead of one path for all."""
    scene, paths = ways.scene, ways.paths
    vertices, meetings = onward(paths), paths.meetings
    assert meetings is not None
    events = happened(vertices, meetings)
    met = events.shape[1]
    cosines = np.full((len(events), met, 2), np.nan)
    kept = min(met, meetings.shape[1] - 1)
    cosines[:, :kept] = meetings[:, 1 : kept + 1, :2]
    theta = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    return {
        "name": ways.renderer,
        "path": "T" * met,
        "width": scene.film.width,
        "height": scene.film.height,
        "step": ways.step,
        "errorStep": ways.step,
        "nm": ways.nm,
        "media": [{"name": medium.name, "ior": medium.ior} for medium in scene.media],
        "solids": [drawn_solid(solid) for solid in scene.solids],
        "planes": [drawn_plane(plane) for plane in _planes(scene)],
        "vertices": pack.array(vertices.transpose(1, 2, 0), 18),
        "thetaI": pack.array(theta[..., 0].T, 20),
        "thetaT": pack.array(theta[..., 1].T, 20),
        "events": pack.array(events.T),
        "status": pack.array(paths.status.astype(np.float32)),
        "weight": pack.array(paths.weight),
        "renderers": [],
    }


def unusable(paths: RayPaths, count: int) -> str:
    """Why the ways of `count` rays cannot be drawn as they were told; "" where they can."""
    if paths.vertices is None or paths.meetings is None:
        return "it told where its rays end, but not their ways"
    shape, other = paths.vertices.shape, paths.meetings.shape
    if shape != other or len(shape) != 3 or (shape[0], shape[2]) != (count, 3):
        return f"it told vertices {shape} and meetings {other} of {count} rays"
    if not 0 < shape[1] <= MOST_VERTICES:
        return f"it told ways of {shape[1]} vertices; those of 1 to {MOST_VERTICES} are drawn"
    if len(paths.status) != count or not np.isfinite(paths.vertices[:, 0]).all():
        return "it told ways that begin nowhere"
    return ""


def onward(paths: RayPaths) -> Float:
    """(n, k + 1, 3) vertices; rays that left the scene go on by as much as the longest way takes.

    Where all of them left it at once, by one unit.
    """
    assert paths.vertices is not None
    vertices = np.concatenate([paths.vertices, np.full((len(paths.status), 1, 3), np.nan)], axis=1)
    rows = np.flatnonzero(paths.status == Status.MISS)
    last = np.isfinite(vertices[rows, :, 0]).sum(axis=1)
    lengths = np.linalg.norm(np.diff(vertices, axis=1), axis=2)
    reach = float(np.nansum(lengths, axis=1).max(initial=0.0)) or 1.0
    vertices[rows, last] = vertices[rows, last - 1] + reach * paths.direction[rows]
    longest = int(np.isfinite(vertices[..., 0]).sum(axis=1).max(initial=2))
    return np.asarray(vertices[:, : max(longest, 2)])


def happened(vertices: Float, meetings: Float) -> Float:
    """(n, k - 2) TRANSMITTED, TOTAL or MIRRORED at each vertex between two; NaN beyond the end.

    Without a cosine beyond, it was reflected where its direction turned by 2 cos(theta_i) n.
    """
    d = np.diff(vertices, axis=1)
    d = d / np.linalg.norm(d, axis=2, keepdims=True)
    turned = np.linalg.norm(np.diff(d, axis=1), axis=2)
    cos_i, cos_t, reflectance = (meetings[:, 1 : turned.shape[1] + 1, k] for k in range(3))
    short = turned.shape[1] - cos_i.shape[1]
    cos_i, cos_t, reflectance = (
        np.pad(a, ((0, 0), (0, short)), constant_values=np.nan) for a in (cos_i, cos_t, reflectance)
    )
    back = ~np.isfinite(cos_t) & (np.abs(turned - 2 * np.abs(cos_i)) < ALIKE) & (turned > ALIKE)
    events = np.where(back, np.where(np.isfinite(reflectance), TOTAL, MIRRORED), TRANSMITTED)
    return np.where(np.isfinite(turned), events, np.nan)


def _planes(scene: ResolvedScene) -> list[Rectangle]:
    """The flat surfaces on which rays land."""
    found = []
    for surface in scene.surfaces:
        if isinstance(surface.shape, Rectangle):
            found.append(surface.shape)
        elif isinstance(surface.shape, Plane):
            n = np.array(surface.shape.normal)
            x = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
            x /= np.linalg.norm(x)
            frame = Frame(
                origin=_vec(surface.shape.offset * n), x=_vec(x), y=_vec(np.cross(n, x)), z=_vec(n)
            )
            found.append(Rectangle(frame=frame, size=(ENDLESS, ENDLESS)))
    return found


def _vec(v: Float) -> Vec3:
    x, y, z = (float(c) for c in v)
    return x, y, z
