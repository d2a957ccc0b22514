"""What a renderer is to the harness: a name, a version, what it can do, and `render`.

A renderer that can also tell where single rays go offers `trace`. All built-in renderers reach
the harness through this protocol and the entry-point group ``snellcheck.renderers``, as a third
party's do.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from harness.scene.resolved import ResolvedScene

Float = NDArray[np.float64]

# Instead of a path's letters: through whatever transmits, and back from whatever does not, until
# the ray lands.
MAIN_WAY = "*"


class Capability(enum.StrEnum):
    """What a renderer claims to model. A scene that needs more is a SKIP with the reason."""

    IMAGE = "image"  # can write images
    RAYS = "rays"  # offers trace()
    MAIN_WAY = "main-way"  # trace() takes MAIN_WAY for a path, and tells what happens on it
    PIXEL_CENTRES = "pixel-centres"  # samples exactly the pixel centre; no noise
    DOUBLE = "double"  # float64 arithmetic; others are taken to be float32
    DOUBLE_DATA = "double-data"  # keeps indices and vertices in float64, too
    LOBE_SWITCH = "lobe-switch"  # honours transport.reflection / .transmission
    SPHERE = "sphere"  # analytic, not tessellated
    CONVEX = "convex"
    CYLINDER = "cylinder"
    CONE = "cone"
    LENS = "lens"  # with spherical or plane faces
    CONIC = "conic"  # lenses of other conics, too
    CSG = "csg"  # unions, intersections and differences of what else it has
    HALF_SPACE = "half-space"  # as parts of these
    MESH = "mesh"
    SMOOTH_MESH = "smooth-mesh"
    PLANE = "plane"  # surfaces that go on for ever
    THIN_SLAB = "thin-slab"  # the lecture's thin face; others are given a real slab
    MIRROR = "mirror"
    DIFFUSE = "diffuse"  # with point lights
    PHONG = "phong"  # diffuse with a highlight
    DIRECTIONAL_LIGHT = "directional-light"
    THIN_LENS = "thin-lens"  # cameras with depth of field, as the mean over the lens says
    TRANSLUCENT = "translucent"
    PICTURE = "picture"
    SAMPLING = "sampling"  # pixels that are weighed means of samples, as the film says
    ENVIRONMENT = "environment"  # a panorama around everything
    ABSORPTION = "absorption"
    DISPERSION = "dispersion"  # by itself, all wavelengths in one picture
    FRESNEL = "fresnel"  # R and T weigh the lobes, unpolarised at each interface
    NESTED = "nested"  # solids inside solids
    PRIORITY = "priority"  # solids that share faces or overlap partly, by their priority
    CAMERA_INSIDE = "camera-inside"  # camera inside a medium
    RADIANCE_N2 = "radiance-n2"  # radiance scales with the square of the index


class Status(enum.IntEnum):
    """How a followed ray ended."""

    HIT = 0  # landed on a surface that bounds no medium
    MISS = 1  # left the scene
    TIR = 2  # the path asked for transmission where there is none
    CUT = 3  # max_depth was reached first


@dataclass(frozen=True)
class Rays:
    """`origins` and unit `directions`, each (n, 3) float64 in world coordinates."""

    origins: Float
    directions: Float


@dataclass(frozen=True)
class RayPaths:
    """Where rays ended that took a given path, e.g. "TT": transmitted at both interfaces.

    `status` (n,) int8 of `Status`; `surface` (n,) int32 index into scene.surfaces or -1;
    `point` (n, 3) where it landed, NaN unless HIT; `direction` (n, 3) last travel direction;
    `weight` (n,) product of Fresnel factors; `optical_length` (n,) sum of ior * length.
    `vertices` (n, k, 3), NaN-padded, and `meetings` (n, k, 3) are there only where the main way is
    asked for: cos_theta_i, cos_theta_t and R at each vertex, NaN where there is none, cos_theta_t
    also in total reflection and at mirrors, R also at what is no interface.
    """

    status: NDArray[np.int8]
    surface: NDArray[np.int32]
    point: Float
    direction: Float
    weight: Float
    optical_length: Float
    vertices: Float | None = None
    meetings: Float | None = None


@dataclass(frozen=True)
class RenderSettings:
    """How to render; what to render is the scene."""

    samples: int = 64  # per pixel, for renderers that sample
    seed: int = 0
    threads: int = 2
    timeout_s: float = 120.0
    memory_mb: int = 4096


@dataclass(frozen=True)
class Image:
    """`pixels` (H, W, 3) float32, linear Rec. 709 radiance, row 0 at the top.

    `variance` (H, W, 3) is the estimated variance of each pixel's mean where the renderer
    samples, else None. `closest` (H, W) is the shortest way between two surfaces, in scene units,
    on any ray of the pixel whose loss would show; None where the renderer does not tell. `cut` is
    the mean over the pixels of the weight that was not followed, for min_weight or max_depth; None
    where the renderer does not tell.
    """

    pixels: NDArray[np.float32]
    variance: NDArray[np.float32] | None = None
    seconds: float = 0.0  # the renderer's own time, start-up excluded where it says so
    log: str = ""
    command: str = ""  # what was run, for people to run again
    closest: NDArray[np.float32] | None = None
    cut: float | None = None


@dataclass(frozen=True)
class Health:
    """What `snellcheck doctor` found. `remedy` is the command that mends what is wrong."""

    name: str
    usable: bool
    version: str = ""
    path: str = ""
    detail: str = ""
    remedy: str = ""
    facts: dict[str, str] = field(default_factory=dict)


@runtime_checkable
class Renderer(Protocol):
    """The one seam between harness and renderers.

    A renderer may also have `concurrency`, how many renders at a time serve it best (1 where it
    says nothing), and `close()`, which ends its process. `translates` is true where `emit` writes
    another language than scene.json without starting anything: then the run keeps what it writes
    beside the records. `fingerprint()` is what its results may be
    kept under from run to run: a text that changes whenever an image might, told without starting
    the renderer, or None where that cannot be known.
    """

    @property
    def name(self) -> str: ...

    @property
    def capabilities(self) -> frozenset[Capability]: ...

    def version(self) -> str:
        """Version of the renderer. Raises RendererMissing where it is not installed."""
        ...

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        """Raises RendererMissing, RendererUnsupported or RendererFailed."""
        ...

    def health(self) -> Health:
        """Probes with a real tiny render in a child process. Never raises."""
        ...

    def emit(self, scene: ResolvedScene, folder: Path) -> Path:
        """Writes what the renderer would be given into `folder`; returns the main file."""
        ...


@runtime_checkable
class RayTracingRenderer(Renderer, Protocol):
    """A renderer with a ray API (`Capability.RAYS`)."""

    def trace(
        self, scene: ResolvedScene, rays: Rays, path: str, settings: RenderSettings
    ) -> RayPaths:
        """Follows each ray along `path`, a letter per interface: T transmit, R reflect.

        After the last letter the ray must land on a surface; interfaces beyond the path are CUT.
        Who claims `Capability.MAIN_WAY` is asked for that, too.
        """
        ...
