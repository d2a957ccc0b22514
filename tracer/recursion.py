"""Double recursion: at every dielectric a ray becomes two.

The recursion is unrolled onto an explicit stack of rays that wait, of which a wave is followed at a
time. It is cut where a ray would have more than `max_depth` segments or carry less than
`min_weight`. What is cut is added up: what is seen and what is cut together bound what a recursion
without end would show.
"""

from __future__ import annotations

from typing import NamedTuple

from tracer.apart import BALL, CROWD, FLAT
from tracer.arrays import ALONE, DIELECTRIC, EMISSIVE, MATERIAL, MEDIUM, NORMALS, Arrays, Floats
from tracer.compiled import called, inlined, merged
from tracer.exposure import (
    IOR_I,
    IOR_T,
    NORMAL,
    OUT,
    PASSED,
    POINT,
    REFLECTED,
    TRANSMITTED,
    Exposure,
    R,
    keep,
    note_gap,
    strength_of,
    wave_at,
    worth,
)
from tracer.hit import NOTHING, Hit, hit_point
from tracer.inside import put_in_ball, put_in_cell, refract_in_balls
from tracer.light import absorbed, is_dark, surroundings
from tracer.shapes import INF
from tracer.surface import Lobes, emitted, refracted, scatter, upright
from tracer.vector import Vec, mul, scale
from tracer.wave import (
    HIT,
    IN,
    PLACE_X,
    PLACE_Y,
    SIZE,
    WEIGHT,
    Ints,
    Ray,
    Wave,
    hit_at,
    padded,
    put_ray,
    put_vec,
    ray_at,
    side_of,
    vec_of,
)

# Queues of rays that meet the same: of DIELECTRIC and EMISSIVE, of other materials, of nothing.
REST, NONE = 2, 3


class Rows(NamedTuple):
    """Where rays are laid aside: those in balls, in flat cells, and all others."""

    ball: int
    flat: int
    first: int
    second: int


class Aside(NamedTuple):
    """How many are."""

    ball: int
    flat: int
    crowd: int


@merged
def go_on(scene: Arrays, exposure: Exposure, height: int) -> int:
    """Adds what the rays of a wave see to their samples, and lays the rays aside that go on.

    The wave is the one above a stack of `height`; how high that is then.
    """
    waiting = exposure.waiting
    places = waiting.order[height:]
    own, rows = places[0], Rows(places[1], places[2], places[3], places[4])
    wave, n = wave_at(waiting, own), waiting.filled[own]
    nothing, lamps, glass, rest = _sort_out(scene, wave, n, exposure.scratch.queues)
    _absorb(scene, wave, n)
    _see(scene, exposure, wave, nothing, lamps)
    _reach_glass(scene, exposure, wave, glass)
    _refract(exposure.lobes, exposure.scratch.glass, glass)
    aside = _split(scene, exposure, wave, glass, rows)
    crowd = _scatter(scene, exposure, wave, rest, rows, aside.crowd)
    refract_in_balls(exposure.lobes, wave_at(waiting, rows.ball), aside.ball)
    up = keep(waiting, height, height + 1, aside.ball, BALL)
    up = keep(waiting, up, height + 2, aside.flat, FLAT)
    up = keep(waiting, up, height + 3, min(crowd, SIZE), CROWD)
    return keep(waiting, up, height + 4, crowd - SIZE, CROWD)


@called
def _sort_out(scene: Arrays, wave: Wave, n: int, queues: Ints) -> tuple[int, int, int, int]:
    """Queues of rays that meet nothing, lamps, glass, and the rest; how many are in each.

    What is done next is then the same for many rays in turn. No branch here depends on a ray.
    """
    filled = queues[4 * SIZE :]
    filled[:4] = 0
    for i in range(min(n, SIZE)):
        hit, _ = side_of(wave.ints[HIT + i])
        which = min(scene.objects[max(hit, 0), MATERIAL], REST) if hit != NOTHING else NONE
        at = filled[which & 3]
        queues[(which * SIZE + at) & (4 * SIZE - 1)] = i
        filled[which & 3] = at + 1
    return filled[NONE], filled[EMISSIVE], filled[DIELECTRIC], filled[REST]


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
    for q in range(0 if is_dark(scene) else nothing):
        ray = ray_at(wave, queues[NONE * SIZE + q] & IN)
        _add(exposure, ray.pixel, mul(ray.weight, surroundings(scene, ray.d)))
    for q in range(lamps):
        i = queues[EMISSIVE * SIZE + q] & IN
        ray, hit = ray_at(wave, i), hit_at(wave, i)
        shown = emitted(scene, hit.object, wave.floats[PLACE_X + i], wave.floats[PLACE_Y + i])
        _add(exposure, ray.pixel, mul(ray.weight, shown))
        _note_gap(exposure, ray, hit.t)


@inlined
def _add(exposure: Exposure, pixel: int, radiance: Vec) -> None:
    for c in range(3):
        exposure.samples.radiance[pixel, c] += exposure.share * radiance[c]


@inlined
def _note_gap(exposure: Exposure, ray: Ray, t: float) -> None:
    """Of the way `t` to what a ray meets; that from the camera is none between two surfaces."""
    way = t if ray.segments > 1 else INF
    note_gap(exposure.samples.closest, ray.pixel, way, strength_of(ray.weight))


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
        i = scratch.queues[DIELECTRIC * SIZE + q] & IN
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
    for q in range(padded(count)):
        ior_i, ior_t = glass[IOR_I + q], glass[IOR_T + q]
        wi, n = vec_of(glass, OUT, q), vec_of(glass, NORMAL, q)
        glass[R + q], glass[PASSED + q], wr, wt = refracted(lobes, wi, n, ior_i, ior_t)
        put_vec(glass, REFLECTED, q, wr)
        put_vec(glass, TRANSMITTED, q, wt)


@called
def _split(scene: Arrays, exposure: Exposure, wave: Wave, count: int, rows: Rows) -> Aside:
    """Lays two rays aside for each that meets glass, where they are worth it."""
    scratch, glass, aside = exposure.scratch, exposure.scratch.glass, Aside(0, 0, 0)
    for q in range(min(count, SIZE)):
        i = scratch.queues[DIELECTRIC * SIZE + q] & IN
        ray, hit, p = ray_at(wave, i), hit_at(wave, i), vec_of(glass, POINT, q)
        _note_gap(exposure, ray, hit.t)
        wr, reflected = vec_of(glass, REFLECTED, q), scale(glass[R + q], ray.weight)
        back = _onward(ray, hit, p, wr, reflected, 1, False)
        at = _lay_aside(exposure, rows, aside.crowd, back)
        wt, passed = vec_of(glass, TRANSMITTED, q), scale(glass[PASSED + q], ray.weight)
        through = _onward(ray, hit, p, wt, passed, 1, True)
        kind = scene.objects[hit.object, ALONE] if hit.entering else CROWD
        if kind == CROWD:
            at = _lay_aside(exposure, rows, at, through)
        aside = Aside(aside.ball, aside.flat, at)
        if kind != CROWD and _is_worth(exposure, through):
            aside = _lay_inside(scene, exposure, rows, aside, vec_of(glass, NORMAL, q), through)
    return aside


@merged
def _lay_inside(
    scene: Arrays, exposure: Exposure, rows: Rows, aside: Aside, n: Vec, ray: Ray
) -> Aside:
    """With a ray that has entered a solid which is alone."""
    if scene.objects[ray.left, ALONE] == BALL:
        wave = wave_at(exposure.waiting, rows.ball)
        put_in_ball(scene, exposure, wave, aside.ball & IN, n, ray)
        return Aside(aside.ball + 1, aside.flat, aside.crowd)
    put_in_cell(scene, wave_at(exposure.waiting, rows.flat), aside.flat & IN, ray)
    return Aside(aside.ball, aside.flat + 1, aside.crowd)


@inlined
def _onward(ray: Ray, hit: Hit, p: Vec, d: Vec, weight: Vec, crossed: int, transmits: bool) -> Ray:
    """What a ray becomes where it has met `crossed` interfaces."""
    segments, medium = ray.segments + crossed, hit.beyond if transmits else hit.medium
    inward = hit.entering == transmits
    return Ray(p, d, weight, ray.pixel, segments, medium, hit.object, hit.face, inward)


@inlined
def _lay_aside(exposure: Exposure, rows: Rows, at: int, ray: Ray) -> int:
    """As the `at`-th of those that are in no solid by themselves; how many there are then.

    No branch here depends on a ray: one that is not worth it is cut, the next takes its place.
    """
    row = rows.first if at < SIZE else rows.second
    put_ray(wave_at(exposure.waiting, row), at & IN, ray)
    return at + _is_worth(exposure, ray)


@inlined
def _is_worth(exposure: Exposure, ray: Ray) -> bool:
    """Whether a ray is to be followed; it is cut if not."""
    strength = strength_of(ray.weight)
    followed = worth(exposure.limits, strength, ray.segments)
    exposure.samples.cut[ray.pixel] += 0.0 if followed else exposure.share * strength
    return followed


# --- other surfaces -------------------------------------------------------------------------------


@merged
def _scatter(scene: Arrays, exposure: Exposure, wave: Wave, count: int, rows: Rows, at: int) -> int:
    """As `_split`, behind `at` rays, for those that meet neither a lamp nor glass."""
    stack = exposure.scratch.stack
    for q in range(count):
        i = exposure.scratch.queues[REST * SIZE + q] & IN
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
        at = _lay_aside(exposure, rows, at, back)
        through = _onward(ray, hit, lobes.p_t, lobes.wt, passed, lobes.crossed, True)
        at = _lay_aside(exposure, rows, at, through)
    return at
