"""What rays of an image have in common: its samples, its limits, and the waves that wait."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracer.arrays import Arrays, Floats
from tracer.compiled import inlined
from tracer.hit import new_stack
from tracer.shapes import INF
from tracer.surface import Lobes
from tracer.vector import Vec
from tracer.wave import FLOATS, INTS, SIZE, STRIDE, Ints, Scratch, Wave

TELLING = 1e-4  # a weight whose loss would show in a picture

# Columns of Scratch.glass, for the rays that meet glass: those of vectors, and others.
POINT, NORMAL, OUT, REFLECTED, TRANSMITTED = (3 * k * STRIDE for k in range(5))
IOR_I, IOR_T, R, PASSED = (k * STRIDE for k in range(15, 19))
GLASS = 19 * STRIDE


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

    The k-th from the bottom is in row ``order[k]`` of the tables, with `filled` rays; `inside` says
    what solids they are in that are alone (BALL, FLAT), or CROWD. A wave is followed by two at most
    and one of each of these, which are followed by one at a time, all of rays with a segment more:
    so no more than ``3 max_depth`` wait.
    """

    floats: Floats  # (waves, FLOATS)
    ints: Ints  # (waves, INTS)
    order: Ints  # (waves,)
    filled: Ints  # (waves,)
    inside: Ints  # (waves,)


class Exposure(NamedTuple):
    """What the waves of one thread have in common. A ray counts `share` in its sample."""

    limits: Limits
    lobes: Lobes
    share: float
    samples: Samples
    waiting: Waiting
    scratch: Scratch


def exposure(
    scene: Arrays, limits: Limits, lobes: Lobes, share: float, samples: Samples
) -> Exposure:
    """With tables of its own for a thread."""
    waves = 3 * limits.max_depth + 5
    floats, ints = np.empty((waves, FLOATS)), np.empty((waves, INTS), np.int64)
    filled, inside = np.empty(waves, np.int64), np.empty(waves, np.int64)
    waiting = Waiting(floats, ints, np.arange(waves), filled, inside)
    scratch = Scratch(np.empty(4 * SIZE + 4, np.int64), np.empty(GLASS), new_stack(scene))
    return Exposure(limits, lobes, share, samples, waiting, scratch)


@inlined
def wave_at(waiting: Waiting, row: int) -> Wave:
    return Wave(waiting.floats[row], waiting.ints[row])


@inlined
def keep(waiting: Waiting, height: int, at: int, n: int, inside: int) -> int:
    """Puts the row at place `at` onto a stack of `height`, if any of its `n` rays are to be
    followed; how high the stack is then.
    """
    if n <= 0:
        return height
    order, row = waiting.order, waiting.order[at]
    waiting.filled[row], waiting.inside[row] = n, inside
    order[at], order[height] = order[height], row
    return height + 1


@inlined
def strength_of(weight: Vec) -> float:
    return max(weight[0], weight[1], weight[2])


@inlined
def worth(limits: Limits, strength: float, segments: int) -> bool:
    """Whether a ray is to be followed."""
    return (strength > 0.0) & (strength >= limits.min_weight) & (segments <= limits.max_depth)


@inlined
def note_gap(closest: Floats, pixel: int, t: float, strength: float) -> None:
    """Of the way `t` between two surfaces."""
    closest[pixel] = min(closest[pixel], t if strength >= TELLING else INF)
