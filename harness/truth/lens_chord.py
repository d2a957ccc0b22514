"""Where a line is in a lens or a cone.

A conicoid is z = r^2 / (R (1 + sqrt(1 - (1 + k) r^2 / R^2))), which solves
r^2 - 2 R z + (1 + k) z^2 = 0 on the sheet where (1 + k) z < R. What lies above it is convex, so a
line is in there between two roots, from one root on, all the way, or nowhere. A lens is what lies
above its front face and below its back face within its edge; a face that bends inwards is cut out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float, lengths
from harness.scene.resolved import Cone, Frame, Lens
from harness.truth.intervals import Chord, both, planes_chord, without

Mask = NDArray[np.bool_]


def lens_chords(lens: Lens, o: Float, d: Float) -> list[Chord]:
    """Up to three intervals: a ray beside the middle of a biconcave lens is in it twice."""
    frame = lens.frame
    back = np.array(frame.origin) + lens.thickness * np.array(frame.z)
    inner = [_tube(lens, o, d)]
    faces = ((np.array(frame.origin), 1.0), (back, -1.0))
    for (vertex, inwards), radius, conic in zip(faces, lens.radii, lens.conics, strict=True):
        if radius is None:
            n = -inwards * np.array(frame.z)
            wall = planes_chord(np.array([[*n, n @ vertex]]), o, d)
            inner = [both(part, wall) for part in inner]
            continue
        opens = np.sign(radius)  # the side of the vertex on which the centre of curvature is
        cap = _above(frame, vertex, opens, abs(radius), conic, inner[0], o, d)
        if opens == inwards:
            inner = [both(part, cap) for part in inner]
        else:
            inner = [left for part in inner for left in without(part, cap)]
    return inner


def cone_chord(cone: Cone, o: Float, d: Float) -> Chord:
    """A cone, pointed or cut off: within the mantle, between its two ends."""
    frame = cone.frame
    z = np.array(frame.z)
    ends = planes_chord(
        np.array([[*z, z @ np.array(frame.origin) + cone.height],
                  [*-z, -(z @ np.array(frame.origin))]]), o, d
    )  # fmt: skip
    slope = (cone.radius - cone.top_radius) / cone.height
    lo, ld = _local(frame, np.array(frame.origin), 1.0, o, d)
    # x^2 + y^2 = (radius - slope z)^2, on the side of the tip where that bracket is positive.
    lift, rate = cone.radius - slope * lo[:, 2], -slope * ld[:, 2]
    a = ld[:, 0] ** 2 + ld[:, 1] ** 2 - rate**2
    b = lo[:, 0] * ld[:, 0] + lo[:, 1] * ld[:, 1] - lift * rate
    c = lo[:, 0] ** 2 + lo[:, 1] ** 2 - lift**2
    roots = _roots(a, b, c)
    on_sheet = [np.isfinite(t) & (lift + np.where(np.isfinite(t), t, 0) * rate > 0) for t in roots]

    def normal(t: Float) -> Float:
        p = lo + np.where(np.isfinite(t), t, 0.0)[:, None] * ld
        radial = np.hypot(p[:, 0], p[:, 1])
        local = np.stack([p[:, 0], p[:, 1], slope * radial], axis=1)
        return _world(frame, 1.0, local)

    def holds(t: Float) -> Mask:
        p = lo + t[:, None] * ld
        return np.asarray(np.hypot(p[:, 0], p[:, 1]) < cone.radius - slope * p[:, 2])

    mantle = _between(roots, on_sheet, rate > 0, holds(_middle(ends)), normal)
    return both(ends, mantle)


def _tube(lens: Lens, o: Float, d: Float) -> Chord:
    """The endless cylinder that is the lens's edge."""
    frame = lens.frame
    lo, ld = _local(frame, np.array(frame.origin), 1.0, o, d)
    a = ld[:, 0] ** 2 + ld[:, 1] ** 2
    b = lo[:, 0] * ld[:, 0] + lo[:, 1] * ld[:, 1]
    cross = lo[:, 0] * ld[:, 1] - lo[:, 1] * ld[:, 0]
    h2 = a * lens.aperture**2 - cross**2
    within = lo[:, 0] ** 2 + lo[:, 1] ** 2 < lens.aperture**2
    with np.errstate(divide="ignore", invalid="ignore"):
        h = np.sqrt(np.maximum(h2, 0))
        t_in, t_out = (-b - h) / a, (-b + h) / a
    along = a == 0
    t_in = np.where(along, np.where(within, -np.inf, np.inf), np.where(h2 > 0, t_in, np.inf))
    t_out = np.where(along, np.where(within, np.inf, -np.inf), np.where(h2 > 0, t_out, -np.inf))

    def normal(t: Float) -> Float:
        p = lo + np.where(np.isfinite(t), t, 0.0)[:, None] * ld
        return _world(frame, 1.0, np.stack([p[:, 0], p[:, 1], np.zeros(len(p))], axis=1))

    return Chord(t_in, t_out, normal(t_in), normal(t_out))


def _above(
    frame: Frame, vertex: Float, opens: float, radius: float, conic: float, tube: Chord, o: Float,
    d: Float,
) -> Chord:  # fmt: skip
    """Where lines in the `tube` are above a conicoid that opens towards `opens` times z."""
    lo, ld = _local(frame, vertex, opens, o, d)
    # Counted from the point nearest to the vertex, so that far cameras cost no digits.
    shift = -np.einsum("ij,ij->i", lo, ld)
    near = lo + shift[:, None] * ld
    k = 1 + conic
    a = ld[:, 0] ** 2 + ld[:, 1] ** 2 + k * ld[:, 2] ** 2
    b = near[:, 0] * ld[:, 0] + near[:, 1] * ld[:, 1] + (k * near[:, 2] - radius) * ld[:, 2]
    c = near[:, 0] ** 2 + near[:, 1] ** 2 + (k * near[:, 2] - 2 * radius) * near[:, 2]
    roots = _roots(a, b, c)
    heights = [near[:, 2] + np.where(np.isfinite(t), t, 0.0) * ld[:, 2] for t in roots]
    on_sheet = [np.isfinite(t) & (k * z < radius) for t, z in zip(roots, heights, strict=True)]

    def normal(t: Float) -> Float:
        p = near + np.where(np.isfinite(t), t, 0.0)[:, None] * ld
        return _world(frame, opens, np.stack([p[:, 0], p[:, 1], k * p[:, 2] - radius], axis=1))

    middle = near + (_middle(tube) - shift)[:, None] * ld
    r2 = middle[:, 0] ** 2 + middle[:, 1] ** 2
    sag = r2 / (radius * (1 + np.sqrt(np.maximum(1 - k * r2 / radius**2, 0.0))))
    cap = _between(roots, on_sheet, ld[:, 2] > 0, middle[:, 2] > sag, normal)
    return Chord(cap.t_in + shift, cap.t_out + shift, cap.n_in, cap.n_out)


def _roots(a: Float, b: Float, c: Float) -> tuple[Float, Float]:
    """Both roots of a t^2 + 2 b t + c, the lower first; infinite where there is none.

    By the form that never subtracts numbers of like size; a line that is parallel to an asymptote
    has one root.
    """
    square = b * b - a * c
    q = -(b + np.where(b >= 0, 1.0, -1.0) * np.sqrt(np.maximum(square, 0.0)))
    with np.errstate(divide="ignore", invalid="ignore"):
        t1, t2 = q / a, c / q
    t1 = np.where((square > 0) & np.isfinite(t1), t1, np.inf)
    t2 = np.where((square > 0) & np.isfinite(t2), t2, np.inf)
    return np.minimum(t1, t2), np.maximum(t1, t2)


def _between(
    roots: tuple[Float, Float], on_sheet: list[Mask], upwards: Mask, holds: Mask, normal: object
) -> Chord:
    """The interval of a line in a convex region above a sheet that it meets at those `roots`.

    One root: from there on, where the line goes `upwards`. None: all of it, or nothing, as a point
    of it `holds`.
    """
    assert callable(normal)
    (low, high), (first, second) = roots, on_sheet
    two, one = first & second, first ^ second
    only = np.where(first, low, high)
    t_in = np.where(two, low, np.where(one & upwards, only, -np.inf))
    t_out = np.where(two, high, np.where(one & ~upwards, only, np.inf))
    nothing = ~two & ~one & ~holds
    t_in, t_out = np.where(nothing, np.inf, t_in), np.where(nothing, -np.inf, t_out)
    return Chord(t_in, t_out, normal(t_in), normal(t_out))


def _middle(chord: Chord) -> Float:
    """A point of each interval; 0 where it has no end or is empty."""
    ends = np.isfinite(chord.t_in) & np.isfinite(chord.t_out)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(ends, (chord.t_in + chord.t_out) / 2, 0.0))


def _local(frame: Frame, origin: Float, opens: float, o: Float, d: Float) -> tuple[Float, Float]:
    """Rays in the frame at `origin`, with z mirrored where `opens` is negative."""
    axes = np.array([frame.x, frame.y, opens * np.array(frame.z)])
    return (o - origin) @ axes.T, d @ axes.T


def _world(frame: Frame, opens: float, local: Float) -> Float:
    """Unit vectors of the world from vectors in the frame."""
    axes = np.array([frame.x, frame.y, opens * np.array(frame.z)])
    length = lengths(local)[:, None]
    return np.asarray(local / np.where(length > 0, length, 1.0) @ axes)
