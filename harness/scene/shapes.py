"""Shapes of a scene file as shapes of numbers: boxes, slabs and prisms become convex solids.

Every function raises SceneInvalid with key paths relative to the shape.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from harness.scene import lenses, model, resolved
from harness.scene.containment import bounds
from harness.scene.degrees import cosd, sind
from harness.scene.findings import Attempts, Finding, SceneInvalid, quoted
from harness.scene.resolved import Vec3
from harness.scene.vectors import (
    IDENTITY,
    Matrix,
    any_frame,
    combination,
    difference,
    exact_dot,
    frame,
    length,
    product,
    rotation,
    turned,
)

if TYPE_CHECKING:
    from harness.scene.tessellation import Points, Triangles

X, Y, Z = IDENTITY
Faces = Sequence[tuple[int, ...]]

# Corner k of a box has its coordinate i at + where bit i of k is set.
BOX_FACES: Faces = (
    (0, 4, 6, 2),  # -x
    (1, 3, 7, 5),  # +x
    (0, 1, 5, 4),  # -y
    (2, 6, 7, 3),  # +y
    (0, 2, 3, 1),  # -z
    (4, 5, 7, 6),  # +z
)
# Corners of a prism: apex, entry side, exit side of the base; first at -y, then at +y.
PRISM_FACES: Faces = (
    (3, 4, 1, 0),  # entry
    (2, 5, 3, 0),  # exit
    (4, 5, 2, 1),  # base
    (1, 2, 0),  # -y
    (5, 4, 3),  # +y
)


def solid_shape(shape: model.SolidShape, folder: Path) -> resolved.SolidShape:
    """The shape of a solid; `folder` is the scene file's, where mesh files are."""
    match shape:
        case model.Sphere():
            return resolved.Sphere(center=_vec(shape.center), radius=shape.radius)
        case model.Box() | model.Slab() | model.Prism() | model.Wedge():
            return _convex(shape)
        case model.AsMesh():
            return polygons(_convex(shape.of))
        case model.Cylinder():
            placed = _along_axis(shape, shape.center)
            return resolved.Cylinder(frame=placed, radius=shape.radius, height=shape.height)
        case model.Cone():
            return lenses.cone(shape, _along_axis(shape, shape.center))
        case model.Lens():
            return lenses.lens(shape, _along_axis(shape, shape.vertex))
        case model.Plane():
            message = "a plane ends nowhere: it bounds no solid by itself"
            expected = "a part of an intersection or difference, which it cuts"
            raise SceneInvalid(Finding(("type",), message, quoted(shape.type), expected))
        case model.Union() | model.Intersection() | model.Difference():
            return _whole(_composed(shape, folder))
        case model.Icosphere():
            return _icosphere(shape)
        case model.MeshFile() | model.MeshData():
            return _closed(_mesh(shape, folder), shape, folder)


def surface_shape(shape: model.SurfaceShape, folder: Path) -> resolved.SurfaceShape:
    """The shape of a surface that bounds no medium."""
    if isinstance(shape, model.Rectangle):
        return rectangle(shape)
    if isinstance(shape, model.Disk):
        return resolved.Disk(frame=_face_frame(shape), radius=shape.radius)
    if isinstance(shape, model.Plane):
        return _plane(shape)
    if isinstance(shape, model.MeshFile | model.MeshData):
        return _mesh(shape, folder)
    return solid_shape(shape, folder)


def rectangle(shape: model.Rectangle) -> resolved.Rectangle:
    return resolved.Rectangle(frame=_face_frame(shape), size=shape.size)


def turn_of(shape: model.Placed) -> Matrix:
    """All rotations of a shape in one, the first in the list applied first."""
    turn = IDENTITY
    for index, step in enumerate(shape.rotate):
        matrix = rotation(_vec(step.axis), step.angle)
        if matrix is None:
            raise _no_direction(("rotate", index, "axis"), step.axis)
        turn = product(matrix, turn)
    return turn


def _vec(values: tuple[float, float, float]) -> Vec3:
    x, y, z = values
    return float(x), float(y), float(z)


def _no_direction(path: tuple[str | int, ...], value: Vec3) -> SceneInvalid:
    return SceneInvalid(
        Finding(path, "has no direction", quoted(list(value)), "a vector other than zero")
    )


def _turned_frame(base: resolved.Frame, turn: Matrix) -> resolved.Frame:
    return resolved.Frame(
        origin=base.origin, x=turned(turn, base.x), y=turned(turn, base.y), z=turned(turn, base.z)
    )


def _face_frame(shape: model.Rectangle | model.Disk | model.Wedge) -> resolved.Frame:
    if not any(shape.normal):
        raise _no_direction(("normal",), shape.normal)
    base = frame(_vec(shape.center), _vec(shape.normal), _vec(shape.up))
    if base is None:
        raise SceneInvalid(
            Finding(
                ("up",) if "up" in shape.model_fields_set else ("normal",),
                "up is zero or parallel to normal, so the face has no orientation",
                f"normal = {quoted(list(shape.normal))}, up = {quoted(list(shape.up))}",
                "an up across the normal, such as [0, 0, -1] for a floor",
            )
        )
    return _turned_frame(base, turn_of(shape))


def _plane(shape: model.Plane) -> resolved.Plane:
    base = any_frame(_vec(shape.center), _vec(shape.normal))
    if base is None:
        raise _no_direction(("normal",), shape.normal)
    normal = turned(turn_of(shape), base.z)
    return resolved.Plane(normal=normal, offset=float(exact_dot(normal, base.origin)))


def _composed(
    shape: model.Union | model.Intersection | model.Difference, folder: Path
) -> resolved.Csg:
    attempts = Attempts()
    parts = [attempts.attempt(("of", k), _part, part, folder) for k, part in enumerate(shape.of)]
    attempts.raise_any()
    analytic = tuple(part for part in parts if isinstance(part, resolved.Part))
    return resolved.Csg(operation=shape.type, parts=analytic)


def _part(shape: model.PartShape, folder: Path) -> resolved.SolidShape | resolved.Plane:
    match shape:
        case model.Plane():
            return _plane(shape)
        case model.Union() | model.Intersection() | model.Difference():
            return _composed(shape, folder)
    return solid_shape(shape, folder)


def _whole(shape: resolved.Csg) -> resolved.Csg:
    """The composed solid, where half-spaces leave it an end; raises SceneInvalid."""
    if not np.isfinite(bounds(shape)).all():
        message = "goes on for ever: a half-space among its parts is cut by nothing"
        expected = "a part that ends, in an intersection with the half-space or before it is cut"
        raise SceneInvalid(Finding(("of",), message, None, expected))
    return shape


def _along_axis(shape: model.Cylinder | model.Cone | model.Lens, origin: Vec3) -> resolved.Frame:
    """A frame with z along the shape's axis."""
    base = any_frame(_vec(origin), _vec(shape.axis))
    if base is None:
        raise _no_direction(("axis",), shape.axis)
    return _turned_frame(base, turn_of(shape))


# --- convex solids --------------------------------------------------------------------------------


def _convex(shape: model.Box | model.Slab | model.Prism | model.Wedge) -> resolved.Convex:
    match shape:
        case model.Box():
            placed = resolved.Frame(origin=_vec(shape.center), x=X, y=Y, z=Z)
            half = tuple(extent / 2 for extent in shape.size)
            return _box(_turned_frame(placed, turn_of(shape)), half, (-half[2], half[2]))
        case model.Slab():
            base = any_frame(_vec(shape.center), _vec(shape.normal))
            if base is None:
                raise _no_direction(("normal",), shape.normal)
            return slab(_turned_frame(base, turn_of(shape)), shape.size, shape.thickness)
        case model.Prism():
            return _prism(shape)
        case model.Wedge():
            return _wedge(shape)


def slab(front: resolved.Frame, size: tuple[float, float], thickness: float) -> resolved.Convex:
    """The box of `thickness` behind the face that `front` is the frame of."""
    return _box(front, tuple(extent / 2 for extent in size), (-thickness, 0.0))


def _box(
    placed: resolved.Frame, half: tuple[float, ...], along_z: tuple[float, float]
) -> resolved.Convex:
    axes = (placed.x, placed.y, placed.z)
    ranges = ((-half[0], half[0]), (-half[1], half[1]), along_z)
    corners = [
        combination(placed.origin, [ranges[i][corner >> i & 1] for i in range(3)], axes)
        for corner in range(8)
    ]
    normals = [direction for axis in axes for direction in (_opposite(axis), axis)]
    return _polyhedron(corners, BOX_FACES, normals)


def _prism(shape: model.Prism) -> resolved.Convex:
    turn = turn_of(shape)
    sine, cosine = sind(shape.apex_angle / 2), cosd(shape.apex_angle / 2)
    axes = (turned(turn, X), turned(turn, Y), turned(turn, Z))
    depth, spread = shape.side * cosine, shape.side * sine
    outline = ((0.0, 0.0), (-depth, spread), (-depth, -spread))  # x, z
    corners = [
        combination(_vec(shape.apex), (x, y, z), axes)
        for y in (-shape.length / 2, shape.length / 2)
        for x, z in outline
    ]
    normals = [
        turned(turn, (sine, 0.0, cosine)),
        turned(turn, (sine, 0.0, -cosine)),
        _opposite(axes[0]),
        _opposite(axes[1]),
        axes[1],
    ]
    return _polyhedron(corners, PRISM_FACES, normals)


def _wedge(shape: model.Wedge) -> resolved.Convex:
    front = _face_frame(shape)
    sine, cosine = sind(shape.angle), cosd(shape.angle)
    half_width, half_height = shape.size[0] / 2, shape.size[1] / 2
    growth = half_height * sine / cosine
    if shape.thickness <= growth:
        expected = f"more than {growth:.10g}, so that it does not end before its edge"
        raise SceneInvalid(
            Finding(("thickness",), "too thin for its angle", quoted(shape.thickness), expected)
        )
    axes = (front.x, front.y, front.z)
    corners = [
        combination(front.origin, (x, y, z), axes)
        for back in (True, False)
        for y in (-half_height, half_height)
        for z in (-shape.thickness - math.copysign(growth, y) if back else 0.0,)
        for x in (-half_width, half_width)
    ]
    tilted = combination((0.0, 0.0, 0.0), (-sine, -cosine), (front.y, front.z))
    sides = [direction for axis in axes[:2] for direction in (_opposite(axis), axis)]
    return _polyhedron(corners, BOX_FACES, [*sides, tilted, front.z])


def _opposite(a: Vec3) -> Vec3:
    return 0.0 - a[0], 0.0 - a[1], 0.0 - a[2]


def _polyhedron(vertices: Sequence[Vec3], faces: Faces, normals: Sequence[Vec3]) -> resolved.Convex:
    """Planes through the rounded vertices: each lies midway between those of its face."""
    planes = []
    for face, normal in zip(faces, normals, strict=True):
        distances = [exact_dot(normal, vertices[k]) for k in face]
        planes.append((*normal, float((min(distances) + max(distances)) / 2)))
    return resolved.Convex(planes=tuple(planes), vertices=tuple(vertices), faces=tuple(faces))


def polygons(shape: resolved.Convex) -> resolved.Mesh:
    """The same solid as triangles: each face a fan around its first vertex."""
    triangles = tuple(
        (face[0], face[k], face[k + 1]) for face in shape.faces for k in range(1, len(face) - 1)
    )
    return resolved.Mesh(vertices=shape.vertices, triangles=triangles)


# --- meshes ---------------------------------------------------------------------------------------


def _icosphere(shape: model.Icosphere) -> resolved.Mesh:
    from harness.scene.tessellation import icosphere, placed

    directions, triangles = icosphere(shape.subdivisions)
    directions = placed(directions, turn_of(shape), (0.0, 0.0, 0.0))
    vertices = placed(directions * shape.radius, IDENTITY, _vec(shape.center))
    return resolved.Mesh(
        vertices=_rows(vertices),
        triangles=_rows(triangles),
        normals=_rows(directions) if shape.smooth else None,
    )


def _mesh(shape: model.MeshFile | model.MeshData, folder: Path) -> resolved.Mesh:
    """A mesh that may be open."""
    from harness.scene.tessellation import placed, vertex_normals

    if isinstance(shape, model.MeshFile):
        from harness.scene.meshfile import read_mesh

        vertices, triangles = read_mesh(folder, shape.file, shape.part)
        vertices, origin = vertices * shape.scale, _vec(shape.translate)
    else:
        vertices, triangles = _written_out(shape)
        origin = (0.0, 0.0, 0.0)
    vertices = placed(vertices, turn_of(shape), origin)
    if np.abs(vertices).max() > model.FARTHEST:
        raise SceneInvalid(Finding((), f"coordinates above {model.FARTHEST:g}"))
    normals = _rows(vertex_normals(vertices, triangles)) if shape.smooth else None
    return resolved.Mesh(vertices=_rows(vertices), triangles=_rows(triangles), normals=normals)


def _written_out(shape: model.MeshData) -> tuple[Points, Triangles]:
    vertices = np.array(shape.vertices, dtype=np.float64)
    for index, triangle in enumerate(shape.triangles):
        if not all(0 <= k < len(vertices) for k in triangle):
            expected = f"indices from 0 to {len(vertices) - 1}"
            where = ("triangles", index)
            raise SceneInvalid(Finding(where, "no such vertex", quoted(list(triangle)), expected))
    return vertices, np.array(shape.triangles, dtype=np.int64)


def _closed(
    mesh: resolved.Mesh, shape: model.MeshFile | model.MeshData, folder: Path
) -> resolved.Mesh:
    """The mesh where it bounds one solid; raises SceneInvalid."""
    from harness.scene.mesh import closed_solid_problems
    from harness.scene.meshfile import hint_of_parts

    problems = closed_solid_problems(np.array(mesh.vertices), np.array(mesh.triangles))
    if problems:
        key, expected = ("triangles",), None
        if isinstance(shape, model.MeshFile):
            key, expected = ("file",), hint_of_parts(shape, folder)
        raise SceneInvalid(
            *(
                Finding(key, f"not the surface of one solid: {problem}", None, expected)
                for problem in problems
            )
        )
    return mesh


def _rows(array: NDArray[Any]) -> Any:
    return array.tolist()  # which the models turn into tuples


# --- sizes ----------------------------------------------------------------------------------------


def smallest_feature(shape: resolved.SurfaceShape) -> float:
    """The smallest radius, thickness or side of a shape."""
    match shape:
        case resolved.Sphere() | resolved.Disk():
            return shape.radius
        case resolved.Cylinder() | resolved.Cone():
            return min(shape.radius, shape.height)
        case resolved.Lens():
            return min(shape.aperture, shape.thickness)
        case resolved.Csg():
            return min(map(smallest_feature, shape.parts))
        case resolved.Rectangle():
            return min(shape.size)
        case resolved.Plane():
            return math.inf
        case resolved.Mesh():
            return float(np.ptp(np.array(shape.vertices), axis=0).max())
        case resolved.Convex():
            return min(
                length(difference(shape.vertices[i], shape.vertices[j]))
                for face in shape.faces
                for i, j in zip(face, (*face[1:], face[0]), strict=True)
            )
