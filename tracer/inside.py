"""Rays inside balls that nothing else comes near, from where they enter until they have left.

Such a ray meets nothing but its sphere. By symmetry it stays in one plane, and always comes at the
same angle: Snell and Fresnel are asked once for all of its reflections, each way to the next is as
long as the first, and all that is done at each is to turn a point and a direction. What leaves the
ball there joins the rays of an ordinary wave.
"""

from __future__ import annotations

from tracer.arrays import AMBIENT, FIRST, Arrays
from tracer.compiled import called, inlined
from tracer.exposure import Exposure, Limits, keep, note_gap, strength_of, wave_at, worth
from tracer.light import absorbed
from tracer.optics import cos_transmitted, fresnel_unpolarised
from tracer.shapes import vec_at
from tracer.surface import Lobes
from tracer.vector import Vec, along, dot, mul, scale
from tracer.wave import (
    DIRECTION,
    FLOATS,
    HIT,
    IN,
    LEFT,
    ORIGIN,
    PIXEL,
    SEGMENTS,
    SIZE,
    STRIDE,
    WEIGHT,
    Ray,
    T,
    Wave,
    put_ray,
    put_vec,
    ray_at,
    vec_of,
)

# Columns of what such a ray carries besides direction and weight.
NORMAL = ORIGIN  # where it is, seen from the centre of its ball
COS_I, IOR_I, IOR_T, BEND, RADIUS = (T + k * STRIDE for k in range(5))
CENTER, STAYS, LEAVES = (T + k * STRIDE for k in (5, 8, 11))
FATE = HIT  # whether what stays and what leaves is to be followed
BOTH = 3


@inlined
def put_inside(scene: Arrays, exposure: Exposure, wave: Wave, i: int, n: Vec, ray: Ray) -> None:
    """Where a `ray` has entered a ball; `n` is the normal there."""
    floats, ints, media = wave.floats, wave.ints, scene.media
    row = scene.objects[ray.left, FIRST]
    center, radius = vec_at(scene.rows, row, 0), scene.rows[row, 3]
    cos_theta_i = -dot(n, ray.d)
    chord = 2.0 * cos_theta_i * radius
    kept = absorbed(media, ray.medium, chord)
    note_gap(exposure.samples, ray.pixel, chord, strength_of(mul(kept, ray.weight)))
    put_vec(floats, NORMAL, i, n)
    put_vec(floats, DIRECTION, i, ray.d)
    put_vec(floats, WEIGHT, i, ray.weight)
    put_vec(floats, CENTER, i, center)
    put_vec(floats, STAYS, i, kept)
    floats[COS_I + i], floats[RADIUS + i] = cos_theta_i, radius
    floats[IOR_I + i], floats[IOR_T + i] = media[ray.medium, 0], media[AMBIENT, 0]
    ints[PIXEL + i], ints[SEGMENTS + i], ints[LEFT + i] = ray.pixel, ray.segments, ray.left


@called
def refract_inside(lobes: Lobes, wave: Wave, n: int) -> None:
    """Snell and Fresnel for rays that have entered: what part stays at each reflection, what leaves
    and how it is bent. Where light gets in it also gets out, for the way back is the same.
    """
    floats = wave.floats
    for i in range(min(n, SIZE)):
        cos_theta_i, ior_i, ior_t = floats[COS_I + i], floats[IOR_I + i], floats[IOR_T + i]
        mu = ior_i / ior_t
        transmits, cos_theta_t = cos_transmitted(cos_theta_i, ior_i, ior_t)
        R = fresnel_unpolarised(cos_theta_i, cos_theta_t, ior_i, ior_t) if transmits else 1.0
        passed = (1.0 - R) * (mu * mu if lobes.radiance_n2 else 1.0)
        floats[BEND + i] = cos_theta_t - mu * cos_theta_i  # see `optics.transmitted`
        kept = vec_of(floats, STAYS, i)
        put_vec(floats, LEAVES, i, scale(passed if lobes.transmission else 0.0, kept))
        put_vec(floats, STAYS, i, scale(R if lobes.reflection or not transmits else 0.0, kept))
        floats[BEND + i] = cos_theta_t - mu * cos_theta_i


@called
def bounce(exposure: Exposure, height: int) -> tuple[int, int]:
    """Follows the rays inside that are above a stack of `height`, from reflection to reflection, as
    long as those that leave fit into a wave; (how high the stack is then, how many were followed).
    """
    waiting = exposure.waiting
    own, other = waiting.order[height], waiting.order[height + 1]
    wave, outside = wave_at(waiting, own), wave_at(waiting, other)
    n, left, rays = waiting.filled[own], 0, 0
    while 0 < n <= SIZE - left:
        rays += n
        _reflect(exposure.limits, wave, Wave(outside.floats[left:], outside.ints[left:]), n)
        n, left = _part(exposure, wave, outside, n, left)
    up = keep(waiting, height, height, n, True)
    return keep(waiting, up, height + 1, left, False), rays


@called
def _reflect(limits: Limits, wave: Wave, outside: Wave, n: int) -> None:
    """On to the next reflection of each ray, and out of the ball what leaves there."""
    floats, ints = wave.floats, wave.ints
    for i in range(min(n, SIZE)):
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
        ints[FATE + i] = worth(limits, strength_of(leaves), segments) + 2 * worth(
            limits, strength_of(stays), segments
        )


@called
def _part(exposure: Exposure, wave: Wave, outside: Wave, n: int, left: int) -> tuple[int, int]:
    """Cuts what is not worth to be followed; (how many stay inside, how many have left in all).

    The last takes the place of one that is cut.
    """
    samples, share, stay, leave = exposure.samples, exposure.share, n, left + n
    for q in range(n):
        i = (n - 1 - q) & IN
        fate = wave.ints[FATE + i]
        if fate != BOTH:
            pixel, at = wave.ints[PIXEL + i], (left + i) & IN
            if fate & 1 == 0:
                samples.cut[pixel] += share * strength_of(vec_of(outside.floats, WEIGHT, at))
                leave -= 1
                put_ray(outside, at, ray_at(outside, leave & IN))
            if fate & 2 == 0:
                samples.cut[pixel] += share * strength_of(vec_of(wave.floats, WEIGHT, i))
                stay -= 1
                for column in range(0, FLOATS, STRIDE):
                    wave.floats[column + i] = wave.floats[column + stay]
                for column in (PIXEL, SEGMENTS, LEFT):
                    wave.ints[column + i] = wave.ints[column + stay]
    return stay, leave
