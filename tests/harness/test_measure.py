"""Metrics, statistics and tolerances against numbers that can be had without them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.expected import Float
from harness.measure import images
from harness.measure.comparison import Unmeasurable
from harness.measure.precision import Precision
from harness.measure.probe_truth import ProbeTruth, probe_truth
from harness.measure.radiance import true_picture
from harness.measure.rays import from_images, from_paths, surely_sampled
from harness.measure.statistics import BIN, Noise, binned
from harness.probe.decode import Reason
from harness.probe.scenes import AMPLITUDE, code_scene
from harness.renderers.base import RayPaths, Status
from harness.scene import resolved as rs
from tests.catalogue import EPS
from tests.fakes.student import module
from tests.harness.scenes import face, parallel, scene, slab

DOUBLE = Precision(EPS, EPS)
SINGLE = Precision(float(np.finfo(np.float32).eps), float(np.finfo(np.float32).eps))
EVERYWHERE = np.ones((16, 16), bool)


def even(value: float) -> np.ndarray:
    return np.full((16, 16, 3), value, np.float32)


# --- images ---------------------------------------------------------------------------------------


@given(st.floats(0.01, 1), st.floats(0.01, 1))
def test_ssim_of_even_pictures_is_that_of_their_means(a: float, b: float) -> None:
    """Wang et al. 2004: without variance (2ab + C1) / (a^2 + b^2 + C1), C1 = (0.01 range)^2."""
    c1 = 0.01**2
    a, b = (float(np.float32(x)) for x in (a, b))
    truth = (2 * a * b + c1) / (a * a + b * b + c1)
    # The means of the windows are rounded, and so are their squares: C2 = 9e-4 divides by that.
    assert images.ssim(even(a), even(b), 1.0) == pytest.approx(truth, abs=1e-11)


def test_ssim_of_equal_pictures_is_one() -> None:
    picture = np.random.default_rng(0).random((20, 30, 3)).astype(np.float32)
    assert images.ssim(picture, picture, 1.0) == 1.0


def test_metrics_of_pictures_that_differ_by_a_constant() -> None:
    a, b = even(0.5), even(0.75)
    assert images.rmse(a, b, EVERYWHERE) == 0.25
    assert images.psnr(a, b, EVERYWHERE, 1.0) == pytest.approx(20 * math.log10(4))
    assert (images.difference(a, b) == 0.25).all()
    assert images.psnr(a, a, EVERYWHERE, 1.0) == math.inf


def test_only_the_pixels_that_count_do() -> None:
    a, b = even(0.5), even(0.5)
    b[3, 4, 1] = 9.0
    keep = EVERYWHERE.copy()
    keep[3, 4] = False
    assert images.rmse(a, b, keep) == 0
    assert images.difference(a, b)[3, 4] == 8.5
    assert images.rmse(a, b, EVERYWHERE) == pytest.approx(8.5 / math.sqrt(16 * 16 * 3))


def test_blocks_are_averaged() -> None:
    fine = np.arange(6 * 4 * 3, dtype=np.float32).reshape(6, 4, 3)
    coarse = images.box_downsample(fine, 2)
    assert coarse.shape == (3, 2, 3)
    assert (coarse[1, 0] == fine[2:4, 0:2].mean(axis=(0, 1))).all()


def test_colour_differences() -> None:
    """Black and white are 100 apart; and the stated slope bounds what a small change can do."""
    assert images.delta_e(even(0.0), even(1.0)) == pytest.approx(100, abs=0.01)
    assert images.delta_e(even(0.3), even(0.3)).max() == 0
    rng = np.random.default_rng(5)
    level = 10 ** rng.uniform(-6, 0, (200, 100, 1))
    colour = (level * rng.random((200, 100, 3))).astype(np.float32)
    change = (1e-3 * level * rng.uniform(-1, 1, colour.shape)).astype(np.float32)
    other = np.maximum(colour + change, 0)
    moved = images.difference(colour, other)
    assert (images.delta_e(colour, other) <= images.LAB_SLOPE * moved + 1e-9).all()


# --- statistics -----------------------------------------------------------------------------------


def noisy(bias: float, seed: int, bins: int = 8) -> bool:
    rng = np.random.default_rng(seed)
    true = np.full((bins * BIN, 3), 0.5)
    value = true + bias + rng.normal(0, 0.1, true.shape)
    return binned(value, true, np.arange(len(true)), Noise(64, 0.05, 0.2)).within


def test_false_alarms_are_as_rare_as_stated() -> None:
    """At a level of 5% over all bins and channels, 400 runs raise 20 alarms, give or take.

    The probability of more than 40 is 1e-5, by the binomial distribution; of fewer than 5, too.
    """
    alarms = sum(not noisy(0.0, seed) for seed in range(400))
    assert 5 <= alarms <= 40


def test_a_bias_of_eight_standard_errors_is_always_seen() -> None:
    """A bin's mean errs by 0.1 / 16; a level of 5% over 24 means allows about 3.1 of that."""
    assert not any(noisy(8 * 0.1 / 16, seed) for seed in range(50))


def test_what_cannot_be_binned_is_no_pass() -> None:
    value = np.zeros((BIN, 3))
    with pytest.raises(Unmeasurable, match="too few"):
        binned(value[1:], value[1:], np.arange(BIN - 1), Noise(64, 0.05))
    value[7, 1] = np.nan
    with pytest.raises(Unmeasurable, match="not finite"):
        binned(value, np.zeros((BIN, 3)), np.arange(BIN), Noise(64, 0.05))


def test_pixels_that_all_fell_alike_still_have_an_error() -> None:
    """Without scatter every deviation would be infinitely many standard errors."""
    value = np.zeros((BIN, 3))
    found = binned(value, value + 1e-9, np.arange(BIN), Noise(64, 0.05))
    assert found.within
    assert not binned(value, value + 0.1, np.arange(BIN), Noise(64, 0.05)).within


@given(st.integers(1, 4096), st.integers(1, 100_000))
def test_a_path_above_the_sure_weight_is_missed_once_in_ten_thousand_probes(
    samples: int, rays: int
) -> None:
    weight = surely_sampled(samples, rays)
    assert 0 < weight <= 1
    assert rays * (1 - weight) ** samples == pytest.approx(1e-4, rel=1e-6)


# --- how sensitive a probe is ---------------------------------------------------------------------


def camera_of() -> rs.Orthographic:
    return rs.Orthographic(
        origin=(0, 0, 5), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), width=1.8
    )


def through_a_ball() -> ProbeTruth:
    made = scene((rs.Sphere(center=(0, 0, 0), radius=1), 1, 0))
    film = rs.Film(width=33, height=1)
    made = made.model_copy(update={"camera": camera_of(), "film": film})
    return probe_truth(made, "TT", (face(-3.0),))


def test_the_condition_of_a_ball_is_its_derivative() -> None:
    """The turn 2 (i - r) has the derivative 2 (1 / cos i - 1 / (n cos r)) by the height h."""
    truth = through_a_ball()
    h = truth.rays.origins[:, 0]
    cos_i, cos_r = np.sqrt(1 - h**2), np.sqrt(1 - (h / 1.5) ** 2)
    derivative = 2 * (1 / cos_i - 1 / (1.5 * cos_r))
    # A shift s across the plane of incidence turns that plane by s / h, and the ray with it.
    turn = 2 * (np.arcsin(h) - np.arcsin(h / 1.5))
    aside = np.divide(np.sin(turn), h, where=h != 0, out=derivative.copy())
    assert truth.direction.by_origin == pytest.approx(np.hypot(derivative, aside), rel=1e-3)


def test_the_condition_by_the_index_is_its_derivative() -> None:
    """Likewise d(turn)/dn n = 2 h / (n cos r)."""
    truth = through_a_ball()
    h = truth.rays.origins[:, 0]
    slope = 2 * np.abs(h) / (1.5 * np.sqrt(1 - (h / 1.5) ** 2))
    assert truth.direction.by_index == pytest.approx(slope, rel=1e-3, abs=1e-9)


def test_the_condition_by_a_ratio_of_indices_is_its_derivative() -> None:
    """Behind parallel faces sin(theta) goes with the one ratio of two glasses alone."""
    made = scene((slab(0, -1), 1, 0), (slab(-1, -2), 2, 0), ior=(1.5, 1.7))
    panes = [s.model_copy(update={"meets": (1 - k,)}) for k, s in enumerate(made.solids)]
    film = rs.Film(width=16, height=1)
    made = made.model_copy(update={"film": film, "solids": tuple(panes)})
    truth = probe_truth(made, "TTT", (face(-3.0),))
    cosine = -truth.rays.directions[:, 2]
    tangent = np.sqrt(1 - cosine**2) / cosine
    assert truth.direction.by_index == pytest.approx(tangent, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("path", ["T", "TT"])
def test_single_precision_stays_within_its_tolerance(path: str) -> None:
    """A slab traced in float32, step by step, with the formulas of the textbook."""
    made = scene((slab(0, -1, half=8), 1, 0)).model_copy(
        update={"film": rs.Film(width=64, height=8)}
    )
    plane = face(-0.5 if path == "T" else -1.5)
    truth = probe_truth(made, path, (plane,))
    f = np.float32
    o, d = truth.rays.origins.astype(f), truth.rays.directions.astype(f)
    n, eta = f(1.5), f(1) / f(1.5)
    for k, z in enumerate((f(0), f(-1))[: len(path)]):
        o = o + ((z - o[:, 2]) / d[:, 2])[:, None] * d
        ratio = eta if k == 0 else n
        cos_i = -d[:, 2]
        cos_t = np.sqrt(f(1) - ratio * ratio * (f(1) - cos_i * cos_i))
        d = ratio * d
        d[:, 2] = -cos_t
    point = o + ((f(plane.frame.origin[2]) - o[:, 2]) / d[:, 2])[:, None] * d
    assert point.dtype == f
    error = np.linalg.norm(point - truth.landings[0].point, axis=1)
    tolerance = truth.point_tolerance(SINGLE)
    assert (error <= tolerance).all()
    # Nor is the bound idle: some error comes within a factor of 100 of its own.
    assert (error / tolerance).max() > 0.01
    turned = np.linalg.norm(np.cross(d, truth.paths.direction), axis=1)
    assert (turned <= truth.direction_tolerance(SINGLE)).all()


def test_tolerances_shrink_with_precision() -> None:
    truth = through_a_ball()
    ratio = truth.point_tolerance(SINGLE) / truth.point_tolerance(DOUBLE)
    assert ratio == pytest.approx(SINGLE.arithmetic / DOUBLE.arithmetic, rel=1e-9)


def test_rays_at_an_edge_say_nothing() -> None:
    """Of rays on both sides of a ball's rim, those within a step of it."""
    made = scene((rs.Sphere(center=(0, 0, 0), radius=1), 1, 0))
    camera = camera_of().model_copy(update={"origin": (1.0, 0.0, 5.0), "width": 1e-3})
    made = made.model_copy(update={"camera": camera, "film": rs.Film(width=101, height=1)})
    truth = probe_truth(made, "TT", (face(-3.0),))
    gap = np.abs(truth.rays.origins[:, 0] - 1)
    assert truth.grazing[gap < 2e-5].all()
    inside = truth.rays.origins[:, 0] < 1 - 3e-4
    assert not truth.grazing[inside].any()


# --- from images and ray APIs to rays -------------------------------------------------------------


def test_images_and_a_ray_api_tell_the_same() -> None:
    made = scene((slab(0, -1, half=20), 1, 0)).model_copy(
        update={"film": rs.Film(width=16, height=4)}
    )
    planes = (face(-2.0, size=40.0), face(-3.0, size=40.0))
    truth = probe_truth(made, "TT", planes)
    render = module().render
    coded = {
        (k, axis): render(code_scene(made, p, axis, 512, "TT").model_dump(mode="json")).astype(
            np.float32
        )
        for k, p in enumerate(planes)
        for axis in "uv"
    }
    nothing = np.zeros(64, bool)
    seen = from_images(coded, truth, 512, 2.0**-25, EPS, nothing, None)
    m = len(truth.rays.origins)
    paths = RayPaths(
        status=np.full(m, Status.HIT, np.int8), surface=np.zeros(m, np.int32),
        point=truth.landings[0].point, direction=truth.paths.direction,
        weight=truth.paths.weight, optical_length=np.ones(m),
    )  # fmt: skip
    told = from_paths(paths)
    assert seen.seen.all()
    assert told.seen.all()
    assert (np.linalg.norm(seen.point - told.point, axis=1) <= seen.point_uncertainty).all()
    assert seen.direction is not None
    assert told.direction is not None
    apart = np.linalg.norm(np.cross(seen.direction, told.direction), axis=1)
    assert (apart <= seen.direction_uncertainty).all()
    assert (told.point_uncertainty == 0).all()


def test_a_ray_that_goes_backwards_is_told_as_it_goes() -> None:
    """More than a right angle off the true one: only the planes' order tells its sense."""
    planes = (face(-2.0, size=40.0), face(-3.0, size=40.0))
    tilt, small = math.radians(60), rs.Film(width=4, height=1)

    def seen_along(x: float) -> rs.ResolvedScene:
        camera = camera_of().model_copy(
            update={"origin": (0, 0, 0), "forward": (x * math.sin(tilt), 0, -math.cos(tilt)),
                    "right": (math.cos(tilt), 0, x * math.sin(tilt))}
        )  # fmt: skip
        return scene().model_copy(update={"camera": camera, "film": small})

    truth, render = probe_truth(seen_along(1), "", planes), module().render
    for order in ((0, 1), (1, 0)):
        coded = {
            (k, axis): render(
                code_scene(seen_along(-1), planes[p], axis, 512, "").model_dump(mode="json")
            ).astype(np.float32)
            for k, p in enumerate(order)
            for axis in "uv"
        }  # fmt: skip
        asked = replace(
            truth, planes=tuple(planes[p] for p in order),
            landings=tuple(truth.landings[p] for p in order),
        )  # fmt: skip
        found = from_images(coded, asked, 512, 2.0**-25, EPS, np.zeros(4, bool), None)
        assert found.seen.all()
        assert found.direction is not None
        wanted = [-math.sin(tilt), 0, -math.cos(tilt)]
        off = np.linalg.norm(found.direction - wanted, axis=1)
        assert (off <= found.direction_uncertainty).all()


def test_dark_and_broken_pixels_are_not_seen() -> None:
    made = scene((slab(0, -1, half=20), 1, 0)).model_copy(
        update={"film": rs.Film(width=4, height=1)}
    )
    plane = face(-2.0, size=40.0)
    truth = probe_truth(made, "TT", (plane,))
    coded = np.tile([0.25 * AMPLITUDE, 0.0, AMPLITUDE], (1, 4, 1)).astype(np.float32)
    coded[0, 1] = 0
    coded[0, 2] = np.nan
    coded[0, 3, 1] = 0.3
    pair = {(0, "u"): coded, (0, "v"): coded}
    found = from_images(pair, truth, 4, 1e-7, EPS, np.zeros(4, bool), None)
    assert found.seen.tolist() == [True, False, False, False]
    # Darkness says that no light came; anything else that does not decode, that something did.
    assert found.undecided.tolist() == [False, False, True, True]
    assert np.isnan(found.point[1:]).all()
    names = {Reason.OK, Reason.DARK, Reason.MIXED, Reason.NOT_FINITE}
    assert found.reasons == {reason.name.lower(): 1 for reason in names}


def test_a_ray_that_did_not_land_has_no_place_whatever_the_api_says() -> None:
    rays = parallel(np.zeros(3))
    status = np.array([Status.HIT, Status.TIR, Status.CUT], np.int8)
    found = from_paths(
        RayPaths(
            status, np.zeros(3, np.int32), np.ones((3, 3)), rays.directions, np.ones(3), np.ones(3)
        )
    )
    assert found.seen.tolist() == [True, False, False]
    assert np.isnan(found.point[1:]).all()
    assert found.reflected is not None
    assert found.reflected.tolist() == [False, True, False]


# --- pictures in closed form ----------------------------------------------------------------------


def picture_scene(*surfaces: rs.Surface, **more: object) -> rs.ResolvedScene:
    return scene().model_copy(
        update={"surfaces": surfaces, "film": rs.Film(width=32, height=24), **more}
    )


def emissive(z: float, pattern: rs.Pattern, size: float) -> rs.Surface:
    return rs.Surface(name=f"at-{-z:g}", shape=face(z, size), material=rs.Emissive(pattern=pattern))


def test_flat_emitters_against_another_renderer() -> None:
    checker = rs.Checker(a=(1, 0.5, 0.2), b=(0, 0.1, 0.9), cells=(7, 5))
    ramp = rs.Ramp(start=(0.1, 0.2, 0.3), end=(0.9, 0.8, 0.7), axis="v")
    made = picture_scene(
        emissive(0.0, checker, 3.0), emissive(-1.0, ramp, 9.0), background=(0.25, 0.5, 0.75)
    )
    true, edge = true_picture(made)
    other = module().render(made.model_dump(mode="json"))
    clear = edge > 1e-9
    assert clear.mean() > 0.9
    assert np.abs(true - other)[clear].max() <= 16 * EPS


def test_a_veil_passes_tinted_and_untinted_light() -> None:
    """The lecture's translucence: filter * colour + transmit of what is behind passes."""
    colour = np.array([0.9, 0.5, 0.1])
    veil = rs.Surface(
        name="veil", shape=face(0.0, 99.0),
        material=rs.Translucent(color=tuple(colour), filter=0.5, transmit=0.25),
    )  # fmt: skip
    light = rs.PointLight(position=(0.0, 0.0, 2.0), intensity=(3.0, 3.0, 3.0))
    behind = emissive(-1.0, rs.Constant(radiance=(1.0, 1.0, 1.0)), 99.0)
    dark, _ = true_picture(picture_scene(veil, behind))
    assert np.abs(dark - (0.5 * colour + 0.25)).max() <= 4 * EPS
    lit, _ = true_picture(picture_scene(veil, behind, lights=(light,)))
    # Straight below the light: I / r^2 / pi times what is left of the colour.
    made = picture_scene(veil, behind, lights=(light,))
    points = points_on(made, 0.0)
    r2 = points[..., 0] ** 2 + points[..., 1] ** 2 + 4
    diffuse = (0.25 * colour / math.pi) * (3 / r2 * 2 / np.sqrt(r2))[..., None]
    assert np.abs(lit - dark - diffuse).max() <= 8 * EPS


def points_on(made: rs.ResolvedScene, z: float) -> Float:
    """Where the pixels look, on the plane at `z` before the camera of `scene`."""
    width, height = made.film.width, made.film.height
    x = (2 * (np.arange(width) + 0.5) / width - 1) * (5 - z)
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * height / width * (5 - z)
    grid_x, grid_y = np.meshgrid(x, y)
    return np.stack([grid_x, grid_y, np.full_like(grid_x, z)], axis=-1)


def test_what_has_no_closed_form_is_refused() -> None:
    wall = rs.Surface(
        name="wall", shape=face(-2.0), material=rs.Emissive(pattern=rs.Constant(radiance=(1, 1, 1)))
    )  # fmt: skip
    with pytest.raises(ValueError, match="solids and faces"):
        true_picture(scene((slab(0, -1), 1, 0)).model_copy(update={"surfaces": (wall,)}))
    mirror = rs.Surface(
        name="mirror", shape=face(0.0), material=rs.Mirror(reflectance=(1, 1, 1))
    )  # fmt: skip
    with pytest.raises(ValueError, match="mirror"):
        true_picture(picture_scene(mirror))
