"""Rays in waves meet what they meet one by one, to the last bit."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest

from tests.tracer.scenes import CAMERA, wall
from tests.tracer.test_properties import SHAPES, moved, rays_at
from tracer.arrays import CELL, COMPOUND, MESH, SHAPE, Arrays, flatten
from tracer.exposure import GLASS
from tracer.hit import NOTHING, UNKNOWN, nearest_hit, new_stack
from tracer.scene import Medium, Mirror, Scene, Solid, Surface
from tracer.shapes import Disk, Sphere
from tracer.vector import Vec
from tracer.wave import (
    BEFORE,
    BEYOND,
    DIRECTION,
    FACE,
    FLOATS,
    HIT,
    INTS,
    LEFT,
    LEFT_FACE,
    MEDIUM,
    ORIGIN,
    SIZE,
    STRIDE,
    Scratch,
    T,
    Wave,
    nearest_hits,
    side_of,
    vec_of,
)

kernel: Any = numba.njit(error_model="numpy")
N = SIZE - 3


@kernel
def together(scene: Arrays, wave: Wave, fresh: bool, scratch: Scratch) -> None:
    nearest_hits(scene, wave, N, fresh, scratch)


@kernel
def one_by_one(scene: Arrays, wave: Wave, t: Any, others: Any, stack: Any) -> None:
    floats, ints = wave.floats, wave.ints
    for i in range(N):
        o, d = vec_of(floats, ORIGIN, i), vec_of(floats, DIRECTION, i)
        (left, inward), left_face = side_of(ints[LEFT + i]), ints[LEFT_FACE + i]
        hit = nearest_hit(scene, o, d, ints[MEDIUM + i], left, left_face, inward, stack[:0], stack)
        t[i] = hit.t
        others[0, i], others[1, i] = 2 * hit.object + hit.entering, hit.face
        others[2, i], others[3, i] = hit.medium, hit.beyond


def anywhere(rng: np.random.Generator, reach: float) -> Vec:
    x, y, z = rng.uniform(-reach, reach, 3).tolist()
    return x, y, z


def scene_of(rng: np.random.Generator, apart: bool) -> Scene:
    """Six solids, each away from the others or anywhere; a ball, a disk and a wall that are not."""
    solids = []
    for k, name in enumerate(rng.choice(sorted(SHAPES), 6).tolist()):
        by = (4.0 * (k % 3) - 4.0, 4.0 * (k // 3) - 2.0, 0.0) if apart else anywhere(rng, 1.0)
        solids.append(Solid(moved(SHAPES[name], by), Medium(1.1 + 0.1 * k), k))
    disk = Disk((0.0, 0.0, -2.5), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 2.0)
    ball = Surface(Sphere((0.0, 0.0, 2.5), 0.5), Mirror((1.0, 1.0, 1.0)))
    lamp = wall(-5.0)
    return Scene(CAMERA, tuple(solids), (ball, Surface(disk, lamp.material), lamp))


@pytest.mark.parametrize("apart", [True, False])
def test_waves_meet_what_single_rays_do(apart: bool) -> None:
    for seed in range(12):
        rng = np.random.default_rng(seed)
        scene = flatten(scene_of(rng, apart))
        assert scene.apart == apart
        scratch = Scratch(np.zeros(4 * SIZE + 4, np.int64), np.zeros(GLASS), new_stack(scene))
        wave = Wave(np.zeros(FLOATS), np.full(INTS, -7))  # what is left of earlier waves
        column = [wave.floats[k * STRIDE : k * STRIDE + N] for k in range(6)]
        ints = {at: wave.ints[at : at + N] for at in (LEFT, LEFT_FACE, MEDIUM, HIT, FACE)}
        before, beyond = wave.ints[BEFORE : BEFORE + N], wave.ints[BEYOND : BEYOND + N]
        t = wave.floats[T : T + N]
        origins, directions = rays_at(rng, N)
        for k in range(3):
            column[k][:], column[3 + k][:] = origins[:, k] * 2.0, directions[:, k]
        ints[LEFT][:], ints[LEFT_FACE][:], ints[MEDIUM][:] = 2 * NOTHING, -1, UNKNOWN
        for bounce in range(6):
            together(scene, wave, bounce == 0, scratch)
            t_alone, alone = np.empty(N), np.empty((4, N), np.int64)
            one_by_one(scene, wave, t_alone, alone, new_stack(scene))
            np.testing.assert_array_equal(t, t_alone)
            np.testing.assert_array_equal(ints[HIT], alone[0])
            met = ints[HIT] >= 0
            kind = scene.objects[np.maximum(ints[HIT] >> 1, 0), SHAPE]
            counts = met & np.isin(kind, [CELL, COMPOUND, MESH])
            np.testing.assert_array_equal(ints[FACE][counts], alone[1][counts])
            np.testing.assert_array_equal(before, alone[2])
            np.testing.assert_array_equal(beyond[met], alone[3][met])
            # On they go, some straight through and some back; what meets nothing begins anew.
            back = rng.random(N) < 0.3
            for k in range(3):
                column[k][met] += (t * column[3 + k])[met]
                column[3 + k][back & met] *= -1.0
            ints[LEFT][:] = np.where(met, ints[HIT] ^ back, ints[LEFT])
            ints[LEFT_FACE][met] = ints[FACE][met]
            ints[MEDIUM][met] = np.where(back, before, beyond)[met]
        assert met.any()
