"""Lengths for single precision: Mitsuba loses thin and small things, and coarse large ones.

Mitsuba's rays leave a surface with an offset of about 1e-4 units, and its positions are single
precision floats. The translator therefore multiplies all lengths by a power of two, which no
float notices, so that the thinnest solid is between `THINNEST` and `THICKEST` units thick.
"""

from __future__ import annotations

import math

from harness.scene import resolved as rs
from harness.scene.regions import thickness

# 600 of Mitsuba's offsets (1e-4): thinner solids would be shifted or swallowed.
THINNEST = 1 / 16
# A float of 16 units has a spacing of 2e-6, a hundredth of the offset: larger scenes would see
# rays hit the surface that they leave.
THICKEST = 8.0


def length_scale(scene: rs.ResolvedScene) -> float:
    """The power of two by which `describe` multiplies lengths; 1 for scenes of ordinary size."""
    thinnest = min((thickness(solid.shape) for solid in scene.solids), default=1.0)
    if thinnest < THINNEST:
        return 2.0 ** math.ceil(math.log2(THINNEST / thinnest))
    if thinnest > THICKEST:
        return 2.0 ** -math.ceil(math.log2(thinnest / THICKEST))
    return 1.0


def scaled(scene: rs.ResolvedScene, factor: float) -> rs.ResolvedScene:
    """The same scene with all lengths times `factor`: the same image."""
    if factor == 1.0:
        return scene
    camera = scene.camera.model_copy(update={"origin": _times(scene.camera.origin, factor)})
    if isinstance(camera, rs.Orthographic):
        camera = camera.model_copy(update={"width": camera.width * factor})
    elif isinstance(camera, rs.ThinLens):
        lens = {"aperture": camera.aperture * factor, "focus": camera.focus * factor}
        camera = camera.model_copy(update=lens)
    return scene.model_copy(
        update={
            "metres_per_unit": scene.metres_per_unit / factor,
            "camera": camera,
            "media": tuple(
                m.model_copy(update={"absorption": _times(m.absorption, 1 / factor)})
                for m in scene.media
            ),
            "solids": tuple(
                s.model_copy(update={"shape": _scaled_shape(s.shape, factor)}) for s in scene.solids
            ),
            "surfaces": tuple(_scaled_surface(s, factor) for s in scene.surfaces),
            "lights": tuple(_scaled_light(light, factor) for light in scene.lights),
        }
    )


def _times(vector: rs.Vec3, factor: float) -> rs.Vec3:
    x, y, z = vector
    return x * factor, y * factor, z * factor


def _scaled_light(light: rs.Light, factor: float) -> rs.Light:
    """Irradiance goes with intensity over distance squared."""
    if isinstance(light, rs.DirectionalLight):
        return light
    intensity = _times(light.intensity, factor**2)
    position = _times(light.position, factor)
    return light.model_copy(update={"position": position, "intensity": intensity})


def _scaled_frame(frame: rs.Frame, factor: float) -> rs.Frame:
    return frame.model_copy(update={"origin": _times(frame.origin, factor)})


def _scaled_surface(surface: rs.Surface, factor: float) -> rs.Surface:
    material = surface.material
    if isinstance(material, rs.ThinSlab):
        material = material.model_copy(update={"thickness": material.thickness * factor})
    shape = _scaled_shape(surface.shape, factor)
    return surface.model_copy(update={"shape": shape, "material": material})


def _scaled_shape(shape: rs.SurfaceShape, factor: float) -> rs.SurfaceShape:
    match shape:
        case rs.Sphere():
            update = {"center": _times(shape.center, factor), "radius": shape.radius * factor}
        case rs.Convex():
            update = {
                "planes": tuple((x, y, z, d * factor) for x, y, z, d in shape.planes),
                "vertices": tuple(_times(v, factor) for v in shape.vertices),
            }
        case rs.Mesh():
            update = {"vertices": tuple(_times(v, factor) for v in shape.vertices)}
        case rs.Cylinder():
            update = {
                "frame": _scaled_frame(shape.frame, factor),
                "radius": shape.radius * factor,
                "height": shape.height * factor,
            }
        case rs.Cone():
            update = {
                "frame": _scaled_frame(shape.frame, factor),
                "radius": shape.radius * factor,
                "top_radius": shape.top_radius * factor,
                "height": shape.height * factor,
            }
        case rs.Lens():
            update = {
                "frame": _scaled_frame(shape.frame, factor),
                "thickness": shape.thickness * factor,
                "radii": tuple(None if r is None else r * factor for r in shape.radii),
                "aperture": shape.aperture * factor,
            }
        case rs.Csg():
            update = {"parts": tuple(_scaled_shape(part, factor) for part in shape.parts)}
        case rs.Rectangle():
            width, height = shape.size
            update = {
                "frame": _scaled_frame(shape.frame, factor),
                "size": (width * factor, height * factor),
            }
        case rs.Plane():
            update = {"offset": shape.offset * factor}
        case rs.Disk():
            update = {
                "frame": _scaled_frame(shape.frame, factor),
                "radius": shape.radius * factor,
            }
    return shape.model_copy(update=update)
