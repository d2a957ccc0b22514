"""Lights on diffuse and glossy surfaces, their shadows, and how light is lost on straight ways."""

from __future__ import annotations

import math

from tracer.arrays import (
    DIELECTRIC,
    DIRECTIONAL,
    MATERIAL,
    THIN_SLAB,
    TRANSLUCENT,
    Arrays,
    Floats,
)
from tracer.compiled import called, inlined, merged
from tracer.hit import hit_point, nearest_hit
from tracer.optics import reflect
from tracer.patterns import CONSTANT, panorama_radiance
from tracer.shapes import vec_at
from tracer.vector import Vec, add, dot, mul, scale, sub


@inlined
def absorbed(media: Floats, medium: int, length: float) -> Vec:
    """Beer-Lambert: what is left of each colour after `length` in a medium."""
    a = vec_at(media, medium, 1)
    if a[0] == 0.0 and a[1] == 0.0 and a[2] == 0.0:
        return 1.0, 1.0, 1.0
    return (
        math.exp(-a[0] * length) if a[0] > 0.0 else 1.0,
        math.exp(-a[1] * length) if a[1] > 0.0 else 1.0,
        math.exp(-a[2] * length) if a[2] > 0.0 else 1.0,
    )


@merged
def unshadowed(
    scene: Arrays,
    o: Vec,
    to_light: Vec,
    distance: float,
    medium: int,
    left: int,
    left_face: int,
    inward: bool,
    stack: Floats,
) -> Vec:
    """What part of a light's rays gets from `distance` along `to_light` to `o`, per colour.

    As in POV-Ray, light passes through dielectrics and thin slabs straight and without Fresnel
    loss, so glass neither darkens nor focuses it; media absorb it and translucence filters it.
    """
    passed = (1.0, 1.0, 1.0)
    while True:
        hit = nearest_hit(scene, o, to_light, medium, left, left_face, inward, stack[:0], stack)
        passed = mul(passed, absorbed(scene.media, medium, min(hit.t, distance)))
        if hit.t >= distance:
            return passed
        material = scene.objects[hit.object, MATERIAL]
        if material == TRANSLUCENT:
            passed = mul(passed, vec_at(scene.materials, hit.object, 0))
        elif material not in (DIELECTRIC, THIN_SLAB):
            return 0.0, 0.0, 0.0
        o, _, _ = hit_point(scene, o, hit.t, to_light, hit.object, hit.face, hit.entering)
        distance -= hit.t
        medium = hit.beyond
        left, left_face, inward = hit.object, hit.face, hit.entering


@called
def lit(
    scene: Arrays,
    reflectance: Vec,
    specular: float,
    exponent: float,
    p: Vec,
    n: Vec,
    wi: Vec,
    medium: int,
    hit: int,
    face: int,
    entering: bool,
    stack: Floats,
) -> Vec:
    """Radiance towards `wi` of a diffuse surface with a highlight (see `scene.Phong`).

    Only lights on the side from which the surface is seen count: `n` points there.
    """
    sent = (0.0, 0.0, 0.0)
    for light in range(len(scene.lights)):
        towards, r, attenuation = vec_at(scene.lights, light, 0), math.inf, 1.0
        if scene.lights[light, 6] != DIRECTIONAL:
            towards = sub(towards, p)
            r = math.sqrt(dot(towards, towards))
            attenuation = 1.0 / (r * r)
            towards = scale(1.0 / r, towards)
        cos_theta = dot(towards, n)
        if cos_theta > 0.0:
            passed = unshadowed(scene, p, towards, r, medium, hit, face, not entering, stack)
            looks = scale(cos_theta, reflectance)
            cos_alpha = dot(reflect(towards, n), wi)
            if specular > 0.0 and cos_alpha > 0.0:
                glint = specular * cos_alpha**exponent
                looks = add(looks, (glint, glint, glint))
            arriving = scale(attenuation / math.pi, vec_at(scene.lights, light, 3))
            sent = add(sent, mul(mul(passed, arriving), looks))
    return sent


@inlined
def surroundings(scene: Arrays, d: Vec) -> Vec:
    """Radiance from where nothing is, in direction `d`."""
    if scene.background[0, 0] == CONSTANT:
        return vec_at(scene.background, 0, 1)
    return panorama_radiance(scene.background[0], scene.texels, d)


@merged
def is_dark(scene: Arrays) -> bool:
    """Whether nothing is seen where nothing is."""
    row = scene.background[0]
    return bool(row[0] == CONSTANT and row[1] == 0.0 and row[2] == 0.0 and row[3] == 0.0)
