"""Panes: a renderer of glass panes and prisms. It stands for yours.

    python panes.py scene.json image.npy

One ray through the centre of each pixel; at glass it goes on as two, reflected and refracted, each
weighted by Fresnel's equations. Arrays of vectors have the shape (n, 3), one row a ray.
"""

import json
import sys
from pathlib import Path

import numpy as np

SKIN = 1e-9  # a ray does not hit again the point where it starts


def main(scene_file, image_file):
    scene = json.loads(Path(scene_file).read_text())
    np.save(image_file, render(scene).astype("<f4"))


def render(scene):
    """(H, W, 3) linear radiance."""
    width, height = scene["film"]["width"], scene["film"]["height"]
    transport = scene["transport"]
    image = np.zeros((width * height, 3))
    origins, directions = camera(scene["camera"], width, height)
    pixels = np.arange(len(image))
    todo = [(pixels, origins, directions, np.ones(len(image)), 1)]
    while todo:
        pixels, origins, directions, weights, depth = todo.pop()
        bright = weights > transport["min_weight"]
        if depth > transport["max_depth"] or not bright.any():
            continue
        rays = [part[bright] for part in (pixels, origins, directions, weights)]
        todo += [(*further, depth + 1) for further in follow(scene, image, *rays)]
    return image.reshape(height, width, 3)


def camera(camera, width, height):
    right, up, forward = (np.array(camera[key]) for key in ("right", "up", "forward"))
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    x = (2 * (column + 0.5) / width - 1).reshape(-1, 1)
    y = ((1 - 2 * (row + 0.5) / height) * height / width).reshape(-1, 1)
    origin = np.array(camera["origin"])
    if camera["type"] == "orthographic":
        half = camera["width"] / 2
        origins = origin + half * (x * right + y * up)
        return origins, np.tile(forward, (len(x), 1))
    directions = forward + camera["tan_half_fov_x"] * (x * right + y * up)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.tile(origin, (len(x), 1)), directions


def follow(scene, image, pixels, origins, directions, weights):
    """Adds light where rays end; yields what goes on from glass."""
    hits = [hit_convex(solid["shape"], origins, directions) for solid in scene["solids"]]
    hits += [hit_rectangle(surface["shape"], origins, directions) for surface in scene["surfaces"]]
    distances = np.array([distance for distance, _ in hits] + [np.full(len(pixels), np.inf)])
    nearest, distance = distances.argmin(axis=0), distances.min(axis=0)
    for number, (_, normals) in enumerate(hits):
        here = (nearest == number) & np.isfinite(distance)
        points = origins[here] + distance[here, None] * directions[here]
        if number < len(scene["solids"]):
            yield from split(scene, scene["solids"][number], normals[here], pixels[here], points,
                             directions[here], weights[here])  # fmt: skip
        else:
            surface = scene["surfaces"][number - len(scene["solids"])]
            light = weights[here, None] * radiance(surface, points)
            np.add.at(image, pixels[here], light)
    away = ~np.isfinite(distance)
    np.add.at(image, pixels[away], weights[away, None] * np.array(scene["background"]))


def hit_convex(convex, origins, directions):
    """Inside all planes at once: from the last entry to the first exit."""
    normals, offsets = np.split(np.array(convex["planes"]), [3], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        speeds = directions @ normals.T
        distances = (offsets.T - origins @ normals.T) / speeds
        beside = ((speeds == 0) & (distances < 0)).any(axis=1)
    enter = np.where(speeds < 0, distances, -np.inf)
    leave = np.where(speeds > 0, distances, np.inf)
    outside = enter.max(axis=1) > SKIN
    distance = np.where(outside, enter.max(axis=1), leave.min(axis=1))
    missed = (enter.max(axis=1) >= leave.min(axis=1)) | (distance <= SKIN) | beside
    face = np.where(outside, enter.argmax(axis=1), leave.argmin(axis=1))
    return np.where(missed, np.inf, distance), normals[face]


def hit_rectangle(rectangle, origins, directions):
    normal = np.array(rectangle["frame"]["z"])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (
            (np.array(rectangle["frame"]["origin"]) - origins) @ normal / (directions @ normal)
        )
        ahead = np.isfinite(distance) & (distance > SKIN)
    points = origins + np.where(ahead, distance, 0)[:, None] * directions
    u, v = coordinates(rectangle, points)
    on = ahead & (np.abs(u - 0.5) <= 0.5) & (np.abs(v - 0.5) <= 0.5)
    return np.where(on, distance, np.inf), np.tile(normal, (len(points), 1))


def coordinates(rectangle, points):
    """(u, v) from (0, 0) at the corner towards -x, -y to (1, 1)."""
    frame, size = rectangle["frame"], rectangle["size"]
    offset = points - np.array(frame["origin"])
    return [offset @ np.array(frame[axis]) / size[k] + 0.5 for k, axis in enumerate("xy")]


def radiance(surface, points):
    """What an emissive rectangle shows."""
    pattern = surface["material"]["pattern"]
    u, v = coordinates(surface["shape"], points)
    if pattern["type"] == "constant":
        return np.tile(pattern["radiance"], (len(points), 1))
    along = u if pattern["axis"] == "u" else v
    if pattern["type"] == "ramp":
        start, end = np.array(pattern["start"]), np.array(pattern["end"])
        return start + along[:, None] * (end - start)
    if pattern["type"] == "position_code":
        fine = pattern["cells"] * along
        code = np.stack([along, fine - np.floor(fine), np.ones_like(along)], axis=1)
        return pattern["amplitude"] * code
    sys.exit(f"panes cannot show the pattern {pattern['type']}")


def split(scene, solid, normals, pixels, points, directions, weights):
    """At glass: the reflected and the refracted rays."""
    entering = np.einsum("ij,ij->i", directions, normals) < 0
    normals = np.where(entering[:, None], normals, -normals)
    inside = scene["media"][solid["medium"]]["ior"]
    outside = scene["media"][solid["exterior"]]["ior"]
    ior_i = np.where(entering, outside, inside)
    ior_t = np.where(entering, inside, outside)
    bent, cos_i, cos_t = refract(directions, normals, ior_i, ior_t)
    share = fresnel(cos_i, cos_t, ior_i, ior_t)
    mirrored = directions + 2 * cos_i[:, None] * normals
    total = share == 1
    go = total | scene["transport"]["reflection"]
    yield pixels[go], points[go], mirrored[go], (weights * share)[go]
    go = ~total & scene["transport"]["transmission"]
    yield pixels[go], points[go], bent[go], (weights * (1 - share))[go]


def refract(directions, normals, ior_i, ior_t):
    """Snell's law; normals point against the rays. Where cos_t is 0 there is no refracted ray."""
    mu = ior_i / ior_t
    cos_i = -np.einsum("ij,ij->i", directions, normals)
    cos_t = np.sqrt(np.maximum(1 - mu**2 * (1 - cos_i**2), 0))
    bent = mu[:, None] * directions + (mu * cos_i - cos_t)[:, None] * normals
    return bent / np.linalg.norm(bent, axis=1, keepdims=True), cos_i, cos_t


def fresnel(cos_i, cos_t, ior_i, ior_t):
    """How much of unpolarised light is reflected; 1 where all of it is."""
    s = (ior_i * cos_i - ior_t * cos_t) / (ior_i * cos_i + ior_t * cos_t)
    p = (ior_t * cos_i - ior_i * cos_t) / (ior_t * cos_i + ior_i * cos_t)
    return np.where(cos_t > 0, (s**2 + p**2) / 2, 1.0)


if __name__ == "__main__":
    main(*sys.argv[1:])
