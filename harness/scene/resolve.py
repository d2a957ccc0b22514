"""From a case to numbers: frames, solids, media and film, as every renderer is given them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, TypeVar

from harness.scene import model, resolved
from harness.scene.crosscheck import AIR
from harness.scene.findings import Finding, KeyPath, SceneInvalid, input_error, quoted
from harness.scene.load import LoadedCase
from harness.scene.resolved import ResolvedScene
from harness.scene.shapes import rectangle, solid_shape, surface_shape
from harness.scene.vectors import PARALLEL, cross, length, unit

Result = TypeVar("Result")


class _Problems:
    """Collects what is wrong in all parts of a scene, so that it is reported at once."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []

    def attempt(self, path: KeyPath, build: Callable[[], Result]) -> Result | None:
        """The result of `build`, or None; its findings are relative to `path`."""
        try:
            return build()
        except SceneInvalid as error:
            self.findings += [
                Finding((*path, *f.path), f.message, f.value, f.expected, f.suggestion)
                for f in error.findings
            ]
            return None


def resolve(case: LoadedCase) -> ResolvedScene:
    """The scene of a case in numbers, without its probes.

    Raises InputError with file, line and key of everything that has no meaning: frames without
    direction, meshes that are not closed, solids that overlap, a camera in an unsaid medium.
    """
    try:
        return _resolve(case)
    except SceneInvalid as error:
        raise input_error(error.findings, case.file) from None


def _resolve(case: LoadedCase) -> ResolvedScene:
    scene, folder, problems = case.model, case.file.parent, _Problems()
    media, index = _media(scene)
    shapes = [
        problems.attempt(("solids", k, "shape"), lambda s=solid: solid_shape(s.shape, folder))
        for k, solid in enumerate(scene.solids)
    ]
    faces = [
        problems.attempt(("surfaces", k, "shape"), lambda s=face: surface_shape(s.shape, folder))
        for k, face in enumerate(scene.surfaces)
    ]
    camera = problems.attempt(("camera",), lambda: _camera(scene.camera))
    if problems.findings:
        raise SceneInvalid(*problems.findings)
    solids = [
        resolved.Solid(name=solid.name, shape=shape, medium=index[solid.medium], exterior=0)
        for solid, shape in zip(scene.solids, shapes, strict=True)
    ]
    surfaces = [
        resolved.Surface(name=face.name, shape=shape, material=_material(face.material, index))
        for face, shape in zip(scene.surfaces, faces, strict=True)
    ]
    return ResolvedScene(
        metres_per_unit=scene.metres_per_unit,
        film=resolved.Film(width=scene.film.width, height=scene.film.height),
        camera=camera,
        media=media,
        solids=tuple(solids),
        surfaces=tuple(surfaces),
        lights=tuple(
            resolved.PointLight(position=light.position, intensity=light.intensity)
            for light in scene.lights
        ),
        background=scene.background,
        transport=resolved.Transport(
            max_depth=scene.transport.max_depth, min_weight=scene.transport.min_weight
        ),
    )


def _media(scene: model.Case) -> tuple[tuple[resolved.Medium, ...], dict[str, int]]:
    """The media, air first unless the scene says what its air is; and their indices by name."""
    names = [AIR, *(name for name in scene.media if name != AIR)]
    defined = {AIR: model.Medium(ior=1.0), **scene.media}
    media = tuple(
        resolved.Medium(name=name, ior=defined[name].ior, absorption=defined[name].absorption)
        for name in names
    )
    return media, {name: k for k, name in enumerate(names)}


def _camera(camera: model.Camera) -> resolved.Camera:
    towards = tuple(t - o for t, o in zip(camera.target, camera.origin, strict=True))
    forward = unit(towards)
    if forward is None:
        raise SceneInvalid(
            Finding(("target",), "is the camera's origin", quoted(list(camera.target)))
        )
    up = unit(camera.up)
    across = cross(forward, up) if up is not None else (0.0, 0.0, 0.0)
    if length(across) < PARALLEL:
        raise SceneInvalid(
            Finding(
                ("up",) if "up" in camera.model_fields_set else ("target",),
                "up is zero or parallel to the direction of view",
                f"up = {quoted(list(camera.up))}",
                "an up across the direction of view",
            )
        )
    right = unit(across)
    base = {
        "origin": camera.origin,
        "right": right,
        "up": unit(cross(right, forward)),
        "forward": forward,
    }
    if isinstance(camera, model.PerspectiveCamera):
        k = math.tan(math.radians(camera.fov_x / 2))
        return resolved.Perspective(**base, tan_half_fov_x=k)
    return resolved.Orthographic(**base, width=camera.width)


def _material(material: model.Material, media: dict[str, int]) -> resolved.Material:
    match material:
        case model.Emissive():
            pattern = material.pattern
            kinds = {
                model.Constant: resolved.Constant,
                model.Checker: resolved.Checker,
                model.Ramp: resolved.Ramp,
            }
            return resolved.Emissive(pattern=kinds[type(pattern)](**pattern.model_dump()))
        case model.ThinSlab():
            return resolved.ThinSlab(
                medium=media[material.medium], exterior=0, thickness=material.thickness
            )
        case model.Diffuse():
            return resolved.Diffuse(reflectance=material.reflectance)
        case model.Mirror():
            return resolved.Mirror(reflectance=material.reflectance)
        case model.Translucent():
            return resolved.Translucent(**material.model_dump())


# --- scenes made from scenes ----------------------------------------------------------------------


def probe_planes(probe: model.Probe) -> tuple[resolved.Rectangle, ...]:
    """The rectangles on which a probe's rays are caught."""
    return tuple(rectangle(plane) for plane in probe.planes)


def with_code_plane(
    scene: ResolvedScene,
    probe_plane: resolved.Rectangle,
    axis: Literal["u", "v"],
    cells: int,
    amplitude: float,
    path: str,
) -> ResolvedScene:
    """The probe scene: everything black but `probe_plane`, which shows where rays land on it.

    Of the surfaces only mirrors and thin slabs stay. Light is followed just as far as `path`
    needs (a letter per interface, T or R), and lobes that it does not take are switched off.
    """
    code = resolved.PositionCode(axis=axis, cells=cells, amplitude=amplitude)
    plane = resolved.Surface(
        name="code-plane", shape=probe_plane, material=resolved.Emissive(pattern=code)
    )
    kept = (
        s for s in scene.surfaces if isinstance(s.material, resolved.ThinSlab | resolved.Mirror)
    )
    transport = resolved.Transport(
        max_depth=len(path) + 1,
        min_weight=scene.transport.min_weight,
        reflection="R" in path,
        transmission="T" in path,
    )
    return scene.model_copy(
        update={
            "surfaces": (*kept, plane),
            "lights": (),
            "background": (0.0, 0.0, 0.0),
            "transport": transport,
        }
    )
