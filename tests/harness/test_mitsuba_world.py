"""Solids that Mitsuba has no shapes for, where the harness's own code follows the rays."""

from __future__ import annotations

import numpy as np
import pytest

from harness.errors import RendererUnsupported
from harness.renderers.base import Rays, RenderSettings, Status
from harness.renderers.persistent import WorkerRenderer
from harness.scene import resolved as rs
from tests.harness.povray_scenes import (
    GLASS,
    Array,
    box,
    camera,
    frame,
    glow,
    make_scene,
    on_plane,
    on_sphere,
    rectangle,
    refract,
)

pytestmark = pytest.mark.mitsuba

SETTINGS = RenderSettings(samples=1, threads=2)
N = GLASS.ior
FLOOR = rectangle((0, 0, -3), (16, 16))
# Positions up to 5 units away and directions, each rounded to single precision at three places on
# the way; faces are met at less than 60 degrees, over which no error grows to more than eightfold.
SINGLE = 3 * 5 * 8 * 2.0**-24


def down(count: int = 400) -> Rays:
    """Downwards within 10 degrees, from a square of 0.4 around (0, 0, 2)."""
    rng = np.random.default_rng(3)
    origins = np.column_stack([rng.uniform(-0.2, 0.2, (count, 2)), np.full(count, 2.0)])
    directions = np.column_stack([rng.uniform(-0.12, 0.12, (count, 2)), np.full(count, -1.0)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Rays(origins.astype(np.float32).astype(float), directions)


def scene_of(shape: rs.SolidShape, *more: rs.SolidShape, **kept: object) -> rs.ResolvedScene:
    solids = [(solid, 1, 0) for solid in (shape, *more)]
    view = camera((0, 0, 3), (0, 0, 0), 30)
    return make_scene(view, solids=solids, surfaces=[(FLOOR, glow(1, 1, 1))], **kept)


def landed(renderer: WorkerRenderer, scene: rs.ResolvedScene, rays: Rays, path: str) -> Array:
    found = renderer.trace(scene, rays, path, SETTINGS)
    assert (found.status == Status.HIT).all()
    return found.point


LENS = rs.Lens(
    frame=frame((0, 0, 0.3), z=(0, 0, -1)),
    thickness=0.6,
    radii=(2.0, -1.5),
    conics=(0.0, 0.0),
    aperture=0.7,
)
FRONT = rs.Sphere(center=(0, 0, 0.3 - 2.0), radius=2.0)
BACK = rs.Sphere(center=(0, 0, -0.3 + 1.5), radius=1.5)
COMMON = rs.Csg(operation="intersection", parts=(FRONT, BACK))


@pytest.mark.parametrize("shape", [LENS, COMMON], ids=["lens", "intersection"])
def test_a_lens_refracts_at_its_two_spheres(exact: WorkerRenderer, shape: rs.SolidShape) -> None:
    rays = down()
    origins, directions = rays.origins, rays.directions
    for sphere, far, ior in ((FRONT, False, (1.0, N)), (BACK, True, (N, 1.0))):
        origins = on_sphere(origins, directions, sphere, far=far)
        outward = (origins - np.array(sphere.center)) / sphere.radius
        directions = refract(directions, -outward if far else outward, *ior)
    x, y, _ = on_plane(origins, directions, FLOOR.frame)
    found = landed(exact, scene_of(shape), rays, "TT")
    assert np.abs(found[:, :2] - np.stack([x, y], axis=1)).max() <= SINGLE


def test_a_hyperbola_brings_parallel_light_to_a_point(exact: WorkerRenderer) -> None:
    """Its conic constant is -n^2; the focus is R / (n - 1) behind (E. Hecht, Optics, 5.2.1)."""
    radius = 3.3 * (N - 1)
    lens = rs.Lens(
        frame=frame((0, 0, 0.7), z=(0, 0, -1)),
        thickness=0.4,
        radii=(None, -radius),
        conics=(0.0, -(N**2)),
        aperture=0.6,
    )
    rays = down()
    straight = np.tile([0.0, 0.0, -1.0], (len(rays.origins), 1))
    found = landed(exact, scene_of(lens), Rays(rays.origins, straight), "TT")
    assert np.abs(found[:, :2]).max() <= SINGLE  # from z = 0.3 by 3.3 down to the floor at -3


def test_what_is_cut_away_is_air_and_what_is_joined_has_no_seam(exact: WorkerRenderer) -> None:
    """Boxes through which rays go straight on, moved aside by 0.4 of glass in all."""
    whole = box((-3, -3, -0.4), (3, 3, 0.4))
    gap = box((-9, -9, -0.2), (9, 9, 0.2))
    cut = rs.Csg(operation="difference", parts=(whole, gap))
    top, bottom = box((-3, -3, 0), (3, 3, 0.2)), box((-3, -3, -0.2), (3, 3, 0))
    joined = rs.Csg(operation="union", parts=(top, bottom))
    rays = down()
    slope = np.linalg.norm(rays.directions[:, :2], axis=1)
    inside = slope / N
    factor = np.tan(np.arcsin(inside)) / np.tan(np.arcsin(slope))  # of the way aside, in glass
    aside = rays.directions[:, :2] / -rays.directions[:, 2:] * (5.0 - 0.4 * (1 - factor))[:, None]
    for shape, path in ((cut, "TTTT"), (joined, "TT")):
        found = landed(exact, scene_of(shape), rays, path)
        assert np.abs(found[:, :2] - rays.origins[:, :2] - aside).max() <= SINGLE


def test_pictures_through_equal_solids_are_equal(exact: WorkerRenderer) -> None:
    """A ball of Mitsuba's own, and one as the common part of itself and a box around it."""
    ball = rs.Sphere(center=(0, 0, 0), radius=1)
    around = rs.Csg(operation="intersection", parts=(ball, box((-2, -2, -2), (2, 2, 2))))
    white = {"background": (1.0, 1.0, 1.0), "film": (48, 32)}
    theirs, ours = (
        exact.render(scene_of(shape, **white), SETTINGS).pixels for shape in (ball, around)
    )
    # Nothing darkens a white world: 20 segments and weights above 1e-7 leave less than 1e-5.
    assert np.abs(theirs - ours).max() <= 1e-5
    assert np.abs(ours - 1).max() <= 1e-5


def test_what_it_cannot_do_it_refuses(exact: WorkerRenderer) -> None:
    light = rs.PointLight(position=(0, 0, 2), intensity=(1, 1, 1))
    with pytest.raises(RendererUnsupported, match="shadows"):
        exact.render(scene_of(LENS, lights=(light,)), SETTINGS)
    balls = tuple(rs.Sphere(center=(0.1 * k, 0, 0), radius=0.3) for k in range(25))
    many = rs.Csg(operation="union", parts=balls)
    with pytest.raises(RendererUnsupported, match="25 faces"):
        exact.render(scene_of(many), SETTINGS)
