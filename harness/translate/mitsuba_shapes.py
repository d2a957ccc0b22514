"""Shapes of the resolved scene as Mitsuba's shapes, in the description's terms.

See `harness.translate.mitsuba` for what stands for meshes and transforms.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from harness.errors import RendererUnsupported
from harness.scene import resolved as rs

Node = dict[str, Any]
Matrix = list[list[float]]

# A disk that bears a pattern becomes a mesh, since Mitsuba's disk has polar texture coordinates.
# The chord of 1/4096 of a circle is 3e-7 of the radius away from the arc. A power of two.
ROUND_CORNERS = 4096


def affine(x: Any, y: Any, z: Any, origin: Any) -> Matrix:
    """The 4 x 4 matrix with columns x, y, z and origin."""
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([x, y, z, origin])
    rows: Matrix = matrix.tolist()
    return rows


def not_in_mitsuba(solid: rs.Solid) -> bool:
    """Whether Mitsuba has no shapes that make it up, or does not know what is where it overlaps."""
    return isinstance(solid.shape, rs.Cone | rs.Lens | rs.Csg) or bool(solid.meets)


def parts(shape: rs.SolidShape | rs.SurfaceShape) -> Iterator[tuple[str, Node]]:
    """Mitsuba shapes that make up `shape`, each with a suffix for its name."""
    match shape:
        case rs.Sphere():
            yield "", {"type": "sphere", "center": list(shape.center), "radius": shape.radius}
        case rs.Convex():
            yield "", _convex(shape)
        case rs.Mesh():
            yield "", _mesh(shape.vertices, shape.triangles, normals=shape.normals)
        case rs.Cylinder():
            yield from _cylinder(shape)
        case rs.Cone() | rs.Lens() | rs.Csg() | rs.Plane():
            raise RendererUnsupported(f"Mitsuba has no {shape.type}")
        case rs.Rectangle():
            yield "", {"type": "rectangle", "to_world": _on_frame(shape.frame, *shape.size)}
        case rs.Disk():
            across = 2 * shape.radius
            yield "", {"type": "disk", "to_world": _on_frame(shape.frame, across, across)}


def _on_frame(frame: rs.Frame, width: float, height: float) -> Matrix:
    """Takes Mitsuba's [-1, 1]^2 to a face of `width` x `height` on `frame`."""
    x, y = np.array(frame.x) * width / 2, np.array(frame.y) * height / 2
    return affine(x, y, frame.z, frame.origin)


def _mesh(vertices: Any, triangles: Any, normals: Any = None, texcoords: Any = None) -> Node:
    node: Node = {
        "type": "mesh",
        "vertices": np.asarray(vertices, np.float32),
        "triangles": np.asarray(triangles, np.uint32),
    }
    if normals is not None:
        node["normals"] = np.asarray(normals, np.float32)
    if texcoords is not None:
        node["texcoords"] = np.asarray(texcoords, np.float32)
    return node


def _convex(shape: rs.Convex) -> Node:
    """Every polygon as a fan of triangles around its first vertex."""
    triangles = [
        (face[0], face[k], face[k + 1]) for face in shape.faces for k in range(1, len(face) - 1)
    ]
    return _mesh(shape.vertices, triangles)


def _cylinder(shape: rs.Cylinder) -> Iterator[tuple[str, Node]]:
    """Mitsuba's cylinder is open, so two disks close it, facing outwards."""
    frame, half = shape.frame, shape.height / 2
    origin, axis = np.array(frame.origin), np.array(frame.z)
    x, y = shape.radius * np.array(frame.x), shape.radius * np.array(frame.y)
    bottom, top = origin - half * axis, origin + half * axis
    yield (
        "_side",
        {
            "type": "cylinder",
            "p0": bottom.tolist(),
            "p1": top.tolist(),
            "radius": shape.radius,
        },
    )
    yield "_top", {"type": "disk", "to_world": affine(x, y, axis, top)}
    yield "_bottom", {"type": "disk", "to_world": affine(x, -y, -axis, bottom)}


def round_mesh(disk: rs.Disk) -> Node:
    """A disk of triangles with the texture coordinates of its bounding square.

    Rings with half as many corners from one to the next inner one, as wide as a side of theirs is
    long, so that no triangle is a sliver: in slivers single precision loses texture coordinates.
    """
    plane, triangles, first, radius, n = [], [], 0, 1.0, ROUND_CORNERS
    while n > 4:
        angle = 2 * math.pi / n * np.arange(n)
        plane.append(radius * np.column_stack([np.cos(angle), np.sin(angle)]))
        j, inner = np.arange(n // 2), first + n
        a, b, c = (first + (2 * j + k) % n for k in range(3))
        p, q = inner + j, inner + (j + 1) % (n // 2)
        triangles += [np.column_stack(corners) for corners in ((a, b, p), (b, q, p), (b, c, q))]
        first, radius, n = inner, radius * (1 - 2 * math.pi / n), n // 2
    plane.append(radius * np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]))
    triangles.append(first + np.array([(0, 1, 2), (0, 2, 3)]))
    points = np.vstack(plane)
    vertices = np.array(disk.frame.origin) + disk.radius * (
        points[:, :1] * np.array(disk.frame.x) + points[:, 1:] * np.array(disk.frame.y)
    )
    return _mesh(vertices, np.vstack(triangles), texcoords=(points + 1) / 2)
