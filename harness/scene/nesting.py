"""Which medium is around what: solids inside solids, thin slabs, and the camera.

Nothing here is written in a scene file but the camera's medium; all of it follows from geometry.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from harness.scene import resolved
from harness.scene.containment import bounds, surface_points
from harness.scene.crosscheck import AIR
from harness.scene.findings import Attempts, Finding, KeyPath, SceneInvalid, quoted
from harness.scene.order import innermost, placed
from harness.scene.resolved import ResolvedScene, Vec3
from harness.scene.shapes import smallest_feature

MediumAt = Callable[[Sequence[Vec3]], int]

# Relative to the scene: what is smaller, or nearer, is lost in rounding.
SMALLEST = 1e-9


def nested(
    scene: ResolvedScene, camera_medium: str | None, priorities: Sequence[int]
) -> ResolvedScene:
    """The scene with the media around its solids, thin slabs and camera.

    `camera_medium` and the solids' `priorities` are what the scene file says. Raises SceneInvalid
    where neither containment nor priority tells which of two solids is there, where the camera's
    medium is not said or said wrongly, and for what is too small.
    """
    extent = _extent(scene)
    attempts = Attempts()
    for k, solid in enumerate(scene.solids):
        attempts.attempt(("solids", k), _check_size, solid, extent)
    for k, surface in enumerate(scene.surfaces):
        attempts.attempt(("surfaces", k), _check_size, surface, extent)
    attempts.raise_any()
    solids = placed(scene.solids, priorities, SMALLEST * extent)
    scene = scene.model_copy(update={"solids": solids})

    def medium_at(points: Sequence[Vec3]) -> int:
        inside = {innermost(solids, point, SMALLEST * extent) for point in points}
        if len(inside) > 1:
            raise SceneInvalid(Finding((), "stands in more than one medium"))
        solid = inside.pop()
        return 0 if solid is None else solids[solid].medium

    camera = attempts.attempt(("camera",), _camera_in_medium, scene, camera_medium, medium_at)
    surfaces = [
        attempts.attempt(("surfaces", k), _surface_in_medium, surface, medium_at)
        for k, surface in enumerate(scene.surfaces)
    ]
    attempts.raise_any()
    return scene.model_copy(update={"surfaces": tuple(surfaces), "camera": camera})


def _extent(scene: ResolvedScene) -> float:
    """The largest coordinate of the scene."""
    corners = [np.array(scene.camera.origin)]
    for shape in (*(s.shape for s in scene.solids), *(s.shape for s in scene.surfaces)):
        if isinstance(shape, resolved.Plane):
            corners.append(shape.offset * np.array(shape.normal))  # the nearest of its points
        else:
            corners += bounds(shape)
    return float(np.max(np.abs(corners)))


def _check_size(member: resolved.Solid | resolved.Surface, extent: float) -> None:
    if isinstance(member.shape, resolved.Csg) and not surface_points(member.shape).size:
        raise SceneInvalid(Finding(("shape",), "nothing is left of it"))
    sizes: dict[KeyPath, float] = {("shape",): smallest_feature(member.shape)}
    if isinstance(member, resolved.Surface) and isinstance(member.material, resolved.ThinSlab):
        sizes["material", "thickness"] = member.material.thickness
    for key, size in sizes.items():
        if size < SMALLEST * extent:
            raise SceneInvalid(
                Finding(
                    key,
                    "too small for a scene of this size",
                    f"{size:g} in coordinates up to {extent:g}",
                    f"≥ {SMALLEST * extent:g}",
                )
            )


def _camera_in_medium(
    scene: ResolvedScene, said: str | None, medium_at: MediumAt
) -> resolved.Camera:
    """The camera with the medium it stands in, which must be what the scene file says."""
    camera = scene.camera
    try:
        found = medium_at(_ray_origins(scene))
    except ValueError as touching:
        (k,) = touching.args
        message = f"stands on the surface of solid {scene.solids[k].name}"
        raise SceneInvalid(Finding(("origin",), message, quoted(list(camera.origin)))) from touching
    name = scene.media[found].name
    if name != (said or AIR):
        place = ("medium",) if said else ("origin",)
        value = quoted(said) if said else quoted(list(camera.origin))
        message = f"the camera stands in {name}"
        raise SceneInvalid(Finding(place, message, value, f'medium = "{name}"'))
    return camera.model_copy(update={"medium": found})


def _ray_origins(scene: ResolvedScene) -> list[Vec3]:
    """Where rays begin: the camera, or for parallel rays some points of its film."""
    camera = scene.camera
    match camera:
        case resolved.Perspective():
            return [camera.origin]
        case resolved.ThinLens():
            half = np.array([camera.aperture, camera.aperture])
        case resolved.Orthographic():
            half = np.array([camera.width, camera.width * scene.film.height / scene.film.width]) / 2
    axes = np.array([camera.right, camera.up])
    steps = np.linspace(-1, 1, 5)
    points = [np.array(camera.origin) + (half * (i, j)) @ axes for i in steps for j in steps]
    return [(float(x), float(y), float(z)) for x, y, z in points]


def _surface_in_medium(surface: resolved.Surface, medium_at: MediumAt) -> resolved.Surface:
    """A thin slab with what is around it; other surfaces as they are."""
    if not isinstance(surface.material, resolved.ThinSlab):
        return surface
    assert isinstance(surface.shape, resolved.Rectangle | resolved.Disk)
    try:
        exterior = medium_at([surface.shape.frame.origin])
    except ValueError as touching:
        raise SceneInvalid(
            Finding(("shape",), "a thin slab may not lie on the surface of a solid")
        ) from touching
    material = surface.material.model_copy(update={"exterior": exterior})
    return surface.model_copy(update={"material": material})
