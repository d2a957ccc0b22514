"""Where Mitsuba's rays go, in both of its modes, against closed forms computed here.

Tolerances. Mitsuba computes in single precision, whose rounding is u = 2^-24. At each of two faces
the ray's direction and position are rounded; what that does to the landing point is the closed
form's own condition number, found by differences in double precision (`condition`). So the
tolerance is 2 u times that, and no number of Mitsuba's is in it.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from harness.renderers.base import RayPaths, Rays, RenderSettings, Status
from harness.renderers.persistent import WorkerRenderer
from harness.scene import resolved as rs
from tests.harness.povray_scenes import (
    Array,
    box,
    camera,
    fresnel,
    glow,
    make_scene,
    on_plane,
    on_sphere,
    rays,
    rectangle,
    refract,
)

pytestmark = pytest.mark.mitsuba

SETTINGS = RenderSettings(threads=2)
U = 2.0**-24
FACES = 2
REACH = 8.0  # no coordinate of a scene here that rays meet is larger
SINGLE = 32 * U  # of a radiance: 2e-6
CELLS = 1000
N = 1.5
BALL = rs.Sphere(center=(0, 0, 0), radius=1)
# Mitsuba's spawn_ray starts (1 + max |p|) of these away from the surface, along its normal
# (mitsuba/core/math.h: RayEpsilon = 1500 times the machine epsilon 2^-24).
RAY_EPSILON = 1500 * 2.0**-24


def pixels(
    renderer: WorkerRenderer, scene: rs.ResolvedScene, settings: RenderSettings = SETTINGS
) -> Array:
    """(H * W, 3) float64."""
    return renderer.render(scene, settings).pixels.reshape(-1, 3).astype(np.float64)


def with_transport(scene: rs.ResolvedScene, **change: object) -> rs.ResolvedScene:
    return scene.model_copy(update={"transport": scene.transport.model_copy(update=change)})


# --- where rays go ------------------------------------------------------------------------------

# A face that rays cross: ((n_x, n_y, n_z), d) with n . p = d, n outward, or a sphere.
Face = tuple[tuple[float, float, float], float] | rs.Sphere


def crossed(
    origins: Array, directions: Array, faces: list[Face], n: float, offset: float = 0.0
) -> tuple[Array, Array]:
    """Rays after they entered glass by the first of two faces and left it by the second.

    They leave each face `offset` (1 + max |p|) away from it along its normal, as Mitsuba's do.
    """
    for entering, face in zip((True, False), faces, strict=True):
        if isinstance(face, rs.Sphere):
            p = on_sphere(origins, directions, face, far=not entering)
            outward = (p - np.array(face.center)) / face.radius
        else:
            outward = np.broadcast_to(np.array(face[0]), origins.shape)
            t = (face[1] - origins @ np.array(face[0])) / (directions * outward).sum(axis=1)
            p = origins + t[:, None] * directions
        against = outward if entering else -outward
        directions = refract(directions, against, *((1.0, n) if entering else (n, 1.0)))
        side = (1 + np.abs(p).max(axis=1, keepdims=True)) * offset
        origins = p - side * against
    return origins, directions


def landed(
    origins: Array,
    directions: Array,
    faces: list[Face],
    n: float,
    plane: rs.Rectangle,
    offset: float = 0.0,
) -> Array:
    """Where rays land on `plane` in its frame, (m, 2); NaN where they do not."""
    x, y, distance = on_plane(*crossed(origins, directions, faces, n, offset), plane.frame)
    inside = (np.abs(x) < plane.size[0] / 2) & (np.abs(y) < plane.size[1] / 2) & (distance > 0)
    return np.where(inside[:, None], np.stack([x, y], axis=1), np.nan)


def condition(reach: float, origins: Array, directions: Array, *how: object) -> Array:
    """By how much a landing point moves at most when a direction moves by 1 and a point by `reach`.

    A rounding of a position is a rounding of its coordinates, which are up to `reach`.
    """
    h = 1e-6
    base = landed(origins, directions, *how)  # type: ignore[arg-type]
    moved = np.zeros(len(base))
    for axis in np.eye(3) * h:
        turned = directions + axis
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        for change, size in (((origins, turned), 1.0), ((origins + axis, directions), reach)):
            shift = landed(*change, *how) - base  # type: ignore[arg-type]
            moved += size * np.linalg.norm(shift, axis=1) / h
    return moved


def coded(scene: rs.ResolvedScene, plane: rs.Rectangle, axis: str) -> rs.ResolvedScene:
    """`scene` with a position code on `plane` and nothing else that shines, for paths TT."""
    code = rs.PositionCode.model_validate({"axis": axis, "cells": CELLS, "amplitude": 0.9})
    face = rs.Surface(name="code", shape=plane, material=rs.Emissive(pattern=code))
    dark = scene.model_copy(update={"surfaces": (face,), "background": (0.0, 0.0, 0.0)})
    return with_transport(dark, max_depth=3, min_weight=0.0, reflection=False)


def located(renderer: WorkerRenderer, scene: rs.ResolvedScene, plane: rs.Rectangle) -> Array:
    """Where rays land on `plane` in its frame, (m, 2), read from codes.

    NaN where none does, and where coarse and fine code disagree, because more than one path did.
    """
    found = []
    for axis, size in zip("uv", plane.size, strict=True):
        image = pixels(renderer, coded(scene, plane, axis))
        red, green, blue = np.where(image[:, 2:] > 0, image, np.nan).T
        fine = green / blue
        cell = np.round(red / blue * CELLS - fine)
        single = np.abs(red / blue * CELLS - fine - cell) < 0.01
        found.append(np.where(single, (cell + fine) / CELLS - 0.5, np.nan) * size)
    return np.stack(found, axis=1)


SLAB_VIEW = camera(
    (0, 0, 0.5), (math.sin(math.radians(38)), 0, 0.5 - math.cos(math.radians(38))), 84
)
APEX = math.radians(40)
WEDGE_ENTRY = (math.sin(APEX / 2), 0.0, math.cos(APEX / 2))
WEDGE_EXIT = (math.sin(APEX / 2), 0.0, -math.cos(APEX / 2))


def prism() -> rs.Convex:
    """An isosceles prism with its apex edge along y, 2 units towards +x, closed at x = 0."""
    height = 2 * math.tan(APEX / 2)
    corners = [(2.0, y, 0.0) for y in (-2.0, 2.0)]
    corners += [(0.0, y, z) for z in (height, -height) for y in (-2.0, 2.0)]
    reach = 2 * math.sin(APEX / 2)
    planes = (
        (*WEDGE_ENTRY, reach),
        (*WEDGE_EXIT, reach),
        (-1.0, 0.0, 0.0, 0.0),
        (0.0, -1.0, 0.0, 2.0),
        (0.0, 1.0, 0.0, 2.0),
    )
    faces = ((0, 1, 3, 2), (0, 4, 5, 1), (2, 3, 5, 4), (0, 2, 4), (1, 5, 3))
    return rs.Convex(planes=planes, vertices=tuple(corners), faces=faces)


# name: shape, camera, plane, faces
GLASSES: dict[str, tuple[rs.SolidShape, rs.Camera, rs.Rectangle, list[Face]]] = {
    "slab": (
        box((-8, -8, -0.25), (8, 8, 0)),
        SLAB_VIEW,
        rectangle((6, 0, -0.5), (16, 16)),
        [((0.0, 0.0, 1.0), 0.0), ((0.0, 0.0, -1.0), 0.25)],
    ),
    "prism": (
        prism(),
        camera((1.0, 0.1, 3), (1.2, 0, 0), 14),
        rectangle((0, 0, -1.5), (8, 8)),
        [
            (WEDGE_ENTRY, 2 * math.sin(APEX / 2)),
            (WEDGE_EXIT, 2 * math.sin(APEX / 2)),
        ],
    ),
    "ball": (
        BALL,
        camera((0.1, 0.2, 6), (0, 0, 0), 12),
        rectangle((0.1, 0, -3), (16, 16)),
        [BALL] * 2,
    ),
}


@pytest.fixture(params=list(GLASSES))
def glass(
    request: pytest.FixtureRequest,
) -> tuple[rs.ResolvedScene, rs.Rectangle, list[Face]]:
    shape, view, plane, faces = GLASSES[request.param]
    return make_scene(view, solids=[(shape, 1, 0)]), plane, faces


def test_exact_rays_land_where_they_should(
    exact: WorkerRenderer, glass: tuple[rs.ResolvedScene, rs.Rectangle, list[Face]]
) -> None:
    scene, plane, faces = glass
    beams = rays(scene)
    truth = landed(*beams, faces, N, plane)
    allowed = FACES * U * condition(REACH, *beams, faces, N, plane)
    error = np.linalg.norm(located(exact, scene, plane) - truth, axis=1)
    compared = np.isfinite(truth[:, 0])
    assert compared.sum() > 2000
    assert (error <= allowed)[compared].all()  # False too where nothing was found


@pytest.mark.parametrize("name", ["slab", "prism"])
def test_exact_rays_through_flat_faces_are_within_1e_5(exact: WorkerRenderer, name: str) -> None:
    """The figure that is promised for these, below 80 degrees of incidence."""
    shape, view, plane, faces = GLASSES[name]
    scene = make_scene(view, solids=[(shape, 1, 0)])
    beams = rays(scene)
    error = np.linalg.norm(located(exact, scene, plane) - landed(*beams, faces, N, plane), axis=1)
    steep = -(beams[1] @ np.array(faces[0][0])) > math.cos(math.radians(80))
    assert np.isfinite(error).sum() > 2000
    assert np.nanmax(error[steep]) <= 1e-5


def test_stock_rays_are_displaced_as_mitsuba_offsets_them(
    stock: WorkerRenderer, glass: tuple[rs.ResolvedScene, rs.Rectangle, list[Face]]
) -> None:
    """The stock integrators' error is its spawn_ray's offset along the normal, and no more."""
    scene, plane, faces = glass
    beams = rays(scene)
    truth = landed(*beams, faces, N, plane)
    displaced = landed(*beams, faces, N, plane, RAY_EPSILON)
    # Mitsuba's own points on triangles are sums of three corners, each rounded.
    allowed = FACES * U * condition(3 * REACH, *beams, faces, N, plane, RAY_EPSILON)
    found = located(stock, scene, plane)
    compared = np.isfinite(displaced[:, 0])
    assert compared.sum() > 2000
    error = np.linalg.norm(found - displaced, axis=1)
    assert (error <= allowed)[compared].all()
    assert np.nanmax(np.linalg.norm(found - truth, axis=1)) > 1e-4


def test_traced_rays_agree_with_coded_ones(exact: WorkerRenderer) -> None:
    """The ray API and the codes of an image are two ways to one and the same ray."""
    shape, view, plane, faces = GLASSES["prism"]
    lit = make_scene(view, solids=[(shape, 1, 0)], surfaces=[(plane, glow(1, 1, 1))])
    beams = rays(lit)
    paths = exact.trace(lit, Rays(*beams), "TT", SETTINGS)
    truth = landed(*beams, faces, N, plane)
    allowed = FACES * U * condition(REACH, *beams, faces, N, plane)
    there = np.isfinite(truth[:, 0])
    assert (paths.status[there] == Status.HIT).all()
    assert (paths.surface[there] == 0).all()
    error = np.linalg.norm(paths.point[:, :2] - truth, axis=1)
    assert (error <= allowed)[there].all()
    turned = np.linalg.norm(paths.direction - crossed(*beams, faces, N)[1], axis=1)
    # Both refractions of this thin prism are far from grazing: 16 roundings of a unit vector.
    assert turned[there].max() <= 16 * U
    weight = np.prod([1 - r for r in _wedge_reflectances(*beams)], axis=0)
    assert np.abs(paths.weight - weight)[there].max() <= SINGLE


def _wedge_reflectances(origins: Array, directions: Array) -> tuple[Array, Array]:
    entry, leave = np.array(WEDGE_ENTRY), np.array(WEDGE_EXIT)
    inside = refract(directions, np.broadcast_to(entry, directions.shape), 1.0, N)
    return fresnel(-directions @ entry, 1.0, N), fresnel(inside @ leave, N, 1.0)


def ways(exact: WorkerRenderer, path: str, **change: object) -> RayPaths:
    """Four rays at a slab before a plane, from above: straight, steep, past it, and away."""
    slab = box((-2, -2, -0.5), (2, 2, 0))
    lit = make_scene(
        camera((0, 0, 3), (0, 0, 0), 20),
        solids=[(slab, 1, 0)],
        surfaces=[(rectangle((0, 0, -2), (20, 20)), glow(1, 1, 1))],
    )
    origins = np.array([(0.1, 0.2, 1.0), (-1.0, 0.0, 1.0), (5.0, 5.0, 1.0), (0.0, 0.0, 1.0)])
    directions = np.array([(0, 0, -1.0), (0.6, 0, -0.8), (0, 0, -1.0), (0, 0, 1.0)])
    return exact.trace(with_transport(lit, **change), Rays(origins, directions), path, SETTINGS)


def test_paths_end_as_their_letters_say(exact: WorkerRenderer) -> None:
    hit, miss, cut = Status.HIT, Status.MISS, Status.CUT
    assert ways(exact, "TT").status.tolist() == [hit, hit, miss, miss]
    assert ways(exact, "").status.tolist() == [cut, cut, hit, miss]
    assert ways(exact, "T").status.tolist() == [cut, cut, miss, miss]
    assert ways(exact, "R").status.tolist() == [miss] * 4
    assert ways(exact, "TRRT").status.tolist() == [hit, hit, miss, miss]
    assert ways(exact, "TT", max_depth=2).status.tolist() == [cut, cut, miss, miss]


def test_a_path_tells_its_optical_length(exact: WorkerRenderer) -> None:
    paths = ways(exact, "TT")
    # straight: 1 in air, 0.5 in glass, 1.5 in air; and the reflectance of normal incidence is 4%
    assert paths.optical_length[0] == pytest.approx(1 + 0.5 * N + 1.5, abs=8 * U * 3)
    assert paths.weight[0] == pytest.approx(0.96**2, rel=SINGLE)
    assert paths.point[0] == pytest.approx((0.1, 0.2, -2), abs=4 * U * 2)
    assert np.isnan(paths.point[2]).all()
    assert paths.surface.tolist() == [0, 0, -1, -1]


def test_total_reflection_is_a_status(exact: WorkerRenderer) -> None:
    """From inside a slab at 30 and 60 degrees; the critical angle is 41.8."""
    slab = box((-9, -9, -9), (9, 9, 0))
    scene = make_scene(
        camera((0, 0, -1), (0, 0, 0), 20, medium=1),
        solids=[(slab, 1, 0)],
        surfaces=[(rectangle((0, 0, 1), (30, 30)), glow(1, 1, 1))],
    )
    angles = np.radians([30.0, 60.0])
    directions = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=1)
    found = exact.trace(scene, Rays(np.tile([0, 0, -1.0], (2, 1)), directions), "T", SETTINGS)
    assert found.status.tolist() == [Status.HIT, Status.TIR]
