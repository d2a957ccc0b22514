"""What a ray meets at a surface: the light that it sends, and the ways that go on from it."""

from __future__ import annotations

from typing import NamedTuple

from tracer.arrays import (
    DIFFUSE,
    EXTERIOR,
    FIRST,
    MATERIAL,
    MEDIUM,
    MIRROR,
    PATTERN,
    RECTANGLE,
    SHAPE,
    TRANSLUCENT,
    Arrays,
    Floats,
)
from tracer.compiled import called, inlined, merged
from tracer.hit import hit_point
from tracer.light import absorbed, lit
from tracer.optics import (
    cos_transmitted,
    fresnel_unpolarised,
    reflect,
    slab_reflectance,
    slab_transmittance,
    transmitted,
)
from tracer.patterns import pattern_radiance
from tracer.shapes import face_coordinates, vec_at
from tracer.vector import Vec, along, chosen, dot, scale

BLACK = (0.0, 0.0, 0.0)


class Lobes(NamedTuple):
    """`reflection` and `transmission` allow the two lobes of dielectrics and thin slabs."""

    reflection: bool
    transmission: bool
    radiance_n2: bool


class Scattered(NamedTuple):
    """What a surface does with a ray.

    `sent` is the radiance it sends back along the ray. The ray goes on from `p` along `wr` with
    its weight times `reflected`, and from `p_t` along `wt` with its weight times `transmitted`,
    having crossed `crossed` interfaces.
    """

    sent: Vec
    reflected: Vec
    p: Vec
    wr: Vec
    transmitted: Vec
    p_t: Vec
    wt: Vec
    crossed: int


@inlined
def interface(wi: Vec, n: Vec, ior_i: float, ior_t: float) -> tuple[bool, float, Vec, Vec]:
    """(transmits, R, wr, wt) where two media meet; R is 1 in total internal reflection."""
    cos_theta_i = max(0.0, dot(wi, n))
    transmits, cos_theta_t = cos_transmitted(cos_theta_i, ior_i, ior_t)
    wr = reflect(wi, n)
    R = fresnel_unpolarised(cos_theta_i, cos_theta_t, ior_i, ior_t)
    wt = transmitted(wi, n, cos_theta_i, cos_theta_t, ior_i / ior_t)
    return transmits, R if transmits else 1.0, wr, chosen(transmits, wt, wr)


@inlined
def refracted(
    lobes: Lobes, wi: Vec, n: Vec, ior_i: float, ior_t: float
) -> tuple[float, float, Vec, Vec]:
    """(what is reflected, what is transmitted, wr, wt) where two media meet."""
    transmits, R, wr, wt = interface(wi, n, ior_i, ior_t)
    mu = ior_i / ior_t
    passed = (1.0 - R) * (mu * mu if lobes.radiance_n2 else 1.0)
    return (
        R if lobes.reflection or not transmits else 0.0,
        passed if lobes.transmission and transmits else 0.0,
        wr,
        wt,
    )


@called
def upright(wi: Vec, smooth: Vec, geometric: Vec, ior_i: float, ior_t: float) -> Vec:
    """The normal to refract at: a mesh's smooth one, but where that would send a ray to the wrong
    side of its triangle, the triangle's own.
    """
    transmits, _, wr, wt = interface(wi, smooth, ior_i, ior_t)
    if dot(wr, geometric) < 0.0 or (transmits and dot(wt, geometric) > 0.0):
        return geometric
    return smooth


@called
def thin_slab(
    scene: Arrays, hit: int, p: Vec, d: Vec, n: Vec, entering: bool
) -> tuple[bool, float, Vec, Vec, float, float]:
    """(transmits, R of one face, wr, exit point, length inside, length taken back).

    The slab lies behind its face. A ray from the front leaves through the back. One from behind
    has gone too far when it meets the face: it is taken back to where it met the slab's back.
    """
    wi = scale(-1.0, d)
    thickness = scene.materials[hit, 6]
    ior_i = scene.media[scene.objects[hit, EXTERIOR], 0]
    ior_t = scene.media[scene.objects[hit, MEDIUM], 0]
    transmits, R, wr, wt = interface(wi, n, ior_i, ior_t)
    cos_theta_i, cos_theta_t = dot(wi, n), -dot(wt, n)
    if not (transmits and cos_theta_t > 0.0 and cos_theta_i > 0.0):
        return False, 1.0, wr, p, 0.0, 0.0
    inside = thickness / cos_theta_t
    back = 0.0 if entering else thickness / cos_theta_i
    return True, R, wr, along(along(p, -back, d), inside, wt), inside, back


@inlined
def _slab_lobes(R: float, a: float, lobes: Lobes) -> tuple[float, float]:
    """(reflected, transmitted): with both lobes on, all internal reflections are in the sums."""
    if lobes.reflection and lobes.transmission:
        return slab_reflectance(R, a), slab_transmittance(R, a)
    return (R if lobes.reflection else 0.0), (
        (1.0 - R) * (1.0 - R) * a if lobes.transmission else 0.0
    )


@inlined
def emitted(scene: Arrays, hit: int, x: float, y: float) -> Vec:
    """What an emissive surface shows; at `x`, `y` from its centre, if it is a rectangle or disk."""
    u, v = 0.5, 0.5
    if scene.objects[hit, SHAPE] >= RECTANGLE:
        u, v = face_coordinates(x, y, scene.rows, scene.objects[hit, FIRST])
    return pattern_radiance(scene.patterns, scene.objects[hit, PATTERN], scene.texels, u, v)


@merged
def scatter(
    scene: Arrays,
    lobes: Lobes,
    o: Vec,
    t: float,
    d: Vec,
    medium: int,
    hit: int,
    face: int,
    entering: bool,
    stack: Floats,
) -> Scattered:
    """What happens to the ray from `o` along `d` in `medium`, which hits after `t` what is no
    interface of two media.
    """
    objects = scene.objects
    p, n, geometric = hit_point(scene, o, t, d, hit, face, entering)
    wi = scale(-1.0, d)
    sent, reflected, passed = BLACK, BLACK, BLACK
    wr, wt, p_t, crossed = wi, d, p, 1
    material = objects[hit, MATERIAL]
    if material == MIRROR:
        wr, reflected = reflect(wi, n), vec_at(scene.materials, hit, 0)
    elif material == DIFFUSE:
        albedo, glint = vec_at(scene.materials, hit, 0), scene.materials[hit, 7]
        exponent = scene.materials[hit, 8]
        sent = lit(
            scene, albedo, glint, exponent, p, geometric, wi, medium, hit, face, entering, stack
        )
    elif material == TRANSLUCENT:
        passed, albedo = vec_at(scene.materials, hit, 0), vec_at(scene.materials, hit, 3)
        sent = lit(scene, albedo, 0.0, 0.0, p, geometric, wi, medium, hit, face, entering, stack)
    else:
        crossed = 2
        transmits, R, wr, p_t, length, _ = thin_slab(scene, hit, p, d, n, entering)
        reflected = (1.0, 1.0, 1.0)
        if transmits:
            a = absorbed(scene.media, objects[hit, MEDIUM], length)
            r0, t0 = _slab_lobes(R, a[0], lobes)
            r1, t1 = _slab_lobes(R, a[1], lobes)
            r2, t2 = _slab_lobes(R, a[2], lobes)
            reflected, passed = (r0, r1, r2), (t0, t1, t2)
    return Scattered(sent, reflected, p, wr, passed, p_t, wt, crossed)
