"""A small ray tracer that snellcheck can test: numpy, one file, nothing of snellcheck's.

    python student.py scene.json image.npy        (or .pfm, or .png with --bits 8 or 16)

It knows spheres, convex polyhedra and emissive rectangles. At a dielectric it follows both the
reflected and the refracted ray, each weighted by Fresnel's equations. All rays of a generation
are traced together: arrays named like a vector have the shape (n, 3), the others (n,).
"""

import argparse
import base64
import json
import struct
import sys
import zlib
from pathlib import Path

import numpy as np

TOO_NEAR = 1e-9  # a ray does not hit again the point where it starts


def dot(a, b):
    return np.sum(a * b, axis=-1)


# --- the camera -----------------------------------------------------------------------------------


def camera_rays(camera, width, height):
    """Origins and unit directions through the centres of all pixels, row 0 at the top."""
    right, up, forward, origin = (
        np.array(camera[key]) for key in ("right", "up", "forward", "origin")
    )
    i, j = np.meshgrid(np.arange(width), np.arange(height))
    x = (2 * (i + 0.5) / width - 1).reshape(-1, 1)
    y = ((1 - 2 * (j + 0.5) / height) * height / width).reshape(-1, 1)
    if camera["type"] == "perspective":
        k = camera["tan_half_fov_x"]
        directions = forward + k * (x * right + y * up)
        return np.broadcast_to(origin, directions.shape), unit(directions)
    half = camera["width"] / 2
    origins = origin + half * (x * right + y * up)
    return origins, np.broadcast_to(forward, origins.shape)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


# --- shapes: the nearest distance (inf for a miss) and the outward normal there -------------------


def hit_sphere(sphere, origins, directions):
    center, radius = np.array(sphere["center"]), sphere["radius"]
    to_center = center - origins
    middle = dot(to_center, directions)  # where the ray is nearest to the centre
    aside = to_center - middle[:, None] * directions
    half_chord = np.sqrt(np.maximum(radius**2 - dot(aside, aside), 0))
    near, far = middle - half_chord, middle + half_chord
    t = np.where(near > TOO_NEAR, near, far)
    t = np.where((half_chord > 0) & (t > TOO_NEAR), t, np.inf)
    point = origins + np.where(np.isfinite(t), t, 0)[:, None] * directions
    # Not divided by the radius: a normal that is not quite unit makes reflections drift away.
    return t, unit(point - center)


def hit_convex(convex, origins, directions):
    """Inside all planes at once: from the last entry to the first exit."""
    planes = np.array(convex["planes"])
    normals, offsets = planes[:, :3], planes[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = directions @ normals.T
        t = (offsets - origins @ normals.T) / speed
    entries = np.where(speed < 0, t, -np.inf)
    exits = np.where(speed > 0, t, np.inf)
    outside = (speed == 0) & (origins @ normals.T > offsets)
    enter, leave = entries.max(axis=1), exits.min(axis=1)
    enters = enter > TOO_NEAR
    t = np.where(enters, enter, leave)
    t = np.where((enter < leave) & (t > TOO_NEAR) & ~outside.any(axis=1), t, np.inf)
    face = np.where(enters, entries.argmax(axis=1), exits.argmin(axis=1))
    return t, normals[face]


def hit_rectangle(rectangle, origins, directions):
    frame = rectangle["frame"]
    normal = np.array(frame["z"])
    with np.errstate(divide="ignore", invalid="ignore"):
        t = dot(np.array(frame["origin"]) - origins, normal) / dot(directions, normal)
    t = np.where(np.isfinite(t) & (t > TOO_NEAR), t, np.inf)
    point = origins + np.where(np.isfinite(t), t, 0)[:, None] * directions
    u, v = texture_coordinates(rectangle, point)
    inside = (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
    return np.where(inside, t, np.inf), np.broadcast_to(normal, directions.shape)


def texture_coordinates(rectangle, points):
    frame, size = rectangle["frame"], rectangle["size"]
    offset = points - np.array(frame["origin"])
    return (dot(offset, np.array(frame[axis])) / size[k] + 0.5 for k, axis in enumerate("xy"))


HIT = {"sphere": hit_sphere, "convex": hit_convex, "rectangle": hit_rectangle}


# --- light ----------------------------------------------------------------------------------------


def radiance(pattern, u, v):
    """What an emissive surface shows at its texture coordinates."""
    kind = pattern["type"]
    if kind == "constant":
        return np.tile(pattern["radiance"], (len(u), 1))
    if kind == "checker":
        across, along = pattern["cells"]
        odd = (cell(u, across) + cell(v, along)) % 2 == 1
        return np.where(odd[:, None], pattern["b"], pattern["a"])
    if kind == "picture":
        texels = np.frombuffer(base64.b64decode(pattern["pixels"]), "<u2") / 65535
        texels = texels.reshape(pattern["height"], pattern["width"], 3)
        return texels[cell(1 - v, pattern["height"]), cell(u, pattern["width"])]
    along = (u if pattern["axis"] == "u" else v)[:, None]
    if kind == "ramp":
        start, end = np.array(pattern["start"]), np.array(pattern["end"])
        return start + along * (end - start)
    if kind == "position_code":
        fine = pattern["cells"] * along
        code = [along, fine - np.floor(fine), np.ones_like(along)]
        return pattern["amplitude"] * np.concatenate(code, axis=1)
    raise SystemExit(f"I cannot show the pattern {kind!r}")


def cell(coordinate, count):
    return np.clip(np.floor(coordinate * count).astype(int), 0, count - 1)


def refract(directions, normals, ior_i, ior_t):
    """Snell's law without trigonometry; `normals` point against `directions`.

    Returns the refracted directions and the unpolarised Fresnel reflectance, 1 where all light
    is reflected. The square below is written so that it stays exact near the critical angle.
    """
    cos_i = -dot(directions, normals)
    mu = ior_i / ior_t
    square = (ior_t - ior_i) * (ior_t + ior_i) / ior_t**2 + (mu * cos_i) ** 2
    cos_t = np.sqrt(np.maximum(square, 0))
    bent = mu[:, None] * directions + (mu * cos_i - cos_t)[:, None] * normals
    r_s = (ior_i * cos_i - ior_t * cos_t) / (ior_i * cos_i + ior_t * cos_t)
    r_p = (ior_t * cos_i - ior_i * cos_t) / (ior_t * cos_i + ior_i * cos_t)
    return unit(bent), np.where(square > 0, (r_s**2 + r_p**2) / 2, 1)


# --- the image ------------------------------------------------------------------------------------


def render(scene):
    """The image, (height, width, 3), linear."""
    width, height = scene["film"]["width"], scene["film"]["height"]
    origins, directions = camera_rays(scene["camera"], width, height)
    rays = {
        "pixel": np.arange(width * height),
        "origin": origins,
        "direction": directions,
        "weight": np.ones((width * height, 3)),
        "medium": np.full(width * height, scene["camera"]["medium"]),
    }
    image = np.zeros((width * height, 3))
    for depth in range(1, scene["transport"]["max_depth"] + 1):
        rays = trace_generation(scene, rays, image)
        keep = rays["weight"].max(axis=1) > scene["transport"]["min_weight"]
        rays = select(rays, keep)
        if not keep.any() or depth == scene["transport"]["max_depth"]:
            break
    return image.reshape(height, width, 3)


def trace_generation(scene, rays, image):
    """Adds what the rays see to the image; returns the rays that go on from where they hit."""
    things = scene["solids"] + scene["surfaces"]
    distance = np.full(len(rays["pixel"]), np.inf)
    nearest = np.full(len(distance), -1)
    normal = np.zeros((len(distance), 3))
    for number, thing in enumerate(things):
        hit = HIT[thing["shape"]["type"]]
        t, outward = hit(thing["shape"], rays["origin"], rays["direction"])
        nearer = t < distance
        distance[nearer], nearest[nearer], normal[nearer] = t[nearer], number, outward[nearer]

    missed = nearest < 0
    add(image, rays, missed, np.array(scene["background"]))
    absorption = np.array([medium["absorption"] for medium in scene["media"]])[rays["medium"]]
    length = np.where(missed, 0, distance)[:, None]
    rays = rays | {
        "weight": rays["weight"] * np.exp(-absorption * length),
        "origin": rays["origin"] + length * rays["direction"],
    }
    children = [select(rays, np.zeros(len(missed), bool))]
    for number, thing in enumerate(things):
        here = nearest == number
        if number < len(scene["solids"]):
            children += split(scene, thing, select(rays, here), normal[here])
        else:
            u, v = texture_coordinates(thing["shape"], rays["origin"][here])
            add(image, rays, here, radiance(thing["material"]["pattern"], u, v))
    return {key: np.concatenate([child[key] for child in children]) for key in rays}


def split(scene, solid, rays, outward):
    """Double recursion: the reflected and the refracted rays at the surface of a solid."""
    transport, iors = scene["transport"], np.array([medium["ior"] for medium in scene["media"]])
    entering = dot(rays["direction"], outward) < 0
    normal = np.where(entering[:, None], outward, -outward)
    beyond = np.where(entering, solid["medium"], solid["exterior"])
    before = np.where(entering, solid["exterior"], solid["medium"])
    bent, R = refract(rays["direction"], normal, iors[before], iors[beyond])
    mirrored = rays["direction"] - 2 * dot(rays["direction"], normal)[:, None] * normal
    reflected = rays | {"direction": mirrored, "weight": rays["weight"] * R[:, None]}
    refracted = rays | {
        "direction": bent,
        "weight": rays["weight"] * (1 - R)[:, None],
        "medium": beyond,
    }
    return [  # total reflection is followed in any case
        select(reflected, (R == 1) | transport["reflection"]),
        select(refracted, (R < 1) & transport["transmission"]),
    ]


def select(rays, which):
    return {key: values[which] for key, values in rays.items()}


def add(image, rays, which, light):
    np.add.at(image, rays["pixel"][which], rays["weight"][which] * light)


# --- image files ----------------------------------------------------------------------------------


def write_npy(path, image):
    np.save(path, image.astype("<f4"))


def write_pfm(path, image):
    """Rows run from the bottom up; the minus sign says little-endian."""
    height, width, _ = image.shape
    header = f"PF\n{width} {height}\n-1.0\n".encode()
    path.write_bytes(header + image[::-1].astype("<f4").tobytes())


def write_png(path, image, bits):
    """sRGB, and says so."""
    height, width, _ = image.shape
    x = image.clip(0, 1)
    x = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)
    values = np.rint(x * (2**bits - 1)).astype(f">u{bits // 8}")
    rows = b"".join(b"\0" + row.tobytes() for row in values)
    header = struct.pack(">IIBBBBB", width, height, bits, 2, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"sRGB", b"\0"), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    data = b"\x89PNG\r\n\x1a\n"
    for name, content in chunks:
        checksum = zlib.crc32(name + content)
        data += struct.pack(">I", len(content)) + name + content + struct.pack(">I", checksum)
    path.write_bytes(data)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--bits", type=int, choices=(8, 16), default=16, help="of a PNG")
    arguments = parser.parse_args()
    image = render(json.loads(arguments.scene.read_text()))
    kind = arguments.output.suffix
    if kind == ".npy":
        write_npy(arguments.output, image)
    elif kind == ".pfm":
        write_pfm(arguments.output, image)
    elif kind == ".png":
        write_png(arguments.output, image, arguments.bits)
    else:
        sys.exit(f"I cannot write {kind!r}")


if __name__ == "__main__":
    main()
