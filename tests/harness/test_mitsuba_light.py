"""What Mitsuba sees, in both of its modes, against closed forms computed here.

Tolerances. The exact mode sums products of single precision numbers, each with a handful of
roundings of 2^-24: `SINGLE` of the largest radiance allows for 32. The stock mode samples; it is
judged by the variance that it tells, at six standard deviations: 4e-5 for one false alarm in the
20,000 pixels and channels that these tests compare.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import stdtrit

from harness.renderers.base import RenderSettings
from harness.renderers.mitsuba import SEEDS
from harness.renderers.persistent import WorkerRenderer
from harness.scene import resolved as rs
from tests.harness.povray_scenes import (
    AIR,
    GLASS,
    Array,
    box,
    camera,
    frame,
    fresnel,
    glow,
    make_scene,
    on_plane,
    rays,
    rectangle,
)

pytestmark = pytest.mark.mitsuba

SETTINGS = RenderSettings(samples=64, threads=2)
SINGLE = 32 * 2.0**-24
SIGMAS = 6
N = 1.5
BALL = rs.Sphere(center=(0, 0, 0), radius=1)
SLAB = box((-8, -8, -0.5), (8, 8, 0))


def pixels(
    renderer: WorkerRenderer, scene: rs.ResolvedScene, settings: RenderSettings = SETTINGS
) -> Array:
    """(H * W, 3) float64."""
    return renderer.render(scene, settings).pixels.reshape(-1, 3).astype(np.float64)


def assert_seen(renderer: WorkerRenderer, scene: rs.ResolvedScene, expected: Array) -> None:
    """The exact mode sees `expected`, (H * W, 3) or a shape that broadcasts to it."""
    expected = np.broadcast_to(expected, (scene.film.width * scene.film.height, 3))
    error = np.abs(pixels(renderer, scene) - expected)
    assert error.max() <= SINGLE * max(1.0, expected.max())


def assert_sampled(renderer: WorkerRenderer, scene: rs.ResolvedScene, expected: Array) -> None:
    """The stock mode's mean is `expected`, as far as its own variance can tell.

    A pixel's variance comes from `SEEDS` renders, so its error is judged by Student's t at a level
    of 1e-6 over all values, and where its few lobes fell alike by the scatter of all pixels; the
    mean of all pixels, whose variance is known well, by 6 sigma.
    """
    image = renderer.render(scene, SETTINGS)
    assert image.variance is not None
    error = image.pixels.reshape(-1, 3) - expected
    scatter = np.sqrt(image.variance.reshape(-1, 3).astype(np.float64))
    rounding = SINGLE * max(1.0, np.max(expected))
    limit = -stdtrit(min(SEEDS, SETTINGS.samples) - 1, 1e-6 / (2 * error.size))
    usual = np.sqrt((scatter**2).mean(axis=0))
    assert (np.abs(error) <= limit * np.maximum(scatter, usual) + rounding).all()
    spread = np.sqrt((scatter**2).sum(axis=0)) / len(error)
    assert (np.abs(error.mean(axis=0)) <= SIGMAS * spread + rounding).all()


def with_transport(scene: rs.ResolvedScene, **change: object) -> rs.ResolvedScene:
    return scene.model_copy(update={"transport": scene.transport.model_copy(update=change)})


# --- camera and patterns ------------------------------------------------------------------------

PERSPECTIVE = camera((0.3, 0.4, 6), (0.5, -0.2, -3), 33)
PARALLEL = rs.Orthographic(
    origin=(-5.5, 0.2, 5), right=(0.8, 0, 0.6), up=(0, 1, 0), forward=(0.6, 0, -0.8), width=7
)
FLAT = rs.Orthographic(origin=(0, 0, 3), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), width=2)
TILTED = rectangle((0.5, -0.2, -3), (6, 4), z=(0.3, -0.2, 1), up=(0.2, 1, 0))
TEXELS = np.random.default_rng(1).integers(0, 65536, (37, 53, 3)).astype("<u2")
PICTURE = rs.Picture(width=53, height=37, pixels=base64.b64encode(TEXELS.tobytes()).decode())
DARK, BRIGHT = np.array((0.1, 2, 0.5)), np.array((3, 0.2, 0.5))


def picture_at(u: Array, v: Array) -> Array:
    return np.asarray(TEXELS[((1 - v) * 37).astype(int), (u * 53).astype(int)] / 65535)


def checker_at(u: Array, v: Array) -> Array:
    even = (np.floor(u * 31) + np.floor(v * 17)) % 2 == 0
    return np.where(even[:, None], DARK, BRIGHT)


def ramp_at(u: Array, v: Array) -> Array:
    return DARK + v[:, None] * (BRIGHT - DARK)


PATTERNS: dict[str, tuple[rs.Pattern, Callable[[Array, Array], Array]]] = {
    "picture": (PICTURE, picture_at),
    "checker": (
        rs.Checker(a=(0.1, 2, 0.5), b=(3, 0.2, 0.5), cells=(31, 17)),
        checker_at,
    ),
    "ramp": (rs.Ramp(start=(0.1, 2, 0.5), end=(3, 0.2, 0.5), axis="v"), ramp_at),
}


@pytest.mark.parametrize("name", PATTERNS)
@pytest.mark.parametrize("view", [PERSPECTIVE, PARALLEL], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("round_face", [False, True], ids=["rectangle", "disk"])
def test_patterns_lie_where_they_should(
    exact: WorkerRenderer, name: str, view: rs.Camera, round_face: bool
) -> None:
    """A picture of noise is as asymmetric as can be: it tells every mirror image and shift."""
    pattern, at = PATTERNS[name]
    face = rs.Disk(frame=TILTED.frame, radius=2) if round_face else TILTED
    scene = make_scene(view, surfaces=[(face, rs.Emissive(pattern=pattern))])
    x, y, _ = on_plane(*rays(scene), TILTED.frame)
    width, height = (4, 4) if round_face else (6, 4)
    u, v = x / width + 0.5, y / height + 0.5
    inside = np.hypot(x, y) < 2 if round_face else (np.abs(x) < 3) & (np.abs(y) < 2)
    assert 0.2 < inside.mean() < 1
    seen = np.where(inside[:, None], at(np.clip(u, 0, 1 - 1e-9), np.clip(v, 1e-9, 1)), 0)
    assert_seen(exact, scene, seen)


def test_stock_pixels_are_means_over_their_squares(stock: WorkerRenderer) -> None:
    """A ramp's mean is its value at the centre, for a camera without perspective."""
    plane = rectangle((0.5, -0.2, -3), (8, 6))
    pattern, at = PATTERNS["ramp"]
    scene = make_scene(FLAT, surfaces=[(plane, rs.Emissive(pattern=pattern))])
    x, y, _ = on_plane(*rays(scene), plane.frame)
    assert_sampled(stock, scene, at(x / 8 + 0.5, y / 6 + 0.5))


# --- energy ---------------------------------------------------------------------------------------

TINTED = rs.Medium(name="glass", ior=N, absorption=(0.0, 0.4, 2.0))
LONG = rs.Transport(max_depth=80, min_weight=1e-9)


def slab_light(cos_theta_i: Array, thickness: float = 0.5) -> tuple[Array, Array]:
    """What a slab of `TINTED` reflects and passes, with all internal reflections, (m, 3) each.

    With the reflectance R of each face and the part A that a crossing leaves, T = (1 - R)^2 A /
    (1 - R^2 A^2) passes and R + R A T is reflected.
    """
    cos_theta_i = cos_theta_i[:, None]
    cos_theta_t = np.sqrt(1 - (1 - cos_theta_i**2) / N**2)
    a = np.exp(-np.array(TINTED.absorption) * thickness / cos_theta_t)
    r = fresnel(cos_theta_i, 1.0, N)
    passed = (1 - r) ** 2 * a / (1 - r**2 * a**2)
    return r + r * a * passed, passed


def before_slab(view: rs.Camera, glass: rs.Medium = TINTED, **more: object) -> rs.ResolvedScene:
    """A slab between planes: of radiance (1, 2, 3) behind it and (0.5, 0.3, 0.1) before it."""
    return make_scene(
        view,
        solids=[(box((-30, -30, -0.5), (30, 30, 0)), 1, 0)],
        surfaces=[
            (rectangle((0, 0, -1), (400, 400)), glow(1, 2, 3)),
            (rectangle((0, 0, 1), (400, 400), z=(0, 0, -1)), glow(0.5, 0.3, 0.1)),
        ],
        media=(AIR, glass),
        transport=LONG,
        **more,
    )


def test_a_slab_reflects_passes_and_absorbs(exact: WorkerRenderer) -> None:
    """At 0 to 75 degrees of incidence."""
    scene = before_slab(camera((0, 0, 0.5), (math.sin(0.6), 0.05, 0.5 - math.cos(0.6)), 74))
    back, through = slab_light(-rays(scene)[1][:, 2])
    assert_seen(exact, scene, back * (0.5, 0.3, 0.1) + through * (1, 2, 3))


def test_stock_sees_the_same_slab(stock: WorkerRenderer) -> None:
    """At 50 degrees, for all pixels."""
    s, c = math.sin(math.radians(50)), math.cos(math.radians(50))
    view = rs.Orthographic(
        origin=(-0.5 * s, 0, 0.5 * c), right=(c, 0, s), up=(0, 1, 0), forward=(s, 0, -c), width=0.4
    )
    for glass in (TINTED, GLASS):
        back, through = slab_light(np.array([c]))
        if glass is GLASS:
            through = np.repeat(through[:, :1], 3, axis=1)  # the first channel absorbs nothing
            back = np.repeat(back[:, :1], 3, axis=1)
        expected = back * (0.5, 0.3, 0.1) + through * (1, 2, 3)
        assert_sampled(stock, before_slab(view, glass, film=(16, 12)), expected)


def test_lobes_are_switched_off_but_total_reflection_is_not(exact: WorkerRenderer) -> None:
    view = camera((0, 0, 0.5), (math.sin(0.6), 0.05, 0.5 - math.cos(0.6)), 74)
    scene = before_slab(view, GLASS)
    r = fresnel(-rays(scene)[1][:, 2], 1.0, N)[:, None]
    assert_seen(exact, with_transport(scene, reflection=False), (1 - r) ** 2 * (1, 2, 3))
    assert_seen(exact, with_transport(scene, transmission=False), r * (0.5, 0.3, 0.1))


def test_total_reflection_is_followed_with_reflection_off(exact: WorkerRenderer) -> None:
    """A 45 degree prism: down through its top, totally reflected, out through its side."""
    corners = [(x, y, z) for x, z in ((0, 0), (2, 0), (2, -2)) for y in (-1, 1)]
    slant = math.sqrt(0.5)
    prism = rs.Convex(
        planes=((0, 0, 1, 0), (1, 0, 0, 2), (-slant, 0, -slant, 0), (0, -1, 0, 1), (0, 1, 0, 1)),
        vertices=tuple(corners),
        faces=((0, 2, 3, 1), (2, 4, 5, 3), (0, 1, 5, 4), (0, 4, 2), (1, 3, 5)),
    )
    view = rs.Orthographic(
        origin=(1, 0, 3), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), width=1.5
    )
    scene = make_scene(
        view,
        solids=[(prism, 1, 0)],
        surfaces=[(rectangle((5, 0, 0), (20, 20), z=(-1, 0, 0)), glow(1, 2, 3))],
        media=(AIR, TINTED),
        transport=rs.Transport(max_depth=9, min_weight=0, reflection=False),
    )
    # Everyone's way through the glass is 2 long, and both faces are met head-on.
    passed = 0.96**2 * np.exp(-2 * np.array(TINTED.absorption))
    assert_seen(exact, scene, passed * (1, 2, 3))
    assert_seen(exact, with_transport(scene, transmission=False), np.zeros(3))


def test_a_white_world_stays_white(exact: WorkerRenderer) -> None:
    """Nested glass balls neither add nor lose light, but for what is cut below 1e-9."""
    scene = make_scene(
        camera((0, 0, 6), (0, 0, 0), 22),
        solids=[(BALL, 1, 0), (rs.Sphere(center=(0.1, 0, 0), radius=0.5), 2, 1)],
        media=(AIR, GLASS, rs.Medium(name="water", ior=1.33)),
        background=(1.0, 0.5, 0.25),
        transport=rs.Transport(max_depth=300, min_weight=1e-9),
    )
    error = np.abs(pixels(exact, scene) - (1.0, 0.5, 0.25))
    # Where whole families of paths are cut (grazing rays are trapped) a little is missing.
    assert np.quantile(error, 0.98) <= SINGLE
    assert error.max() <= 1e-4


def test_radiance_grows_with_the_square_of_the_index(
    exact: WorkerRenderer, stock: WorkerRenderer
) -> None:
    """Mitsuba's convention, claimed as `RADIANCE_N2`: from inside glass a white world is n^2."""
    scene = make_scene(
        camera((0.2, 0.1, 0), (0, 0, -1), 60, medium=1),
        solids=[(BALL, 1, 0)],
        background=(1.0, 1.0, 1.0),
        transport=LONG,
    )
    assert_seen(exact, scene, np.array(N**2))
    assert_sampled(stock, scene, np.array(N**2))


def test_a_path_is_cut_at_its_depth_and_weight(exact: WorkerRenderer) -> None:
    """Of the sum over internal reflections only the first terms are left."""
    view = camera((0, 0, 0.5), (0, 0, 0), 40)
    scene = before_slab(view, GLASS)
    cos_theta_i = -rays(scene)[1][:, 2]
    r = fresnel(cos_theta_i, 1.0, N)[:, None]
    first = (1 - r) ** 2 * (1, 2, 3) + r * (0.5, 0.3, 0.1)
    assert_seen(exact, with_transport(scene, max_depth=3), first)
    # The next term has R (1 - R)^2 of at least 3.6e-2, and further ones less than 2.3e-3.
    second = first + r * (1 - r) ** 2 * (0.5, 0.3, 0.1)
    assert_seen(exact, with_transport(scene, min_weight=1e-2), second)


# --- surfaces -------------------------------------------------------------------------------------

FLAT = rs.Orthographic(origin=(0, 0, 3), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), width=2)


def lambert(scene: rs.ResolvedScene, color: tuple[float, float, float]) -> Array:
    """Radiance of a diffuse plane z = 0 under the scene's only light."""
    (light,) = scene.lights
    origins = rays(scene)[0] * (1, 1, 0)
    away = np.array(light.position) - origins
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    falls = np.array(light.intensity) * away[:, 2:] / distance**3
    return np.asarray(np.array(color) / math.pi * falls)


def lit(material: rs.Material, *more: tuple[rs.SurfaceShape, rs.Material]) -> rs.ResolvedScene:
    light = rs.PointLight(position=(0.3, -0.2, 1.5), intensity=(3.0, 2.0, 1.0))
    sheet = rectangle((0, 0, 0), (8, 8))
    return make_scene(FLAT, surfaces=[(sheet, material), *more], lights=(light,))


def test_a_diffuse_plane_under_a_point_light(exact: WorkerRenderer) -> None:
    color = (0.8, 0.5, 0.2)
    scene = lit(rs.Diffuse(reflectance=color))
    assert_seen(exact, scene, lambert(scene, color))


def test_a_diffuse_plane_is_lit_from_the_side_that_is_seen(exact: WorkerRenderer) -> None:
    """Its back too, but nothing shines through."""
    color = (0.8, 0.5, 0.2)
    scene = lit(rs.Diffuse(reflectance=color))
    turned = rectangle((0, 0, 0), (8, 8), z=(0, 0, -1))
    back = scene.surfaces[0].model_copy(update={"shape": turned})
    assert_seen(exact, scene.model_copy(update={"surfaces": (back,)}), lambert(scene, color))
    behind = scene.lights[0].model_copy(update={"position": (0.3, -0.2, -1.5)})
    assert_seen(exact, scene.model_copy(update={"lights": (behind,)}), np.zeros(3))


def test_what_is_in_the_way_of_a_light_casts_a_shadow(exact: WorkerRenderer) -> None:
    """A disk above the plane, under the light, too high to be seen itself."""
    color = (0.8, 0.5, 0.2)
    disk = rs.Disk(frame=frame((0.3, -0.2, 3.5)), radius=0.1)
    scene = lit(rs.Diffuse(reflectance=color), (disk, rs.Diffuse(reflectance=(0, 0, 0))))
    light = scene.lights[0].model_copy(update={"position": (0.3, -0.2, 4.0)})
    scene = scene.model_copy(update={"lights": (light,)})
    origins = rays(scene)[0] * (1, 1, 0)
    # The cone from 4 through the disk at 3.5 has a radius of 0.1 * 4 / 0.5 on the plane.
    distance = np.linalg.norm(origins - (0.3, -0.2, 0), axis=1, keepdims=True)
    shadow = distance < 0.1 * 4 / 0.5
    assert 0.2 < shadow.mean() < 0.9
    seen = np.where(shadow, 0, lambert(scene, color))
    clear = np.abs(distance - 0.8)[:, 0] > 1e-4  # of the edge, single precision cannot say
    error = np.abs(pixels(exact, scene) - seen)
    assert error[clear].max() <= SINGLE


@pytest.mark.parametrize("back", [False, True], ids=["front", "back"])
def test_a_translucent_sheet_passes_tints_and_scatters(
    exact: WorkerRenderer, stock: WorkerRenderer, back: bool
) -> None:
    """Of the light behind, filter * color + transmit passes; the rest is diffuse."""
    color = (0.9, 0.5, 0.2)
    sheet = rs.Translucent(color=color, filter=0.3, transmit=0.2)
    behind = rectangle((0, 0, -2), (8, 8)), glow(1, 2, 3)
    scene = lit(sheet, behind)
    if back:
        turned = rectangle((0, 0, 0), (8, 8), z=(0, 0, -1))
        face = scene.surfaces[0].model_copy(update={"shape": turned})
        scene = scene.model_copy(update={"surfaces": (face, scene.surfaces[1])})
    through = 0.3 * np.array(color) + 0.2
    expected = through * (1, 2, 3) + 0.5 * lambert(scene, color)
    assert_seen(exact, scene, expected)


@pytest.mark.parametrize(("filter_", "transmit"), [(0.0, 1.0), (1.0, 0.0), (0.0, 0.0), (0.6, 0.0)])
def test_translucence_at_its_ends(exact: WorkerRenderer, filter_: float, transmit: float) -> None:
    """Fully transparent is untinted; fully filtering is tinted; neither is plain diffuse."""
    color = (0.9, 0.5, 0.2)
    sheet = rs.Translucent(color=color, filter=filter_, transmit=transmit)
    scene = lit(sheet, (rectangle((0, 0, -2), (8, 8)), glow(1, 2, 3)))
    through = filter_ * np.array(color) + transmit
    left = 1 - filter_ - transmit
    assert_seen(exact, scene, through * (1, 2, 3) + left * lambert(scene, color))


def test_mirrors_reflect_from_both_sides(exact: WorkerRenderer) -> None:
    """Two facing mirrors: seen in the first, seen in the second, the world beyond."""
    reflectance = (0.9, 0.8, 0.5)
    for z in ((1, 0, 1), (-1, 0, -1)):
        scene = make_scene(
            FLAT,
            surfaces=[
                (rectangle((0, 0, 0), (8, 8), z=z), rs.Mirror(reflectance=reflectance)),
                (rectangle((9, 0, 0), (20, 20), z=(-1, 0, 0)), glow(1, 2, 3)),
            ],
        )
        assert_seen(exact, scene, np.array(reflectance) * (1, 2, 3))
