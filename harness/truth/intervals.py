"""Intervals of lines: where they are in a region, and in two regions at once or in one alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float


@dataclass(frozen=True)
class Chord:
    """Where lines enter and leave a region; t_in > t_out where they miss it."""

    t_in: Float
    t_out: Float
    n_in: Float
    n_out: Float


def both(a: Chord, b: Chord) -> Chord:
    """Where a line is in two convex regions at once."""
    later, sooner = b.t_in > a.t_in, b.t_out < a.t_out
    return Chord(
        np.maximum(a.t_in, b.t_in),
        np.minimum(a.t_out, b.t_out),
        np.where(later[:, None], b.n_in, a.n_in),
        np.where(sooner[:, None], b.n_out, a.n_out),
    )


def without(a: Chord, b: Chord) -> tuple[Chord, Chord]:
    """Where a line is in `a` but not in `b`: before it and after it; either may be empty."""
    misses = b.t_in >= b.t_out
    starts, ends = np.where(misses, np.inf, b.t_in), np.where(misses, np.inf, b.t_out)
    before, after = starts < a.t_out, ends > a.t_in
    return (
        Chord(a.t_in, np.minimum(a.t_out, starts), a.n_in,
              np.where(before[:, None], -b.n_in, a.n_out)),
        Chord(np.maximum(a.t_in, ends), a.t_out,
              np.where(after[:, None], -b.n_out, a.n_in), a.n_out),
    )  # fmt: skip


# Of so few planes it is quicker to take one after the other, each for all rays at once.
FEW = 6


def planes_chord(planes: Float, o: Float, d: Float, chunk: int = 1 << 15) -> Chord:
    """Of the convex region of all `planes` (k, 4), n . p <= w.

    Works through `chunk` plane-ray pairs at a time, few enough to stay in the processor's cache.
    """
    m, few, normals = len(o), len(planes) <= FEW, np.ascontiguousarray(planes[:, :3])
    t_in, t_out = np.empty(m), np.empty(m)
    first, last = np.zeros(m, np.intp), np.zeros(m, np.intp)
    step = max(1, chunk // len(planes))
    for start in range(0, m, step):
        rows = slice(start, start + step)
        # (k, rows) of few planes, (rows, k) of many: what is compared stands together in memory.
        if few:
            slope, height = normals @ d[rows].T, planes[:, 3:] - normals @ o[rows].T
        else:
            slope, height = d[rows] @ normals.T, planes[:, 3] - o[rows] @ normals.T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            t = height / slope
        entering, leaving = np.where(slope < 0, t, -np.inf), np.where(slope > 0, t, np.inf)
        if not slope.all():  # parallel to a plane and beyond it, a line never enters
            entering[(slope == 0) & (height < 0)] = np.inf
        choose = _one_by_one if few else _at_once
        t_in[rows], first[rows] = choose(entering)
        nearest, last[rows] = choose(np.negative(leaving, out=leaving))
        np.negative(nearest, out=t_out[rows])
    return Chord(t_in, t_out, normals.take(first, axis=0), normals.take(last, axis=0))


def _one_by_one(t: Float) -> tuple[Float, NDArray[np.intp]]:
    """The largest of each column of `t` (k, m), and the first row that has it."""
    most, which = t[0].copy(), np.zeros(t.shape[1], np.intp)
    for k in range(1, len(t)):
        np.copyto(which, k, where=t[k] > most)
        np.maximum(most, t[k], out=most)
    return most, which


def _at_once(t: Float) -> tuple[Float, NDArray[np.intp]]:
    """The same of each row of `t` (m, k)."""
    which = t.argmax(axis=1)
    return t[np.arange(len(t)), which], which
