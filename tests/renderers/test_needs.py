"""What a scene needs follows from what is in it."""

from __future__ import annotations

from typing import Any

import pytest

from harness.errors import RendererUnsupported
from harness.renderers.base import Capability
from harness.renderers.needs import needs, require
from harness.renderers.proof import proof_scene
from harness.scene import resolved as rs

ALL = frozenset(Capability)
BALL = proof_scene(ALL)
FRAME = rs.Frame(origin=(0, 0, 0), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
FACE = rs.Rectangle(frame=FRAME, size=(1, 1))
TETRAHEDRON = rs.Mesh(
    vertices=((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    triangles=((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)),
)


def with_solid(shape: rs.SolidShape, **more: int) -> rs.ResolvedScene:
    solid = rs.Solid(name="thing", shape=shape, **{"medium": 1, "exterior": 0, **more})
    return BALL.model_copy(update={"solids": (solid,)})


def with_surface(material: rs.Material, shape: rs.SurfaceShape = FACE) -> rs.ResolvedScene:
    surface = rs.Surface(name="face", shape=shape, material=material)
    return BALL.model_copy(update={"solids": (), "surfaces": (surface,)})


def glow(pattern: rs.Pattern) -> rs.Emissive:
    return rs.Emissive(pattern=pattern)


def test_a_bare_backdrop_needs_nothing() -> None:
    assert needs(proof_scene(frozenset())) == frozenset()


@pytest.mark.parametrize(
    ("shape", "wanted"),
    [
        (rs.Sphere(center=(0, 0, 0), radius=1), {"sphere"}),
        (rs.Convex(planes=(), vertices=(), faces=()), {"convex"}),
        (rs.Cylinder(frame=FRAME, radius=1, height=1), {"cylinder"}),
        (TETRAHEDRON, {"mesh"}),
        (TETRAHEDRON.model_copy(update={"normals": ((0, 0, 1),) * 4}), {"mesh", "smooth-mesh"}),
    ],
)
def test_shapes(shape: Any, wanted: set[str]) -> None:
    assert needs(with_solid(shape)) == wanted | {"fresnel"}
    assert needs(with_surface(rs.Diffuse(reflectance=(1, 1, 1)), shape)) == wanted | {"diffuse"}


@pytest.mark.parametrize(
    ("material", "wanted"),
    [
        (glow(rs.Constant(radiance=(1, 1, 1))), set()),
        (glow(rs.PositionCode(axis="u", cells=10, amplitude=1)), set()),
        (glow(rs.Picture(width=1, height=1, pixels="AAAAAAAA")), {"picture"}),
        (rs.Mirror(reflectance=(1, 1, 1)), {"mirror"}),
        (rs.Diffuse(reflectance=(1, 1, 1)), {"diffuse"}),
        (rs.Translucent(color=(1, 1, 1), filter=0, transmit=0), {"translucent"}),
        (rs.ThinSlab(medium=1, exterior=0, thickness=1), {"thin-slab"}),
    ],
)
def test_materials(material: Any, wanted: set[str]) -> None:
    assert needs(with_surface(material)) == wanted


def test_absorption_only_where_something_is_made_of_it() -> None:
    absorbing = rs.Medium(name="ink", ior=1.5, absorption=(0, 0.1, 0))
    air = BALL.media[0]
    assert "absorption" in needs(BALL.model_copy(update={"media": (air, absorbing)}))
    assert "absorption" not in needs(BALL.model_copy(update={"media": (*BALL.media, absorbing)}))
    foggy = air.model_copy(update={"absorption": (0.1, 0, 0)})
    assert "absorption" in needs(BALL.model_copy(update={"media": (foggy, BALL.media[1])}))


def test_nesting_and_a_camera_inside() -> None:
    sphere = rs.Sphere(center=(0, 0, 0), radius=1)
    assert "nested" in needs(with_solid(sphere, exterior=1, medium=0))
    inside = BALL.camera.model_copy(update={"medium": 1})
    assert "camera-inside" in needs(BALL.model_copy(update={"camera": inside}))


def test_transmission_alone_needs_no_fresnel() -> None:
    transport = BALL.transport.model_copy(update={"reflection": False})
    assert needs(BALL) == {"sphere", "fresnel"}
    assert needs(BALL.model_copy(update={"transport": transport})) == {"sphere"}


def test_the_message_names_the_reason() -> None:
    require(BALL, "mine", frozenset({Capability.SPHERE, Capability.FRESNEL}))
    with pytest.raises(RendererUnsupported) as caught:
        require(BALL, "mine", frozenset())
    assert str(caught.value) == (
        "mine does not claim fresnel (solid 'ball' reflects a part), "
        "sphere (solid 'ball' is a sphere)"
    )
