"""Shapes in POV-Ray's scene description language, and the only way numbers become text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from harness.scene import resolved as rs
from harness.scene.regions import Both, Either, HalfSpace, Region, Round, Side, region
from harness.scene.vectors import any_frame

# A direction that no edge of a sane mesh is parallel to; points are in a mesh where a ray along
# it meets an odd number of triangles.
INSIDE_VECTOR = (0.3713906763541037, 0.5570860145311556, 0.7427813527082074)


def shape_text(shape: rs.SurfaceShape, *modifiers: str, solid: bool = False) -> str:
    """The shape with its modifiers; of a rectangle or disk the pattern goes with its matrix."""
    body = "\n  ".join(modifiers)
    match shape:
        case rs.Sphere():
            head = f"sphere {{ {vector(shape.center)}, {number(shape.radius)}"
        case rs.Cylinder():
            middle, half = np.array(shape.frame.origin), shape.height / 2 * np.array(shape.frame.z)
            ends = f"{vector(middle - half)}, {vector(middle + half)}"
            head = f"cylinder {{ {ends}, {number(shape.radius)}"
        case rs.Convex():
            # Planes are double precision; the vertices of a mesh2 would be single.
            planes = (f"  plane {{ {vector(p[:3])}, {number(p[3])} }}" for p in shape.planes)
            head = "\n".join(("intersection {", *planes))
        case rs.Cone():
            base, axis = np.array(shape.frame.origin), np.array(shape.frame.z)
            ends = f"{vector(base)}, {number(shape.radius)}"
            ends += f", {vector(base + shape.height * axis)}, {number(shape.top_radius)}"
            head = f"cone {{ {ends}"
        case rs.Lens():
            head = "\n".join(("intersection {", *_parts(region(shape))))
        case rs.Csg():
            # A union would show the faces that one part has inside another.
            kind = "merge" if shape.operation == "union" else shape.operation
            head = "\n".join((f"{kind} {{", *map(shape_text, shape.parts)))
        case rs.Mesh():
            return _mesh(shape, body, solid)
        case rs.Rectangle():
            head = "polygon { 5, <0, 0>, <1, 0>, <1, 1>, <0, 1>, <0, 0>"
            body += f"\n  {_unit_square_to(shape.frame, *shape.size)}"
        case rs.Disk():
            head = "disc { <0.5, 0.5, 0>, z, 0.5"
            body += f"\n  {_unit_square_to(shape.frame, 2 * shape.radius, 2 * shape.radius)}"
    return f"{head}\n  {body}\n}}"


def _unit_square_to(frame: rs.Frame, width: float, height: float) -> str:
    """The matrix that takes (u, v, 0) to the face; its rows are the images of x, y, z, origin."""
    x, y, z = width * np.array(frame.x), height * np.array(frame.y), np.array(frame.z)
    corner = np.array(frame.origin) - (x + y) / 2
    numbers = ", ".join(number(c) for c in (*x, *y, *(z * max(width, height)), *corner))
    return f"matrix <{numbers}>"


def _mesh(shape: rs.Mesh, body: str, solid: bool) -> str:
    """Vertices are single precision, so they are written relative to the middle of the mesh."""
    vertices = np.array(shape.vertices)
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    lists = [_list("vertex_vectors", vertices - middle)]
    if shape.normals is not None:
        lists.append(_list("normal_vectors", shape.normals))
    faces = ", ".join(f"<{a:d}, {b:d}, {c:d}>" for a, b, c in shape.triangles)
    lists.append(f"  face_indices {{ {len(shape.triangles):d}, {faces} }}")
    if solid:
        lists.append(f"  inside_vector {vector(INSIDE_VECTOR)}")
    return "\n".join(("mesh2 {", *lists, f"  {body}", f"  translate {vector(middle)}", "}"))


def _list(name: str, vectors: Sequence[Sequence[float]] | np.ndarray) -> str:
    return f"  {name} {{ {len(vectors):d}, {', '.join(vector(v) for v in vectors)} }}"


# --- regions --------------------------------------------------------------------------------------


def _parts(where: Region) -> Iterator[str]:
    """The objects that a region is the intersection of, a line each."""
    for part in where.parts if isinstance(where, Both) else (where,):
        yield f"  {_region(part)}"


def _region(where: Region) -> str:
    match where:
        case Both(parts):
            return f"intersection {{ {' '.join(map(_region, parts))} }}"
        case Either(parts):  # a union would show the surfaces that one part has inside another
            return f"merge {{ {' '.join(map(_region, parts))} }}"
        case Side(bound, outside):
            inverse = " inverse" if outside else ""
            if isinstance(bound, HalfSpace):
                return f"plane {{ {vector(bound.normal)}, {number(bound.offset)}{inverse} }}"
            return _round(bound, inverse)


def _round(bound: Round, inverse: str) -> str:
    """A body of revolution; in a frame of its own, so that no digits are lost far away."""
    if bound.c == -1:
        center = np.array(bound.origin) + bound.b / 2 * np.array(bound.axis)
        radius = math.sqrt(bound.a + bound.b**2 / 4)
        return f"sphere {{ {vector(center)}, {number(radius)}{inverse} }}"
    frame = any_frame(bound.origin, bound.axis)
    assert frame is not None  # axes of bounds are unit vectors
    rows = ", ".join(number(c) for axis in (frame.x, frame.y, frame.z, frame.origin) for c in axis)
    place = f"matrix <{rows}>"
    squares = f"<1, 1, {number(-bound.c)}>, <0, 0, 0>"
    body = f"quadric {{ {squares}, <0, 0, {number(-bound.b)}>, {number(-bound.a)}"
    if bound.c <= 0:
        return f"{body}{inverse} {place} }}"
    # A quadric has both nappes or sheets.
    ahead = f"plane {{ -z, {number(bound.b / (2 * bound.c))} }}"
    return f"intersection {{ {body} }} {ahead}{inverse} {place} }}"


# --- numbers --------------------------------------------------------------------------------------


def number(value: float) -> str:
    """The one way by which a scene's values become text. Raises ValueError unless finite."""
    finite = float(value)
    if not math.isfinite(finite):
        raise ValueError(f"not a finite number: {finite}")
    return repr(finite)


def vector(values: Sequence[float] | np.ndarray) -> str:
    return f"<{', '.join(number(v) for v in values)}>"


def rgb(values: Sequence[float], factor: float = 1.0) -> str:
    return f"rgb {vector([factor * v for v in values])}"
