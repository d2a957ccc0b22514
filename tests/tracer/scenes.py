"""Small scenes and rays that the tests of this folder share."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tracer.camera import Perspective
from tracer.mesh import Mesh
from tracer.path import Paths, follow
from tracer.patterns import Constant
from tracer.scene import Emissive, Medium, Scene, Solid, Surface
from tracer.shapes import Plane, Rectangle, Sphere
from tracer.solids import Cell, polyhedron
from tracer.vector import Vec

Floats = NDArray[np.float64]

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
CAMERA = Perspective((0.0, 0.0, 9.0), X, Y, (0.0, 0.0, -1.0), 1.0)
GLASS = Medium(1.5)


def wall(z: float, size: float = 1e4) -> Surface:
    """An emissive face across the z axis."""
    face = Rectangle((0.0, 0.0, z), X, Y, Z, (size, size))
    return Surface(face, Emissive(Constant((1.0, 1.0, 1.0))))


def slab(thickness: float, front: float = 0.0, half: float = 2000.0) -> Cell:
    """From z = front down to z = front - thickness."""
    planes = [
        Plane((0.0, 0.0, 1.0), front),
        Plane((0.0, 0.0, -1.0), thickness - front),
        Plane((1.0, 0.0, 0.0), half),
        Plane((-1.0, 0.0, 0.0), half),
        Plane((0.0, 1.0, 0.0), half),
        Plane((0.0, -1.0, 0.0), half),
    ]
    ends = (front - thickness, front)
    corners = [(x, y, z) for x in (-half, half) for y in (-half, half) for z in ends]
    return polyhedron(planes, corners)


def prism(apex_degrees: float) -> Cell:
    """Apex edge along y at the origin, opening towards -x; faces at half the apex angle."""
    half = math.radians(apex_degrees / 2)
    up, down = (math.sin(half), 0.0, math.cos(half)), (math.sin(half), 0.0, -math.cos(half))
    planes = [
        Plane(up, 0.0),
        Plane(down, 0.0),
        Plane((-1.0, 0.0, 0.0), 10.0),
        Plane((0.0, 1.0, 0.0), 10.0),
        Plane((0.0, -1.0, 0.0), 10.0),
    ]
    z = 10.0 * math.tan(half)
    corners = [(x, y, q) for y in (-10.0, 10.0) for x, q in ((0.0, 0.0), (-10.0, z), (-10.0, -z))]
    return polyhedron(planes, corners)


def cube_mesh() -> Mesh:
    v = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    t = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    return Mesh(v, t)


def cube() -> Cell:
    axes = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    planes = [Plane((s * x, s * y, s * z), 1.0) for x, y, z in axes for s in (-1.0, 1.0)]
    return polyhedron(planes, [(x, y, z) for x, y, z in cube_mesh().vertices.tolist()])


def glass(shape: Sphere | Cell | Mesh, ior: float, *, ends_at: float | None = None) -> Scene:
    """A solid of index `ior`, and a wall across z below it where rays shall land."""
    surfaces = () if ends_at is None else (wall(ends_at),)
    return Scene(CAMERA, (Solid(shape, Medium(ior)),), surfaces)


def down(theta_degrees: float) -> Vec:
    """A direction down at an angle from -z, towards +x."""
    theta = math.radians(theta_degrees)
    return math.sin(theta), 0.0, -math.cos(theta)


def one(scene: Scene, origin: Vec, direction: Vec, path: str) -> Paths:
    return follow(scene, [origin], [direction], path, vertices=True)


def angles(a: Floats, b: Floats) -> Floats:
    """Between rows, in radians; atan2 keeps the digits that acos loses."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))


def axis_crossing(point: Floats, direction: Floats) -> float:
    """Z where a ray in the plane y = 0 crosses the z axis."""
    return float(point[2] - direction[2] * point[0] / direction[0])
