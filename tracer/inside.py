"""Rays inside solids that are alone, from where they enter until they have left.

Such a ray meets nothing but its solid. In a ball it stays in one plane by symmetry, and always
comes at the same angle: Snell and Fresnel are asked once for all of its reflections, each way to
the next is as long as the first, and all that is done at each is to turn a point and a direction.
In a cell between planes it meets the first that is ahead. What leaves the solid joins the rays of
an ordinary wave.
"""

from __future__ import annotations

from tracer.apart import BALL, CROWD, FLAT
from tracer.arrays import ALONE, AMBIENT, COUNT, FIRST, Arrays, Floats
from tracer.compiled import called, inlined, merged
from tracer.exposure import Exposure, Limits, keep, note_gap, strength_of, wave_at, worth
from tracer.light import absorbed
from tracer.optics import cos_transmitted, fresnel_unpolarised
from tracer.shapes import INF, plane_stretch, vec_at
from tracer.surface import Lobes, refracted
from tracer.vector import Vec, along, chosen, dot, mul, scale
from tracer.wave import (
    DIRECTION,
    FACE,
    FLOATS,
    HIT,
    IN,
    LEFT,
    LEFT_FACE,
    MEDIUM,
    ORIGIN,
    PIXEL,
    SEGMENTS,
    SIZE,
    STRIDE,
    WEIGHT,
    Ints,
    Ray,
    T,
    Wave,
    padded,
    put_ray,
    put_vec,
    ray_at,
    vec_of,
)

# Columns of what such a ray carries besides direction and weight.
COS_I, IOR_I, IOR_T, BEND, RADIUS = (T + k * STRIDE for k in range(5))
CENTER, STAYS, LEAVES = (T + k * STRIDE for k in (5, 8, 11))
NORMAL = ORIGIN  # in a ball, where it is as seen from the centre
AHEAD = STAYS  # in a cell, the normal of the plane that it meets
FATE = HIT  # whether what stays and what leaves is to be followed
BOTH = 3


# --- in balls -------------------------------------------------------------------------------------


@merged
def put_in_ball(scene: Arrays, exposure: Exposure, wave: Wave, i: int, n: Vec, ray: Ray) -> None:
    """Where a `ray` has entered a ball; `n` is the normal there."""
    floats, ints, media = wave.floats, wave.ints, scene.media
    row = scene.objects[ray.left, FIRST]
    center, radius = vec_at(scene.rows, row, 0), scene.rows[row, 3]
    cos_theta_i = -dot(n, ray.d)
    chord = 2.0 * cos_theta_i * radius
    kept = absorbed(media, ray.medium, chord)
    note_gap(exposure.samples.closest, ray.pixel, chord, strength_of(mul(kept, ray.weight)))
    put_vec(floats, NORMAL, i, n)
    put_vec(floats, DIRECTION, i, ray.d)
    put_vec(floats, WEIGHT, i, ray.weight)
    put_vec(floats, CENTER, i, center)
    put_vec(floats, STAYS, i, kept)
    floats[COS_I + i], floats[RADIUS + i] = cos_theta_i, radius
    floats[IOR_I + i], floats[IOR_T + i] = media[ray.medium, 0], media[AMBIENT, 0]
    ints[PIXEL + i], ints[SEGMENTS + i], ints[LEFT + i] = ray.pixel, ray.segments, ray.left


@called
def refract_in_balls(lobes: Lobes, wave: Wave, n: int) -> None:
    """Snell and Fresnel for rays that have entered: what part stays at each reflection, what leaves
    and how it is bent. Where light gets in it also gets out, for the way back is the same.
    """
    floats = wave.floats
    for i in range(padded(n)):
        cos_theta_i, ior_i, ior_t = floats[COS_I + i], floats[IOR_I + i], floats[IOR_T + i]
        mu = ior_i / ior_t
        transmits, cos_theta_t = cos_transmitted(cos_theta_i, ior_i, ior_t)
        R = fresnel_unpolarised(cos_theta_i, cos_theta_t, ior_i, ior_t) if transmits else 1.0
        passed = (1.0 - R) * (mu * mu if lobes.radiance_n2 else 1.0)
        floats[BEND + i] = cos_theta_t - mu * cos_theta_i  # see `optics.transmitted`
        kept = vec_of(floats, STAYS, i)
        put_vec(floats, LEAVES, i, scale(passed if lobes.transmission else 0.0, kept))
        put_vec(floats, STAYS, i, scale(R if lobes.reflection or not transmits else 0.0, kept))


@called
def _reflect_in_balls(limits: Limits, wave: Wave, outside: Wave, n: int) -> None:
    """On to the next reflection of each ray, and out of the ball what leaves there."""
    floats, ints = wave.floats, wave.ints
    for i in range(padded(n)):
        d, weight = vec_of(floats, DIRECTION, i), vec_of(floats, WEIGHT, i)
        pixel, k, segments = ints[PIXEL + i], ints[LEFT + i], ints[SEGMENTS + i] + 1
        cos_theta_i, mu = floats[COS_I + i], floats[IOR_I + i] / floats[IOR_T + i]
        across = along(vec_of(floats, NORMAL, i), 2.0 * cos_theta_i, d)
        n_out = scale(1.5 - 0.5 * dot(across, across), across)  # back onto it (see sphere_normal)
        stays = mul(vec_of(floats, STAYS, i), weight)
        leaves = mul(vec_of(floats, LEAVES, i), weight)
        p = along(vec_of(floats, CENTER, i), floats[RADIUS + i], n_out)
        wt = along(scale(mu, d), floats[BEND + i], n_out)
        put_ray(outside, i, Ray(p, wt, leaves, pixel, segments, AMBIENT, k, 0, False))
        put_vec(floats, NORMAL, i, n_out)
        put_vec(floats, DIRECTION, i, along(d, -2.0 * cos_theta_i, n_out))
        put_vec(floats, WEIGHT, i, stays)
        ints[SEGMENTS + i] = segments
        ints[FATE + i] = _fate(limits, stays, leaves, segments)


# --- in cells between planes ----------------------------------------------------------------------


@merged
def put_in_cell(scene: Arrays, wave: Wave, i: int, ray: Ray) -> None:
    """Where a `ray` has entered one."""
    put_ray(wave, i, ray)
    wave.ints[LEFT + i] = ray.left
    wave.floats[IOR_I + i] = scene.media[ray.medium, 0]
    wave.floats[IOR_T + i] = scene.media[AMBIENT, 0]


@merged
def _cross_cells(
    objects: Ints, rows: Floats, media: Floats, closest: Floats, wave: Wave, n: int
) -> None:
    """How far it is for each ray to the plane that it meets, and what is left of it there.

    Of all that a scene has, only what is needed: each array is some ten arguments.
    """
    floats, ints = wave.floats, wave.ints
    for i in range(padded(n)):
        floats[T + i] = INF
    for k in range(len(objects)):
        count = 0
        if objects[k, ALONE] == FLAT:
            for i in range(min(n, SIZE)):
                count += ints[LEFT + i] == k
        if count > 0:
            for row in range(objects[k, FIRST], objects[k, FIRST] + objects[k, COUNT]):
                _meet_plane(wave, n, k, row, vec_at(rows, row, 2), rows[row, 5])
    for i in range(min(n, SIZE)):
        t, weight = max(floats[T + i], 0.0), vec_of(floats, WEIGHT, i)  # not behind it, by rounding
        weight = mul(weight, absorbed(media, ints[MEDIUM + i], t))
        note_gap(closest, ints[PIXEL + i], t, strength_of(weight))
        floats[T + i] = t
        put_vec(floats, WEIGHT, i, weight)


@merged
def _meet_plane(wave: Wave, n: int, k: int, row: int, normal: Vec, offset: float) -> None:
    """For the rays in solid `k`, but those that have met this plane last."""
    floats, ints = wave.floats, wave.ints
    for i in range(padded(n)):
        _, t = plane_stretch(
            vec_of(floats, ORIGIN, i), vec_of(floats, DIRECTION, i), normal, offset
        )
        first = (t < floats[T + i]) & (ints[LEFT + i] == k) & (ints[LEFT_FACE + i] != row)
        floats[T + i] = t if first else floats[T + i]
        put_vec(floats, AHEAD, i, chosen(first, normal, vec_of(floats, AHEAD, i)))
        ints[FACE + i] = row if first else ints[FACE + i]


@called
def _reflect_in_cells(limits: Limits, lobes: Lobes, wave: Wave, outside: Wave, n: int) -> None:
    """As `_reflect_in_balls`."""
    floats, ints = wave.floats, wave.ints
    for i in range(padded(n)):
        d, weight = vec_of(floats, DIRECTION, i), vec_of(floats, WEIGHT, i)
        pixel, k, segments = ints[PIXEL + i], ints[LEFT + i], ints[SEGMENTS + i] + 1
        face, ior_i, ior_t = ints[FACE + i], floats[IOR_I + i], floats[IOR_T + i]
        p = along(vec_of(floats, ORIGIN, i), floats[T + i], d)
        wi, facing = scale(-1.0, d), scale(-1.0, vec_of(floats, AHEAD, i))
        kept, passed, wr, wt = refracted(lobes, wi, facing, ior_i, ior_t)
        stays, leaves = scale(kept, weight), scale(passed, weight)
        put_ray(outside, i, Ray(p, wt, leaves, pixel, segments, AMBIENT, k, face, False))
        put_vec(floats, ORIGIN, i, p)
        put_vec(floats, DIRECTION, i, wr)
        put_vec(floats, WEIGHT, i, stays)
        ints[SEGMENTS + i], ints[LEFT_FACE + i] = segments, face
        ints[FATE + i] = _fate(limits, stays, leaves, segments)


# --- in both --------------------------------------------------------------------------------------


@called
def bounce(scene: Arrays, exposure: Exposure, height: int) -> tuple[int, int]:
    """Follows the rays inside that are above a stack of `height`, from reflection to reflection, as
    long as those that leave fit into a wave; (how high the stack is then, how many were followed).
    """
    waiting = exposure.waiting
    own, other = waiting.order[height], waiting.order[height + 1]
    wave, outside, kind = wave_at(waiting, own), wave_at(waiting, other), waiting.inside[own]
    n, left, rays = waiting.filled[own], 0, 0
    while 0 < n <= SIZE - left:
        rays += n
        leaving = Wave(outside.floats[left:], outside.ints[left:])
        if kind == BALL:
            _reflect_in_balls(exposure.limits, wave, leaving, n)
        else:
            _cross_cells(scene.objects, scene.rows, scene.media, exposure.samples.closest, wave, n)
            _reflect_in_cells(exposure.limits, exposure.lobes, wave, leaving, n)
        n, left = _part(exposure.samples.cut, exposure.share, wave, outside, n, left)
    up = keep(waiting, height, height, n, kind)
    return keep(waiting, up, height + 1, left, CROWD), rays


@inlined
def _fate(limits: Limits, stays: Vec, leaves: Vec, segments: int) -> int:
    """Which of the two are to be followed, of BOTH: 1 for what leaves, 2 for what stays."""
    return worth(limits, strength_of(leaves), segments) + 2 * worth(
        limits, strength_of(stays), segments
    )


@merged
def _part(
    cut: Floats, share: float, wave: Wave, outside: Wave, n: int, left: int
) -> tuple[int, int]:
    """Cuts what is not worth to be followed; (how many stay inside, how many have left in all).

    The last takes the place of one that is cut.
    """
    stay, leave = n, left + n
    for q in range(n):
        i = (n - 1 - q) & IN
        fate = wave.ints[FATE + i]
        if fate != BOTH:
            pixel, at = wave.ints[PIXEL + i], (left + i) & IN
            if fate & 1 == 0:
                cut[pixel] += share * strength_of(vec_of(outside.floats, WEIGHT, at))
                leave -= 1
                put_ray(outside, at, ray_at(outside, leave & IN))
            if fate & 2 == 0:
                cut[pixel] += share * strength_of(vec_of(wave.floats, WEIGHT, i))
                stay -= 1
                for column in range(0, FLOATS, STRIDE):
                    wave.floats[column + i] = wave.floats[column + stay]
                for column in (PIXEL, SEGMENTS, MEDIUM, LEFT, LEFT_FACE):
                    wave.ints[column + i] = wave.ints[column + stay]
    return stay, leave
