"""Small resolved scenes for the harness's tests."""

from __future__ import annotations

import math

import numpy as np

from harness.expected import Float
from harness.renderers.base import Rays
from harness.scene import resolved as rs

AIR = rs.Medium(name="air", ior=1.0)


def unit(v: tuple[float, float, float]) -> tuple[float, float, float]:
    length = math.hypot(*v)
    return v[0] / length, v[1] / length, v[2] / length


def slab(top: float, bottom: float, half: float = 1000.0) -> rs.Convex:
    """Between the planes z = top and z = bottom."""
    sides = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]
    planes = ((0, 0, 1, top), (0, 0, -1, -bottom), *((*n, half) for n in sides))
    corners = ((x, y, z) for x in (half, -half) for y in (half, -half) for z in (top, bottom))
    return rs.Convex(planes=planes, vertices=tuple(corners), faces=())


def prism(apex: float, side: float = 10.0) -> rs.Convex:
    """Apex edge along y at the origin, opening towards -x; angle `apex` in radians."""
    s, c = math.sin(apex / 2), math.cos(apex / 2)
    planes = ((s, 0, c, 0), (s, 0, -c, 0), (-1, 0, 0, side), (0, 1, 0, side), (0, -1, 0, side))
    return rs.Convex(planes=planes, vertices=(), faces=())


def face(
    z: float, size: float = 1000.0, normal: tuple[float, float, float] = (0, 0, 1)
) -> rs.Rectangle:
    """A rectangle through (0, 0, z)."""
    n = np.array(unit(normal))
    x = np.array([1.0, 0, 0]) if abs(n[0]) < 0.9 else np.array([0, 1.0, 0])
    x -= (x @ n) * n
    x /= np.linalg.norm(x)
    frame = rs.Frame(origin=(0, 0, z), x=tuple(x), y=tuple(np.cross(n, x)), z=tuple(n))
    return rs.Rectangle(frame=frame, size=(size, size))


def scene(
    *solids: tuple[rs.SolidShape, int, int],
    ior: tuple[float, ...] = (1.5,),
    absorption: tuple[float, float, float] = (0, 0, 0),
    inside: int = 0,
) -> rs.ResolvedScene:
    """Air and media of the indices `ior`; solids as (shape, medium, exterior)."""
    glasses = (
        rs.Medium(name=f"glass-{k}", ior=n, absorption=absorption) for k, n in enumerate(ior)
    )
    camera = rs.Perspective(
        origin=(0, 0, 5), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1),
        tan_half_fov_x=1.0, medium=inside,
    )  # fmt: skip
    return rs.ResolvedScene(
        film=rs.Film(width=8, height=4),
        camera=camera,
        media=(AIR, *glasses),
        solids=tuple(
            rs.Solid(name=f"solid-{k}", shape=shape, medium=medium, exterior=exterior)
            for k, (shape, medium, exterior) in enumerate(solids)
        ),
        transport=rs.Transport(max_depth=10, min_weight=0),
    )


def fan(theta: Float, height: float = 1.0) -> Rays:
    """From (0, 0, height) downwards in the plane y = 0, at `theta` from -z towards +x."""
    directions = np.stack([np.sin(theta), np.zeros_like(theta), -np.cos(theta)], axis=1)
    return Rays(np.tile([0.0, 0.0, height], (len(theta), 1)), directions)


def parallel(heights: Float, distance: float = 5.0) -> Rays:
    """Rays along -z that start at (h, 0, distance)."""
    origins = np.stack([heights, np.zeros_like(heights), np.full_like(heights, distance)], axis=1)
    return Rays(origins, np.tile([0.0, 0.0, -1.0], (len(heights), 1)))


def angle(a: Float, b: Float) -> Float:
    """Between vectors (m, 3), radians; exact for small angles."""
    across = np.linalg.norm(np.cross(a, b), axis=1)
    return np.asarray(np.arctan2(across, np.einsum("ij,ij->i", a, b)))
