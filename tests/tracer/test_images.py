"""Images: energy, materials, determinism."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tracer.camera import Orthographic, Perspective
from tracer.errors import SceneError
from tracer.image import render
from tracer.mesh import Mesh
from tracer.patterns import Checker, Constant, Picture, PositionCode, Ramp
from tracer.scene import (
    Diffuse,
    Emissive,
    Medium,
    Mirror,
    PointLight,
    Scene,
    Solid,
    Surface,
    ThinSlab,
    Translucent,
    Transport,
)
from tracer.shapes import Rectangle, Sphere
from tracer.solids import cylinder

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
GLASS = Medium(1.5)
CAMERA = Perspective((0.0, 0.0, 6.0), X, Y, (0.0, 0.0, -1.0), math.tan(math.radians(15)))
FLAT = Orthographic((0.0, 0.0, 6.0), X, Y, (0.0, 0.0, -1.0), 2.0)
FACE = Rectangle((0.0, 0.0, 0.0), X, Y, Z, (2.0, 2.0))
DEEP = Transport(max_depth=200, min_weight=0.0)


def one_surface(material: object, **more: object) -> Scene:
    surface = Surface(FACE, material)  # type: ignore[arg-type]
    return Scene(FLAT, surfaces=(surface,), **more)  # type: ignore[arg-type]


BALL = Solid(Sphere((0.0, 0.0, 0.0), 1.0), GLASS)
ROD = Solid(cylinder((0.4, 0.0, 0.0), (0.6, 0.0, 0.8), 0.5, 1.5), GLASS)


@pytest.mark.parametrize("solid", [BALL, ROD])
def test_furnace(solid: Solid) -> None:
    """A white world stays white: what is missing is exactly what was cut."""
    scene = Scene(CAMERA, (solid,), background=WHITE, transport=Transport(30, 1e-6))
    image = render(scene, 64, 64)
    total = image.pixels + image.cut[:, :, None]
    # At most 60 weights are summed, each a product of at most 30 rounded factors.
    assert np.abs(total - 1.0).max() <= 1e-12
    assert image.cut.max() > 0.0


def test_furnace_without_cut() -> None:
    """Inside a sphere a ray meets the surface at one angle for ever: R^200 is left at most."""
    scene = Scene(
        Perspective((0.0, 0.0, 6.0), X, Y, (0.0, 0.0, -1.0), 0.15),
        (BALL,),
        background=WHITE,
        transport=DEEP,
    )
    image = render(scene, 32, 32)
    assert np.abs(image.pixels - 1.0).max() <= 1e-9
    slab = one_surface(ThinSlab(GLASS, 0.1), background=WHITE)
    assert np.abs(render(slab, 8, 8).pixels - 1.0).max() <= 1e-15


def test_same_bits_for_any_number_of_threads() -> None:
    board = Surface(
        Rectangle((0.0, 0.0, -3.0), X, Y, Z, (16.0, 16.0)),
        Emissive(Checker((0.1, 0.3, 0.9), (0.9, 0.6, 0.2), (16, 16))),
    )
    scene = Scene(CAMERA, (BALL,), (board,))
    one, three = render(scene, 61, 47, threads=1), render(scene, 61, 47, threads=3)
    assert (one.pixels == three.pixels).all()
    assert (one.cut == three.cut).all()


def test_normal_incidence_reflects_four_percent() -> None:
    scene = Scene(
        Orthographic((0.0, 0.0, 6.0), X, Y, (0.0, 0.0, -1.0), 1e-9),
        (BALL,),
        (Surface(Rectangle((0.0, 0.0, 9.0), X, Y, Z, (9.0, 9.0)), Emissive(Constant(WHITE))),),
        transport=Transport(2, 0.0),
    )
    assert render(scene, 1, 1).pixels[0, 0] == pytest.approx(0.04, rel=1e-14)
    dark = replace(scene, transport=Transport(2, 0.0, reflection=False))
    assert render(dark, 1, 1).pixels[0, 0] == pytest.approx(0.0)


def test_beer_lambert() -> None:
    ruby = Medium(1.0, (0.1, 0.7, 2.0))  # no reflection: the index matches
    scene = Scene(
        Orthographic((0.0, 0.0, 6.0), X, Y, (0.0, 0.0, -1.0), 1e-9),
        (Solid(Sphere((0.0, 0.0, 0.0), 1.0), ruby),),
        background=WHITE,
    )
    expected = np.exp(-2.0 * np.array(ruby.absorption))
    assert render(scene, 1, 1).pixels[0, 0] == pytest.approx(expected, rel=1e-14)


def test_radiance_scales_with_the_square_of_the_index_on_demand() -> None:
    """A camera in glass sees an outer world (1 - R) n^2 times as bright; T alone without n^2."""
    inside = Scene(
        Orthographic((0.0, 0.0, 0.0), X, Y, (0.0, 0.0, -1.0), 1e-9),
        (BALL,),
        background=WHITE,
        transport=Transport(2, 0.0),
    )
    assert render(inside, 1, 1).pixels[0, 0] == pytest.approx(0.96, rel=1e-14)
    scaled = replace(inside, transport=Transport(2, 0.0, radiance_n2=True))
    assert render(scaled, 1, 1).pixels[0, 0] == pytest.approx(0.96 * 2.25, rel=1e-14)


def test_diffuse_follows_cosine_and_square_of_distance() -> None:
    light = PointLight((3.0, 0.0, 4.0), (1.0, 2.0, 3.0))
    image = render(one_surface(Diffuse((0.5, 0.5, 0.5)), lights=(light,)), 1, 1)
    assert image.pixels[0, 0] == pytest.approx(
        0.5 / math.pi * np.array(light.intensity) * (4 / 5) / 25, rel=1e-14
    )
    behind = PointLight((3.0, 0.0, -4.0), WHITE)
    assert (render(one_surface(Diffuse(WHITE), lights=(behind,)), 1, 1).pixels == 0).all()


def test_shadows() -> None:
    light = PointLight((0.0, 3.0, 4.0), WHITE)
    bare = one_surface(Diffuse(WHITE), lights=(light,))
    lit = render(bare, 1, 1).pixels

    def with_blocker(material: object) -> np.ndarray:
        blocker = Surface(
            Rectangle((0.0, 1.5, 2.0), X, (0.0, 0.8, -0.6), (0.0, 0.6, 0.8), (1.0, 1.0)),
            material,  # type: ignore[arg-type]
        )
        return render(replace(bare, surfaces=(*bare.surfaces, blocker)), 1, 1).pixels

    assert (with_blocker(Mirror()) == 0).all()
    assert (with_blocker(ThinSlab(GLASS, 0.1)) == lit).all()
    filtered = with_blocker(Translucent((0.5, 1.0, 0.0), filter=0.6, transmit=0.2))
    assert filtered == pytest.approx(lit * np.array([0.5, 0.8, 0.2]), rel=1e-14)
    ball = Solid(Sphere((0.0, 1.5, 2.0), 0.3), Medium(1.5, (0.0, 1.0, 2.0)))
    through = render(replace(bare, solids=(ball,)), 1, 1).pixels
    assert through == pytest.approx(lit * np.exp([0.0, -0.6, -1.2]), rel=1e-14)


@pytest.mark.parametrize(("filter_", "transmit"), [(0.0, 1.0), (0.5, 0.0), (0.3, 0.4)])
def test_translucence_splits_the_light(filter_: float, transmit: float) -> None:
    """What passes takes the surface's colour, untinted where it is wholly transparent."""
    color = np.array([0.2, 0.5, 1.0])
    light = PointLight((0.0, 0.0, 5.0), WHITE)
    material = Translucent(tuple(color.tolist()), filter_, transmit)
    image = render(one_surface(material, lights=(light,), background=(0.8, 0.8, 0.8)), 1, 1)
    passes = 0.8 * (filter_ * color + transmit)
    stays = (1 - filter_ - transmit) * color / math.pi / 25
    assert image.pixels[0, 0] == pytest.approx(passes + stays, rel=1e-14)


def test_patterns_show_where_they_should() -> None:
    def seen(pattern: object, size: int = 4) -> np.ndarray:
        return render(one_surface(Emissive(pattern)), size, size).pixels  # type: ignore[arg-type]

    corner = seen(Checker(WHITE, BLACK, (2, 4)))
    assert corner[3, 0, 0] == 1.0  # the cell at (0, 0), bottom left
    assert corner[2, 0, 0] == 0.0
    assert corner[3, 2, 0] == 0.0
    ramp = seen(Ramp(BLACK, (1.0, 2.0, 4.0), "v"))
    assert ramp[0, 0] == pytest.approx([0.875, 1.75, 3.5], rel=1e-14)
    code = seen(PositionCode("u", 10, 2.0))
    assert code[0, 1] == pytest.approx([0.75, 2 * 0.75, 2.0], rel=1e-13)
    texels = np.arange(12.0).reshape(2, 2, 3)
    picture = seen(Picture(texels), 2)
    assert (picture == texels).all()


def test_patterns_need_coordinates() -> None:
    ball = Surface(Sphere(BLACK, 1.0), Emissive(Ramp(BLACK, WHITE)), "lamp")
    with pytest.raises(SceneError, match="lamp: only rectangles and disks can show a pattern"):
        render(Scene(CAMERA, surfaces=(ball,)), 2, 2)


def test_meshes_with_holes_are_refused_by_edge() -> None:
    vertices = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    closed = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])
    solid = Solid(Mesh(vertices, closed), GLASS, name="tetra")
    render(Scene(CAMERA, (solid,)), 2, 2)
    hole = replace(solid, shape=Mesh(vertices, closed[:3]))
    with pytest.raises(
        SceneError, match=r"tetra: not a closed solid, 3 bad edges: edge .* borders"
    ):
        render(Scene(CAMERA, (hole,)), 2, 2)
    inside_out = replace(solid, shape=Mesh(vertices, closed[:, ::-1]))
    with pytest.raises(SceneError, match="counter-clockwise"):
        render(Scene(CAMERA, (inside_out,)), 2, 2)


@pytest.mark.parametrize("ior", [0.0, -1.5, math.nan, math.inf])
def test_bad_indices_are_refused(ior: float) -> None:
    with pytest.raises(SceneError, match="index of refraction"):
        Medium(ior)
