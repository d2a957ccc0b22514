"""ResolvedScene -> tracer.scene.Scene: a change of names, never of numbers."""

from __future__ import annotations

import math

import numpy as np

import tracer.camera
import tracer.film
import tracer.mesh
import tracer.patterns
import tracer.scene
import tracer.shapes
import tracer.solids
from harness.scene import resolved
from harness.scene.regions import along, opposite
from harness.translate.texels import radiance_of


def translate(scene: resolved.ResolvedScene) -> tracer.scene.Scene:
    """The scene as our tracer reads it. Raises tracer.errors.SceneError for what it refuses."""
    media = [tracer.scene.Medium(m.ior, m.absorption) for m in scene.media]
    transport = scene.transport
    return tracer.scene.Scene(
        camera=_camera(scene.camera),
        solids=tuple(
            tracer.scene.Solid(_solid_shape(s.shape), media[s.medium], s.priority, s.name)
            for s in scene.solids
        ),
        surfaces=tuple(
            tracer.scene.Surface(_shape(s.shape), _material(s.material, media), s.name)
            for s in scene.surfaces
        ),
        lights=tuple(
            tracer.scene.PointLight(light.position, light.intensity)
            if isinstance(light, resolved.PointLight)
            else tracer.scene.DirectionalLight(light.direction, light.irradiance)
            for light in scene.lights
        ),
        background=_background(scene.background),
        ambient=media[0],
        transport=tracer.scene.Transport(
            max_depth=transport.max_depth,
            min_weight=transport.min_weight,
            reflection=transport.reflection,
            transmission=transport.transmission,
        ),
    )


def sampling(film: resolved.Film) -> tracer.film.Sampling:
    """How the film's pixels are sampled."""
    if film.sigma is None:
        return tracer.film.Sampling(film.samples)
    return tracer.film.Sampling(film.samples, tracer.film.Gaussian(film.sigma))


def _background(
    background: resolved.Rgb | resolved.Panorama,
) -> resolved.Rgb | tracer.patterns.Picture:
    if isinstance(background, resolved.Panorama):
        return tracer.patterns.Picture(radiance_of(background))
    return background


def _camera(camera: resolved.Camera) -> tracer.camera.Camera:
    axes = camera.origin, camera.right, camera.up, camera.forward
    match camera:
        case resolved.Perspective():
            return tracer.camera.Perspective(*axes, camera.tan_half_fov_x)
        case resolved.Orthographic():
            return tracer.camera.Orthographic(*axes, camera.width)
        case resolved.ThinLens():
            lens = camera.aperture, camera.focus, camera.lens_samples
            return tracer.camera.ThinLens(*axes, camera.tan_half_fov_x, *lens)


def _solid_shape(shape: resolved.SolidShape) -> tracer.scene.SolidShape:
    if isinstance(shape, resolved.Mesh):
        normals = None if shape.normals is None else np.array(shape.normals, float)
        return tracer.mesh.Mesh(
            np.array(shape.vertices, float), np.array(shape.triangles, np.int64), normals
        )
    return _analytic(shape)


def _part(shape: resolved.Part) -> tracer.solids.Part:
    return _plane(shape) if isinstance(shape, resolved.Plane) else _analytic(shape)


def _plane(shape: resolved.Plane) -> tracer.shapes.Plane:
    return tracer.shapes.Plane(shape.normal, shape.offset)


def _analytic(shape: resolved.Analytic) -> tracer.solids.Analytic:
    match shape:
        case resolved.Sphere():
            return tracer.shapes.Sphere(shape.center, shape.radius)
        case resolved.Convex():
            planes = [tracer.shapes.Plane((x, y, z), d) for x, y, z, d in shape.planes]
            return tracer.solids.polyhedron(planes, list(shape.vertices))
        case resolved.Cylinder():
            frame = shape.frame
            return tracer.solids.cylinder(frame.origin, frame.z, shape.radius, shape.height)
        case resolved.Cone(frame=frame):
            top = along(frame.origin, shape.height, frame.z)
            down = opposite(frame.z)
            return tracer.solids.cone(top, down, shape.radius, shape.height, shape.top_radius)
        case resolved.Lens(frame=frame):
            first, second = (math.inf if r is None else r for r in shape.radii)
            return tracer.solids.lens(
                frame.origin,
                frame.z,
                (first, second),
                shape.thickness,
                shape.aperture,
                shape.conics,
            )
        case resolved.Csg():
            return _composed(shape)


def _composed(shape: resolved.Csg) -> tracer.solids.Compound:
    first, *others = map(_part, shape.parts)
    match shape.operation:
        case "union":
            return tracer.solids.union(first, *others)
        case "intersection":
            return tracer.solids.intersection(first, *others)
        case "difference":
            return tracer.solids.difference(first, *others)


def _shape(shape: resolved.SurfaceShape) -> tracer.scene.Shape:
    match shape:
        case resolved.Rectangle(frame=f):
            return tracer.shapes.Rectangle(f.origin, f.x, f.y, f.z, shape.size)
        case resolved.Disk(frame=f):
            return tracer.shapes.Disk(f.origin, f.x, f.y, f.z, shape.radius)
        case resolved.Plane():
            return _plane(shape)
        case _:
            return _solid_shape(shape)


def _material(
    material: resolved.Material, media: list[tracer.scene.Medium]
) -> tracer.scene.Material:
    match material:
        case resolved.Emissive():
            return tracer.scene.Emissive(_pattern(material.pattern))
        case resolved.Diffuse():
            return tracer.scene.Diffuse(material.reflectance)
        case resolved.Phong():
            return tracer.scene.Phong(material.reflectance, material.specular, material.exponent)
        case resolved.Mirror():
            return tracer.scene.Mirror(material.reflectance)
        case resolved.Translucent():
            return tracer.scene.Translucent(material.color, material.filter, material.transmit)
        case resolved.ThinSlab():
            return tracer.scene.ThinSlab(
                media[material.medium], material.thickness, media[material.exterior]
            )


def _pattern(pattern: resolved.Pattern) -> tracer.patterns.Pattern:
    match pattern:
        case resolved.Constant():
            return tracer.patterns.Constant(pattern.radiance)
        case resolved.Checker():
            return tracer.patterns.Checker(pattern.a, pattern.b, pattern.cells)
        case resolved.Ramp():
            return tracer.patterns.Ramp(pattern.start, pattern.end, pattern.axis)
        case resolved.PositionCode():
            return tracer.patterns.PositionCode(pattern.axis, pattern.cells, pattern.amplitude)
        case resolved.Picture():
            return tracer.patterns.Picture(radiance_of(pattern))
