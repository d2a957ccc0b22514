"""Programs that nobody here wrote, on the same rays. They come with the oracles group.

What each does not model: rayoptics traces surfaces in a given order, transmits only and raises on
total reflection. raysect moves rays off surfaces by 1e-9 of a metre, and its camera is not used.
tmm knows plane layers but no rays; `inc_tmm` sums powers, without interference. colour knows
one interface, in degrees.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest

from tests.tracer.scenes import Floats, Y, angles, down, glass, one, slab, wall
from tracer import optics
from tracer.path import follow
from tracer.scene import Medium, Scene, Solid
from tracer.shapes import Sphere
from tracer.solids import cone, cylinder, difference, intersection, lens, union

EPS = float(np.finfo(float).eps)
ANGLES = [0.0, 20.0, 45.0, 60.0, 80.0]


def oracle(name: str) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # they warn of optional parts when they are imported
        return pytest.importorskip(name, reason=f"{name}: install the oracles group")


# --- powers ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("polarisation", ["s", "p"])
def test_slab_by_tmm(degrees: float, polarisation: str) -> None:
    tmm = oracle("tmm")
    theta, ior, absorption, thickness = math.radians(degrees), 1.5, 0.05, 10.0
    wavelength = 5e-4
    k = absorption * wavelength / (4 * math.pi)
    layers, lengths = [1.0, ior + 1j * k, 1.0], [np.inf, thickness, np.inf]
    theirs = tmm.inc_tmm(polarisation, layers, lengths, ["i", "i", "i"], theta, wavelength)
    c = math.cos(theta)
    _, ct = optics.cos_transmitted(c, 1.0, ior)
    a = math.exp(-absorption * thickness / ct)
    fresnel = optics.fresnel_s if polarisation == "s" else optics.fresnel_p
    R = fresnel(c, ct, 1.0, ior)
    # Their index is complex; k = 2e-6 enters R and the angle as its square, 4e-12.
    assert optics.slab_transmittance(R, a) == pytest.approx(theirs["T"], abs=1e-11)
    assert optics.slab_reflectance(R, a) == pytest.approx(theirs["R"], abs=1e-11)


@pytest.mark.parametrize("degrees", ANGLES)
def test_interface_by_colour(degrees: float) -> None:
    phenomena = oracle("colour.phenomena")
    theta_t = float(np.squeeze(phenomena.snell_law(1.0, 1.5, degrees)))
    _, ours = optics.snell(math.radians(degrees), 1.0, 1.5)
    assert math.degrees(ours) == pytest.approx(theta_t, abs=90 * 8 * EPS)
    power = phenomena.polarised_light_reflection_coefficient(1.0, 1.5, degrees, theta_t)
    s, p = np.squeeze(np.real(power)).tolist()
    c = math.cos(math.radians(degrees))
    _, ct = optics.cos_transmitted(c, 1.0, 1.5)
    found = optics.fresnel_s(c, ct, 1.0, 1.5), optics.fresnel_p(c, ct, 1.0, 1.5)
    # Their cosines come from angles in degrees that were rounded; dR / dtheta < 4 at 80 degrees.
    assert found == pytest.approx((s, p), abs=8 * EPS * 4 * 2)


# --- rays through surfaces in order -------------------------------------------------------------


def by_rayoptics(
    surfaces: list[tuple[float, ...]], origin: Floats, direction: Floats
) -> tuple[Floats, Floats]:
    """(last point, direction) through (curvature, z, index behind it, conic); their axis is +z.

    They know no edges of lenses, no solids, and neither weights nor total reflection.
    """
    raytrace, surface = oracle("rayoptics.raytr.raytrace"), oracle("rayoptics.elem.surface")
    profiles = oracle("rayoptics.elem.profiles")
    path = []
    for k, (curvature, z, ior, *conic) in enumerate(surfaces):
        profile = profiles.Conic(c=curvature, cc=conic[0] if conic else 0.0)
        to_next = surfaces[k + 1][1] - z if k + 1 < len(surfaces) else 0.0
        transform = np.identity(3), np.array([0.0, 0.0, to_next])
        path.append((surface.Surface(profile=profile), None, transform, ior, 1))
    rays, *_ = raytrace.trace_raw(iter(path), origin, direction, 550.0)
    last = np.array(rays[-1][0]) + np.array([0.0, 0.0, surfaces[-1][1]])
    return last, np.array(rays[-1][1])


FLIP = np.array([1.0, 1.0, -1.0])  # their light goes up +z, ours comes down


LENSES: dict[str, tuple[tuple[float, float], tuple[float, float]]] = {  # radii, conics
    "biconvex": ((3.0, -2.0), (0.0, 0.0)),
    "biconcave": ((-3.0, 2.0), (0.0, 0.0)),
    "meniscus": ((1.5, 2.2), (0.0, 0.0)),
    "planohyperbolic": ((math.inf, -2.0), (0.0, -2.25)),
    "paraboloid, ellipsoid": ((2.0, -2.5), (-1.0, 0.4)),
    "hollow conics": ((-2.0, 2.5), (-3.0, -0.5)),
}


@pytest.mark.parametrize("name", ["slab", "ball", *LENSES, "doublet", "nested"])
def test_sequence_by_rayoptics(name: str) -> None:
    n = 1.5
    match name:
        case "slab":
            scene = glass(slab(2.0), n, ends_at=-6.0)
            surfaces = [(0.0, 0.0, n), (0.0, 2.0, 1.0)]
        case "ball":
            scene = glass(Sphere((0.0, 0.0, -1.0), 1.0), n, ends_at=-6.0)
            surfaces = [(1.0, 0.0, n), (-1.0, 2.0, 1.0)]
        case "doublet":
            first = lens((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (3.0, -2.0), 0.8, 0.7)
            second = lens((0.0, 0.0, -0.8), (0.0, 0.0, -1.0), (-2.0, -6.0), 0.4, 0.7)
            cemented = Solid(first, Medium(n)), Solid(second, Medium(1.62))
            scene = Scene(glass(slab(1.0), n).camera, cemented, (wall(-6.0),))
            surfaces = [(1 / 3.0, 0.0, n), (-1 / 2.0, 0.8, 1.62), (-1 / 6.0, 1.2, 1.0)]
        case lens_name if lens_name in LENSES:
            radii, conics = LENSES[lens_name]
            solid = lens((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), radii, 0.8, 0.7, conics)
            scene = glass(solid, n, ends_at=-6.0)
            surfaces = [(1 / radii[0], 0.0, n, conics[0]), (1 / radii[1], 0.8, 1.0, conics[1])]
        case _:
            shell, core = Medium(n), Medium(1.8)
            balls = (
                Solid(Sphere((0.0, 0.0, -1.0), 1.0), shell),
                Solid(Sphere((0.0, 0.0, -1.0), 0.6), core),
            )
            scene = Scene(glass(slab(1.0), n).camera, balls, (wall(-6.0),))
            surfaces = [(1.0, 0.0, n), (1 / 0.6, 0.4, 1.8), (-1 / 0.6, 1.6, n), (-1.0, 2.0, 1.0)]
    path = "T" * len(surfaces)
    surfaces = [(0.0, -3.0, 1.0), *surfaces, (0.0, 6.0, 1.0)]
    for x, y, tilt in [(0.0, 0.0, 0.0), (0.3, 0.1, 2.0), (-0.4, 0.2, 5.0)]:
        direction = np.array(down(tilt))
        found = one(scene, (x, y, 3.0), (direction[0], direction[1], direction[2]), path)
        point, out = by_rayoptics(surfaces, np.array([x, y, 0.0]), direction * FLIP)
        assert np.abs(found.point[0] * FLIP - point).max() <= 1e-14 * 6
        assert np.abs(found.direction[0] * FLIP - out).max() <= 1e-14


# --- rays through solids --------------------------------------------------------------------------


def by_raysect(primitives: list[Any], origin: Floats, direction: Floats) -> Floats:
    """Vertices of a ray that is transmitted everywhere; the last solid met must be opaque."""
    core, logging = oracle("raysect.core"), oracle("raysect.optical.loggingray")
    world = oracle("raysect.optical").World()
    for primitive in primitives:
        primitive.parent = world
    start = core.Point3D(*origin), core.Vector3D(*direction)
    ray = logging.LoggingRay(*start, extinction_prob=0.0)  # else it ends some rays by chance
    ray.trace(world)
    points = []
    for hit in ray.log:
        p = hit.hit_point.transform(hit.primitive_to_world)
        points.append((p.x, p.y, p.z))
    return np.array(points)


@pytest.mark.parametrize("name", ["ball", "box", "cone", "drilled", "joined", "cut", "nested"])
def test_solids_by_raysect(name: str) -> None:
    core, optical = oracle("raysect.core"), oracle("raysect.optical")
    primitive, material = oracle("raysect.primitive"), oracle("raysect.optical.material")
    clear = optical.ConstantSF(1.0)

    def dielectric(ior: float, outside: float) -> Any:
        index, external = optical.ConstantSF(ior), optical.ConstantSF(outside)
        return material.Dielectric(index, clear, external_index=external, transmission_only=True)

    shell, core_glass = Medium(1.5), Medium(1.8)
    catch = primitive.Box(
        core.Point3D(-50, -50, -7), core.Point3D(50, 50, -6), material=material.AbsorbingSurface()
    )
    theirs: list[Any]
    match name:
        case "ball":
            solids: tuple[Solid, ...] = (Solid(Sphere((0.0, 0.0, 0.0), 1.0), shell),)
            theirs = [primitive.Sphere(1.0, material=dielectric(1.5, 1.0))]
        case "box":
            solids = (Solid(slab(2.0, 1.0, 3.0), shell),)
            corners = core.Point3D(-3, -3, -1), core.Point3D(3, 3, 1)
            theirs = [primitive.Box(*corners, material=dielectric(1.5, 1.0))]
        case "cone":
            pointed = cone((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), 1.2, 2.0)
            solids = (Solid(pointed, shell),)
            place = core.translate(0, 0, -1)
            theirs = [primitive.Cone(1.2, 2.0, transform=place, material=dielectric(1.5, 1.0))]
        case "drilled" | "joined" | "cut":
            ball, rod = Sphere((0.0, 0.0, 0.0), 1.0), ((0.3, 0.0, 0.0), Y, 0.4, 4.0)
            ours_is = {"drilled": difference, "joined": union, "cut": intersection}[name]
            theirs_is = {"drilled": "Subtract", "joined": "Union", "cut": "Intersect"}[name]
            solids = (Solid(ours_is(ball, cylinder(*rod)), shell),)
            # Their cylinder begins at the origin, along +z.
            place = core.translate(0.3, 2.0, 0.0) * core.rotate_x(90)
            parts = primitive.Sphere(1.0), primitive.Cylinder(0.4, 4.0, transform=place)
            theirs = [getattr(primitive, theirs_is)(*parts, material=dielectric(1.5, 1.0))]
        case _:
            solids = (
                Solid(Sphere((0.0, 0.0, 0.0), 1.0), shell),
                Solid(Sphere((0.0, 0.0, 0.0), 0.6), core_glass),
            )
            theirs = [
                primitive.Sphere(1.0, material=dielectric(1.5, 1.0)),
                primitive.Sphere(0.6, material=dielectric(1.8, 1.5)),
            ]
    path = "TTTT" if name in ("nested", "drilled") else "TT"
    scene = Scene(glass(slab(1.0), 1.5).camera, solids, (wall(-6.0),))
    # None grazes where it leaves: there the start of their legs would count for much more.
    aside = -0.05 if name in ("drilled", "cut") else -0.5
    for x, tilt in [(0.2, 0.0), (0.3, 3.0), (aside, 8.0)]:
        direction = np.array(down(tilt))
        origin = np.array([x, 0.05, 3.0])
        found = follow(scene, [origin], [direction], path, vertices=True)
        points = by_raysect([*theirs, catch], origin, direction)
        ours = found.vertices[0, 1:]
        assert points.shape == ours.shape
        # They start each leg up to 1e-9 along the normal from where the last one ended, and the
        # rest of the path spreads that, most of all where it leaves at a grazing angle.
        beside = origin + 1e-6 * np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        moved = follow(scene, beside, [direction] * 2, path, vertices=True).vertices[:, 1:]
        spread = max(1.0, np.abs(moved - ours).max() / 1e-6)
        within = 2e-9 * len(path) * spread
        assert np.abs(points - ours).max() <= within
        last = (points[-1] - points[-2])[None] / np.linalg.norm(points[-1] - points[-2])
        assert angles(found.direction, last).max() <= within
