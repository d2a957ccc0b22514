"""Double recursion: at every dielectric a ray becomes two.

The recursion is unrolled onto an explicit stack of rays that wait, of which a wave is followed at a
time. It is cut where a ray would have more than `max_depth` segments or carry less than
`min_weight`. What is cut is added up: what is seen and what is cut together bound what a recursion
without end would show.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracer.arrays import DIELECTRIC, EMISSIVE, MATERIAL, MEDIUM, NORMALS, Arrays, Floats
from tracer.compiled import called, inlined, merged
from tracer.hit import NOTHING, Hit, hit_point, new_stack
from tracer.light import absorbed, surroundings
from tracer.shapes import INF
from tracer.surface import Lobes, emitted, interface, scatter, upright
from tracer.vector import Vec, along, mul, scale
from tracer.wave import (
    FLOATS,
    HIT,
    IN,
    INTS,
    SIZE,
    STRIDE,
    WEIGHT,
    Ints,
    Ray,
    Scratch,
    Wave,
    hit_at,
    put_ray,
    put_vec,
    ray_at,
    side_of,
    vec_of,
)

TELLING = 1e-4  # a weight whose loss would show in a picture


class Limits(NamedTuple):
    max_depth: int
    min_weight: float


class Samples(NamedTuple):
    """Samples of some rows of the film, one after the other.

    `cut` is the weight that was not followed. `closest` is the shortest way between two surfaces
    that light of at least `TELLING` took. `disperses` says that the wavelength matters.
    """

    radiance: Floats  # (n, 3)
    cut: Floats  # (n,)
    closest: Floats
    disperses: NDArray[np.uint8]


class Waiting(NamedTuple):
    """Waves of rays that wait to be followed, the last first.

    The k-th from the bottom is in row ``order[k]`` of the tables, with `filled` rays. A wave is
    followed by two at most, of rays with a segment more: so no more wait than `max_depth`.
    """

    floats: Floats  # (waves, FLOATS)
    ints: Ints  # (waves, INTS)
    order: Ints  # (waves,)
    filled: Ints  # (waves,)


class Exposure(NamedTuple):
    """What the waves of one thread have in common. A ray counts `share` in its sample."""

    limits: Limits
    lobes: Lobes
    share: float
    samples: Samples
    waiting: Waiting
    scratch: Scratch


# Columns of Scratch.glass, for the rays that meet glass: those of vectors, and others.
POINT, NORMAL, OUT, REFLECTED, TRANSMITTED = (3 * k * STRIDE for k in range(5))
IOR_I, IOR_T, R, PASSED = (k * STRIDE for k in range(15, 19))
GLASS = 19 * STRIDE


def exposure(
    scene: Arrays, limits: Limits, lobes: Lobes, share: float, samples: Samples
) -> Exposure:
    """With tables of its own for a thread."""
    waves = limits.max_depth + 2
    floats, ints = np.empty((waves, FLOATS)), np.empty((waves, INTS), np.int64)
    waiting = Waiting(floats, ints, np.arange(waves), np.empty(waves, np.int64))
    scratch = Scratch(np.empty(4 * SIZE, np.int64), np.empty(GLASS), new_stack(scene))
    return Exposure(limits, lobes, share, samples, waiting, scratch)


@merged
def go_on(scene: Arrays, exposure: Exposure, height: int) -> int:
    """Adds what the rays of a wave see to their samples, and lays the rays aside that go on.

    The wave is the one above a stack of `height`; how high that is then.
    """
    waiting = exposure.waiting
    order, filled = waiting.order, waiting.filled
    own, first, second = order[height], order[height + 1], order[height + 2]
    wave, n = Wave(waiting.floats[own], waiting.ints[own]), filled[own]
    nothing, lamps, glass, rest = _sort_out(scene, wave, n, exposure.scratch.queues)
    _absorb(scene, wave, n)
    _see(scene, exposure, wave, nothing, lamps)
    _reach_glass(scene, exposure, wave, glass)
    _refract(exposure.lobes, exposure.scratch.glass, glass)
    count = _split(exposure, wave, glass, first, second)
    count = _scatter(scene, exposure, wave, rest, first, second, count)
    filled[first], filled[second] = min(count, SIZE), count - SIZE
    waves = (count + SIZE - 1) // SIZE
    order[height], order[height + 1], order[height + 2] = first, second, own
    if waves < 2:
        order[height + waves], order[height + 2] = own, second
    if waves == 0:
        order[height + 1] = first
    return height + waves


@called
def _sort_out(scene: Arrays, wave: Wave, n: int, queues: Ints) -> tuple[int, int, int, int]:
    """Queues of rays that meet nothing, lamps, glass, and the rest; how many are in each.

    What is done next is then the same for many rays in turn. No branch here depends on a ray.
    """
    nothing = lamps = glass = rest = 0
    for i in range(min(n, SIZE)):
        hit, _ = side_of(wave.ints[HIT + i])
        material, missed = scene.objects[max(hit, 0), MATERIAL], hit == NOTHING
        queues[nothing], queues[SIZE + lamps] = i, i
        queues[2 * SIZE + glass], queues[3 * SIZE + rest] = i, i
        nothing += missed
        lamps += (not missed) & (material == EMISSIVE)
        glass += (not missed) & (material == DIELECTRIC)
        rest = i + 1 - nothing - lamps - glass
    return nothing, lamps, glass, rest


@called
def _absorb(scene: Arrays, wave: Wave, n: int) -> None:
    """Takes from the rays' weights what is lost on the way to what they meet."""
    absorbs = False
    for row in scene.media:
        absorbs |= row[1] + row[2] + row[3] > 0.0
    if absorbs:
        for i in range(min(n, SIZE)):
            ray, hit = ray_at(wave, i), hit_at(wave, i)
            left = absorbed(scene.media, hit.medium, hit.t)
            put_vec(wave.floats, WEIGHT, i, mul(ray.weight, left))


@called
def _see(scene: Arrays, exposure: Exposure, wave: Wave, nothing: int, lamps: int) -> None:
    """The ways that end, in the surroundings or on a lamp."""
    queues = exposure.scratch.queues
    for q in range(nothing):
        ray = ray_at(wave, queues[q] & IN)
        _add(exposure, ray.pixel, mul(ray.weight, surroundings(scene, ray.d)))
    for q in range(lamps):
        i = queues[SIZE + q] & IN
        ray, hit = ray_at(wave, i), hit_at(wave, i)
        shown = emitted(scene, hit.object, along(ray.o, hit.t, ray.d))
        _add(exposure, ray.pixel, mul(ray.weight, shown))
        _note_gap(exposure, ray, hit.t)


@inlined
def _strength(weight: Vec) -> float:
    return max(weight[0], weight[1], weight[2])


@inlined
def _add(exposure: Exposure, pixel: int, radiance: Vec) -> None:
    for c in range(3):
        exposure.samples.radiance[pixel, c] += exposure.share * radiance[c]


@inlined
def _note_gap(exposure: Exposure, ray: Ray, t: float) -> None:
    """Of the way `t` to what a ray meets."""
    closest, pixel = exposure.samples.closest, ray.pixel
    tells = (ray.segments > 1) & (_strength(ray.weight) >= TELLING)
    closest[pixel] = min(closest[pixel], t if tells else INF)


@inlined
def _note_dispersion(scene: Arrays, exposure: Exposure, pixel: int, one: int, other: int) -> None:
    if scene.media[one, 4] + scene.media[other, 4] > 0.0:
        exposure.samples.disperses[pixel] = 1


# --- glass ----------------------------------------------------------------------------------------


@called
def _reach_glass(scene: Arrays, exposure: Exposure, wave: Wave, count: int) -> None:
    """Where rays meet glass, and what it is like there."""
    scratch, glass = exposure.scratch, exposure.scratch.glass
    for q in range(min(count, SIZE)):
        i = scratch.queues[2 * SIZE + q] & IN
        ray, hit = ray_at(wave, i), hit_at(wave, i)
        p, n, geometric = hit_point(scene, ray.o, hit.t, ray.d, hit.object, hit.face, hit.entering)
        wi = scale(-1.0, ray.d)
        ior_i, ior_t = scene.media[hit.medium, 0], scene.media[hit.beyond, 0]
        if scene.objects[hit.object, NORMALS] >= 0:
            n = upright(wi, n, geometric, ior_i, ior_t)
        put_vec(glass, POINT, q, p)
        put_vec(glass, NORMAL, q, n)
        put_vec(glass, OUT, q, wi)
        glass[IOR_I + q], glass[IOR_T + q] = ior_i, ior_t
        _note_dispersion(scene, exposure, ray.pixel, hit.medium, hit.beyond)


@called
def _refract(lobes: Lobes, glass: Floats, count: int) -> None:
    """Snell and Fresnel: where to rays go on from glass, and with what part of their weight."""
    for q in range(min(count, SIZE)):
        ior_i, ior_t = glass[IOR_I + q], glass[IOR_T + q]
        wi, n = vec_of(glass, OUT, q), vec_of(glass, NORMAL, q)
        transmits, reflectance, wr, wt = interface(wi, n, ior_i, ior_t)
        mu = ior_i / ior_t
        passed = (1.0 - reflectance) * (mu * mu if lobes.radiance_n2 else 1.0)
        glass[R + q] = reflectance if lobes.reflection or not transmits else 0.0
        glass[PASSED + q] = passed if lobes.transmission and transmits else 0.0
        put_vec(glass, REFLECTED, q, wr)
        put_vec(glass, TRANSMITTED, q, wt)


@called
def _split(exposure: Exposure, wave: Wave, count: int, first: int, second: int) -> int:
    """Lays two rays aside for each that meets glass, where they are worth it; how many."""
    scratch, glass, at = exposure.scratch, exposure.scratch.glass, 0
    for q in range(min(count, SIZE)):
        i = scratch.queues[2 * SIZE + q] & IN
        ray, hit, p = ray_at(wave, i), hit_at(wave, i), vec_of(glass, POINT, q)
        _note_gap(exposure, ray, hit.t)
        wr, reflected = vec_of(glass, REFLECTED, q), scale(glass[R + q], ray.weight)
        at = _lay_aside(exposure, first, second, at, _onward(ray, hit, p, wr, reflected, 1, False))
        wt, passed = vec_of(glass, TRANSMITTED, q), scale(glass[PASSED + q], ray.weight)
        at = _lay_aside(exposure, first, second, at, _onward(ray, hit, p, wt, passed, 1, True))
    return at


@inlined
def _onward(ray: Ray, hit: Hit, p: Vec, d: Vec, weight: Vec, crossed: int, transmits: bool) -> Ray:
    """What a ray becomes where it has met `crossed` interfaces."""
    segments, medium = ray.segments + crossed, hit.beyond if transmits else hit.medium
    inward = hit.entering == transmits
    return Ray(p, d, weight, ray.pixel, segments, medium, hit.object, hit.face, inward)


@inlined
def _lay_aside(exposure: Exposure, first: int, second: int, at: int, ray: Ray) -> int:
    """As the `at`-th of the two waves in rows `first` and `second`; how many there are then.

    No branch here depends on a ray: one that is not worth it is cut, the next takes its place.
    """
    waiting, limits = exposure.waiting, exposure.limits
    row, strength = first if at < SIZE else second, _strength(ray.weight)
    put_ray(Wave(waiting.floats[row], waiting.ints[row]), at & IN, ray)
    worth = (strength > 0.0) & (strength >= limits.min_weight) & (ray.segments <= limits.max_depth)
    exposure.samples.cut[ray.pixel] += 0.0 if worth else exposure.share * strength
    return at + worth


# --- other surfaces -------------------------------------------------------------------------------


@merged
def _scatter(
    scene: Arrays, exposure: Exposure, wave: Wave, count: int, first: int, second: int, at: int
) -> int:
    """As `_split`, behind `at` rays, for those that meet neither a lamp nor glass."""
    stack = exposure.scratch.stack
    for q in range(count):
        i = exposure.scratch.queues[3 * SIZE + q] & IN
        ray, hit = ray_at(wave, i), hit_at(wave, i)
        k, medium = hit.object, hit.medium
        _note_gap(exposure, ray, hit.t)
        _note_dispersion(scene, exposure, ray.pixel, medium, scene.objects[k, MEDIUM])
        lobes = scatter(
            scene, exposure.lobes, ray.o, hit.t, ray.d, medium, k, hit.face, hit.entering, stack
        )
        _add(exposure, ray.pixel, mul(ray.weight, lobes.sent))
        reflected, passed = mul(ray.weight, lobes.reflected), mul(ray.weight, lobes.transmitted)
        back = _onward(ray, hit, lobes.p, lobes.wr, reflected, 1, False)
        at = _lay_aside(exposure, first, second, at, back)
        through = _onward(ray, hit, lobes.p_t, lobes.wt, passed, lobes.crossed, True)
        at = _lay_aside(exposure, first, second, at, through)
    return at
