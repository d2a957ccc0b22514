"""Every shape as glass, and as the other materials; how fast polygons approach a ball."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.tracer.scenes import GLASS, X, Y, Z, angles, cube, cube_mesh, glass
from tracer.camera import Perspective
from tracer.errors import SceneError
from tracer.image import render
from tracer.mesh import Mesh
from tracer.path import follow
from tracer.patterns import Constant
from tracer.scene import (
    Diffuse,
    Emissive,
    Mirror,
    PointLight,
    Scene,
    Shape,
    Solid,
    SolidShape,
    Surface,
    ThinSlab,
    Translucent,
    Transport,
)
from tracer.shapes import Disk, Rectangle, Sphere
from tracer.solids import cone, cylinder, difference, intersection, lens, union

WHITE = (1.0, 1.0, 1.0)
CAMERA = Perspective((0.3, 0.2, 6.0), X, Y, (0.0, 0.0, -1.0), 0.25)
SHAPES: dict[str, SolidShape] = {
    "ball": Sphere((0.0, 0.0, 0.0), 1.0),
    "cube": cube(),
    "polygons": cube_mesh(),
    "rod": cylinder((0.0, 0.0, 0.0), (0.6, 0.0, 0.8), 0.7, 1.5),
    "cone": cone((0.0, 0.0, 0.9), (0.0, 0.0, -1.0), 0.8, 1.6),
    "cone from behind": cone((0.0, 0.0, -0.9), (0.0, 0.0, 1.0), 0.8, 1.6),
    "frustum": cone((0.0, 0.0, 0.9), (0.0, 0.0, -1.0), 0.8, 1.6, 0.3),
    "lens": lens((0.0, 0.0, 0.3), (0.0, 0.0, -1.0), (1.5, -1.2), 0.6, 0.5),
    "plano": lens((0.0, 0.0, 0.3), (0.0, 0.0, -1.0), (math.inf, -1.2), 0.6, 0.5),
    "parabolic": lens((0.0, 0.0, 0.3), (0.0, 0.0, -1.0), (1.5, -1.2), 0.6, 0.5, (-1.0, -3.0)),
    "biconcave": lens((0.0, 0.0, 0.1), (0.0, 0.0, -1.0), (-1.5, 1.2), 0.2, 0.8),
    "meniscus": lens((0.0, 0.0, 0.3), (0.0, 0.0, -1.0), (1.5, 2.2), 0.6, 0.8),
    "rod lens": lens((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.7, -0.9), 2.0, 0.6),
    "hollow hyperboloid": lens(
        (0.0, 0.0, 0.1), (0.0, 0.0, -1.0), (-1.5, 1.2), 0.2, 0.8, (-3.0, -1.0)
    ),
    "moon": difference(Sphere((0.0, 0.0, 0.0), 1.0), Sphere((0.5, 0.0, 0.6), 0.7)),
    "drilled cube": difference(cube(), cylinder((0.6, 0.6, 0.0), Z, 0.2, 6.0)),
    "cube with a knob": union(cube(), Sphere((0.0, 0.0, 0.9), 0.5)),
    "corner of a cube": intersection(cube(), Sphere((0.6, 0.6, 0.6), 1.5)),
}
each_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())


@each_shape
def test_white_world_stays_white(shape: Shape) -> None:
    """Light that enters leaves again: image and cut add up to 1 whatever the solid."""
    scene = Scene(CAMERA, (Solid(shape, GLASS),), background=WHITE, transport=Transport(24, 1e-5))
    image = render(scene, 48, 48)
    assert np.abs(image.pixels + image.cut[:, :, None] - 1).max() <= 1e-12


@each_shape
def test_mirrors_and_panes_of_any_shape(shape: Shape) -> None:
    mirror = Scene(CAMERA, surfaces=(Surface(shape, Mirror()),), background=WHITE)
    image = render(mirror, 32, 32)
    assert np.abs(image.pixels - 1).max() <= 1e-14
    sheet = Surface(shape, Translucent((1.0, 1.0, 1.0), filter=0.25, transmit=0.25))
    pixels = render(replace(mirror, surfaces=(sheet,)), 32, 32).pixels
    # The light of each pixel misses the surface or passes it twice; a hollow one, also four times.
    seen = set(np.round(pixels.ravel(), 12).tolist())
    assert {0.25, 1.0} <= seen <= {0.0625, 0.25, 1.0}


@each_shape
def test_diffuse_shapes_shadow_themselves(shape: Shape) -> None:
    """Light from behind the camera reaches what it sees; light from the far side does not."""
    body = Surface(shape, Diffuse(WHITE))
    front = PointLight((0.3, 0.2, 6.0), (36.0, 36.0, 36.0))
    seen = render(Scene(CAMERA, surfaces=(body,), lights=(front,)), 32, 32).pixels
    covered = render(
        Scene(CAMERA, surfaces=(Surface(shape, Emissive(Constant(WHITE))),)), 32, 32
    ).pixels
    assert ((seen > 0) == (covered > 0)).all()
    assert covered.max() == 1.0
    inside = PointLight((0.0, 0.0, 0.0), WHITE)
    dark = render(Scene(CAMERA, surfaces=(body,), lights=(inside,)), 32, 32).pixels
    assert (dark == 0).all()


def test_disk_is_round() -> None:
    disk = Disk((0.0, 0.0, 0.0), X, Y, Z, 1.0)
    scene = Scene(CAMERA, surfaces=(Surface(disk, Emissive(Constant(WHITE))),))
    seen = render(scene, 512, 512).pixels[:, :, 0].sum()
    on_film = math.pi / (6 * 0.25) ** 2 / 4  # of the film's area
    assert seen / 512**2 == pytest.approx(on_film, rel=2e-3)


BAD: dict[str, Callable[[], object]] = {
    "sphere: radius": lambda: Sphere((0.0, 0.0, 0.0), 0.0),
    "rectangle: height": lambda: Rectangle((0.0, 0.0, 0.0), X, Y, Z, (1.0, math.nan)),
    "disk: radius": lambda: Disk((0.0, 0.0, 0.0), X, Y, Z, -1.0),
    "cylinder: height": lambda: cylinder((0.0, 0.0, 0.0), Z, 1.0, math.inf),
    "cone: radius": lambda: cone((0.0, 0.0, 0.0), Z, -1.0, 1.0),
    "cone: tip_radius": lambda: cone((0.0, 0.0, 0.0), Z, 1.0, 1.0, 1.5),
    "lens: a radius of curvature": lambda: lens((0.0, 0.0, 0.0), Z, (math.nan, 1.0), 0.1, 0.5),
    "does not reach": lambda: lens((0.0, 0.0, 0.0), Z, (-1.0, 1.0), 0.1, 1.5),
    "lens: thickness": lambda: lens((0.0, 0.0, 0.0), Z, (1.0, -1.0), 0.0, 0.5),
    "thickness must be positive": lambda: ThinSlab(GLASS, 0.0),
    "finite numbers": lambda: PointLight((0.0, math.nan, 0.0), WHITE),
    "max_depth": lambda: Transport(0),
    "min_weight": lambda: Transport(10, 1.0),
    "together at most 1": lambda: Translucent(WHITE, 0.6, 0.5),
}


@pytest.mark.parametrize(("message", "make"), BAD.items(), ids=BAD.keys())
def test_what_has_no_meaning_is_refused(message: str, make: Callable[[], object]) -> None:
    with pytest.raises(SceneError, match=message):
        make()


@pytest.mark.parametrize("ulps", [-4, 0, 4])
def test_along_the_axis_a_direction_may_be_long_by_rounding(ulps: int) -> None:
    hollow = lens((0.0, 0.0, 0.2), (0.0, 0.0, -1.0), (-1.5, 1.2), 0.4, 0.8)
    found = follow(
        glass(hollow, 1.5),
        [[0.0, 0.0, 1.0]],
        [[0.0, 0.0, -(1.0 + ulps * np.finfo(float).eps)]],
        "TT",
        vertices=True,
    )
    assert found.vertices[0, 1:3, 2] == pytest.approx([0.2, -0.2], abs=1e-15)


def icosphere(subdivisions: int, smooth: bool) -> Mesh:
    """All vertices on the unit sphere; each triangle becomes four."""
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=1.0)
    vertices = np.ascontiguousarray(ball.vertices, float)
    normals = vertices / np.linalg.norm(vertices, axis=1)[:, None] if smooth else None
    return Mesh(vertices, np.ascontiguousarray(ball.faces, np.int64), normals)


@pytest.mark.parametrize(("smooth", "order"), [(False, 1.0), (True, 2.0)])
def test_polygons_approach_the_ball(smooth: bool, order: float) -> None:
    """The exit direction's error shrinks with the edge length, with its square if smooth."""
    rng = np.random.default_rng(7)
    radius, turn = 0.7 * np.sqrt(rng.random(4000)), rng.uniform(0, 2 * math.pi, 4000)
    origins = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(4000, 3.0)], axis=1)
    directions = np.tile([0.0, 0.0, -1.0], (4000, 1))
    exact = follow(glass(Sphere((0.0, 0.0, 0.0), 1.0), 1.5), origins, directions, "TT")
    errors = []
    for subdivisions in (3, 4, 5):
        mesh = icosphere(subdivisions, smooth)
        found = follow(glass(mesh, 1.5), origins, directions, "TT")
        errors.append(float(np.sqrt(np.mean(angles(found.direction, exact.direction) ** 2))))
    orders = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert orders == pytest.approx([order, order], abs=0.15)
