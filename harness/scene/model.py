"""The format of a scene file, as pydantic models. `load` reads a file into a `Case`.

A number may be written as an expression over the case's parameters and axes: ``"=ior / 2"``.
`expand` has replaced all of them before these models see the data, so models hold numbers only.
Lengths are in scene units, angles in degrees. Unknown keys are errors.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from harness.scene.media_model import Medium as Medium
from harness.scene.media_model import Spectrum as Spectrum
from harness.scene.media_model import Wavelength
from harness.scene.shape_model import FARTHEST as FARTHEST
from harness.scene.shape_model import AsMesh as AsMesh
from harness.scene.shape_model import Box as Box
from harness.scene.shape_model import Cone as Cone
from harness.scene.shape_model import Cylinder as Cylinder
from harness.scene.shape_model import Difference as Difference
from harness.scene.shape_model import Disk as Disk
from harness.scene.shape_model import Finite as Finite
from harness.scene.shape_model import Icosphere as Icosphere
from harness.scene.shape_model import Intersection as Intersection
from harness.scene.shape_model import Lens as Lens
from harness.scene.shape_model import MeshData as MeshData
from harness.scene.shape_model import MeshFile as MeshFile
from harness.scene.shape_model import Name as Name
from harness.scene.shape_model import NonNegative as NonNegative
from harness.scene.shape_model import PartShape as PartShape
from harness.scene.shape_model import Placed as Placed
from harness.scene.shape_model import Plane as Plane
from harness.scene.shape_model import Positive as Positive
from harness.scene.shape_model import Prism as Prism
from harness.scene.shape_model import Radius as Radius
from harness.scene.shape_model import Rectangle as Rectangle
from harness.scene.shape_model import Reflectance as Reflectance
from harness.scene.shape_model import Rgb as Rgb
from harness.scene.shape_model import Rotation as Rotation
from harness.scene.shape_model import Slab as Slab
from harness.scene.shape_model import SolidShape as SolidShape
from harness.scene.shape_model import Sphere as Sphere
from harness.scene.shape_model import Strict as Strict
from harness.scene.shape_model import SurfaceShape as SurfaceShape
from harness.scene.shape_model import Union as Union
from harness.scene.shape_model import Unit as Unit
from harness.scene.shape_model import Vec3 as Vec3
from harness.scene.shape_model import Wedge as Wedge

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


class Environment(Strict):
    """What rays see that leave the scene: a panorama of all around, in an image file.

    Its middle lies along -z, +x is to the right of it, and its top row is above (+y): the whole
    circle across, and half of one from top to bottom.
    """

    file: str
    encoding: Literal["srgb", "linear"] = "srgb"


Pattern = Annotated[Constant | Checker | Ramp | Picture, Field(discriminator="type")]


class Emissive(Strict):
    type: Literal["emissive"]
    pattern: Pattern


class Diffuse(Strict):
    type: Literal["diffuse"]
    reflectance: Reflectance


class Phong(Strict):
    """Diffuse, with a highlight of the light's colour around its mirror direction."""

    type: Literal["phong"]
    reflectance: Reflectance
    specular: NonNegative
    exponent: Annotated[float, Field(ge=1, le=1000, allow_inf_nan=False)]


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
    Emissive | Diffuse | Phong | Mirror | Translucent | ThinSlab, Field(discriminator="type")
]


# --- the scene ------------------------------------------------------------------------------------


class Solid(Strict):
    """Where solids overlap partly, the one of the higher `priority` is there."""

    name: Name
    shape: SolidShape
    medium: Name
    priority: Annotated[int, Field(ge=-1000, le=1000)] = 0


class Surface(Strict):
    name: Name
    shape: SurfaceShape
    material: Material


class PointLight(Strict):
    type: Literal["point"]
    position: Vec3
    intensity: Rgb


class DirectionalLight(Strict):
    """From far away, travelling along `direction`; `irradiance` is across it."""

    type: Literal["directional"]
    direction: Vec3
    irradiance: Rgb


Light = Annotated[PointLight | DirectionalLight, Field(discriminator="type")]


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


class ThinLensCamera(CameraBase):
    """A lens of radius `aperture`: what is `focus` units ahead is sharp.

    Each pixel is the mean through `lens_samples` squared points of the lens, evenly spread.
    """

    type: Literal["thin_lens"]
    fov_x: Annotated[float, Field(gt=0, lt=180)]
    aperture: Positive
    focus: Positive
    lens_samples: Annotated[int, Field(ge=1, le=64)] = 8


Camera = Annotated[
    PerspectiveCamera | OrthographicCamera | ThinLensCamera, Field(discriminator="type")
]


class BoxFilter(Strict):
    """The mean over the pixel's own area."""

    type: Literal["box"]


class GaussianFilter(Strict):
    """`sigma` in pixels."""

    type: Literal["gaussian"]
    sigma: Annotated[float, Field(gt=0, le=16, allow_inf_nan=False)] = 0.5


Filter = Annotated[BoxFilter | GaussianFilter, Field(discriminator="type")]


class Film(Strict):
    """At quality `normal`; `draft` halves and `high` doubles it where `scalable`.

    A pixel is what its centre sees, or of `samples` squared evenly spread in each pixel the mean
    that is weighed by `filter`. Probes go through pixel centres always.
    """

    width: Annotated[int, Field(ge=1, le=8192)] = 256
    height: Annotated[int, Field(ge=1, le=8192)] = 256
    scalable: bool = True
    samples: Annotated[int, Field(ge=1, le=16)] = 1
    filter: Filter = BoxFilter(type="box")


class Transport(Strict):
    max_depth: Annotated[int, Field(ge=1, le=10000)] = 40
    min_weight: Annotated[float, Field(ge=0, lt=1)] = 1e-6
    dispersion: Annotated[
        bool, Field(description="whether renderers are to render all wavelengths at once")
    ] = False


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
    shapes: dict[Name, SolidShape] = Field(default_factory=dict)
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
    environment: Environment | None = None
    wavelength: Wavelength = 587.5618
    spectrum: Spectrum | None = None
    media: dict[Name, Medium] = Field(default_factory=dict)
    solids: tuple[Solid, ...] = ()
    surfaces: tuple[Surface, ...] = ()
    lights: tuple[Light, ...] = ()
    transport: Transport = Transport()
    probes: tuple[Probe, ...] = ()
    variants: tuple[Variant, ...] = ()
    checks: Annotated[tuple[CheckSpec, ...], Field(min_length=1)]
    tables: tuple[Table, ...] = ()
