"""A resolved scene means the same to the tracer."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from harness.renderers.base import Rays, RenderSettings, Status
from harness.renderers.tracer import TracerEngine
from harness.scene import resolved as rs

FRAME = rs.Frame(origin=(0, 0, -3), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
MEDIA = (rs.Medium(name="vacuum", ior=1.0), rs.Medium(name="glass", ior=1.5))
CUBE = [(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
PLANES = ((-1, 0, 0, 1), (1, 0, 0, 1), (0, -1, 0, 1), (0, 1, 0, 1), (0, 0, -1, 1), (0, 0, 1, 1))


def scene(shape: rs.SolidShape, pattern: rs.Pattern) -> rs.ResolvedScene:
    wall = rs.Rectangle(frame=FRAME, size=(20, 20))
    return rs.ResolvedScene(
        film=rs.Film(width=24, height=16),
        camera=rs.Perspective(
            origin=(0, 0, 6), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), tan_half_fov_x=0.3
        ),
        media=MEDIA,
        solids=(rs.Solid(name="solid", shape=shape, medium=1, exterior=0),),
        surfaces=(rs.Surface(name="wall", shape=wall, material=rs.Emissive(pattern=pattern)),),
        transport=rs.Transport(max_depth=12, min_weight=1e-9),
    )


CHECKER = rs.Checker(a=(1, 0, 0), b=(0, 0, 1), cells=(10, 10))
CONVEX = rs.Convex(planes=PLANES, vertices=tuple(CUBE), faces=QUADS)
MESH = rs.Mesh(
    vertices=tuple(CUBE),
    triangles=tuple(t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))),
)


def test_film_has_width_and_height_the_right_way_round() -> None:
    image = TracerEngine().render(scene(CONVEX, CHECKER), RenderSettings())
    assert image.pixels.shape == (16, 24, 3)
    assert image.pixels.dtype == np.float32
    assert np.isfinite(image.pixels).all()


def test_a_cube_of_triangles_looks_like_a_cube_of_planes() -> None:
    engine = TracerEngine()
    a = engine.render(scene(CONVEX, CHECKER), RenderSettings())
    b = engine.render(scene(MESH, CHECKER), RenderSettings())
    assert np.abs(a.pixels - b.pixels).max() <= 1e-6


def test_picture_is_read_from_its_top_left() -> None:
    levels = np.array([[[65535, 0, 0], [0, 65535, 0]], [[0, 0, 65535], [0, 0, 0]]], "<u2")
    picture = rs.Picture(width=2, height=2, pixels=base64.b64encode(levels.tobytes()).decode())
    far = rs.Sphere(center=(0, 50, 0), radius=0.1)
    pixels = TracerEngine().render(scene(far, picture), RenderSettings()).pixels
    assert pixels[0, 0].tolist() == [1, 0, 0]
    assert pixels[0, -1].tolist() == [0, 1, 0]
    assert pixels[-1, 0].tolist() == [0, 0, 1]


def test_trace_follows_the_path() -> None:
    rays = Rays(np.array([[0.0, 0, 6]]), np.array([[0.0, 0, -1]]))
    found = TracerEngine().trace(scene(CONVEX, CHECKER), rays, "TT", RenderSettings())
    assert found.status[0] == Status.HIT
    assert found.surface[0] == 0
    assert found.point[0] == pytest.approx([0, 0, -3])
    assert found.optical_length[0] == pytest.approx(5 + 2 * 1.5 + 2)


def test_health_is_probed() -> None:
    assert TracerEngine().health().usable
