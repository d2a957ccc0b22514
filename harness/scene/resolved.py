"""The resolved scene: numbers only, the one document that every renderer is given.

`ResolvedScene.model_dump_json()` is `scene.json`, which an outside renderer reads; its JSON
Schema is published by ``snellcheck schema --of scene``. All decisions are made before this point,
so no translator asks about units, handedness, degrees or defaults.

Conventions
-----------
* Right-handed, +Y up, column vectors, lengths in scene units, radiance linear Rec. 709.
* `ior` is the absolute index of refraction; media[0] is what surrounds everything.
* A solid is closed, filled with `medium`, and lies wholly inside `exterior`. Where it `meets` other
  solids, because they overlap partly or share faces, what fills a point is the solid of the highest
  `priority` there, and what two solids share of their faces is one interface between their media.
* Normals of solids point outwards. A face's front is the side its frame's z axis points to;
  cameras of conformance scenes see emissive faces from the front only.
* `max_depth` counts path segments: camera to first surface is 1.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from harness.scene.frozen import Frozen as Frozen
from harness.scene.frozen import Rgb as Rgb
from harness.scene.frozen import Vec3 as Vec3
from harness.scene.resolved_camera import Camera as Camera
from harness.scene.resolved_camera import Orthographic as Orthographic
from harness.scene.resolved_camera import Perspective as Perspective
from harness.scene.resolved_camera import ThinLens as ThinLens
from harness.scene.resolved_shapes import Analytic as Analytic
from harness.scene.resolved_shapes import Cone as Cone
from harness.scene.resolved_shapes import Convex as Convex
from harness.scene.resolved_shapes import Csg as Csg
from harness.scene.resolved_shapes import Cylinder as Cylinder
from harness.scene.resolved_shapes import Disk as Disk
from harness.scene.resolved_shapes import Frame as Frame
from harness.scene.resolved_shapes import Lens as Lens
from harness.scene.resolved_shapes import Mesh as Mesh
from harness.scene.resolved_shapes import Part as Part
from harness.scene.resolved_shapes import PartShape as PartShape
from harness.scene.resolved_shapes import Plane as Plane
from harness.scene.resolved_shapes import Rectangle as Rectangle
from harness.scene.resolved_shapes import SolidShape as SolidShape
from harness.scene.resolved_shapes import Sphere as Sphere
from harness.scene.resolved_shapes import SurfaceShape as SurfaceShape

SCENE_FORMAT: Literal["snellcheck-scene"] = "snellcheck-scene"


# --- patterns: radiance over (u, v) ---------------------------------------------------------------


class Constant(Frozen):
    type: Literal["constant"] = "constant"
    radiance: Rgb


class Checker(Frozen):
    """cells[0] x cells[1] cells; the cell at (0, 0) has radiance `a`, its neighbours `b`."""

    type: Literal["checker"] = "checker"
    a: Rgb
    b: Rgb
    cells: tuple[int, int]


class Ramp(Frozen):
    """start at coordinate 0, end at coordinate 1, linear in between."""

    type: Literal["ramp"] = "ramp"
    start: Rgb
    end: Rgb
    axis: Literal["u", "v"]


class PositionCode(Frozen):
    """amplitude * (c, frac(cells * c), 1) with c = u or v: where did this pixel's ray land?"""

    type: Literal["position_code"] = "position_code"
    axis: Literal["u", "v"]
    cells: int
    amplitude: float


class Picture(Frozen):
    """Nearest-texel image. `pixels` is base64 of little-endian uint16 RGB, row 0 at the top.

    A value k is radiance k / 65535. u = 0 is the left edge, v = 1 the top edge.
    """

    type: Literal["picture"] = "picture"
    width: int
    height: int
    pixels: str


class Panorama(Frozen):
    """What lies in each direction d, d unit: equirectangular, `pixels` as of a picture.

    u = 1/2 + atan2(d_x, -d_z) / 2 pi and v = 1 - acos(d_y) / pi. Radiance is bilinear between the
    middles of the texels, across the seam at u = 0 too, and does not change above the middles of
    the first row and below those of the last.
    """

    type: Literal["panorama"] = "panorama"
    width: int
    height: int
    pixels: str


Pattern = Annotated[Constant | Checker | Ramp | PositionCode | Picture, Field(discriminator="type")]


# --- materials of surfaces that bound no medium ---------------------------------------------------


class Emissive(Frozen):
    """Emits the pattern's radiance in all directions and reflects nothing."""

    type: Literal["emissive"] = "emissive"
    pattern: Pattern


class Diffuse(Frozen):
    """Lambertian, lit by point lights: L = reflectance / pi * I cos(theta) / r^2."""

    type: Literal["diffuse"] = "diffuse"
    reflectance: Rgb


class Phong(Frozen):
    """L = (reflectance cos(theta) + specular cos(alpha)^exponent) E / pi, summed over the lights.

    E is a light's irradiance across its direction, alpha the angle between its mirror direction
    and the viewer. Nothing is seen of lights on the other side.
    """

    type: Literal["phong"] = "phong"
    reflectance: Rgb
    specular: float
    exponent: float


class Mirror(Frozen):
    type: Literal["mirror"] = "mirror"
    reflectance: Rgb


class Translucent(Frozen):
    """The lecture's translucence; rays pass straight through.

    Of the light, ``filter * color + transmit`` passes (the filtered part takes the surface's
    diffuse colour, the transmitted part is untinted) and a Lambertian reflectance of
    ``(1 - filter - transmit) * color`` remains.
    """

    type: Literal["translucent"] = "translucent"
    color: Rgb
    filter: float
    transmit: float


class ThinSlab(Frozen):
    """The lecture's thin face: offsets the ray as a slab of `thickness` would, keeps its direction.

    The face is the slab's front; the slab extends `thickness` behind it. Both sides of it are
    `exterior`.
    """

    type: Literal["thin_slab"] = "thin_slab"
    medium: int
    exterior: int
    thickness: float


Material = Annotated[
    Emissive | Diffuse | Phong | Mirror | Translucent | ThinSlab, Field(discriminator="type")
]


# --- the scene ------------------------------------------------------------------------------------


class Medium(Frozen):
    """`absorption` is Napierian, per scene unit and colour channel: T = exp(-absorption L).

    `ior` holds at all wavelengths, but where there is an Abbe number `abbe`, (n - 1) / (nF - nC):
    there it is the index at the scene's wavelength, and a renderer disperses light by itself.
    """

    name: str
    ior: float
    absorption: Rgb = (0.0, 0.0, 0.0)
    abbe: float | None = None


class Solid(Frozen):
    """`meets` has the indices of solids that overlap it partly or share a face with it.

    A solid inside another has the higher priority of the two.
    """

    name: str
    shape: SolidShape
    medium: int
    exterior: int
    priority: int = 0
    meets: tuple[int, ...] = ()


class Surface(Frozen):
    name: str
    shape: SurfaceShape
    material: Material


class PointLight(Frozen):
    """`intensity` is radiant intensity: irradiance = intensity cos(theta) / r^2."""

    type: Literal["point"] = "point"
    position: Vec3
    intensity: Rgb


class DirectionalLight(Frozen):
    """Travels along the unit vector `direction`; `irradiance` is what faces across it receive."""

    type: Literal["directional"] = "directional"
    direction: Vec3
    irradiance: Rgb


Light = Annotated[PointLight | DirectionalLight, Field(discriminator="type")]


class Film(Frozen):
    """A pixel is the weighed mean of samples, of which each pixel has `samples` squared.

    They are the middles of as many equal squares; with one, a pixel is what its centre sees. With
    `sigma`, in pixels, the weight of a sample is ``max(0, exp(-r^2 / 2 sigma^2) - exp(-8))`` in
    each of x and y, r from the pixel's centre; without, all of the pixel's own count alike. Beyond
    the film's border there are no samples: the others count more.
    """

    width: int = Field(ge=1, le=16384)
    height: int = Field(ge=1, le=16384)
    samples: int = Field(ge=1, le=16, default=1)
    sigma: float | None = None


class Transport(Frozen):
    """How far light is followed.

    `reflection` and `transmission` say which lobes of a dielectric are followed; total internal
    reflection always is. A probe switches lobes off to isolate one path; a renderer that cannot
    follows both and relies on `max_depth`.
    """

    max_depth: int = Field(ge=1)
    min_weight: float = Field(ge=0.0, lt=1.0)
    reflection: bool = True
    transmission: bool = True


class ResolvedScene(Frozen):
    format: Literal["snellcheck-scene"] = SCENE_FORMAT
    version: Literal[1] = 1
    metres_per_unit: float = 1.0
    film: Film
    camera: Camera
    media: tuple[Medium, ...]
    solids: tuple[Solid, ...] = ()
    surfaces: tuple[Surface, ...] = ()
    lights: tuple[Light, ...] = ()
    background: Rgb | Panorama = (0.0, 0.0, 0.0)
    transport: Transport
