"""Scenes and rays for the tests of POV-Ray, and the closed forms that they are judged by.

Everything here follows from the definitions in `harness.scene.resolved` and from Snell, Fresnel
and Beer; nothing is taken from a renderer or from our tracer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.scene import resolved as rs

Array = NDArray[np.float64]
AIR = rs.Medium(name="air", ior=1.0)
GLASS = rs.Medium(name="glass", ior=1.5)


# --- scenes ---------------------------------------------------------------------------------------


def frame(
    origin: Sequence[float] = (0, 0, 0),
    z: Sequence[float] = (0, 0, 1),
    up: Sequence[float] = (0, 1, 0),
) -> rs.Frame:
    axis = np.array(z) / np.linalg.norm(z)
    x = np.cross(up, axis)
    x /= np.linalg.norm(x)
    return rs.Frame(
        origin=_triple(origin), x=_triple(x), y=_triple(np.cross(axis, x)), z=_triple(axis)
    )


def rectangle(origin: Sequence[float], size: tuple[float, float], **axes: Any) -> rs.Rectangle:
    return rs.Rectangle(frame=frame(origin, **axes), size=size)


def box(low: Sequence[float], high: Sequence[float]) -> rs.Convex:
    corners = [_triple([high[k] if i >> k & 1 else low[k] for k in range(3)]) for i in range(8)]
    planes = [
        (*_triple(sign * np.eye(3)[axis]), sign * float((low, high)[sign > 0][axis]))
        for axis in range(3)
        for sign in (-1, 1)
    ]
    faces = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))
    return rs.Convex(planes=tuple(planes), vertices=tuple(corners), faces=faces)


def camera(
    origin: Sequence[float], target: Sequence[float], fov_x: float, medium: int = 0
) -> rs.Perspective:
    forward = np.array(target, float) - origin
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    return rs.Perspective(
        origin=_triple(origin),
        right=_triple(right),
        up=_triple(np.cross(right, forward)),
        forward=_triple(forward),
        tan_half_fov_x=math.tan(math.radians(fov_x / 2)),
        medium=medium,
    )


def glow(*radiance: float) -> rs.Emissive:
    return rs.Emissive(pattern=rs.Constant(radiance=_triple(radiance)))


def make_scene(
    view: rs.Camera,
    *,
    solids: Sequence[tuple[rs.SolidShape, int, int]] = (),
    surfaces: Sequence[tuple[rs.SurfaceShape, rs.Material]] = (),
    media: tuple[rs.Medium, ...] = (AIR, GLASS),
    depth: int = 20,
    film: tuple[int, int] = (96, 64),
    **more: Any,
) -> rs.ResolvedScene:
    """`solids` are (shape, medium, exterior); `more` are further fields of the scene."""
    return rs.ResolvedScene(
        film=rs.Film(width=film[0], height=film[1]),
        camera=view,
        media=media,
        solids=tuple(
            rs.Solid(name=f"solid{k}", shape=shape, medium=medium, exterior=exterior)
            for k, (shape, medium, exterior) in enumerate(solids)
        ),
        surfaces=tuple(
            rs.Surface(name=f"surface{k}", shape=shape, material=material)
            for k, (shape, material) in enumerate(surfaces)
        ),
        transport=more.pop("transport", rs.Transport(max_depth=depth, min_weight=1e-7)),
        **more,
    )


def _triple(values: Sequence[float] | Array) -> rs.Vec3:
    x, y, z = (float(v) for v in values)
    return x, y, z


def polygons(solid: rs.Convex, turned: rs.Frame) -> rs.Mesh:
    """The faces of `solid`, four-sided each, as triangles in another frame."""
    to_world = np.array([turned.x, turned.y, turned.z])
    corners = np.array(solid.vertices) @ to_world + np.array(turned.origin)
    return rs.Mesh(
        vertices=tuple(map(tuple, corners.tolist())),
        triangles=tuple(t for a, b, c, d in solid.faces for t in ((a, b, c), (a, c, d))),
    )


# --- rays -----------------------------------------------------------------------------------------


def rays(scene: rs.ResolvedScene) -> tuple[Array, Array]:
    """Origins and unit directions through the pixel centres, by the definition of the cameras."""
    view, width, height = scene.camera, scene.film.width, scene.film.height
    j, i = (a.reshape(-1, 1) for a in np.mgrid[0:height, 0:width])
    x = 2 * (i + 0.5) / width - 1
    y = (1 - 2 * (j + 0.5) / height) * height / width
    origin, right, up, forward = (
        np.array(v) for v in (view.origin, view.right, view.up, view.forward)
    )
    if isinstance(view, rs.Orthographic):
        origins = origin + view.width / 2 * (x * right + y * up)
        return origins, np.broadcast_to(forward, origins.shape)
    directions = forward + view.tan_half_fov_x * (x * right + y * up)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.broadcast_to(origin, directions.shape), directions


def on_plane(origins: Array, directions: Array, face: rs.Frame) -> tuple[Array, Array, Array]:
    """Where rays meet the face's plane: x and y in its frame, and the distance."""
    normal, origin = np.array(face.z), np.array(face.origin)
    with np.errstate(all="ignore"):
        t = ((origin - origins) @ normal) / (directions @ normal)
        points = origins + t[:, None] * directions - origin
    return points @ np.array(face.x), points @ np.array(face.y), t


def on_sphere(origins: Array, directions: Array, sphere: rs.Sphere, far: bool) -> Array:
    """The nearer or farther point of the sphere on each ray, NaN where it misses."""
    local = origins - np.array(sphere.center)
    b = (local * directions).sum(axis=1)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b**2 - (local**2).sum(axis=1) + sphere.radius**2)
    return np.asarray(origins + ((root if far else -root) - b)[:, None] * directions)


def refract(directions: Array, normals: Array, n_from: float, n_to: float) -> Array:
    """Snell's law; `normals` against `directions`. NaN where the reflection is total."""
    mu, c = n_from / n_to, -(directions * normals).sum(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(1 - mu**2 * (1 - c**2))
    return np.asarray(mu * directions + (mu * c - root) * normals)


def fresnel(cos_theta_i: Array, n_from: float, n_to: float) -> Array:
    """Unpolarised reflectance; 1 where the reflection is total."""
    sin2_t = (n_from / n_to) ** 2 * (1 - cos_theta_i**2)
    cos_t = np.sqrt(np.maximum(1 - sin2_t, 0))
    s = (n_from * cos_theta_i - n_to * cos_t) / (n_from * cos_theta_i + n_to * cos_t)
    p = (n_to * cos_theta_i - n_from * cos_t) / (n_to * cos_theta_i + n_from * cos_t)
    return np.where(sin2_t >= 1, 1.0, (s**2 + p**2) / 2)


def through_ball(
    ball: rs.Sphere, origins: Array, directions: Array, outside: float, inside: float
) -> tuple[Array, Array]:
    center = np.array(ball.center)
    first = on_sphere(origins, directions, ball, far=False)
    inner = refract(directions, (first - center) / ball.radius, outside, inside)
    second = on_sphere(first, inner, ball, far=True)
    return second, refract(inner, (center - second) / ball.radius, inside, outside)


# --- what many tests look at and from where ------------------------------------------------------

N = GLASS.ior
BALL = rs.Sphere(center=(0, 0, 0), radius=1)
BEHIND = rectangle((0.1, 0, -3), (16, 16))
PERSPECTIVE = camera((0.3, 0.4, 6), (0.5, -0.2, -3), 33)
TILTED = rectangle((0.5, -0.2, -3), (6, 4), z=(0.3, -0.2, 1), up=(0.2, 1, 0))
