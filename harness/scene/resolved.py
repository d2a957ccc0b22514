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

Triple = tuple[int, int, int]

SCENE_FORMAT: Literal["snellcheck-scene"] = "snellcheck-scene"


class Frame(Frozen):
    """An orthonormal right-handed frame in world coordinates: p = origin + a x + b y + c z."""

    origin: Vec3
    x: Vec3
    y: Vec3
    z: Vec3


# --- shapes -------------------------------------------------------------------------------------


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
