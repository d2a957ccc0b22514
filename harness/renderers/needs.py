"""What a scene asks of a renderer: none is blamed for what it does not claim."""

from __future__ import annotations

from collections.abc import Iterator

from harness.errors import RendererUnsupported
from harness.renderers.base import Capability
from harness.scene import resolved
from harness.scene.resolved import ResolvedScene

_SHAPES = {
    resolved.Sphere: Capability.SPHERE,
    resolved.Convex: Capability.CONVEX,
    resolved.Cylinder: Capability.CYLINDER,
    resolved.Cone: Capability.CONE,
    resolved.Lens: Capability.LENS,
    resolved.Csg: Capability.CSG,
    resolved.Mesh: Capability.MESH,
    resolved.Plane: Capability.PLANE,
}
_MATERIALS = {
    resolved.Mirror: Capability.MIRROR,
    resolved.Diffuse: Capability.DIFFUSE,
    resolved.Phong: Capability.PHONG,
    resolved.Translucent: Capability.TRANSLUCENT,
    resolved.ThinSlab: Capability.THIN_SLAB,
}


def needs(scene: ResolvedScene) -> frozenset[Capability]:
    """The capabilities that `scene` cannot be rendered rightly without.

    Rectangles, disks and emission are taken for granted. Capabilities that say how a result is
    to be read (PIXEL_CENTRES, LOBE_SWITCH, RADIANCE_N2) or that a check or a diagram needs
    (RAYS, MAIN_WAY) are not here.
    """
    return frozenset(_reasons(scene))


def require(scene: ResolvedScene, name: str, capabilities: frozenset[Capability]) -> None:
    """Raises RendererUnsupported, naming what in the scene asks for what is not claimed."""
    reasons = _reasons(scene)
    missing = [f"{c} ({reasons[c]})" for c in sorted(reasons.keys() - capabilities)]
    if missing:
        raise RendererUnsupported(f"{name} does not claim {', '.join(missing)}")


def _reasons(scene: ResolvedScene) -> dict[Capability, str]:
    """The first thing in the scene that asks for each capability."""
    reasons: dict[Capability, str] = {}
    for capability, reason in _all_reasons(scene):
        reasons.setdefault(capability, reason)
    return reasons


def _all_reasons(scene: ResolvedScene) -> Iterator[tuple[Capability, str]]:
    for solid in scene.solids:
        yield from _of_shape(solid.shape, f"solid {solid.name!r}")
        if solid.exterior != 0:
            yield Capability.NESTED, f"solid {solid.name!r} is inside another"
        if solid.meets:
            other = scene.solids[solid.meets[0]].name
            yield Capability.PRIORITY, f"solid {solid.name!r} touches or overlaps {other!r}"
        if any(scene.media[solid.medium].absorption):
            yield Capability.ABSORPTION, f"solid {solid.name!r} absorbs"
        if scene.media[solid.medium].abbe is not None:
            yield Capability.DISPERSION, f"solid {solid.name!r} is to disperse light"
        if scene.transport.reflection:
            yield Capability.FRESNEL, f"solid {solid.name!r} reflects a part"
    for surface in scene.surfaces:
        place = f"surface {surface.name!r}"
        yield from _of_shape(surface.shape, place)
        if capability := _MATERIALS.get(type(surface.material)):
            yield capability, place
        if _is_picture(surface.material):
            yield Capability.PICTURE, f"{place} shows a picture"
    yield from _of_surroundings(scene)


def _of_surroundings(scene: ResolvedScene) -> Iterator[tuple[Capability, str]]:
    if scene.film.samples > 1:
        yield Capability.SAMPLING, "pixels are means of samples"
    if isinstance(scene.background, resolved.Panorama):
        yield Capability.ENVIRONMENT, "a panorama is around everything"
    if any(scene.media[0].absorption):
        yield Capability.ABSORPTION, "the medium around everything absorbs"
    if any(isinstance(light, resolved.DirectionalLight) for light in scene.lights):
        yield Capability.DIRECTIONAL_LIGHT, "a light comes from far away"
    if isinstance(scene.camera, resolved.ThinLens):
        yield Capability.THIN_LENS, "the camera has a lens"
    if scene.camera.medium != 0:
        yield Capability.CAMERA_INSIDE, "the camera stands inside a solid"


def _of_shape(shape: resolved.SurfaceShape, place: str) -> Iterator[tuple[Capability, str]]:
    if capability := _SHAPES.get(type(shape)):
        yield capability, f"{place} is a {shape.type}"
    if isinstance(shape, resolved.Lens) and any(shape.conics):
        yield Capability.CONIC, f"{place} has faces that are no spheres"
    if isinstance(shape, resolved.Csg):
        for part in shape.parts:
            if isinstance(part, resolved.Plane):
                yield Capability.HALF_SPACE, f"{place} is cut by a half-space"
            else:
                yield from _of_shape(part, place)
    if isinstance(shape, resolved.Mesh) and shape.normals is not None:
        yield Capability.SMOOTH_MESH, f"{place} is shaded smoothly"


def _is_picture(material: resolved.Material) -> bool:
    return isinstance(material, resolved.Emissive) and isinstance(
        material.pattern, resolved.Picture
    )
