"""Double recursion: at every dielectric a ray becomes two.

The recursion is unrolled onto an explicit stack of rays that wait. It is cut where a ray would
have more than `max_depth` segments or carry less than `min_weight`. What is cut is added up: what
is seen and what is cut together bound what a recursion without end would show.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracer.arrays import EMISSIVE, MATERIAL, MEDIUM, Arrays, Floats
from tracer.compiled import inlined
from tracer.hit import NOTHING, UNKNOWN, nearest_hit
from tracer.light import absorbed, surroundings
from tracer.shapes import vec_at
from tracer.surface import BLACK, Lobes, emitted, scatter
from tracer.vector import Vec, add, along, mul

TELLING = 1e-4  # a weight whose loss would show in a picture


class Limits(NamedTuple):
    max_depth: int
    min_weight: float


class Seen(NamedTuple):
    """What a ray of the camera has seen.

    `cut` is the weight that was not followed. `closest` is the shortest way between two surfaces
    that light of at least `TELLING` took. `rays` were followed. `disperses` says that the
    wavelength matters.
    """

    radiance: Vec
    cut: float
    closest: float
    rays: int
    disperses: bool


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
) -> Seen:
    """What arrives at `o` against `d`."""
    seen, cut, closest, height = BLACK, 0.0, np.inf, 0
    rays, disperses = 0, False
    ray = Ray(o, d, (1.0, 1.0, 1.0), 1, UNKNOWN, NOTHING, -1, False)
    while True:
        hit, face, t, entering, medium, beyond = nearest_hit(
            scene, ray.o, ray.d, ray.medium, ray.left, ray.left_face, ray.inward, stack
        )
        rays += 1
        weight = mul(ray.weight, absorbed(scene.media, medium, t))
        if hit == NOTHING:
            seen = add(seen, mul(weight, surroundings(scene, ray.d)))
        else:
            if ray.segments > 1 and t < closest and max(weight[0], weight[1], weight[2]) >= TELLING:
                closest = t
        if hit != NOTHING and scene.objects[hit, MATERIAL] == EMISSIVE:
            shown = emitted(scene, hit, along(ray.o, t, ray.d))
            seen = add(seen, mul(weight, shown))
        elif hit != NOTHING:
            inside = scene.objects[hit, MEDIUM]  # of a thin slab
            for known in (medium, beyond, inside):
                disperses |= scene.media[known, 4] > 0.0
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
            return Seen(seen, cut, closest, rays, disperses)
        height -= 1
        ray = _take_up(waiting, height)
