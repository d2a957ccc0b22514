"""Images by double recursion: at every dielectric a ray becomes two.

The recursion is unrolled onto an explicit stack of rays that wait. It is cut where a ray would
have more than `max_depth` segments or carry less than `min_weight`. What is cut is added up per
pixel: image and cut together bound what a recursion without end would show.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracer.arrays import Arrays, Floats, flatten
from tracer.camera import camera_row, pixel_centre, primary_ray
from tracer.compiled import compiled, inlined
from tracer.hit import NOTHING, UNKNOWN, nearest_hit, new_stack
from tracer.light import absorbed
from tracer.scene import Scene
from tracer.shapes import vec_at
from tracer.surface import BLACK, Lobes, scatter
from tracer.threads import for_bands
from tracer.vector import Vec, add, mul

TELLING = 1e-4  # a weight whose loss would show in a picture
BAND = 4  # rows of pixels that a thread takes at a time


@dataclass(frozen=True, eq=False)
class Render:
    """`pixels` (H, W, 3) radiance, row 0 at the top; `cut` (H, W), the weight not followed.

    In a world of radiance 1 without absorption, pixels + cut is 1. `closest` (H, W) is the shortest
    way between two surfaces on any ray that carries at least `TELLING`, infinite where there is
    none: a ray through a corner of glass, which a renderer that cannot resolve it loses.
    """

    pixels: Floats
    cut: Floats
    closest: Floats


class Limits(NamedTuple):
    max_depth: int
    min_weight: float


class Ray(NamedTuple):
    """A ray under way: what it carries, and the face that it has left (see `nearest_hit`)."""

    o: Vec
    d: Vec
    weight: Vec
    segments: int
    medium: int
    left: int
    left_face: int
    inward: bool


class Waiting(NamedTuple):
    """Rays that wait to be followed, never more than `max_depth`."""

    floats: Floats  # (depth, 9)
    ints: NDArray[np.int64]  # (depth, 5)


@inlined
def _lay_aside(waiting: Waiting, at: int, ray: Ray) -> None:
    for k in range(3):
        waiting.floats[at, k] = ray.o[k]
        waiting.floats[at, 3 + k] = ray.d[k]
        waiting.floats[at, 6 + k] = ray.weight[k]
    ints = waiting.ints
    ints[at, 0], ints[at, 1], ints[at, 2] = ray.segments, ray.medium, ray.left
    ints[at, 3], ints[at, 4] = ray.left_face, ray.inward


@inlined
def _take_up(waiting: Waiting, at: int) -> Ray:
    floats, ints = waiting.floats, waiting.ints
    o, d, weight = vec_at(floats, at, 0), vec_at(floats, at, 3), vec_at(floats, at, 6)
    return Ray(o, d, weight, ints[at, 0], ints[at, 1], ints[at, 2], ints[at, 3], ints[at, 4] != 0)


@inlined
def _worth(ray: Ray, limits: Limits) -> tuple[bool, float]:
    """(follow it, what is cut if not)."""
    strength = max(ray.weight[0], ray.weight[1], ray.weight[2])
    if strength > 0.0 and strength >= limits.min_weight and ray.segments <= limits.max_depth:
        return True, 0.0
    return False, strength


@inlined
def radiance(
    scene: Arrays, limits: Limits, lobes: Lobes, o: Vec, d: Vec, waiting: Waiting, stack: Floats
) -> tuple[Vec, float, float]:
    """(radiance that arrives at `o` against `d`, weight cut, closest)."""
    seen, cut, closest, height = BLACK, 0.0, np.inf, 0
    ray = Ray(o, d, (1.0, 1.0, 1.0), 1, UNKNOWN, NOTHING, -1, False)
    while True:
        hit, face, t, entering, medium, beyond = nearest_hit(
            scene, ray.o, ray.d, ray.medium, ray.left, ray.left_face, ray.inward, stack
        )
        weight = mul(ray.weight, absorbed(scene.media, medium, t))
        if hit == NOTHING:
            seen = add(seen, mul(weight, vec_at(scene.background, 0, 0)))
        else:
            if ray.segments > 1 and t < closest and max(weight[0], weight[1], weight[2]) >= TELLING:
                closest = t
            at = scatter(scene, lobes, ray.o, t, ray.d, medium, hit, face, entering, beyond, stack)
            seen = add(seen, mul(weight, at.sent))
            reflected = Ray(
                at.p,
                at.wr,
                mul(weight, at.reflected),
                ray.segments + 1,
                at.medium,
                hit,
                face,
                not entering,
            )
            transmitted = Ray(
                at.p_t,
                at.wt,
                mul(weight, at.transmitted),
                ray.segments + at.crossed,
                at.beyond,
                hit,
                face,
                entering,
            )
            reflects, lost_r = _worth(reflected, limits)
            transmits, lost_t = _worth(transmitted, limits)
            cut += lost_r + lost_t
            if transmits and reflects:
                _lay_aside(waiting, height, reflected)
                height += 1
            if transmits:
                ray = transmitted
                continue
            if reflects:
                ray = reflected
                continue
        if height == 0:
            return seen, cut, closest
        height -= 1
        ray = _take_up(waiting, height)


@compiled
def _render_rows(
    scene: Arrays,
    limits: Limits,
    lobes: Lobes,
    camera: Floats,
    begin: int,
    end: int,
    waiting: Waiting,
    stack: Floats,
    pixels: Floats,
    cut: Floats,
    closest: Floats,
) -> None:
    height, width = cut.shape
    for j in range(begin, end):
        for i in range(width):
            x, y = pixel_centre(i, j, width, height)
            o, d = primary_ray(camera, x, y)
            seen, lost, near = radiance(scene, limits, lobes, o, d, waiting, stack)
            for k in range(3):
                pixels[j, i, k] = seen[k]
            cut[j, i] = lost
            closest[j, i] = near


def render(scene: Scene, width: int, height: int, threads: int | None = None) -> Render:
    """The image that the scene's camera sees through its pixels' centres.

    Raises SceneError for a scene that cannot be traced. The same bits for any number of threads.
    """
    arrays = flatten(scene)
    transport = scene.transport
    limits = Limits(transport.max_depth, transport.min_weight)
    lobes = Lobes(transport.reflection, transport.transmission, transport.radiance_n2)
    camera = camera_row(scene.camera, width, height)
    film = (height, width)
    image = Render(np.empty((*film, 3)), np.empty(film), np.empty(film))

    def rows(begin: int, end: int) -> None:
        depth = transport.max_depth + 1
        waiting = Waiting(np.empty((depth, 9)), np.empty((depth, 5), np.int64))
        _render_rows(
            arrays,
            limits,
            lobes,
            camera,
            begin,
            end,
            waiting,
            new_stack(arrays),
            image.pixels,
            image.cut,
            image.closest,
        )

    for_bands(rows, height, BAND, threads)
    return image
