"""What a scene is made of, in words; `arrays.flatten` turns it into numbers for the kernels."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from tracer.camera import Camera
from tracer.errors import SceneError
from tracer.mesh import Mesh
from tracer.patterns import Pattern, Picture
from tracer.shapes import Disk, Plane, Rectangle, Sphere
from tracer.solids import Cell, Compound
from tracer.spectrum import LINE_D, Dispersion
from tracer.vector import Vec

SolidShape = Sphere | Cell | Compound | Mesh
Shape = SolidShape | Rectangle | Disk | Plane


@dataclass(frozen=True)
class Medium:
    """`ior` is the absolute index; light decays as ``exp(-absorption * length)`` per colour.

    A medium that disperses has a formula for an index, which is taken at the scene's wavelength.
    """

    ior: float | Dispersion
    absorption: Vec = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if isinstance(self.ior, float | int) and not (0.0 < self.ior < math.inf):
            raise SceneError(f"an index of refraction must be positive, not {self.ior}")
        if not all(0.0 <= a < math.inf for a in self.absorption):
            raise SceneError(f"absorption must be at least 0 and finite, not {self.absorption}")

    def index(self, wavelength_nm: float) -> float:
        """The index of refraction at a wavelength. Raises SceneError where the formula has none."""
        if isinstance(self.ior, float | int):
            return float(self.ior)
        return self.ior.ior(wavelength_nm)


VACUUM = Medium(1.0)


def _require_end(shape: Shape, name: str) -> None:
    if isinstance(shape, Compound) and not math.isfinite(shape.radius):
        raise SceneError(f"{name}: goes on for ever; half-spaces must cut something that ends")


@dataclass(frozen=True)
class Solid:
    """A closed shape filled with `medium`.

    Where solids overlap, the one of highest `priority` is there; of equal ones the smallest, so
    that what lies wholly inside another needs none. Faces that two solids share are one interface
    between their media.
    """

    shape: SolidShape
    medium: Medium
    priority: int = 0
    name: str = "solid"

    def __post_init__(self) -> None:
        _require_end(self.shape, self.name)


@dataclass(frozen=True)
class Emissive:
    """Emits the pattern's radiance in all directions and reflects nothing."""

    pattern: Pattern


@dataclass(frozen=True)
class Diffuse:
    """Lambertian, lit by the scene's lights: L = reflectance / pi * E, E their irradiance."""

    reflectance: Vec


@dataclass(frozen=True)
class Phong:
    """Lambertian with a highlight around the mirror direction of each light.

    ``L = (reflectance cos(theta) + specular cos(alpha)^exponent) I / (pi r^2)`` with alpha between
    the mirror direction and the viewer: B. T. Phong, Comm. ACM 18, 1975, in the scale of `Diffuse`.
    The highlight has the light's colour. It is a model of looks and conserves no energy.
    """

    reflectance: Vec
    specular: float
    exponent: float

    def __post_init__(self) -> None:
        if not (0.0 <= self.specular < math.inf and 0.0 <= self.exponent < math.inf):
            raise SceneError(
                "a highlight needs a specular and an exponent of at least 0, "
                f"not {self.specular} and {self.exponent}"
            )


@dataclass(frozen=True)
class Mirror:
    reflectance: Vec = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Translucent:
    """The lecture's translucence: ``filter * color + transmit`` passes straight through, and
    ``(1 - filter - transmit) * color`` remains as a Lambertian reflectance.
    """

    color: Vec
    filter: float
    transmit: float

    def __post_init__(self) -> None:
        passing = self.filter + self.transmit
        if not (self.filter >= 0.0 and self.transmit >= 0.0 and passing <= 1.0 + 1e-12):
            raise SceneError(
                "filter and transmit must be at least 0 and together at most 1, "
                f"not {self.filter} and {self.transmit}"
            )


@dataclass(frozen=True)
class ThinSlab:
    """The lecture's thin face: shifts the ray as a slab behind it would, keeps its direction."""

    medium: Medium
    thickness: float
    exterior: Medium = VACUUM

    def __post_init__(self) -> None:
        if not (0.0 < self.thickness < math.inf):
            raise SceneError(f"a thin slab's thickness must be positive, not {self.thickness}")


Material = Emissive | Diffuse | Phong | Mirror | Translucent | ThinSlab


@dataclass(frozen=True)
class Surface:
    shape: Shape
    material: Material
    name: str = "surface"

    def __post_init__(self) -> None:
        _require_end(self.shape, self.name)


@dataclass(frozen=True)
class PointLight:
    position: Vec
    intensity: Vec  # radiant intensity

    def __post_init__(self) -> None:
        if not all(math.isfinite(x) for x in (*self.position, *self.intensity)):
            raise SceneError(f"a light needs finite numbers, not {self}")


@dataclass(frozen=True)
class DirectionalLight:
    """Light from far away that travels along the unit vector `direction`.

    `irradiance` is what a surface at right angles to it receives.
    """

    direction: Vec
    irradiance: Vec

    def __post_init__(self) -> None:
        if abs(math.hypot(*self.direction) - 1.0) > 1e-9 or not all(
            map(math.isfinite, self.irradiance)
        ):
            raise SceneError(f"a light needs a unit direction and finite numbers, not {self}")


@dataclass(frozen=True)
class Transport:
    """How far light is followed.

    `max_depth` counts path segments, camera to first surface is 1; rays that carry less than
    `min_weight` are cut. The lobes of dielectrics can be switched off; total internal reflection
    cannot. `radiance_n2` scales radiance with the square of the index, as it does in nature; the
    factor cancels where camera and emitter are in media of the same index.
    """

    max_depth: int = 40
    min_weight: float = 1e-6
    reflection: bool = True
    transmission: bool = True
    radiance_n2: bool = False

    def __post_init__(self) -> None:
        if self.max_depth < 1:
            raise SceneError(f"max_depth must be at least 1, not {self.max_depth}")
        if not (0.0 <= self.min_weight < 1.0):
            raise SceneError(f"min_weight must be at least 0 and below 1, not {self.min_weight}")


@dataclass(frozen=True)
class Scene:
    """`wavelength`, in nm, is what media that disperse are taken at.

    `background` is what rays see that leave the scene: a radiance, or a picture of all around.

    Such a picture is an equirectangular panorama: its middle lies along -z, +x is to the right of
    it, and its top row is above (+y).
    """

    camera: Camera
    solids: tuple[Solid, ...] = ()
    surfaces: tuple[Surface, ...] = ()
    lights: tuple[PointLight | DirectionalLight, ...] = ()
    background: Vec | Picture = (0.0, 0.0, 0.0)
    ambient: Medium = VACUUM  # around all solids
    wavelength: float = LINE_D
    transport: Transport = field(default_factory=Transport)
