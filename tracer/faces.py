"""Rectangles, disks and whole planes: faces that belong to no solid, met from either side."""

from __future__ import annotations

from typing import NamedTuple

from tracer.compiled import inlined
from tracer.shapes import INF, Disk, Plane, Rectangle, Rows, vec_at
from tracer.vector import Vec, along, dot, scale, sub


def face_row(face: Rectangle | Disk | Plane) -> list[float]:
    """A plane is a rectangle that ends nowhere; it needs no axes, as nothing on it has a place."""
    if isinstance(face, Plane):
        center = scale(face.offset, face.normal)
        return [*center, *(0.0,) * 6, *face.normal, INF, INF]
    half = (face.radius,) * 2 if isinstance(face, Disk) else (face.size[0] / 2, face.size[1] / 2)
    return [*face.origin, *face.x, *face.y, *face.z, *half]


class OpenFace(NamedTuple):
    """A rectangle's or disk's centre, axes and half of its size."""

    center: Vec
    x: Vec
    y: Vec
    z: Vec
    half_x: float
    half_y: float


@inlined
def open_face(rows: Rows, row: int) -> OpenFace:
    center, x, y = vec_at(rows, row, 0), vec_at(rows, row, 3), vec_at(rows, row, 6)
    return OpenFace(center, x, y, vec_at(rows, row, 9), rows[row, 12], rows[row, 13])


@inlined
def face_hit(
    o: Vec, d: Vec, face: OpenFace, is_disk: bool, best: float
) -> tuple[float, float, float]:
    """(distance, place along x, along y) of a rectangle or disk, from either side; infinitely far
    if missed or not before `best`.

    Whatever lies behind the ray or beyond `best` is sorted out before anything is divided.
    """
    height, approach = dot(face.z, sub(face.center, o)), dot(face.z, d)
    if approach < 0.0:
        height, approach = -height, -approach
    if not 0.0 < height < best * approach:
        return INF, 0.0, 0.0
    t = height / approach
    p = sub(along(o, t, d), face.center)
    x, y = dot(p, face.x), dot(p, face.y)
    if is_disk:
        inside = x * x + y * y <= face.half_x * face.half_x
    else:
        inside = abs(x) <= face.half_x and abs(y) <= face.half_y
    return t if inside else INF, x, y
