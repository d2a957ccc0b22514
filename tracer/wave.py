"""Rays a wave at a time: what each of them meets next.

Most of what a processor could do lies idle while one ray waits for its own roots and quotients.
So rays that have nothing to do with each other stand side by side, a column for each of their
numbers, and every loop here is over the rays of a wave. It is the arithmetic of `tracer.hit`, to
the last bit; but where a loop neither calls nor looks anything up, LLVM makes it one of
instructions that work on several rays at once. For that, all columns lie in one table, at places
that are known when it is compiled, so that none can be taken to overlap another.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracer.arrays import AMBIENT, DISK, FIRST, RECTANGLE, SHAPE, SPHERE, Arrays, Floats
from tracer.compiled import called, inlined, merged
from tracer.faces import face_hit, open_face
from tracer.hit import (
    NOTHING,
    UNKNOWN,
    Hit,
    far_from_ball,
    nearest_hit,
    object_hit,
    ranked,
    sphere_hit,
    surface_left,
)
from tracer.shapes import INF, vec_at
from tracer.vector import Vec, along, dot, sub

Ints = NDArray[np.int64]

SIZE = 256  # rays of a wave: few enough for their columns to stay in a cache
STEP = 16  # rays that LLVM may treat at once, in one loop or another
STRIDE = SIZE + 24  # from column to column, so that they do not all start in the same part of it
IN = SIZE - 1  # ``i & IN`` is i, and tells the compiler that it is not negative

# Where columns begin: of what a ray carries, and of what it meets. Those of vectors are three.
ORIGIN, DIRECTION, WEIGHT = 0 * STRIDE, 3 * STRIDE, 6 * STRIDE
T, PLACE_X, PLACE_Y = (k * STRIDE for k in range(9, 12))  # where on a rectangle or disk
FLOATS = 23 * STRIDE  # from T on, `tracer.inside` has columns of its own
PIXEL, SEGMENTS, MEDIUM, LEFT, LEFT_FACE = (k * STRIDE for k in range(5))
HIT, FACE, BEFORE, BEYOND = (k * STRIDE for k in range(5, 9))
INTS = 9 * STRIDE


class Wave(NamedTuple):
    """Rays under way, and what they meet."""

    floats: Floats  # (FLOATS,)
    ints: Ints  # (INTS,)


class Ray(NamedTuple):
    """One of them: what it carries, and the face that it has left (see `nearest_hit`)."""

    o: Vec
    d: Vec
    weight: Vec
    pixel: int
    segments: int
    medium: int
    left: int
    left_face: int
    inward: bool


class Scratch(NamedTuple):
    """What is needed to treat one wave."""

    queues: Ints  # (4 SIZE + 4,): four queues, and how many are in each
    glass: Floats  # see `recursion`
    stack: Floats  # see `hit.new_stack`


@inlined
def padded(n: int) -> int:
    """With some of the empty places behind `n` rays, which do no harm: whole steps, as what is left
    over would be treated one by one.
    """
    return (min(n, SIZE) + STEP - 1) & -STEP


@inlined
def vec_of(floats: Floats, column: int, i: int) -> Vec:
    return floats[column + i], floats[column + STRIDE + i], floats[column + 2 * STRIDE + i]


@inlined
def put_vec(floats: Floats, column: int, i: int, v: Vec) -> None:
    floats[column + i], floats[column + STRIDE + i], floats[column + 2 * STRIDE + i] = v


# LEFT and HIT tell an object and a direction in one number: to the inside of it, or not.


@inlined
def sided(k: int, inward: bool) -> int:
    return 2 * k + inward


@inlined
def side_of(number: int) -> tuple[int, bool]:
    return number >> 1, number & 1 == 1


@inlined
def put_ray(wave: Wave, i: int, ray: Ray) -> None:
    floats, ints = wave.floats, wave.ints
    put_vec(floats, ORIGIN, i, ray.o)
    put_vec(floats, DIRECTION, i, ray.d)
    put_vec(floats, WEIGHT, i, ray.weight)
    ints[PIXEL + i], ints[SEGMENTS + i], ints[MEDIUM + i] = ray.pixel, ray.segments, ray.medium
    ints[LEFT + i], ints[LEFT_FACE + i] = sided(ray.left, ray.inward), ray.left_face


@inlined
def ray_at(wave: Wave, i: int) -> Ray:
    floats, ints = wave.floats, wave.ints
    left, inward = side_of(ints[LEFT + i])
    return Ray(
        vec_of(floats, ORIGIN, i),
        vec_of(floats, DIRECTION, i),
        vec_of(floats, WEIGHT, i),
        ints[PIXEL + i],
        ints[SEGMENTS + i],
        ints[MEDIUM + i],
        left,
        ints[LEFT_FACE + i],
        inward,
    )


@inlined
def hit_at(wave: Wave, i: int) -> Hit:
    ints = wave.ints
    hit, entering = side_of(ints[HIT + i])
    t, before, beyond = wave.floats[T + i], ints[BEFORE + i], ints[BEYOND + i]
    return Hit(hit, ints[FACE + i], t, entering, before, beyond)


@inlined
def _nearer(wave: Wave, i: int, k: int, t: float, entering: bool) -> None:
    """Takes note of a hit, where it is the nearest so far."""
    floats, ints = wave.floats, wave.ints
    nearer = t < floats[T + i]
    floats[T + i] = t if nearer else floats[T + i]
    ints[HIT + i] = sided(k, entering) if nearer else ints[HIT + i]


@inlined
def _rank(wave: Wave, i: int, k: int, t: float, entering: bool) -> None:
    """Takes note of the medium of solid `k`, before its hit is noted."""
    floats, ints = wave.floats, wave.ints
    before, beyond = ranked(ints[BEFORE + i], ints[BEYOND + i], floats[T + i], k, t, entering)
    ints[BEFORE + i], ints[BEYOND + i] = before, beyond


@merged
def nearest_hits(scene: Arrays, wave: Wave, n: int, fresh: bool, scratch: Scratch) -> None:
    """What the first `n` rays meet (see `tracer.hit.nearest_hit`), BEFORE and BEYOND what media.

    Where solids are apart from each other, a ray knows which it is in once it has met one. Only
    those that are `fresh` from the camera do not.
    """
    floats, ints = wave.floats, wave.ints
    rank = not scene.apart or (fresh and not _begin_outside(scene, wave, n))
    for i in range(padded(n)):
        floats[T + i], ints[HIT + i] = INF, sided(NOTHING, False)
        ints[FACE + i] = 0  # unless a hit tells another
        ints[BEFORE + i], ints[BEYOND + i] = AMBIENT, AMBIENT
    for k in range(len(scene.objects)):
        kind, ranks = scene.objects[k, SHAPE], rank and k < scene.solids
        if kind in (RECTANGLE, DISK):
            _faces(scene, wave, n, k, kind == DISK)
        elif kind == SPHERE and not ranks:
            _spheres(scene, wave, n, k)
        else:
            _one_by_one(scene, wave, n, k, ranks, scratch)
    _settle(scene, wave, n, rank)
    if not scene.apart:
        _pass_hidden(scene, wave, n, scratch.stack)


@called
def _begin_outside(scene: Arrays, wave: Wave, n: int) -> bool:
    """Whether fresh rays are known to begin outside of all solids; if so, they know it then too."""
    floats, nearest = wave.floats, INF
    for k in range(scene.solids):
        center, radius_squared = vec_at(scene.balls, k, 0), scene.balls[k, 3]
        for i in range(padded(n)):
            from_center = sub(vec_of(floats, ORIGIN, i), center)
            floats[T + i] = dot(from_center, from_center) - radius_squared
        for i in range(min(n, SIZE)):
            nearest = min(nearest, floats[T + i])
    if nearest <= 0.0:
        return False
    for i in range(padded(n)):
        wave.ints[MEDIUM + i] = AMBIENT
    return True


@called
def _spheres(scene: Arrays, wave: Wave, n: int, k: int) -> None:
    floats, ints = wave.floats, wave.ints
    row, gone = scene.objects[k, FIRST], 0
    while gone < n and ints[LEFT + gone] == sided(k, False):
        gone += 1
    if gone == n:
        return  # all have left it, as a whole wave does that was inside
    center, radius = vec_at(scene.rows, row, 0), scene.rows[row, 3]
    for i in range(padded(n)):
        o, d = vec_of(floats, ORIGIN, i), vec_of(floats, DIRECTION, i)
        t, entering = sphere_hit(o, d, center, radius, ints[LEFT + i] == sided(k, True))
        t = INF if ints[LEFT + i] == sided(k, False) else t
        _nearer(wave, i, k, t, entering)


@called
def _faces(scene: Arrays, wave: Wave, n: int, k: int, is_disk: bool) -> None:
    floats, ints = wave.floats, wave.ints
    face = open_face(scene.rows, scene.objects[k, FIRST])
    for i in range(padded(n)):
        o, d = vec_of(floats, ORIGIN, i), vec_of(floats, DIRECTION, i)
        t, x, y = face_hit(o, d, face, is_disk, floats[T + i])
        t = INF if ints[LEFT + i] >> 1 == k else t
        floats[PLACE_X + i] = x if t < floats[T + i] else floats[PLACE_X + i]
        floats[PLACE_Y + i] = y if t < floats[T + i] else floats[PLACE_Y + i]
        _nearer(wave, i, k, t, dot(d, face.z) < 0.0)


@called
def _one_by_one(scene: Arrays, wave: Wave, n: int, k: int, rank: bool, scratch: Scratch) -> None:
    """What the rays meet of any object, those that come near it; if it `ranks`, of what medium."""
    floats, ints, queue = wave.floats, wave.ints, scratch.queues
    center, radius_squared = vec_at(scene.balls, k, 0), scene.balls[k, 3]
    for i in range(padded(n)):
        o, d = vec_of(floats, ORIGIN, i), vec_of(floats, DIRECTION, i)
        far = far_from_ball(o, d, center, radius_squared)
        queue[i] = 0 if far and ints[LEFT + i] >> 1 != k else 1
    near = 0
    for i in range(min(n, SIZE)):
        comes_near = queue[i]
        queue[near] = i
        near += comes_near
    for q in range(min(near, SIZE)):
        i = queue[q] & IN
        ray = ray_at(wave, i)
        leaving = surface_left(scene, ray.left, ray.left_face, ray.inward)
        on_face, t_max = ray.left_face if ray.left == k else -1, INF if rank else floats[T + i]
        t, face, enters = object_hit(
            scene, k, ray.o, ray.d, on_face, ray.inward, leaving, t_max, scratch.stack
        )
        if rank:
            _rank(wave, i, k, t, enters)
        if t < floats[T + i]:
            ints[FACE + i] = face
        _nearer(wave, i, k, t, enters)


@called
def _settle(scene: Arrays, wave: Wave, n: int, rank: bool) -> None:
    """The media before and beyond what is hit."""
    ints, solids = wave.ints, scene.solids
    for i in range(padded(n)):
        (hit, entering), medium = side_of(ints[HIT + i]), ints[MEDIUM + i]
        before = ints[BEFORE + i] if medium == UNKNOWN else medium
        beyond = ints[BEYOND + i]
        if not rank:
            beyond = 1 + hit if entering else AMBIENT
        ints[BEFORE + i], ints[BEYOND + i] = before, before if hit >= solids else beyond


@called
def _pass_hidden(scene: Arrays, wave: Wave, n: int, stack: Floats) -> None:
    """Rays that meet first what is not to be seen go on one by one."""
    floats, ints = wave.floats, wave.ints
    for i in range(min(n, SIZE)):
        if 0 <= ints[HIT + i] < 2 * scene.solids and ints[BEFORE + i] == ints[BEYOND + i]:
            ray = ray_at(wave, i)
            left, on = ray.left, ray.left_face
            hit = nearest_hit(
                scene, ray.o, ray.d, ray.medium, left, on, ray.inward, stack[:0], stack
            )
            floats[T + i] = hit.t
            if scene.objects[max(hit.object, 0), SHAPE] >= RECTANGLE:
                face = open_face(scene.rows, scene.objects[hit.object, FIRST])
                from_center = sub(along(ray.o, hit.t, ray.d), face.center)
                floats[PLACE_X + i] = dot(from_center, face.x)
                floats[PLACE_Y + i] = dot(from_center, face.y)
            ints[HIT + i], ints[FACE + i] = sided(hit.object, hit.entering), hit.face
            ints[BEFORE + i], ints[BEYOND + i] = hit.medium, hit.beyond
