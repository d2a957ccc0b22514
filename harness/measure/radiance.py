"""The truth of a whole picture, where one exists: flat surfaces one behind the other.

A translucent face lets ``filter * color + transmit`` of the light behind it pass and reflects the
rest of its colour diffusely (lecture: Translucence); point lights fall on it without shadow.
"""

from __future__ import annotations

import numpy as np

from harness.expected import Float
from harness.measure.comparison import FREE_OF_INDEX, Comparison, Unmeasurable
from harness.measure.images import Pixels
from harness.measure.panorama import panorama_radiance
from harness.measure.pictures import geometric_error
from harness.measure.precision import Precision
from harness.measure.probe_truth import ROUNDINGS
from harness.measure.statistics import Noise, binned
from harness.renderers.base import Rays
from harness.scene.resolved import (
    Checker,
    Constant,
    Diffuse,
    DirectionalLight,
    Emissive,
    Orthographic,
    Panorama,
    Pattern,
    Plane,
    Ramp,
    Rectangle,
    ResolvedScene,
    Rgb,
    Surface,
    Translucent,
)
from harness.truth.camera import primary_rays


def true_picture(scene: ResolvedScene) -> tuple[Float, Float]:
    """(H, W, 3) radiance and (H, W) the smallest distance to an edge of a face or pattern cell.

    Distances are in units on the face. Raises ValueError where the scene has no closed form.
    """
    rays = primary_rays(scene)
    if scene.solids:
        raise ValueError("a scene with solids and faces has no closed form of its picture")
    m = len(rays.origins)
    radiance, through = np.zeros((m, 3)), np.ones((m, 3))
    edge = np.full(m, np.inf)
    reached = np.zeros(m)
    for _ in scene.surfaces:
        t, which = _nearest(scene, rays, reached)
        for index, surface in enumerate(scene.surfaces):
            rows = np.flatnonzero(which == index)
            point = rays.origins[rows] + t[rows, None] * rays.directions[rows]
            emitted, passes, distance = _shade(scene, surface, point)
            radiance[rows] += through[rows] * emitted
            through[rows] *= passes
            edge[rows] = np.minimum(edge[rows], distance)
        reached = np.where(which >= 0, t, np.inf)
    radiance += through * _around(scene.background, rays.directions)
    shape = (scene.film.height, scene.film.width)
    return radiance.reshape(*shape, 3), edge.reshape(shape)


def _around(background: Rgb | Panorama, directions: Float) -> Float:
    """The radiance that comes from behind everything."""
    if isinstance(background, Panorama):
        return panorama_radiance(background, directions)
    return np.array(background)


def _face(surface: Surface) -> Rectangle | Plane:
    if not isinstance(surface.shape, Rectangle | Plane):
        raise ValueError(f"the {surface.shape.type} '{surface.name}' has no closed form here")
    return surface.shape


def _normal(face: Rectangle | Plane) -> Float:
    return np.array(face.normal if isinstance(face, Plane) else face.frame.z)


def _local(face: Rectangle, point: Float) -> tuple[Float, Float]:
    local = point - np.array(face.frame.origin)
    return local @ np.array(face.frame.x), local @ np.array(face.frame.y)


def _nearest(scene: ResolvedScene, rays: Rays, after: Float) -> tuple[Float, Float]:
    best, which = np.full(len(after), np.inf), np.full(len(after), -1)
    for index, surface in enumerate(scene.surfaces):
        face = _face(surface)
        z = _normal(face)
        with np.errstate(divide="ignore", invalid="ignore"):
            if isinstance(face, Plane):
                t = (face.offset - rays.origins @ z) / (rays.directions @ z)
                hit = (t > after) & np.isfinite(t)
            else:
                t = ((np.array(face.frame.origin) - rays.origins) @ z) / (rays.directions @ z)
                x, y = _local(face, rays.origins + t[:, None] * rays.directions)
                hit = (t > after) & (np.abs(x) < face.size[0] / 2) & (np.abs(y) < face.size[1] / 2)
        nearer = hit & (t < best)
        best, which = np.where(nearer, t, best), np.where(nearer, index, which)
    return best, which


def _shade(scene: ResolvedScene, surface: Surface, point: Float) -> tuple[Float, Float, Float]:
    """What a face sends towards the camera, what it lets pass, and how near its edges are."""
    face, material = _face(surface), surface.material
    nothing, edge = np.zeros((len(point), 3)), np.full(len(point), np.inf)
    if isinstance(face, Rectangle):
        x, y = _local(face, point)
        width, height = face.size
        edge = np.minimum(width / 2 - np.abs(x), height / 2 - np.abs(y))
    match material:
        case Emissive(pattern=Constant(radiance=radiance)):
            return np.broadcast_to(np.array(radiance), nothing.shape), nothing, edge
        case Emissive() if isinstance(face, Rectangle):
            emitted, cell = _emission(material.pattern, x / width + 0.5, y / height + 0.5, face)
            return emitted, nothing, np.minimum(edge, cell)
        case Translucent():
            color = np.array(material.color)
            passes = np.broadcast_to(material.filter * color + material.transmit, nothing.shape)
            rest = (1 - material.filter - material.transmit) * color
            return rest / np.pi * _irradiance(scene, face, point), passes, edge
        case Diffuse():
            lit = np.array(material.reflectance) / np.pi * _irradiance(scene, face, point)
            return lit, nothing, edge
    raise ValueError(f"{material.type} has no closed form here")


def _irradiance(scene: ResolvedScene, face: Rectangle | Plane, point: Float) -> Float:
    """I cos(theta) / r^2 and, of light from far away, E cos(theta), of all lights in front."""
    normal = _normal(face)
    total = np.zeros((len(point), 3))
    for light in scene.lights:
        if isinstance(light, DirectionalLight):
            slope = max(-float(np.dot(light.direction, normal)), 0.0)
            total += slope * np.array(light.irradiance)
            continue
        way = np.array(light.position) - point
        r2 = np.einsum("ij,ij->i", way, way)
        cos = np.maximum(way @ normal, 0) / np.sqrt(r2)
        total += (cos / r2)[:, None] * np.array(light.intensity)
    return total


def _emission(pattern: Pattern, u: Float, v: Float, face: Rectangle) -> tuple[Float, Float]:
    far = np.full(len(u), np.inf)
    match pattern:
        case Ramp():
            c = u if pattern.axis == "u" else v
            return (1 - c)[:, None] * np.array(pattern.start) + c[:, None] * np.array(
                pattern.end
            ), far
        case Checker():
            a, b = u * pattern.cells[0], v * pattern.cells[1]
            first = (np.floor(a) + np.floor(b)) % 2 == 0
            near_u = np.abs(a - np.round(a)) * face.size[0] / pattern.cells[0]
            near_v = np.abs(b - np.round(b)) * face.size[1] / pattern.cells[1]
            value = np.where(first[:, None], np.array(pattern.a), np.array(pattern.b))
            return value, np.minimum(near_u, near_v)
    raise ValueError(f"{pattern.type} has no closed form here")


def against_truth(
    scene: ResolvedScene,
    picture: Pixels,
    quantum: float,
    precision: Precision,
    noise: Noise | None,
) -> Comparison:
    """A picture against its closed form, pixel by pixel; edges within a renderer's error excluded.

    With `noise` the picture is sampled over pixel areas: then pixels that an edge crosses are
    excluded and means are judged.
    """
    true, edge = true_picture(scene)
    if picture.shape != true.shape:
        raise Unmeasurable(f"the picture is {picture.shape}, expected {true.shape}")
    if scene.film.samples > 1:
        raise Unmeasurable("the truth is what the centres of pixels see, and not what samples do")
    if not np.isfinite(picture).all():
        raise Unmeasurable("the picture holds values that are not finite")
    extent = float(np.abs(np.array(scene.camera.origin)).max()) + 1
    stray = geometric_error(extent, len(scene.surfaces), precision.arithmetic)
    if noise is not None:
        if isinstance(scene.background, Panorama):
            raise Unmeasurable("the mean of a panorama over a pixel has no closed form")
        rows = np.flatnonzero(edge.ravel() > footprint(scene))
        sampled = binned(picture.reshape(-1, 3).astype(float), true.reshape(-1, 3), rows, noise)
        sampled.detail.update(FREE_OF_INDEX)
        return sampled
    keep = edge > stray
    error = np.abs(picture.astype(np.float64) - true).max(axis=-1)
    roundings = ROUNDINGS * (len(scene.surfaces) + 1) * precision.arithmetic / 2
    tolerance = quantum + roundings * (float(true.max()) + _steepness(scene))
    y, x = np.unravel_index(int(np.where(keep, error, -1).argmax()), error.shape)
    channel = int(np.abs(picture[y, x].astype(np.float64) - true[y, x]).argmax())
    return Comparison(
        float(picture[y, x, channel]), float(true[y, x, channel]), tolerance,
        bool(error[keep].max() <= tolerance),
        "quantum of the image + 8 eps per surface, and per radian of a panorama",
        detail={"max": float(error[keep].max()), "rms": float(np.sqrt((error[keep] ** 2).mean())),
                "excluded_grazing": int((~keep).sum()), "worst_pixel_x": int(x),
                "worst_pixel_y": int(y), **FREE_OF_INDEX},
    )  # fmt: skip


def _steepness(scene: ResolvedScene) -> float:
    """By how much radiance a panorama changes per radian, anywhere in the picture."""
    if not isinstance(scene.background, Panorama):
        return 0.0
    d, step = primary_rays(scene).directions, 1e-6
    here = panorama_radiance(scene.background, d)
    changes = [0.0]
    for axis in np.eye(3):
        there = d + step * axis
        there /= np.linalg.norm(there, axis=1, keepdims=True)
        changes.append(float(np.abs(panorama_radiance(scene.background, there) - here).max()))
    return float(np.sqrt(3)) * max(changes) / step


def footprint(scene: ResolvedScene) -> float:
    """Twice the diagonal of a pixel on the farthest face: an edge that far off is not in it."""
    camera = scene.camera
    if isinstance(camera, Orthographic):
        return 2 * camera.width / scene.film.width
    faces = [_face(surface) for surface in scene.surfaces]
    if any(isinstance(face, Plane) for face in faces):
        raise Unmeasurable("the mean over a pixel that sees a horizon has no closed form")
    far = max(float(np.linalg.norm(np.array(face.frame.origin) - camera.origin))
              for face in faces if isinstance(face, Rectangle))  # fmt: skip
    return float(2 * np.sqrt(2) * 2 * camera.tan_half_fov_x / scene.film.width * far * 1.5)
