"""From a case to numbers: frames, solids, media and film, as every renderer is given them."""

from __future__ import annotations

import math
from pathlib import Path

from harness.scene import model, resolved
from harness.scene.crosscheck import AIR
from harness.scene.dispersion import abbe_number, index, wavelengths
from harness.scene.findings import Attempts, Finding, SceneInvalid, input_error, quoted
from harness.scene.load import LoadedCase
from harness.scene.meshfile import parts_left_out
from harness.scene.nesting import nested
from harness.scene.resolved import ResolvedScene
from harness.scene.shapes import rectangle, slab, solid_shape, surface_shape
from harness.scene.vectors import PARALLEL, combination, cross, length, unit


def resolve(case: LoadedCase) -> ResolvedScene:
    """The scene of a case in numbers, without its probes.

    Raises InputError with file, line and key of everything that has no meaning: frames without
    direction, meshes that are not closed, solids that overlap, a camera in an unsaid medium.
    """
    try:
        return _resolve(case.model, case.file.parent)
    except SceneInvalid as error:
        raise input_error(error.findings, case.file) from None


def spectral_media(case: LoadedCase) -> tuple[tuple[float, tuple[resolved.Medium, ...]], ...]:
    """The scene's media at each wavelength of its spectrum; empty where it has none.

    Raises InputError as `resolve` does.
    """
    spectrum = case.model.spectrum
    if spectrum is None:
        return ()
    attempts = Attempts()
    try:
        found = attempts.attempt(("spectrum",), wavelengths, spectrum) or ()
        attempts.raise_any()
        return tuple((w, _media(case.model, w)[0]) for w in found)
    except SceneInvalid as error:
        raise input_error(error.findings, case.file) from None


def probe_planes(probe: model.Probe) -> tuple[resolved.Rectangle, ...]:
    """The rectangles on which a probe's rays are caught."""
    return tuple(map(rectangle, probe.planes))


def _resolve(case: model.Case, folder: Path) -> ResolvedScene:
    attempts = Attempts()
    media, medium_of = _media(case, case.wavelength)
    shapes = [
        attempts.attempt(("solids", k, "shape"), solid_shape, solid.shape, folder)
        for k, solid in enumerate(case.solids)
    ]
    faces = [
        attempts.attempt(("surfaces", k, "shape"), surface_shape, surface.shape, folder)
        for k, surface in enumerate(case.surfaces)
    ]
    materials = [
        attempts.attempt(("surfaces", k, "material"), _material, surface, medium_of, folder)
        for k, surface in enumerate(case.surfaces)
    ]
    for k, probe in enumerate(case.probes):
        for i, plane in enumerate(probe.planes):
            attempts.attempt(("probes", k, "planes", i), rectangle, plane)
    camera = attempts.attempt(("camera",), _camera, case.camera)
    background = attempts.attempt(("environment",), _environment, case.environment, folder)
    lights = [attempts.attempt(("lights", k), _light, light) for k, light in enumerate(case.lights)]
    if not attempts.findings:
        attempts.findings += parts_left_out(case, folder)
    attempts.raise_any()
    assert camera is not None
    surfaces = tuple(
        resolved.Surface(name=surface.name, shape=shape, material=material)
        for surface, shape, material in zip(case.surfaces, faces, materials, strict=True)
        if shape is not None and material is not None
    )
    scene = ResolvedScene(
        metres_per_unit=case.metres_per_unit,
        film=_film(case.film),
        camera=camera,
        media=media,
        solids=tuple(
            resolved.Solid(name=solid.name, shape=shape, medium=medium_of[solid.medium], exterior=0)
            for solid, shape in zip(case.solids, shapes, strict=True)
            if shape is not None
        ),
        surfaces=surfaces,
        lights=tuple(light for light in lights if light is not None),
        background=background if background is not None else case.background,
        transport=resolved.Transport(
            max_depth=case.transport.max_depth, min_weight=case.transport.min_weight
        ),
    )
    return nested(scene, case.camera.medium, [solid.priority for solid in case.solids])


# --- parts ----------------------------------------------------------------------------------------


def _media(
    case: model.Case, wavelength: float
) -> tuple[tuple[resolved.Medium, ...], dict[str, int]]:
    """The media, air first unless the scene says what its air is; and their indices by name."""
    defined = {AIR: model.Medium(ior=1.0), **case.media}
    attempts = Attempts()
    air = attempts.attempt(("media", AIR), index, defined[AIR], wavelength, 1.0)
    iors = {
        name: attempts.attempt(("media", name), index, medium, wavelength, air or 1.0)
        for name, medium in defined.items()
        if name != AIR
    }
    attempts.raise_any()
    iors[AIR] = air
    abbe = {
        name: abbe_number(medium, wavelength, defined[AIR]) if case.transport.dispersion else None
        for name, medium in defined.items()
    }
    media = tuple(
        resolved.Medium(
            name=name, ior=iors[name] or 1.0, absorption=medium.absorption, abbe=abbe[name]
        )
        for name, medium in defined.items()
    )
    return media, {name: k for k, name in enumerate(defined)}


def _camera(camera: model.Camera) -> resolved.Camera:
    (ox, oy, oz), (tx, ty, tz) = camera.origin, camera.target
    forward = unit((tx - ox, ty - oy, tz - oz))
    if forward is None:
        target = quoted(list(camera.target))
        raise SceneInvalid(Finding(("target",), "is where the camera's origin is", target))
    across = cross(forward, camera.up)
    right = unit(across)
    if right is None or length(across) < PARALLEL * length(camera.up):
        raise SceneInvalid(
            Finding(
                ("up",) if "up" in camera.model_fields_set else (),
                "up is zero or parallel to the direction of view",
                f"up = {quoted(list(camera.up))}",
                "an up across the direction of view, such as [0, 0, -1] to look down",
            )
        )
    up = cross(right, forward)
    stand = {"origin": camera.origin, "right": right, "up": up, "forward": forward}
    match camera:
        case model.OrthographicCamera():
            return resolved.Orthographic.model_validate({**stand, "width": camera.width})
        case model.PerspectiveCamera():
            half = math.tan(math.radians(camera.fov_x / 2))
            return resolved.Perspective.model_validate({**stand, "tan_half_fov_x": half})
        case model.ThinLensCamera():
            half = math.tan(math.radians(camera.fov_x / 2))
            lens = {
                "aperture": camera.aperture,
                "focus": camera.focus,
                "lens_samples": camera.lens_samples,
            }
            return resolved.ThinLens.model_validate({**stand, "tan_half_fov_x": half, **lens})


def _film(film: model.Film) -> resolved.Film:
    gaussian = film.filter if isinstance(film.filter, model.GaussianFilter) else None
    if gaussian is not None and film.samples == 1:
        message = "weighs samples, of which there is one at the pixel's centre"
        raise SceneInvalid(Finding(("film", "filter"), message, None, "film.samples of 2 or more"))
    return resolved.Film(
        width=film.width,
        height=film.height,
        samples=film.samples,
        sigma=None if gaussian is None else gaussian.sigma,
    )


def _environment(environment: model.Environment | None, folder: Path) -> resolved.Panorama | None:
    if environment is None:
        return None
    from harness.scene.pictures import read_picture

    seen = read_picture(folder, environment.file, environment.encoding)
    return resolved.Panorama(width=seen.width, height=seen.height, pixels=seen.pixels)


def _light(light: model.Light) -> resolved.Light:
    if isinstance(light, model.PointLight):
        return resolved.PointLight(position=light.position, intensity=light.intensity)
    direction = unit(light.direction)
    if direction is None:
        raise SceneInvalid(
            Finding(("direction",), "has no direction", quoted(list(light.direction)))
        )
    return resolved.DirectionalLight(direction=direction, irradiance=light.irradiance)


def _material(surface: model.Surface, medium_of: dict[str, int], folder: Path) -> resolved.Material:
    flat = isinstance(surface.shape, model.Rectangle | model.Disk)
    match surface.material:
        case model.Emissive(pattern=pattern):
            if not flat and not isinstance(pattern, model.Constant):
                raise SceneInvalid(
                    Finding(
                        ("pattern", "type"),
                        f"a pattern has no place on a {surface.shape.type}",
                        quoted(pattern.type),
                        "constant, or a rectangle or disk as the shape",
                    )
                )
            return resolved.Emissive(pattern=_pattern(pattern, folder))
        case model.Diffuse(reflectance=reflectance):
            return resolved.Diffuse(reflectance=reflectance)
        case model.Phong() as phong:
            return resolved.Phong(
                reflectance=phong.reflectance, specular=phong.specular, exponent=phong.exponent
            )
        case model.Mirror(reflectance=reflectance):
            return resolved.Mirror(reflectance=reflectance)
        case model.Translucent() as translucent:
            if translucent.filter + translucent.transmit > 1:
                total = f"{translucent.filter:g} + {translucent.transmit:g}"
                raise SceneInvalid(Finding(("transmit",), "filter + transmit above 1", total))
            return resolved.Translucent(
                color=translucent.color,
                filter=translucent.filter,
                transmit=translucent.transmit,
            )
        case model.ThinSlab() as face:
            if not flat:
                kind = quoted(surface.shape.type)
                raise SceneInvalid(
                    Finding(("type",), "a thin slab is flat", kind, "a rectangle or disk")
                )
            return resolved.ThinSlab(
                medium=medium_of[face.medium], exterior=0, thickness=face.thickness
            )


def _pattern(pattern: model.Pattern, folder: Path) -> resolved.Pattern:
    match pattern:
        case model.Constant():
            return resolved.Constant(radiance=pattern.radiance)
        case model.Checker():
            return resolved.Checker(a=pattern.a, b=pattern.b, cells=pattern.cells)
        case model.Ramp():
            return resolved.Ramp(start=pattern.start, end=pattern.end, axis=pattern.axis)
        case model.Picture():
            from harness.scene.pictures import read_picture

            try:
                return read_picture(folder, pattern.file, pattern.encoding)
            except SceneInvalid as error:
                below = (finding.below(("pattern",)) for finding in error.findings)
                raise SceneInvalid(*below) from error


# --- thin slabs -----------------------------------------------------------------------------------


def expand_thin_slabs(scene: ResolvedScene) -> ResolvedScene:
    """The same scene with a real slab for each thin one, for renderers without thin slabs.

    The slab lies behind the face. Only its edges differ from the thin slab, which has none.
    """
    names = {solid.name for solid in scene.solids}
    solids = list(scene.solids)
    for surface in scene.surfaces:
        if isinstance(surface.material, resolved.ThinSlab):
            name = surface.name
            while name in names:
                name += "-slab"
            names.add(name)
            solids.append(_real_slab(name, surface.shape, surface.material))
    kept = (s for s in scene.surfaces if not isinstance(s.material, resolved.ThinSlab))
    return scene.model_copy(update={"solids": tuple(solids), "surfaces": tuple(kept)})


def _real_slab(name: str, face: resolved.SurfaceShape, thin: resolved.ThinSlab) -> resolved.Solid:
    shape: resolved.SolidShape
    if isinstance(face, resolved.Rectangle):
        shape = slab(face.frame, face.size, thin.thickness)
    elif isinstance(face, resolved.Disk):
        middle = combination(face.frame.origin, (-thin.thickness / 2,), (face.frame.z,))
        shape = resolved.Cylinder(
            frame=face.frame.model_copy(update={"origin": middle}),
            radius=face.radius,
            height=thin.thickness,
        )
    else:
        raise TypeError(f"a thin slab on a {face.type}")
    return resolved.Solid(name=name, shape=shape, medium=thin.medium, exterior=thin.exterior)
