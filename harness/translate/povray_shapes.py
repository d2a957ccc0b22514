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
        case rs.Plane():
            head = f"plane {{ {vector(shape.normal)}, {number(shape.offset)}"
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


def region_text(where: Both | Either, *modifiers: str) -> str:
    """A region with modifiers for all its faces."""
    # A union would show the surfaces that one part has inside another.
    kind = "intersection" if isinstance(where, Both) else "merge"
    if len(where.parts) == 1:  # of which POV-Ray would say that it is no CSG
        kind = "object"
    return f"{kind} {{ {' '.join((*map(_region, where.parts), *modifiers))} }}"


def _region(where: Region) -> str:
    match where:
        case Both() | Either():
            return region_text(where)
        case Side(bound, outside):
            if isinstance(bound, HalfSpace):
                inverse = " inverse" if outside else ""
                return f"plane {{ {vector(bound.normal)}, {number(bound.offset)}{inverse} }}"
            return _round(bound, outside)


def _round(bound: Round, outside: bool) -> str:
    """A body of revolution; in a frame of its own, so that no digits are lost far away.

    POV-Ray's `inverse` turns the normal of a quadric round twice, so that its outside has the
    texture of its inside: what is outside of one is written as a quadric of the other sign.
    """
    if bound.c == -1:
        center = np.array(bound.origin) + bound.b / 2 * np.array(bound.axis)
        radius = math.sqrt(bound.a + bound.b**2 / 4)
        return f"sphere {{ {vector(center)}, {number(radius)}{' inverse' if outside else ''} }}"
    frame = any_frame(bound.origin, bound.axis)
    assert frame is not None  # axes of bounds are unit vectors
    rows = ", ".join(number(c) for axis in (frame.x, frame.y, frame.z, frame.origin) for c in axis)
    place = f"matrix <{rows}>"
    sign = -1.0 if outside else 1.0
    squares, line = vector([sign, sign, -sign * bound.c]), vector([0, 0, -sign * bound.b])
    body = f"quadric {{ {squares}, <0, 0, 0>, {line}, {number(-sign * bound.a)}"
    if bound.c <= 0:
        return f"{body} {place} }}"
    # A quadric has both nappes or sheets.
    middle = bound.b / (2 * bound.c)
    if outside:
        return f"merge {{ {body} }} plane {{ z, {number(-middle)} }} {place} }}"
    return f"intersection {{ {body} }} plane {{ -z, {number(middle)} }} {place} }}"


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
