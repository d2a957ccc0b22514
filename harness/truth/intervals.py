"""Intervals of lines: where they are in a region, and in two regions at once or in one alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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


def planes_chord(planes: Float, o: Float, d: Float, chunk: int = 1 << 15) -> Chord:
    """Of the convex region of all `planes` (k, 4), n . p <= w.

    Works through `chunk` plane-ray pairs at a time, few enough to stay in the processor's cache.
    """
    m = len(o)
    out = [np.empty(m), np.empty(m), np.empty((m, 3)), np.empty((m, 3))]
    step = max(1, chunk // len(planes))
    for start in range(0, m, step):
        rows = slice(start, start + step)
        slope = d[rows] @ planes[:, :3].T
        height = planes[:, 3] - o[rows] @ planes[:, :3].T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            t = height / slope
        entering, leaving = np.where(slope < 0, t, -np.inf), np.where(slope > 0, t, np.inf)
        if not slope.all():  # parallel to a plane and beyond it, a line never enters
            entering[(slope == 0) & (height < 0)] = np.inf
        first, last = entering.argmax(1), leaving.argmin(1)
        index = np.arange(len(first))
        out[0][rows], out[1][rows] = entering[index, first], leaving[index, last]
        out[2][rows], out[3][rows] = planes[first, :3], planes[last, :3]
    return Chord(*out)
