"""Single rays through slabs, prisms and balls against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.tracer.scenes import CAMERA, GLASS, X, Y, Z, angles, cube, cube_mesh, prism, slab, wall
from tracer.errors import SceneError
from tracer.itinerary import itinerary
from tracer.path import CUT, HIT, MISS, NO_LEG, TIR, follow
from tracer.scene import Medium, Mirror, Scene, Solid, Surface, ThinSlab, Translucent
from tracer.shapes import Rectangle, Sphere
from tracer.solids import cylinder

EPS = float(np.finfo(float).eps)


def fan(degrees: np.ndarray, height: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Rays from (0, 0, height) downwards, at the given angles from the normal."""
    theta = np.radians(degrees)
    directions = np.stack([np.sin(theta), np.zeros_like(theta), -np.cos(theta)], axis=1)
    return np.tile([0.0, 0.0, height], (len(theta), 1)), directions


ANGLES = np.linspace(0.0, 80.0, 161)


@pytest.mark.parametrize("thickness", [1e-3, 0.25, 1.0])
@pytest.mark.parametrize("ior", [1.333, 1.5, 2.417])
def test_slab_shifts_and_keeps_the_direction(thickness: float, ior: float) -> None:
    z = -thickness - 0.5
    scene = Scene(CAMERA, (Solid(slab(thickness), Medium(ior)),), (wall(z),))
    origins, directions = fan(ANGLES)
    found = follow(scene, origins, directions, "TT")
    assert (found.status == HIT).all()
    assert angles(found.direction, directions).max() <= 1e-12
    theta = np.radians(ANGLES)
    s, c = np.sin(theta), np.cos(theta)
    expected = thickness * s * (1 - c / np.sqrt(ior**2 - s**2))
    unshifted = origins + directions * ((0.5 - z) / c)[:, None]
    offset = (unshifted - found.point)[:, 0] * c
    # Points are known to eps of the largest coordinate, |x| <= 7 here, a few operations each.
    assert np.abs(offset - expected).max() <= 8 * 7 * 2.3e-16
    if thickness == 1.0:
        assert np.abs(offset[1:] / expected[1:] - 1).max() <= 1e-12
    fresnel_twice = found.weight
    assert fresnel_twice[0] == pytest.approx((1 - ((ior - 1) / (ior + 1)) ** 2) ** 2, rel=1e-14)
    straight = 0.5 + ior * thickness + 0.5
    assert found.optical_length[0] == pytest.approx(straight, rel=1e-14)


@pytest.mark.parametrize("from_behind", [False, True])
def test_thin_slab_does_to_a_ray_what_a_slab_does(from_behind: bool) -> None:
    thickness = 0.25
    face = Rectangle((0.0, 0.0, 0.0), X, Y, Z, (100.0, 100.0))
    thin = Surface(face, ThinSlab(GLASS, thickness))
    origins, directions = fan(ANGLES[ANGLES <= 75])
    z = -1.0
    if from_behind:
        origins, directions, z = -origins, -directions, 1.0
    real = follow(
        Scene(CAMERA, (Solid(slab(thickness), GLASS),), (wall(z),)), origins, directions, "TT"
    )
    ours = follow(Scene(CAMERA, (), (thin, wall(z))), origins, directions, "TT")
    assert (ours.status == HIT).all()
    assert (ours.surface == 1).all()
    assert (ours.direction == directions).all()
    assert np.abs(ours.point - real.point).max() <= 1e-14
    assert ours.weight == pytest.approx(real.weight, rel=1e-14)
    assert ours.optical_length == pytest.approx(real.optical_length, rel=1e-14)


@pytest.mark.parametrize(("apex", "ior"), [(60.0, 1.5), (40.0, 1.5), (45.0, 1.785)])
def test_prism_deviates_by_the_closed_form(apex: float, ior: float) -> None:
    """D = i + asin(sin A sqrt(n^2 - sin^2 i) - cos A sin i) - A; above 1, TIR."""
    i = np.radians(np.linspace(1.0, 88.0, 88))
    A = math.radians(apex)
    target = np.array([-1.0, 0.0, math.tan(A / 2)])  # on the upper face
    # The ray comes from the base's side of the normal, which stands at A / 2 from +z towards +x.
    beta = A / 2 - i
    towards = np.stack([np.sin(beta), np.zeros_like(i), np.cos(beta)], axis=1)
    scene = Scene(CAMERA, (Solid(prism(apex), Medium(ior)),), (wall(-50.0),))
    found = follow(scene, target + 0.05 * towards, -towards, "TT")
    sine = math.sin(A) * np.sqrt(ior**2 - np.sin(i) ** 2) - math.cos(A) * np.sin(i)
    passes = sine < 1
    assert (found.status[~passes] == TIR).all()
    deviation = i[passes] + np.arcsin(sine[passes]) - A
    measured = angles(found.direction, -towards)[passes]
    condition = 1 / np.sqrt(1 - sine[passes] ** 2)
    assert (np.abs(measured - deviation) <= 1e-14 * np.maximum(1, condition)).all()
    assert condition.size > 40


def test_ball_bends_as_the_closed_form() -> None:
    """Two refractions turn a ray by 2 (i - r), towards the axis."""
    scene = Scene(CAMERA, (Solid(Sphere((0.0, 0.0, 0.0), 1.0), GLASS),), (wall(-3.0),))
    h = np.linspace(0.0, 0.98, 200)  # beyond, rays turn by more than 90 degrees
    origins = np.stack([h, np.zeros_like(h), np.full_like(h, 3.0)], axis=1)
    found = follow(scene, origins, np.tile([0.0, 0.0, -1.0], (200, 1)), "TT", vertices=True)
    assert (found.status == HIT).all()
    turn = 2 * (np.arcsin(h) - np.arcsin(h / 1.5))
    expected = np.stack([-np.sin(turn), np.zeros_like(h), -np.cos(turn)], axis=1)
    condition = 1 / np.sqrt(1 - h**2)
    assert (angles(found.direction, expected) <= 1e-14 * condition).all()
    assert found.vertices.shape == (200, 4, 3)
    on_ball = np.linalg.norm(found.vertices[:, 1:3], axis=2)
    assert np.abs(on_ball - 1).max() <= 1e-15 * 3
    assert (found.vertices[:, 3] == found.point).all()


def test_statuses() -> None:
    ball = Solid(Sphere((0.0, 0.0, 0.0), 1.0), GLASS)
    scene = Scene(CAMERA, (ball,), (wall(-3.0),))
    down = [(0.0, 0.0, -1.0)]
    through = [(0.2, 0.0, 3.0)]

    def one(path: str, origin: list[tuple[float, float, float]] = through) -> tuple[int, int]:
        found = follow(scene, origin, down, path)
        assert np.isnan(found.point).all() == (found.status[0] != HIT)
        return int(found.status[0]), int(found.surface[0])

    assert one("TT") == (HIT, 0)
    assert one("T") == (CUT, -1)  # still inside
    assert one("TTT") == (MISS, -1)  # landed before its path was complete
    assert one("TT", [(5.0, 0.0, 3.0)]) == (MISS, -1)  # passed the ball by
    assert one("", [(5.0, 0.0, 3.0)]) == (HIT, 0)
    assert one("R") == (MISS, -1)  # back to where it came from
    inside = follow(scene, [(0.9, 0.0, 0.0)], down, "T")
    assert inside.status[0] == TIR


def test_mirror_takes_an_r() -> None:
    mirror = Surface(Rectangle((0.0, 0.0, 0.0), X, Y, Z, (2.0, 2.0)), Mirror())
    scene = Scene(CAMERA, (), (mirror, wall(5.0)))
    found = follow(scene, [(0.0, 0.0, 1.0)], [(0.6, 0.0, -0.8)], "R")
    assert found.status[0] == HIT
    assert found.surface[0] == 1
    assert found.direction[0] == pytest.approx((0.6, 0.0, 0.8), abs=1e-16)


def test_polygons_and_planes_bound_the_same_cube() -> None:
    """The rays hit faces, edges, diagonals and corners exactly."""
    x, y = np.meshgrid(np.linspace(-0.96, 0.96, 49), np.linspace(-0.96, 0.96, 49))
    origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, 3.0)], axis=1)
    tilt = np.tile([0.1, -0.2, -math.sqrt(1 - 0.05)], (x.size, 1))
    for directions in (np.tile([0.0, 0.0, -1.0], (x.size, 1)), tilt):
        for path in ("TT", "TRT", "TRRT"):
            a = follow(
                Scene(CAMERA, (Solid(cube(), GLASS),), (wall(-9.0),)), origins, directions, path
            )
            b = follow(
                Scene(CAMERA, (Solid(cube_mesh(), GLASS),), (wall(-9.0),)),
                origins,
                directions,
                path,
            )
            assert (a.status == b.status).all()
            hit = a.status == HIT
            assert np.abs(a.point[hit] - b.point[hit]).max(initial=0.0) <= 1e-14
            assert a.weight == pytest.approx(b.weight, rel=1e-13)


def test_bad_rays_are_refused_in_one_message() -> None:
    scene = Scene(CAMERA, (), (wall(-1.0),))
    with pytest.raises(SceneError, match="ray 1 needs a finite origin and a unit direction"):
        follow(scene, np.zeros((2, 3)), [(0, 0, -1), (0, 0, 0)], "")
    with pytest.raises(SceneError, match="letters T and R"):
        follow(scene, np.zeros((1, 3)), [(0, 0, -1)], "TX")


def test_all_that_happens_on_the_way() -> None:
    """A ball of water in a glass block: media, angles and factors of each leg, by Snell's law."""
    solids = (
        Solid(slab(4.0, front=2.0, half=4.0), Medium(1.5), name="block"),
        Solid(Sphere((0.0, 0.0, 0.0), 1.0), Medium(1.333), name="drop"),
    )
    scene = Scene(CAMERA, solids, (wall(-9.0),))
    theta = np.radians([0.0, 5.0, 9.0])
    origins = np.array([[-2.0 * math.tan(t) - 0.3, 0.0, 4.0] for t in theta])
    directions = np.column_stack([np.sin(theta), 0 * theta, -np.cos(theta)])
    found = follow(scene, origins, directions, vertices=True)
    assert (found.status == HIT).all()
    assert (found.solid[:, :6] == [-1, 0, 1, 0, -1, NO_LEG]).all()
    assert found.cos_theta_i[:, 0] == pytest.approx(np.cos(theta), rel=4 * EPS)
    indices = np.array([1.0, 1.5, 1.333, 1.5, 1.0])
    for k in range(4):
        cos_i, cos_t = found.cos_theta_i[:, k], found.cos_theta_t[:, k]
        sin_i, sin_t = np.sqrt(1 - cos_i**2), np.sqrt(1 - cos_t**2)
        # A root of 1 - cos^2 near 0 loses half of the digits.
        assert indices[k] * sin_i == pytest.approx(indices[k + 1] * sin_t, abs=4e-8)
        r_s = (indices[k] * cos_i - indices[k + 1] * cos_t) / (
            indices[k] * cos_i + indices[k + 1] * cos_t
        )
        r_p = (indices[k + 1] * cos_i - indices[k] * cos_t) / (
            indices[k + 1] * cos_i + indices[k] * cos_t
        )
        R = (r_s**2 + r_p**2) / 2
        assert found.reflectance[:, k] == pytest.approx(R, rel=1e-12)
    lengths = np.linalg.norm(np.diff(found.vertices[:, :6], axis=1), axis=2)
    assert found.optical_length == pytest.approx(lengths @ indices, rel=8 * EPS)
    assert found.weight == pytest.approx((1 - found.reflectance[:, :4]).prod(axis=1), rel=8 * EPS)
    told = itinerary(scene, found, 1).splitlines()
    assert len(told) == 6
    assert "block" in told[1]
    assert "drop" in told[2]
    assert told[-1].startswith("landed; weight 0.9")


def test_the_main_way_turns_where_light_is_totally_reflected() -> None:
    """Down a rod of glass: no loss at the side, 45 degrees each time, and out at the end."""
    rod = Solid(cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0, 9.0), Medium(1.5), name="rod")
    scene = Scene(CAMERA, (rod,), (wall(-9.0),))
    slope = 1 / math.sqrt(2)
    found = follow(scene, [[0.0, 0.0, 4.0]], [[slope, 0.0, -slope]], vertices=True)
    # From the axis at z = 4 it meets the side at 3, 1, -1, -3, the end at -4.5; n sin 45 > 1 there.
    assert found.vertices[0, 1:5, 2] == pytest.approx([3, 1, -1, -3], abs=1e-14)
    assert np.isnan(found.cos_theta_t[0, :5]).all()
    assert (found.reflectance[0, :5] == 1).all()
    assert "total" in itinerary(scene, found)


def test_a_surface_ends_the_main_way_but_mirrors_and_veils_do_not() -> None:
    mirror = Surface(Rectangle((0.0, 0.0, -1.0), X, Y, Z, (4.0, 4.0)), Mirror())
    veil = Surface(
        Rectangle((0.0, 0.0, 1.0), X, Y, Z, (4.0, 4.0)), Translucent((1.0, 1.0, 1.0), 0.5, 0.2)
    )
    scene = Scene(CAMERA, surfaces=(mirror, veil, wall(5.0)))
    found = follow(scene, [[0.0, 0.0, 3.0]], [[0.0, 0.0, -1.0]], vertices=True)
    assert found.status[0] == HIT
    assert found.surface[0] == 2
    assert found.vertices[0, :5, 2].tolist() == [3, 1, -1, 1, 5]
    nothing = follow(scene, [[0.0, 0.0, 3.0]], [[0.0, 0.0, -1.0]])
    assert nothing.solid.shape[0] == nothing.vertices.shape[0] == 0
