"""How a scene is fitted to what POV-Ray can hold: lengths to its hit floor, light to 16 bits.

POV-Ray drops hits nearer than 1e-4 units and shadows nearer than 1e-3, whatever the scene's size,
so lengths are multiplied by a power of two, which no number notices. Its 16-bit images clip at 1,
so radiance is multiplied by the `exposure`, which is undone after reading.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from harness.errors import RendererUnsupported
from harness.scene import resolved as rs
from harness.scene.containment import bounds, signed_distance
from harness.scene.regions import thickness

# configbackend.h of POV-Ray 3.7: MIN_ISECT_DEPTH, SMALL_TOLERANCE, MAX_DISTANCE.
HIT_FLOOR = 1e-4
SHADOW_FLOOR = 1e-3
FAR = 1e7
# Scenes are scaled to reach this far from the world's origin: the hit floor is then 1.5e-9 of the
# scene, so that hardly a ray is lost near the edges of prisms and slabs (at 1e-7 two of 65,536 in
# the complete package were), and still 1e6 times what double precision rounds there.
REACH = 65536.0
# And this far where solids reach into each other, by a few hit floors (see `povray_contact`).
REACH_IN_CONTACT = 8 * REACH
# And no further where a plane goes on for ever. POV-Ray's ends at `FAR`, 4e4 times as far as the
# rest: the horizon is lower by some 1e-5 of the angle at which the scene is seen.
REACH_WITH_PLANES = 256.0
# Nothing may be thinner than this many hit floors.
FLOORS = 1000


def length_scale(scene: rs.ResolvedScene) -> float:
    """The power of two by which the translator multiplies lengths.

    The scene is made to reach `REACH` units or less, `REACH_IN_CONTACT` where solids meet, or
    `REACH_WITH_PLANES` where it goes on for ever; larger, up to a tenth of `FAR`, only where a
    solid would be thinner than `FLOORS` hit floors.
    Raises RendererUnsupported where no scale gives both.
    """
    reach = max(_extents(scene), default=1.0) or 1.0
    aim = REACH_IN_CONTACT if any(solid.meets for solid in scene.solids) else REACH
    if any(isinstance(surface.shape, rs.Plane) for surface in scene.surfaces):
        aim = REACH_WITH_PLANES
    factor = 2.0 ** math.floor(math.log2(aim / reach))
    thinnest = min((thickness(solid.shape) for solid in scene.solids), default=math.inf)
    if thinnest * factor < FLOORS * HIT_FLOOR:
        factor = 2.0 ** math.ceil(math.log2(FLOORS * HIT_FLOOR / thinnest))
        if reach * factor > FAR / 10:
            raise RendererUnsupported(
                f"a solid {thinnest:g} units thick in a scene {reach:g} units wide: POV-Ray "
                f"ignores hits nearer than {HIT_FLOOR:g} and farther than {FAR:g} units"
            )
    return factor


def extent(scene: rs.ResolvedScene) -> float:
    """No coordinate of anything in the scene is larger."""
    return max(_extents(scene))


def _extents(scene: rs.ResolvedScene) -> Iterator[float]:
    """Upper bounds of the coordinates of all that is in the scene."""
    yield float(np.abs(scene.camera.origin).max())
    for light in scene.lights:
        if isinstance(light, rs.PointLight):
            yield float(np.abs(light.position).max())
    for solid in scene.solids:
        yield _extent(solid.shape)
    for surface in scene.surfaces:
        yield _extent(surface.shape)


def _extent(shape: rs.SurfaceShape) -> float:
    match shape:
        case rs.Sphere():
            return float(np.abs(shape.center).max()) + shape.radius
        case rs.Convex() | rs.Mesh():
            return float(np.abs(shape.vertices).max())
        case rs.Cylinder():
            return float(np.abs(shape.frame.origin).max()) + shape.radius + shape.height / 2
        case rs.Cone() | rs.Lens() | rs.Csg():
            return float(np.abs(bounds(shape)).max())
        case rs.Plane():
            return abs(shape.offset)
        case rs.Rectangle():
            return float(np.abs(shape.frame.origin).max()) + math.hypot(*shape.size) / 2
        case rs.Disk():
            return float(np.abs(shape.frame.origin).max()) + shape.radius


def exposure(scene: rs.ResolvedScene) -> float:
    """What radiance is multiplied by so that the brightest point that there can be is 1.

    Mirrors, dielectrics and translucent faces pass on weighted means of what they see (their
    weights sum to at most 1), so the brightest thing that emits or is lit bounds every pixel.
    Raises RendererUnsupported where a light touches a lit surface: nothing bounds its radiance.
    """
    around = scene.background
    furthest = 1.0 if isinstance(around, rs.Panorama) else max(around)
    bounds = [furthest, *(_brightest(scene, surface) for surface in scene.surfaces)]
    brightest = max(bounds)
    return 1.0 / brightest if brightest > 0 else 1.0


def _brightest(scene: rs.ResolvedScene, surface: rs.Surface) -> float:
    match surface.material:
        case rs.Emissive(pattern=pattern):
            return _brightest_radiance(pattern)
        case rs.Diffuse(reflectance=reflectance):
            return _brightest_lit(scene, surface.shape, reflectance)
        case rs.Phong(reflectance=(r, g, b), specular=glint):
            return _brightest_lit(scene, surface.shape, (r + glint, g + glint, b + glint))
        case rs.Translucent(color=color):
            return _brightest_lit(scene, surface.shape, color)
    return 0.0


def _brightest_radiance(pattern: rs.Pattern) -> float:
    match pattern:
        case rs.Constant():
            return max(pattern.radiance)
        case rs.Checker():
            return max(*pattern.a, *pattern.b)
        case rs.Ramp():
            return max(*pattern.start, *pattern.end)
        case rs.PositionCode():
            return pattern.amplitude
        case rs.Picture():
            return 1.0  # so that, where nothing is brighter, 16-bit texels stay what they are


def _brightest_lit(scene: rs.ResolvedScene, shape: rs.SurfaceShape, reflectance: rs.Rgb) -> float:
    """The bound reflectance / pi * sum of intensity / distance^2, over the nearest points."""
    radiance = np.zeros(3)
    for light in scene.lights:
        if isinstance(light, rs.DirectionalLight):
            radiance += np.array(reflectance) / math.pi * np.array(light.irradiance)
            continue
        distance = _distance(shape, np.array([light.position]))
        if distance <= 0.0:
            raise RendererUnsupported("a point light touches or is inside a surface that it lights")
        radiance += np.array(reflectance) / math.pi * np.array(light.intensity) / distance**2
    return float(radiance.max())


def _distance(shape: rs.SurfaceShape, point: np.ndarray) -> float:
    """Lower bound of the distance of `point` (1, 3) from the shape's surface."""
    if not isinstance(shape, rs.Rectangle | rs.Disk):
        return float(abs(signed_distance(shape, point)[0]))
    frame = shape.frame
    x, y, z = (point[0] - np.array(frame.origin)) @ np.array([frame.x, frame.y, frame.z]).T
    if isinstance(shape, rs.Disk):
        return math.hypot(max(math.hypot(x, y) - shape.radius, 0.0), z)
    outside = [max(abs(c) - s / 2, 0.0) for c, s in zip((x, y), shape.size, strict=True)]
    return math.hypot(*outside, z)
