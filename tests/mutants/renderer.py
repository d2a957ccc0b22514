"""A correct dielectric ray tracer whose every rule can be exchanged, as an outside renderer.

    python renderer.py --fault NAME --amount A [--shows float|16bit|8bit] [--float32]

speaks the worker protocol on stdin and stdout (docs/worker-protocol.md). With `scene.json` and
`image.npy` as further arguments it renders once. Without a fault it is right.

Cameras, shapes and patterns are those of the documented student.py; what happens at surfaces is
`Rules`. It imports nothing of snellcheck's.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "docs" / "bring-your-own-renderer")]

import student  # noqa: E402
from student import dot, unit  # noqa: E402

CAPABILITIES = [
    *("image", "pixel-centres", "lobe-switch", "sphere", "convex", "mesh", "smooth-mesh"),
    *("picture", "absorption", "fresnel", "nested", "camera-inside", "thin-slab"),
]


class Rules:
    """Physics. `a` is how large a fault is; the right rules do not look at it.

    Arrays named like a vector are (n, 3), the others (n,); `n` faces the ray.
    """

    too_near = 1e-9
    claims: tuple[str, ...] = ()

    def __init__(self, a: float) -> None:
        self.a = a

    def camera_rays(self, camera, width, height):
        return student.camera_rays(camera, width, height)

    def max_depth(self, depth):
        return depth

    def shape_normal(self, outward, shape):
        return outward

    def faces(self, outward, entering):
        """The normal that refraction and reflection are computed with."""
        return np.where(entering[:, None], outward, -outward)

    def recalled(self, n, d, before):
        """The normal after all; `before` is that of the surface where the ray started, or NaN."""
        return n

    def indices(self, inner, outer, entering, shape):
        """Indices here and beyond."""
        return np.where(entering, outer, inner), np.where(entering, inner, outer)

    def bend(self, d, n, ior_i, ior_t, entering, leg):
        """Refracted directions, and where reflection is total."""
        bent, R = student.refract(d, n, ior_i, ior_t)
        return bent, R >= 1

    def reflectance(self, cos_i, ior_i, ior_t, entering):
        """By the cosine of incidence alone; 1 where reflection is total."""
        cos_t = np.sqrt(np.maximum(1 - (ior_i / ior_t) ** 2 * (1 - cos_i**2), 0))
        s, p = self.polarised(cos_i, cos_t, ior_i, ior_t)
        return np.where(cos_t > 0, (s + p) / 2, 1.0)

    def polarised(self, cos_i, cos_t, ior_i, ior_t):
        with np.errstate(invalid="ignore"):
            s = ((ior_i * cos_i - ior_t * cos_t) / (ior_i * cos_i + ior_t * cos_t)) ** 2
            p = ((ior_t * cos_i - ior_i * cos_t) / (ior_t * cos_i + ior_i * cos_t)) ** 2
        return np.nan_to_num(s), np.nan_to_num(p)

    def weights(self, R, total, ior_i, ior_t, cos_i):
        """What the reflected and the transmitted ray weigh."""
        return R, np.where(total, 0.0, 1 - R)

    def start(self, p, d, n):
        return p

    def absorbed(self, sigma, length, d, n, forward, ends_in_reflection):
        """Optical depth (n, 3); `n` is the normal at the start of the way, NaN at the camera."""
        return sigma * length[:, None]

    def thin_offset(self, shift):
        return shift

    def shown(self, image):
        return image


# --- shapes that student.py does not have ---------------------------------------------------------


def hit_mesh(mesh, origins, directions, margin=-1e-12):
    """Möller and Trumbore (1997), all rays by all triangles; `margin` shrinks the triangles."""
    vertices, triangles = np.array(mesh["vertices"]), np.array(mesh["triangles"])
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    e1, e2 = b - a, c - a
    h = np.cross(directions[:, None], e2[None])
    det = np.einsum("tk,ntk->nt", e1, h)
    s = origins[:, None] - a[None]
    q = np.cross(s, e1[None])
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ntk,ntk->nt", s, h) / det
        v = np.einsum("nk,ntk->nt", directions, q) / det
        t = np.einsum("tk,ntk->nt", e2, q) / det
        inside = (u >= margin) & (v >= margin) & (u + v <= 1 - margin)
        t = np.where(inside & (t > student.TOO_NEAR), t, np.inf)
    first = t.argmin(axis=1)
    rows = np.arange(len(t))
    if mesh.get("normals"):
        corner = np.array(mesh["normals"])[triangles[first]]
        w = np.stack([1 - u - v, u, v])[:, rows, first].T
        return t[rows, first], unit(np.einsum("nk,nkj->nj", w, corner))
    return t[rows, first], unit(np.cross(e1, e2))[first]


student.HIT["mesh"] = hit_mesh


# --- the image ------------------------------------------------------------------------------------


def render(scene, rules, rounded=lambda x: x):
    """The image (height, width, 3). `rounded` is what the arithmetic makes of every number."""
    width, height = scene["film"]["width"], scene["film"]["height"]
    origins, directions = rules.camera_rays(scene["camera"], width, height)
    count = width * height
    rays = {
        "pixel": np.arange(count),
        "origin": rounded(np.array(origins)),
        "direction": rounded(np.array(directions)),
        "weight": np.ones((count, 3)),
        "medium": np.full(count, scene["camera"]["medium"]),
        "n": np.full((count, 3), np.nan),
    }
    image = np.zeros((count, 3))
    for _ in range(rules.max_depth(scene["transport"]["max_depth"])):
        rays = _generation(scene, rules, rays, image, rounded)
        # What is not a number is followed too, as renderers do.
        light = ~(rays["weight"].max(axis=1) <= scene["transport"]["min_weight"])
        rays = student.select(rays, light)
        if not len(rays["pixel"]):
            break
    return rules.shown(image.reshape(height, width, 3))


def _generation(scene, rules, rays, image, rounded):
    things = scene["solids"] + scene["surfaces"]
    t = np.full(len(rays["pixel"]), np.inf)
    nearest, outward = np.full(len(t), -1), np.zeros((len(t), 3))
    for number, thing in enumerate(things):
        distance, n = student.HIT[thing["shape"]["type"]](
            thing["shape"], rays["origin"], rays["direction"]
        )
        nearer = distance < t
        t[nearer], nearest[nearer] = distance[nearer], number
        outward[nearer] = rules.shape_normal(n, thing["shape"])[nearer]
    missed = nearest < 0
    student.add(image, rays, missed, np.array(scene["background"]))
    length = np.where(missed, 0, t)
    moved = rays | {
        "origin": rounded(rays["origin"] + length[:, None] * rays["direction"]),
        "length": length,
    }
    children = []
    for number, thing in enumerate(things):
        here = student.select(moved, nearest == number)
        n = rounded(outward[nearest == number])
        if number < len(scene["solids"]):
            children += _split(scene, rules, thing, here, n)
        elif thing["material"]["type"] == "thin_slab":
            children.append(_thin(scene, rules, thing["material"], _absorb(scene, rules, here), n))
        else:
            u, v = student.texture_coordinates(thing["shape"], here["origin"])
            shine = student.radiance(thing["material"]["pattern"], u, v)
            student.add(image, _absorb(scene, rules, here), slice(None), shine)
    children = [{k: rounded(v) if k in ("direction", "weight") else v for k, v in child.items()}
                for child in children]  # fmt: skip
    empty = student.select(moved, np.zeros(len(missed), bool))
    return {k: np.concatenate([c[k] for c in (empty, *children)]) for k in rays}


def _absorb(scene, rules, rays, ends_in_reflection=False):
    sigma = np.array([medium["absorption"] for medium in scene["media"]])[rays["medium"]]
    forward = np.array(scene["camera"]["forward"])
    depth = rules.absorbed(
        sigma, rays["length"], rays["direction"], rays["n"], forward, ends_in_reflection
    )
    return rays | {"weight": rays["weight"] * np.exp(-depth)}


def _split(scene, rules, solid, rays, outward):
    transport, iors = scene["transport"], np.array([m["ior"] for m in scene["media"]])
    entering = dot(rays["direction"], outward) < 0
    inner = np.full(len(entering), iors[solid["medium"]])
    outer = np.full(len(entering), iors[solid["exterior"]])
    d = rays["direction"]
    n = rules.recalled(rules.faces(outward, entering), d, rays["n"])
    ior_i, ior_t = rules.indices(inner, outer, entering, solid["shape"])
    bent, total = rules.bend(d, n, ior_i, ior_t, entering, rays["length"])
    facing = np.where((dot(d, n) > 0)[:, None], -n, n)
    cos_i = np.clip(-dot(d, facing), 0, 1)
    R = rules.reflectance(cos_i, ior_i, ior_t, entering)
    R = np.where(total, np.where(np.isfinite(R), np.maximum(R, 1), R), R)
    w_r, w_t = rules.weights(R, total, ior_i, ior_t, cos_i)
    mirrored = d + 2 * cos_i[:, None] * facing
    beyond = np.where(entering, solid["medium"], solid["exterior"])
    p = rays["origin"]

    def child(parent, direction, weight, medium):
        start = rules.start(p, direction, facing)
        weight = parent["weight"] * weight[:, None]
        return parent | {"direction": direction, "origin": start, "n": facing, "weight": weight,
                         "medium": medium}  # fmt: skip

    back = child(_absorb(scene, rules, rays, True), mirrored, w_r, rays["medium"])
    on = child(_absorb(scene, rules, rays), bent, w_t, beyond)
    return [
        student.select(back, total | transport["reflection"]),
        student.select(on, ~total & transport["transmission"]),
    ]


def _thin(scene, rules, material, rays, outward):
    """Transmission through the lecture's thin face; the probes that use it do not reflect."""
    iors = np.array([m["ior"] for m in scene["media"]])
    d = rays["direction"]
    n = np.where((dot(d, outward) > 0)[:, None], -outward, outward)
    cos_i = -dot(d, n)
    inner = np.full(len(cos_i), iors[material["medium"]])
    outer, entering = np.full(len(cos_i), iors[material["exterior"]]), np.ones(len(cos_i), bool)
    ior_i, ior_t = rules.indices(inner, outer, entering, {"type": "thin_slab"})
    bent, _ = rules.bend(d, n, ior_i, ior_t, entering, rays["length"])
    R = rules.reflectance(cos_i, ior_i, ior_t, entering)
    way = bent * (material["thickness"] / -dot(bent, n))[:, None]
    shift = way - dot(way, d)[:, None] * d
    along = dot(way, d)[:, None] * d
    return rays | {
        "origin": rays["origin"] + along + rules.thin_offset(shift), "n": n,
        "weight": rays["weight"] * ((1 - R) ** 2)[:, None],
    }  # fmt: skip


# --- what its files can hold ----------------------------------------------------------------------


def srgb_8bit(x):
    x = np.clip(x, 0, 1)
    coded = np.where(
        x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055
    )
    v = np.rint(coded * 255) / 255
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


SHOWS = {
    "float": lambda x: x,
    "16bit": lambda x: np.rint(np.clip(x, 0, 1) * 65535) / 65535,
    "8bit": srgb_8bit,
}


def as_float32(x):
    return x.astype(np.float32).astype(np.float64)


# --- the program ----------------------------------------------------------------------------------


def main() -> None:
    import unlisted  # noqa: F401  (it registers more of them)
    from faults import FAULTS

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fault", choices=sorted(FAULTS), default="none")
    parser.add_argument("--amount", type=float, default=1.0)
    parser.add_argument("--shows", choices=sorted(SHOWS), default="float")
    parser.add_argument("--float32", action="store_true")
    parser.add_argument("files", nargs="*", type=Path)
    chosen = parser.parse_args()
    rules = FAULTS[chosen.fault](chosen.amount)
    # In single precision a point lies up to 1e-6 off its surface.
    student.TOO_NEAR = max(rules.too_near, 1e-5 if chosen.float32 else 0.0)

    def write(scene, output):
        rounded = as_float32 if chosen.float32 else (lambda x: x)
        with np.errstate(all="ignore"):
            image = SHOWS[chosen.shows](render(json.loads(Path(scene).read_text()), rules, rounded))
        student.write_npy(output, image)

    if chosen.files:
        write(*chosen.files)
        return
    exact = [] if chosen.float32 else ["double", "double-data"]
    hello = {
        "protocol": 1, "name": "mutant", "version": "1.0", "operations": ["render"],
        "capabilities": [*CAPABILITIES, *exact, *rules.claims],
    }  # fmt: skip
    for line in sys.stdin:
        asked = json.loads(line)
        began, reply = time.perf_counter(), {"ok": True}
        if asked["op"] == "hello":
            reply |= hello
        else:
            write(asked["scene"], asked["output"])
            reply["seconds"] = time.perf_counter() - began
        print(json.dumps({"id": asked["id"], **reply}), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
