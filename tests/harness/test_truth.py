"""The chained truth against closed forms of whole systems, which know nothing of its chain.

Tolerances: a direction after k interfaces is right to 8 eps per interface times its condition, the
derivative of the angle that comes out by the one that goes in; a point, to 8 eps of the coordinates
on the way plus the direction's error times the distance.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.expected import Float
from harness.renderers.base import Rays, Status
from harness.scene import resolved as rs
from harness.scene.model import Box, Icosphere, Rotation
from harness.scene.resolved import ResolvedScene, Sphere
from harness.scene.shapes import polygons, solid_shape
from harness.truth.paths import ClosedForm, TruePaths
from tests.catalogue import EPS, Row, numbers, rows
from tests.harness.scenes import angle, face, fan, parallel, prism, scene, slab, unit

INDICES = st.floats(1.05, 3.0)
BALL = Sphere(center=(0, 0, 0), radius=1)


def follow(given_scene: ResolvedScene, rays: Rays, path: str) -> TruePaths:
    return ClosedForm(given_scene).follow(rays, path)


def hits(paths: TruePaths) -> bool:
    return bool((paths.status == Status.HIT).all())


# --- slabs ----------------------------------------------------------------------------------------

ANGLES = np.radians(np.linspace(0, 85, 52))


@given(INDICES, st.floats(1e-6, 5))
def test_a_slab_shifts_rays_and_keeps_their_direction(ior: float, thickness: float) -> None:
    """E. Hecht, Optics, 4.4: d = t sin(theta) (1 - cos(theta) / sqrt(n^2 - sin^2(theta)))."""
    rays = fan(ANGLES)
    made = scene((slab(0, -thickness), 1, 0), ior=(ior,))
    paths = follow(made, rays, "TT")
    assert hits(paths)
    assert angle(paths.direction, rays.directions).max() <= 16 * EPS / math.cos(ANGLES[-1])
    s, c = np.sin(ANGLES), np.cos(ANGLES)
    offset = thickness * s * (1 - c / np.sqrt(ior**2 - s**2))
    # How far the ray that leaves is from the line of the one that came, seen along -side.
    side = np.stack([c, np.zeros_like(c), s], axis=1)
    measured = -np.einsum("ij,ij->i", paths.origin - rays.origins, side)
    reach = 1 / c + thickness
    assert (np.abs(measured - offset) <= 16 * EPS * reach / c).all()
    assert (paths.medium == 0).all()


@given(INDICES)
def test_a_plane_in_the_glass_shows_the_angle_inside(ior: float) -> None:
    made = scene((slab(0, -3), 1, 0), ior=(ior,))
    exact, rays = ClosedForm(made), fan(ANGLES)
    paths = exact.follow(rays, "T")
    landing = exact.land(paths, face(-1.0))
    assert (landing.status == Status.HIT).all()
    assert (paths.medium == 1).all()
    tan_t = np.tan(np.arcsin(np.sin(ANGLES) / ior))
    # The ray enters at x = tan(theta) and has come down by 1 inside.
    assert (
        np.abs(landing.point[:, 0] - np.tan(ANGLES) - tan_t) <= 32 * EPS / np.cos(ANGLES) ** 2
    ).all()
    assert np.abs(landing.point[:, 2] + 1).max() <= 8 * EPS * np.tan(ANGLES[-1])


def test_the_true_interfaces_and_cosines_are_told() -> None:
    paths = follow(scene((slab(0, -2), 1, 0)), fan(ANGLES), "TT")
    theta_t = np.arcsin(np.sin(ANGLES) / 1.5)
    assert np.abs(paths.cos_theta_i[:, 0] - np.cos(ANGLES)).max() <= 8 * EPS
    assert np.abs(paths.cos_theta_i[:, 1] - np.cos(theta_t)).max() <= 8 * EPS
    assert np.abs(paths.interface[:, 0, 2]).max() <= 8 * EPS
    assert np.abs(paths.interface[:, 1, 2] + 2).max() <= 16 * EPS
    # Normals face the ray, on both faces.
    assert (paths.n == [0, 0, 1]).all()


@pytest.mark.parametrize("row", [r for r in rows("slab_RT") if r.p[0] == 0], ids=str)
def test_beer_lambert_and_fresnel_add_up_to_the_slab_s_transmittance(row: Row) -> None:
    """At normal incidence: T = (1 - r)^2 a / (1 - r^2 a^2), the sum over all internal reflections.

    The paths are TT, TRRT, TRRRRT, … through the slab, and R, TRT, TRRRT, … back from it.
    """
    _, ior, alpha, thickness = numbers(row.p)
    exact = ClosedForm(scene((slab(0, -thickness), 1, 0), ior=(ior,), absorption=(alpha,) * 3))

    def light(path: str, plane: rs.Rectangle) -> float:
        paths = exact.follow(fan(np.zeros(1)), path)
        return float(paths.weight[0] * exact.land(paths, plane).transmission[0, 0])

    behind, before = face(-thickness - 1), face(2.0)
    orders = range(12)  # each is r^2 = 1.6e-3 times the one before
    transmitted = sum(light("T" + "RR" * k + "T", behind) for k in orders)
    reflected = light("R", before) + sum(light("T" + "RR" * k + "RT", before) for k in orders)
    # A dozen roundings of sums below 1, each path's own far smaller.
    assert abs(transmitted - float(row.v[5])) <= 16 * EPS
    assert abs(reflected - float(row.v[4])) <= 16 * EPS


@pytest.mark.parametrize("row", rows("slab_T_scalar"), ids=str)
def test_the_truth_is_that_of_a_tracer_without_polarisation(row: Row) -> None:
    """Unpolarised Fresnel at each face. With polarisation, 0.72871 instead of 0.70788 at 70°."""
    degrees, ior = numbers(row.p)
    exact = ClosedForm(scene((slab(0, -1), 1, 0), ior=(ior,)))
    rays = fan(np.radians([degrees]))
    total = sum(float(exact.follow(rays, "T" + "RR" * k + "T").weight[0]) for k in range(40))
    assert abs(total - float(row.v)) <= 32 * EPS


def test_absorption_grows_with_the_way_inside() -> None:
    made = scene((slab(0, -0.7), 1, 0), absorption=(0.2, 0.7, 1.5))
    exact = ClosedForm(made)
    landing = exact.land(exact.follow(fan(ANGLES), "TT"), face(-1.0))
    length = 0.7 / np.cos(np.arcsin(np.sin(ANGLES) / 1.5))
    depth = length[:, None] * np.array([0.2, 0.7, 1.5])
    assert (np.abs(landing.transmission - np.exp(-depth)) <= 32 * EPS).all()


# --- prisms ---------------------------------------------------------------------------------------


def into_prism(apex: float, theta: Float) -> Rays:
    """Rays that enter the upper face in the middle of it, from the base's side of its normal."""
    target = 3 * np.array([-math.cos(apex / 2), 0.0, math.sin(apex / 2)])
    bearing = apex / 2 - theta  # of where the ray comes from, measured from +z towards +x
    towards = np.stack([np.sin(bearing), np.zeros_like(theta), np.cos(bearing)], axis=1)
    return Rays(target + 0.1 * towards, -towards)


@given(st.floats(0.2, 1.3), st.floats(1.2, 2.0))
def test_a_prism_deviates_as_its_closed_form(apex: float, ior: float) -> None:
    """Born & Wolf, 4.7.2: total internal reflection exactly where its arcsine has no value."""
    theta = np.radians(np.linspace(2, 88, 44))
    rays = into_prism(apex, theta)
    paths = follow(scene((prism(apex, 100.0), 1, 0), ior=(ior,)), rays, "TT")
    sine = math.sin(apex) * np.sqrt(ior**2 - np.sin(theta) ** 2) - math.cos(apex) * np.sin(theta)
    clear = np.abs(sine - 1) > 1e-12
    passes = clear & (sine < 1)
    assert (paths.status[clear & ~passes] == Status.TIR).all()
    assert (paths.status[passes] == Status.HIT).all()
    deviation = theta[passes] + np.arcsin(sine[passes]) - apex
    condition = ior / np.sqrt(1 - sine[passes] ** 2)
    measured = angle(paths.direction, rays.directions)[passes]
    assert (np.abs(measured - np.abs(deviation)) <= 32 * EPS * (1 + condition)).all()


@pytest.mark.parametrize("row", rows("prism_dev"), ids=str)
def test_a_prism_deviates_as_the_catalogue_says(row: Row) -> None:
    degrees, apex, ior = numbers(row.p)
    rays = into_prism(math.radians(apex), np.radians([degrees]))
    paths = follow(scene((prism(math.radians(apex)), 1, 0), ior=(ior,)), rays, "TT")
    assert hits(paths)
    condition = (
        1
        / paths.cos_theta_i[0, 1]
        * ior
        / math.sqrt(max(1e-3, 1 - (ior * math.sin(math.acos(paths.cos_theta_i[0, 1]))) ** 2))
    )
    measured = angle(paths.direction, rays.directions)[0]
    assert abs(math.degrees(measured) - float(row.v)) <= math.degrees(32 * EPS * (1 + condition))


# --- balls ----------------------------------------------------------------------------------------


@given(INDICES)
def test_a_ball_turns_rays_by_twice_the_difference_of_the_angles(ior: float) -> None:
    h = np.linspace(-0.99, 0.99, 67)
    rays = parallel(h)
    paths = follow(scene((BALL, 1, 0), ior=(ior,)), rays, "TT")
    assert hits(paths)
    i, r = np.arcsin(h), np.arcsin(h / ior)
    turn = 2 * (i - r)
    wanted = np.stack([-np.sin(turn), np.zeros_like(h), -np.cos(turn)], axis=1)
    # d(turn)/dh = 2 (1 / cos i - 1 / (n cos r)); h itself is right to eps of the 5 units before.
    bound = 16 * EPS * 5 / np.sqrt(1 - h**2)
    assert (angle(paths.direction, wanted) <= bound).all()


@pytest.mark.parametrize("row", rows("ball_real"), ids=str)
def test_a_ball_s_real_focus(row: Row) -> None:
    h, radius, ior = numbers(row.p)
    ball = Sphere(center=(0, 0, 0), radius=radius)
    paths = follow(scene((ball, 1, 0), ior=(ior,)), parallel(np.array([h]), 5 * radius), "TT")
    o, d = paths.origin[0], paths.direction[0]
    crossing = -(o[2] - d[2] * o[0] / d[0])
    # An error e of the point and of the angle moves the crossing by e / sin and L e / sin.
    bound = 16 * EPS * 5 * radius * (1 + crossing) / abs(d[0])
    assert abs(crossing - float(row.v[0])) <= bound


@pytest.mark.parametrize("row", rows("ball_view"), ids=str)
def test_the_view_through_a_ball(row: Row) -> None:
    phi, before, behind, radius, ior = numbers(row.p)
    ball = Sphere(center=(0, 0, 0), radius=radius)
    exact = ClosedForm(scene((ball, 1, 0), ior=(ior,)))
    paths = exact.follow(fan(np.radians([phi]), before), "TT")
    landing = exact.land(paths, face(-behind))
    assert landing.status[0] == Status.HIT
    y = float(row.v)
    # h = a sin(phi) is right to 8 eps a; the angles to that over cos i; the screen is b away.
    steep = 1 / math.sqrt(1 - (before * math.sin(math.radians(phi)) / radius) ** 2)
    bound = 8 * EPS * before / radius * steep * 4 * (behind + radius) / paths.direction[0, 2] ** 2
    assert abs(landing.point[0, 0] - y) <= bound


@pytest.mark.parametrize("row", rows("rainbow"), ids=str)
def test_rainbows_are_paths_with_internal_reflections(row: Row) -> None:
    """D = k pi + 2 i - 2 (k + 1) r, which is least at the angle in the catalogue."""
    ior, k = float(row.p[0]), int(row.p[1])
    i, total, _ = map(math.radians, numbers(row.v))
    exact = ClosedForm(scene((BALL, 1, 0), ior=(ior,)))

    def turned(height: float) -> float:
        paths = exact.follow(parallel(np.array([height])), "T" + "R" * k + "T")
        assert hits(paths)
        x, _, z = paths.direction[0]
        return float(np.arctan2(-x, -z) % (2 * math.pi))

    # At the extremum the angle of incidence does not matter to first order: what is left is the
    # rounding of 2 (k + 2) angles that grow up to 2 pi.
    bound = 8 * EPS * (k + 2) * 2 * math.pi
    assert abs(turned(math.sin(i)) - total) <= bound
    aside = [turned(math.sin(i + step)) for step in (-1e-3, 1e-3)]
    assert min(aside) > turned(math.sin(i))


@pytest.mark.parametrize("row", rows("aplanatic"), ids=str)
def test_the_aplanatic_points_of_a_ball(row: Row) -> None:
    """From R / n inside a ball every ray leaves as if it came from n R: no aberration at all."""
    radius, ior = numbers(row.p)
    source, image = numbers(row.v)
    ball = Sphere(center=(0, 0, 0), radius=radius)
    made = scene((ball, 1, 0), ior=(ior,), inside=1)
    theta = np.linspace(0.05, 1.3, 20)
    directions = np.stack([np.sin(theta), np.zeros_like(theta), np.cos(theta)], axis=1)
    rays = Rays(np.tile([0, 0, -source], (len(theta), 1)), directions)
    paths = follow(made, rays, "T")
    assert hits(paths)
    o, d = paths.origin, paths.direction
    crossing = o[:, 2] - d[:, 2] * o[:, 0] / d[:, 0]
    bound = 32 * EPS * ior * radius / d[:, 0] ** 2 / np.abs(d[:, 2] + 1e-3)
    assert (np.abs(crossing + image) <= bound).all()


@given(st.tuples(INDICES, INDICES))
def test_nested_balls_keep_bouguers_invariant(ior: tuple[float, float]) -> None:
    """In concentric spheres n r sin(theta) stays the same along a ray (Born & Wolf, 3.2)."""
    outer, inner = Sphere(center=(0, 0, 0), radius=2), Sphere(center=(0, 0, 0), radius=1)
    h = np.linspace(0.05, 0.6, 12)
    for solids in (((outer, 1, 0), (inner, 2, 1)), ((inner, 2, 1), (outer, 1, 0))):  # any order
        paths = follow(scene(*solids, ior=ior), parallel(h), "TTTT")
        assert hits(paths)
        sines = np.sqrt(1 - paths.cos_theta_i**2)
        before, radius = np.array([1, *ior, ior[0]]), np.array([2, 1, 1, 2])
        # A sine found from its cosine is right to eps / sine, and the index multiplies that.
        bound = 64 * EPS * 3 * 2 / sines
        assert (np.abs(before * radius * sines - h[:, None]) <= bound).all()
        assert (paths.medium == 0).all()


# --- how paths end --------------------------------------------------------------------------------


def test_total_internal_reflection_is_a_status() -> None:
    made = scene((slab(0, -10), 1, 0), inside=1)
    theta = np.radians([10.0, 41.8, 41.82, 60.0, 89.0])  # critical: 41.8103
    upwards = fan(theta, 1.0)
    rays = Rays(upwards.origins - [0, 0, 2], upwards.directions * [1, 1, -1])
    paths = follow(made, rays, "T")
    assert paths.status.tolist() == [Status.HIT] * 2 + [Status.TIR] * 3
    mirrored = follow(made, rays, "R")
    assert hits(mirrored)
    assert (mirrored.weight[2:] == 1).all()
    assert (mirrored.weight[:2] < 1).all()
    # What was totally reflected stays where it was: nothing of it lands anywhere.
    landing = ClosedForm(made).land(paths, face(5.0, normal=(0, 0, -1)))
    assert np.isnan(landing.point[2:]).all()
    assert landing.status.tolist() == paths.status.tolist()


def test_statuses() -> None:
    exact = ClosedForm(scene((BALL, 1, 0)))
    rays = parallel(np.array([0.5, 2.0]))
    assert exact.follow(rays, "TT").status.tolist() == [Status.HIT, Status.MISS]
    assert exact.follow(rays, "TTT").status.tolist() == [Status.MISS, Status.MISS]
    straight = exact.follow(rays, "")
    assert straight.status.tolist() == [Status.HIT, Status.HIT]
    # The ball is in the way of the first ray, of which the path says nothing.
    assert exact.land(straight, face(-3.0)).status.tolist() == [Status.CUT, Status.HIT]
    # Inside the ball, a plane behind it is beyond another interface.
    assert exact.land(exact.follow(rays, "T"), face(-3.0)).status[0] == Status.CUT
    assert exact.land(exact.follow(rays, "T"), face(0.0)).status[0] == Status.HIT
    # A plane in the back of the ray, or beside it.
    assert exact.land(exact.follow(rays, "TT"), face(3.0)).status[0] == Status.MISS
    assert exact.land(exact.follow(rays, "TT"), face(-3.0, size=0.01)).status[0] == Status.MISS


def test_a_world_without_solids() -> None:
    exact = ClosedForm(scene())
    rays = fan(np.radians([0.0, 45.0]))
    paths = exact.follow(rays, "")
    landing = exact.land(paths, face(-1.0))
    assert np.abs(landing.point - [[0, 0, -1], [2, 0, -1]]).max() <= 8 * EPS
    assert np.isinf(paths.ahead).all()
    assert (exact.follow(rays, "T").status == Status.MISS).all()


# --- polygons -------------------------------------------------------------------------------------


def test_a_convex_mesh_is_its_polyhedron() -> None:
    turn = Rotation(axis=(1.0, 2.0, 3.0), angle=20.0)
    box = solid_shape(Box(type="box", size=(2.0, 2.0, 2.0), rotate=(turn,)), Path())
    assert isinstance(box, rs.Convex)
    rays = parallel(np.linspace(-0.9, 0.9, 41))
    tilted = Rays(rays.origins, np.tile(unit((0.1, -0.07, -1.0)), (41, 1)))
    for path in ("TT", "TRT", "R"):
        a = follow(scene((box, 1, 0)), tilted, path)
        b = follow(scene((polygons(box), 1, 0)), tilted, path)
        assert (a.status == b.status).all()
        assert (a.status == Status.HIT).sum() > 10
        # The planes of the faces and those of their corners agree to 8 eps of the box's size, of
        # which each of the three interfaces may make as much again.
        assert np.abs(a.direction - b.direction).max() <= 3 * 16 * EPS
        assert np.abs(a.origin - b.origin).max() <= 3 * 16 * EPS * 5


def test_what_has_no_closed_form_is_refused() -> None:
    smooth = Icosphere(type="icosphere", radius=1.0, subdivisions=0, smooth=True)
    with pytest.raises(ValueError, match="no closed form"):
        ClosedForm(scene((solid_shape(smooth, Path()), 1, 0)))
    ball = solid_shape(Icosphere(type="icosphere", radius=1.0, subdivisions=1), Path())
    assert isinstance(ball, rs.Mesh)
    dented = ball.model_copy(update={"vertices": ((0.1, 0.1, 0.1), *ball.vertices[1:])})
    with pytest.raises(ValueError, match="not convex"):
        ClosedForm(scene((dented, 1, 0)))
