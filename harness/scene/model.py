"""The format of a scene file, as pydantic models. `load` reads a file into a `Case`.

A number may be written as an expression over the case's parameters and axes: ``"=ior / 2"``.
`expand` has replaced all of them before these models see the data, so models hold numbers only.
Lengths are in scene units, angles in degrees. Unknown keys are errors.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

FARTHEST = 1e12  # of all numbers, so that no product of a few of them overflows

Finite = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=FARTHEST, allow_inf_nan=False)]
Unit = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Vec3 = tuple[Finite, Finite, Finite]
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


class Cylinder(Placed):
    """Capped; `center` is its middle, `axis` its direction."""

    type: Literal["cylinder"]
    center: Vec3 = (0, 0, 0)
    axis: Vec3 = (0, 1, 0)
    radius: Positive
    height: Positive


class Icosphere(Placed):
    """A sphere as a triangle mesh: `subdivisions` of an icosahedron, all vertices on the sphere."""

    type: Literal["icosphere"]
    center: Vec3 = (0, 0, 0)
    radius: Positive
    subdivisions: Annotated[int, Field(ge=0, le=8)]
    smooth: bool = False


class MeshFile(Placed):
    """A closed mesh from a PLY, OBJ or STL file beside the scene file."""

    type: Literal["mesh"]
    file: str
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
    of: Annotated[Box | Slab | Prism, Field(discriminator="type")]


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
    Sphere | Box | Slab | Prism | Cylinder | Icosphere | MeshFile | MeshData | AsMesh,
    Field(discriminator="type"),
]
SurfaceShape = Annotated[
    Rectangle | Disk | Sphere | Box | Cylinder | Icosphere | MeshFile | MeshData,
    Field(discriminator="type"),
]


# --- patterns and materials -----------------------------------------------------------------------


class Constant(Strict):
    type: Literal["constant"]
    radiance: Rgb


class Checker(Strict):
    type: Literal["checker"]
    a: Rgb
    b: Rgb
    cells: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]]


class Ramp(Strict):
    type: Literal["ramp"]
    start: Rgb
    end: Rgb
    axis: Literal["u", "v"] = "u"


class Picture(Strict):
    """An image file beside the scene file: PNG of 8 or 16 bits, in `encoding`."""

    type: Literal["picture"]
    file: str
    encoding: Literal["srgb", "linear"] = "srgb"


Pattern = Annotated[Constant | Checker | Ramp | Picture, Field(discriminator="type")]


class Emissive(Strict):
    type: Literal["emissive"]
    pattern: Pattern


class Diffuse(Strict):
    type: Literal["diffuse"]
    reflectance: Reflectance


class Mirror(Strict):
    type: Literal["mirror"]
    reflectance: Reflectance = (1, 1, 1)


class Translucent(Strict):
    type: Literal["translucent"]
    color: Reflectance
    filter: Unit = 0.0
    transmit: Unit = 0.0


class ThinSlab(Strict):
    type: Literal["thin_slab"]
    medium: Name
    thickness: Positive


Material = Annotated[
    Emissive | Diffuse | Mirror | Translucent | ThinSlab, Field(discriminator="type")
]


# --- the scene ------------------------------------------------------------------------------------


class Medium(Strict):
    """`absorption` per scene unit and colour channel: T = exp(-absorption L)."""

    ior: Annotated[float, Field(ge=0.001, le=1000, allow_inf_nan=False)]
    absorption: Rgb = (0, 0, 0)


class Solid(Strict):
    name: Name
    shape: SolidShape
    medium: Name


class Surface(Strict):
    name: Name
    shape: SurfaceShape
    material: Material


class PointLight(Strict):
    type: Literal["point"]
    position: Vec3
    intensity: Rgb


class CameraBase(Strict):
    origin: Vec3
    target: Vec3
    up: Vec3 = (0, 1, 0)
    medium: Name | None = None  # what the camera stands in; must be said where it is not the air


class PerspectiveCamera(CameraBase):
    type: Literal["perspective"]
    fov_x: Annotated[float, Field(gt=0, lt=180)]


class OrthographicCamera(CameraBase):
    type: Literal["orthographic"]
    width: Positive


Camera = Annotated[PerspectiveCamera | OrthographicCamera, Field(discriminator="type")]


class Film(Strict):
    """At quality `normal`; `draft` halves and `high` doubles it where `scalable`."""

    width: Annotated[int, Field(ge=1, le=8192)] = 256
    height: Annotated[int, Field(ge=1, le=8192)] = 256
    scalable: bool = True


class Transport(Strict):
    max_depth: Annotated[int, Field(ge=1, le=10000)] = 40
    min_weight: Annotated[float, Field(ge=0, lt=1)] = 1e-6


class Probe(Strict):
    """One isolated path, measured with the camera's rays.

    `path` has a letter per interface: T transmit, R reflect. `planes` are the backdrops on which
    rays are caught, each in a render of its own. With `measure` "position" they carry position
    codes of at most `cells` cells, and two of them give the direction; with "light" the first one
    has radiance 1, so that a pixel shows the weight of the path. With "all-light" it shows the
    light of all paths together that the scene's transport allows; `path` is the shortest of them.
    `total_reflection` says that all R of the path are total, so that a renderer that can switch
    partial reflection off shows this path alone.
    """

    name: Name
    path: Annotated[
        str, Field(pattern=r"^[TR]*$", max_length=64, description="letters T and R, as in TRT")
    ]
    planes: Annotated[tuple[Rectangle, ...], Field(min_length=1, max_length=2)]
    measure: Literal["position", "light", "all-light"] = "position"
    total_reflection: bool = False
    cells: Annotated[int, Field(ge=1, le=16383)] = 4095


class Variant(Placed):
    """The same case in another form, of which every probe must show the same.

    `shapes` replaces those of the solids it names; then everything, camera and planes too, is
    turned by `rotate` about the origin and made `scale` times as large.
    """

    name: Name
    shapes: dict[Name, SolidShape] = {}
    scale: Positive = 1.0


# --- checks ---------------------------------------------------------------------------------------


class Known(Strict):
    """A documented deviation of a renderer: KNOWN while its size stays in [at_least, at_most].

    When it is gone the check fails, because the scene is out of date; `at_least` 0 says that it
    shows in some permutations only. `astray` is how many rays may be lost by it, or come where none
    should. With `variants` it is about these alone; sizes are those in the case's own units.
    """

    renderer: str
    at_least: Finite
    at_most: Finite
    astray: Annotated[int, Field(ge=0)] = 0
    variants: tuple[Name, ...] = ()
    cause: Annotated[str, Field(min_length=10)]


class CheckSpec(Strict):
    """One comparison to make, for every renderer that can.

    `against` is "truth" (closed form), "renderers" (every pair) or a renderer's name. Without
    `tolerance` it is derived; with it, `derivation` must say where it comes from.
    """

    observable: str
    against: str = "truth"
    probe: Name | None = None
    tolerance: Positive | None = None
    derivation: str = ""
    renderers: tuple[str, ...] = ()
    known: tuple[Known, ...] = ()


class Table(Strict):
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


class Case(Strict):
    """A scene file after its axes and expressions were evaluated: one permutation."""

    format: Literal[1]
    title: Annotated[str, Field(min_length=1)]
    family: Name
    description: str = ""
    lecture: str = ""
    sources: Annotated[tuple[str, ...], Field(min_length=1)]
    formula: str = ""
    tags: tuple[str, ...] = ()
    metres_per_unit: Positive = 1.0
    film: Film = Film()
    camera: Camera
    background: Rgb = (0, 0, 0)
    media: dict[Name, Medium] = {}
    solids: tuple[Solid, ...] = ()
    surfaces: tuple[Surface, ...] = ()
    lights: tuple[PointLight, ...] = ()
    transport: Transport = Transport()
    probes: tuple[Probe, ...] = ()
    variants: tuple[Variant, ...] = ()
    checks: Annotated[tuple[CheckSpec, ...], Field(min_length=1)]
    tables: tuple[Table, ...] = ()
