"""A resolved scene as Mitsuba's scene description: plain dicts, lists and numpy arrays.

Nothing here imports Mitsuba. `describe` is what `harness.renderers.mitsuba_load` turns into a live
scene and what `harness.translate.mitsuba_xml` writes for Mitsuba's own command line.

The description is the dict that ``mitsuba.load_dict`` takes, with these stand-ins for objects:

* ``to_world`` and ``to_uv`` are 4 x 4 nested lists;
* a ``mesh`` has ``vertices`` (n, 3) and optionally ``normals`` (n, 3) and ``texcoords`` (n, 2),
  float32, and ``triangles`` (m, 3) uint32;
* a ``bitmap`` has ``pixels`` (h, w, 3) float32, row 0 at v = 0, the bottom; an ``envmap`` has
  them with row 0 at the top.

Two things that Mitsuba does differently from the scene's definition, on purpose left to it:
radiance scales with the square of the index (it cancels where camera and emitter stand in the same
medium), and diffuse surfaces are lit by emissive ones too, not by point lights alone.
"""

from __future__ import annotations

import math
from collections.abc import Container

import numpy as np

from harness.errors import RendererUnsupported
from harness.scene import resolved as rs
from harness.translate.mitsuba_scale import length_scale, scaled
from harness.translate.mitsuba_shapes import Node, affine, parts, round_mesh
from harness.translate.mitsuba_textures import code_texture, environment, texture

# Beyond this many bounces Mitsuba plays Russian roulette, which would only add noise.
RR_DEPTH = 1000
# Mitsuba's cameras start their rays at a near plane and end them at a far one. These lie outside
# what a scaled scene holds (see `mitsuba_scale`), and cost no precision: 1.8e-7 rad as ever.
NEAR_CLIP = 1e-4
FAR_CLIP = 1e6


def describe(
    scene: rs.ResolvedScene, samples: int = 64, without: Container[int] = frozenset()
) -> Node:
    """The scene as a Mitsuba description, in lengths multiplied by `length_scale(scene)`.

    `samples` per pixel are what the written scene asks for. Solids of the indices `without` are
    left to whoever follows the rays. Raises RendererUnsupported where Mitsuba has no counterpart.
    """
    scene = scaled(scene, length_scale(scene))
    node: Node = {
        "type": "scene",
        "integrator": integrator(scene),
        "sensor": _sensor(scene, samples),
    }
    node |= {f"medium_{k}": _medium(m) for k, m in enumerate(scene.media) if any(m.absorption)}
    for k, solid in enumerate(scene.solids):
        if k in without:
            continue
        boundary = _boundary(scene, solid)
        for part, shape in parts(solid.shape):
            node[f"solid_{k}{part}"] = {**shape, **boundary}
    for k, surface in enumerate(scene.surfaces):
        node |= _surface(f"surface_{k}", surface)
    for k, light in enumerate(scene.lights):
        node[f"light_{k}"] = _light(light)
    if isinstance(scene.background, rs.Panorama):
        node["background"] = environment(scene.background)
    elif any(scene.background):
        node["background"] = {"type": "constant", "radiance": rgb(scene.background)}
    return node


def _light(light: rs.Light) -> Node:
    if isinstance(light, rs.DirectionalLight):
        irradiance = rgb(light.irradiance)
        return {"type": "directional", "direction": list(light.direction), "irradiance": irradiance}
    intensity = rgb(light.intensity)
    return {"type": "point", "position": list(light.position), "intensity": intensity}


def rgb(value: rs.Rgb) -> Node:
    return {"type": "rgb", "value": list(value)}


def integrator(scene: rs.ResolvedScene) -> Node:
    """`path`, or a volumetric one where a medium absorbs: `path` passes over media in silence.

    `volpath` makes NaN where a medium absorbs some channels and others not at all (its free paths
    are infinite in those); `volpathmis` is made for media that differ between channels.
    """
    absorption = [medium.absorption for medium in scene.media if any(medium.absorption)]
    kind = "path"
    if absorption:
        coloured = any(len(set(channels)) > 1 for channels in absorption)
        kind = "volpathmis" if coloured else "volpath"
    return {
        "type": kind,
        "max_depth": scene.transport.max_depth,
        "rr_depth": max(RR_DEPTH, scene.transport.max_depth + 1),
    }


# --- camera ---------------------------------------------------------------------------------------


def _sensor(scene: rs.ResolvedScene, samples: int) -> Node:
    camera, film = scene.camera, scene.film
    # Mitsuba's cameras look along their +z and have +x on the left.
    left = np.negative(camera.right)
    sensor: Node = {
        "near_clip": NEAR_CLIP,
        "far_clip": FAR_CLIP,
        "film": {
            "type": "hdrfilm",
            "width": film.width,
            "height": film.height,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "independent", "sample_count": samples},
    }
    if isinstance(camera, rs.ThinLens):
        raise RendererUnsupported("Mitsuba's lens is sampled at random, not at given points")
    if isinstance(camera, rs.Perspective):
        sensor["type"] = "perspective"
        sensor["fov_axis"] = "x"
        sensor["fov"] = 2 * math.degrees(math.atan(camera.tan_half_fov_x))
        sensor["to_world"] = affine(left, camera.up, camera.forward, camera.origin)
    else:
        half = camera.width / 2
        sensor["type"] = "orthographic"
        sensor["to_world"] = affine(
            half * left, half * np.array(camera.up), camera.forward, camera.origin
        )
    if any(scene.media[camera.medium].absorption):
        sensor["medium"] = _reference(camera.medium)
    return sensor


# --- media and interfaces -------------------------------------------------------------------------


def _medium(medium: rs.Medium) -> Node:
    """An absorbing medium. Mitsuba takes sigma_t as a colour in [0, 1], times `scale`."""
    strongest = max(medium.absorption)
    red, green, blue = (sigma / strongest for sigma in medium.absorption)
    return {
        "type": "homogeneous",
        "albedo": rgb((0.0, 0.0, 0.0)),
        "sigma_t": rgb((red, green, blue)),
        "scale": strongest,
    }


def _reference(medium: int) -> Node:
    return {"type": "ref", "id": f"medium_{medium}"}


def interface(scene: rs.ResolvedScene, inside: int, outside: int) -> Node:
    """The BSDF between two media, normals pointing to the one `outside`.

    `ext_ior` is always said, because Mitsuba's default is air, 1.000277.
    """
    return {
        "type": "dielectric",
        "int_ior": scene.media[inside].ior,
        "ext_ior": scene.media[outside].ior,
    }


def _boundary(scene: rs.ResolvedScene, solid: rs.Solid) -> Node:
    """The interface of a solid, one surface for both of its sides, and the media there."""
    node: Node = {"bsdf": interface(scene, solid.medium, solid.exterior)}
    if any(scene.media[solid.medium].absorption):
        node["interior"] = _reference(solid.medium)
    if any(scene.media[solid.exterior].absorption):
        node["exterior"] = _reference(solid.exterior)
    return node


# --- surfaces -------------------------------------------------------------------------------------


def _surface(name: str, surface: rs.Surface) -> Node:
    """The shapes of a surface with their material, by name."""
    match surface.material:
        case rs.Emissive(pattern=rs.Constant() as constant):
            look = _luminous(rgb(constant.radiance))
        case rs.Emissive(pattern=pattern):
            return {name: _patterned(surface, pattern)}
        case rs.Diffuse(reflectance=reflectance):
            look = {"bsdf": _diffuse(reflectance)}
        case rs.Phong():
            raise RendererUnsupported(
                f"surface {surface.name!r}: Mitsuba has no BSDF that is the scene's phong"
            )
        case rs.Mirror(reflectance=reflectance):
            look = {"bsdf": _mirror(reflectance)}
        case rs.Translucent() as translucent:
            look = {"bsdf": _translucent(translucent)}
        case rs.ThinSlab():
            raise RendererUnsupported(
                f"surface {surface.name!r}: Mitsuba has no thin face that offsets the ray "
                "(its thindielectric does not)"
            )
    return {name + part: {**shape, **look} for part, shape in parts(surface.shape)}


def _luminous(radiance: Node) -> Node:
    """Emits, and reflects nothing; without a BSDF of its own it would be half grey."""
    black = {"type": "diffuse", "reflectance": rgb((0.0, 0.0, 0.0))}
    return {"bsdf": black, "emitter": {"type": "area", "radiance": radiance}}


def _patterned(surface: rs.Surface, pattern: rs.Pattern) -> Node:
    """A face that emits `pattern` over its texture coordinates."""
    match surface.shape, pattern:
        case rs.Rectangle() as face, rs.PositionCode() as code:
            return {**dict(parts(face))[""], **_luminous(code_texture(code))}
        case rs.Rectangle() as face, rs.Checker() | rs.Ramp() | rs.Picture() as picture:
            return {**dict(parts(face))[""], **_luminous(texture(picture))}
        case rs.Disk() as face, rs.Checker() | rs.Ramp() | rs.Picture() as picture:
            return {**round_mesh(face), **_luminous(texture(picture))}
    raise RendererUnsupported(
        f"surface {surface.name!r}: Mitsuba's {surface.shape.type} has no texture coordinates for "
        f"a {pattern.type}"
    )


def _diffuse(reflectance: rs.Rgb) -> Node:
    return _two_sided({"type": "diffuse", "reflectance": rgb(reflectance)})


def _mirror(reflectance: rs.Rgb) -> Node:
    smooth = {"type": "conductor", "material": "none", "specular_reflectance": rgb(reflectance)}
    return _two_sided(smooth)


def _two_sided(bsdf: Node) -> Node:
    return {"type": "twosided", "bsdf": bsdf}


def _translucent(material: rs.Translucent) -> Node:
    """What passes is a thin dielectric without an index step: it only tints. The rest is diffuse.

    A blend by the passing fraction w gives diffuse (1 - w) color, and for the light that passes
    w * (filter * color + transmit) / w. Both are the scene's, and both colours are within [0, 1].
    """
    passing = material.filter + material.transmit
    if passing == 0:
        return _diffuse(material.color)
    red, green, blue = ((material.filter * c + material.transmit) / passing for c in material.color)
    tint = {
        "type": "thindielectric",
        "int_ior": 1.0,
        "ext_ior": 1.0,
        "specular_transmittance": rgb((red, green, blue)),
    }
    rest = _diffuse(material.color)
    return {"type": "blendbsdf", "weight": passing, "diffuse": rest, "tint": tint}
