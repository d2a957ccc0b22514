"""The shapes of the resolved scene: all of a scene's geometry, in numbers.

Conventions are those of `harness.scene.resolved`, which has these names too.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from harness.scene.frozen import Frozen, Vec3

Triple = tuple[int, int, int]


class Frame(Frozen):
    """An orthonormal right-handed frame in world coordinates: p = origin + a x + b y + c z."""

    origin: Vec3
    x: Vec3
    y: Vec3
    z: Vec3


class Sphere(Frozen):
    type: Literal["sphere"] = "sphere"
    center: Vec3
    radius: float


class Convex(Frozen):
    """A convex polyhedron: box, slab, prism, wedge.

    Inside is where ``n . p <= d`` for every plane ``(n_x, n_y, n_z, d)``, n unit and outward.
    `faces[k]` lists the vertices of the polygon in `planes[k]`, counter-clockwise from outside.
    """

    type: Literal["convex"] = "convex"
    planes: tuple[tuple[float, float, float, float], ...]
    vertices: tuple[Vec3, ...]
    faces: tuple[tuple[int, ...], ...]


class Cylinder(Frozen):
    """Capped cylinder; axis along frame.z, from -height/2 to +height/2."""

    type: Literal["cylinder"] = "cylinder"
    frame: Frame
    radius: float
    height: float


class Cone(Frozen):
    """Cone from a base of `radius` around frame.origin to `top_radius`, `height` along frame.z.

    0 <= top_radius <= radius; 0 is a pointed cone.
    """

    type: Literal["cone"] = "cone"
    frame: Frame
    radius: float
    top_radius: float
    height: float


class Lens(Frozen):
    """Lens with its front vertex at frame.origin, its back vertex `thickness` along frame.z.

    `radii` of curvature are positive where the centre lies towards +z, null for a plane: biconvex
    is (+, -), biconcave (-, +). `conics` are conic constants: both faces are
    z = r^2 / (R (1 + sqrt(1 - (1 + k) r^2 / R^2))) from their vertices, for r up to `aperture`, the
    radius of the cylinder that is the edge. Everything between the faces and within the edge is
    inside.
    """

    type: Literal["lens"] = "lens"
    frame: Frame
    thickness: float
    radii: tuple[float | None, float | None]
    conics: tuple[float, float]
    aperture: float


class Mesh(Frozen):
    """Closed triangle mesh, counter-clockwise from outside.

    With `normals` (one per vertex, unit) the surface is shaded smoothly: rays refract at the
    interpolated normal. Without, at the geometric normal of the triangle.
    """

    type: Literal["mesh"] = "mesh"
    vertices: tuple[Vec3, ...]
    triangles: tuple[Triple, ...]
    normals: tuple[Vec3, ...] | None = None


class Rectangle(Frozen):
    """Open face: size[0] along frame.x, size[1] along frame.y, centred on the origin.

    Texture coordinates run from (0, 0) at (-x, -y) to (1, 1) at (+x, +y).
    """

    type: Literal["rectangle"] = "rectangle"
    frame: Frame
    size: tuple[float, float]


class Disk(Frozen):
    """Open face of `radius` around frame.origin; texture coordinates as its bounding square."""

    type: Literal["disk"] = "disk"
    frame: Frame
    radius: float


class Plane(Frozen):
    """Where ``n . p = d``, without end: n is the unit `normal`, d the `offset`.

    A surface's front is where the normal points. As a part of a composed solid it is the half-space
    behind it, ``n . p <= d``.
    """

    type: Literal["plane"] = "plane"
    normal: Vec3
    offset: float


class Csg(Frozen):
    """Solids composed as sets: what is in any, in all, or in the first and none of the others.

    Parts may share faces; in a union these are none of it, in a difference they are. Parts that are
    planes cut what ends: the whole never goes on for ever.
    """

    type: Literal["csg"] = "csg"
    operation: Literal["union", "intersection", "difference"]
    parts: tuple[PartShape, ...]


Analytic = Sphere | Convex | Cylinder | Cone | Lens | Csg
Part = Analytic | Plane
PartShape = Annotated[
    Sphere | Convex | Cylinder | Cone | Lens | Csg | Plane, Field(discriminator="type")
]
SolidShape = Annotated[
    Sphere | Convex | Cylinder | Cone | Lens | Csg | Mesh, Field(discriminator="type")
]
SurfaceShape = Annotated[
    Sphere | Convex | Cylinder | Cone | Lens | Csg | Mesh | Rectangle | Disk | Plane,
    Field(discriminator="type"),
]
