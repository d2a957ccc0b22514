"""Point lights on diffuse surfaces, and how light is lost on straight ways."""

from __future__ import annotations

import math

from tracer.arrays import (
    DIELECTRIC,
    MATERIAL,
    THIN_SLAB,
    TRANSLUCENT,
    Arrays,
    Floats,
)
from tracer.compiled import called, inlined
from tracer.hit import hit_point, nearest_hit
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


@called
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
        hit = nearest_hit(scene, o, to_light, medium, left, left_face, inward, stack)
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
def lambertian(
    scene: Arrays,
    reflectance: Vec,
    p: Vec,
    n: Vec,
    medium: int,
    hit: int,
    face: int,
    entering: bool,
    stack: Floats,
) -> Vec:
    """Radiance of a diffuse surface under all lights: reflectance / pi * I cos(theta) / r^2.

    Only lights on the side from which the surface is seen count: `n` points there.
    """
    irradiance = (0.0, 0.0, 0.0)
    for light in range(len(scene.lights)):
        towards = sub(vec_at(scene.lights, light, 0), p)
        r = math.sqrt(dot(towards, towards))
        wl = scale(1.0 / r, towards)
        cos_theta = dot(wl, n)
        if cos_theta > 0.0:
            passed = unshadowed(scene, p, wl, r, medium, hit, face, not entering, stack)
            intensity = mul(passed, vec_at(scene.lights, light, 3))
            irradiance = add(irradiance, scale(cos_theta / (r * r), intensity))
    return scale(1.0 / math.pi, mul(reflectance, irradiance))
