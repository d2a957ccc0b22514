"""The shapes of a scene file, as pydantic models; and what numbers and names it may hold.

Lengths are in scene units, angles in degrees.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

FARTHEST = 1e12  # of all numbers, so that no product of a few of them overflows

Finite = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=FARTHEST, allow_inf_nan=False)]
Unit = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Vec3 = tuple[Finite, Finite, Finite]
Radius = Annotated[float, Field(description="a radius of curvature; inf for a plane")]
NonNegative = Annotated[float, Field(ge=0, le=FARTHEST, allow_inf_nan=False)]
Rgb = tuple[NonNegative, NonNegative, NonNegative]
Reflectance = tuple[Unit, Unit, Unit]
Name = Annotated[
    str,
    Field(
        max_length=64,
        pattern=r"^[A-Za-z][A-Za-z0-9_-]*$",
        description="a name: a letter, then letters, digits, _ and -",
    ),
]


class Strict(BaseModel):
    # strict: "1.5" and true are no numbers.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


# --- shapes -------------------------------------------------------------------------------------
# Every shape takes `rotate`, applied about its centre: axis and angle in degrees, first to last.


class Rotation(Strict):
    axis: Vec3
    angle: Finite


class Placed(Strict):
    rotate: tuple[Rotation, ...] = ()


class Sphere(Placed):
    type: Literal["sphere"]
    center: Vec3 = (0, 0, 0)
    radius: Positive


class Box(Placed):
    type: Literal["box"]
    center: Vec3 = (0, 0, 0)
    size: tuple[Positive, Positive, Positive]


class Slab(Placed):
    """A wide box whose front face has the outward normal `normal` and the centre `center`."""

    type: Literal["slab"]
    center: Vec3 = (0, 0, 0)
    normal: Vec3 = (0, 0, 1)
    thickness: Positive
    size: tuple[Positive, Positive] = (100, 100)


class Prism(Placed):
    """Isosceles prism: apex edge along y through `apex`, opening towards -x.

    Its two refracting faces of length `side` meet at the apex with `apex_angle`, symmetric about
    the x axis: the entry face has its outward normal in the quadrant (+x, +z), the exit face in
    (+x, -z), each at apex_angle/2 from ±z. `length` is measured along y, centred on the apex.
    """

    type: Literal["prism"]
    apex: Vec3 = (0, 0, 0)
    apex_angle: Annotated[float, Field(gt=0, lt=180)]
    side: Positive
    length: Positive


class Wedge(Placed):
    """A slab whose back face is turned by `angle`: it grows thicker towards `up`.

    Front face as of a slab; `thickness` is that of its middle.
    """

    type: Literal["wedge"]
    center: Vec3 = (0, 0, 0)
    normal: Vec3 = (0, 0, 1)
    up: Vec3 = (0, 1, 0)
    thickness: Positive
    angle: Annotated[float, Field(ge=0, lt=90)]
    size: tuple[Positive, Positive]


class Cylinder(Placed):
    """Capped; `center` is its middle, `axis` its direction."""

    type: Literal["cylinder"]
    center: Vec3 = (0, 0, 0)
    axis: Vec3 = (0, 1, 0)
    radius: Positive
    height: Positive


class Cone(Placed):
    """`center` is the middle of its base; it narrows along `axis`, to `top_radius` if cut off."""

    type: Literal["cone"]
    center: Vec3 = (0, 0, 0)
    axis: Vec3 = (0, 1, 0)
    radius: Positive
    top_radius: NonNegative = 0
    height: Positive


class Lens(Placed):
    """`vertex` is the middle of its front face, `axis` points from there to the back.

    `radii` of curvature are positive where the centre lies in the direction of `axis`, infinite
    for a plane; `conics` are the faces' conic constants.
    """

    type: Literal["lens"]
    vertex: Vec3 = (0, 0, 0)
    axis: Vec3 = (0, 0, -1)
    thickness: Positive
    radii: tuple[Radius, Radius]
    conics: tuple[Finite, Finite] = (0, 0)
    diameter: Positive


class Icosphere(Placed):
    """A sphere as a triangle mesh: `subdivisions` of an icosahedron, all vertices on the sphere."""

    type: Literal["icosphere"]
    center: Vec3 = (0, 0, 0)
    radius: Positive
    subdivisions: Annotated[int, Field(ge=0, le=7)]  # 327,680 triangles; see MOST_TRIANGLES
    smooth: bool = False


class MeshFile(Placed):
    """A closed mesh from a PLY, OBJ or STL file beside the scene file; or one `part` of it."""

    type: Literal["mesh"]
    file: str
    part: Annotated[str, Field(min_length=1, max_length=256)] | None = None
    scale: Positive = 1.0
    translate: Vec3 = (0, 0, 0)
    smooth: bool = False


class MeshData(Placed):
    """A closed mesh written out: counter-clockwise from outside."""

    type: Literal["triangles"]
    vertices: Annotated[tuple[Vec3, ...], Field(min_length=4)]
    triangles: Annotated[tuple[tuple[int, int, int], ...], Field(min_length=4)]
    smooth: bool = False


class AsMesh(Strict):
    """Another shape, tessellated along its flat faces: the same solid as polygons."""

    type: Literal["polygons"]
    of: Annotated[Box | Slab | Prism | Wedge, Field(discriminator="type")]


class Plane(Placed):
    """Through `center`, without end; `normal` points to its front.

    In a composed solid it is the half-space behind it.
    """

    type: Literal["plane"]
    center: Vec3 = (0, 0, 0)
    normal: Vec3 = (0, 0, 1)


class Composed(Strict):
    """Solids composed as sets; each part has a place of its own."""

    of: Annotated[tuple[PartShape, ...], Field(min_length=2)]


class Union(Composed):
    """What is in any of the parts; faces that they share are none of it."""

    type: Literal["union"]


class Intersection(Composed):
    """What is in all of the parts."""

    type: Literal["intersection"]


class Difference(Composed):
    """What is in the first part and in none of the others."""

    type: Literal["difference"]


PartShape = Annotated[
    Sphere
    | Box
    | Slab
    | Prism
    | Wedge
    | Cylinder
    | Cone
    | Lens
    | Plane
    | Union
    | Intersection
    | Difference,
    Field(discriminator="type"),
]


class Rectangle(Placed):
    """Open face; `normal` points to its front, `up` gives the direction of its v coordinate."""

    type: Literal["rectangle"]
    center: Vec3 = (0, 0, 0)
    normal: Vec3 = (0, 0, 1)
    up: Vec3 = (0, 1, 0)
    size: tuple[Positive, Positive]


class Disk(Placed):
    type: Literal["disk"]
    center: Vec3 = (0, 0, 0)
    normal: Vec3 = (0, 0, 1)
    up: Vec3 = (0, 1, 0)
    radius: Positive


SolidShape = Annotated[
    Sphere
    | Box
    | Slab
    | Prism
    | Wedge
    | Cylinder
    | Cone
    | Lens
    | Plane
    | Union
    | Intersection
    | Difference
    | Icosphere
    | MeshFile
    | MeshData
    | AsMesh,
    Field(discriminator="type"),
]
SurfaceShape = Annotated[
    Rectangle | Disk | Plane | Sphere | Box | Cylinder | Cone | Icosphere | MeshFile | MeshData,
    Field(discriminator="type"),
]
