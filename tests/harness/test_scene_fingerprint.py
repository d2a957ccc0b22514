"""Scenes are told apart by what they are, not by the last bit of a sine."""

from __future__ import annotations

import math

import pytest

from harness.scene import resolved
from harness.scene.fingerprint import fingerprint
from harness.scene.resolved import ResolvedScene
from tests.harness.tiny import prepared


@pytest.fixture(scope="module")
def scene() -> ResolvedScene:
    (case,) = prepared("ball-picture")
    return case.scene


def moved(scene: ResolvedScene, factor: float) -> ResolvedScene:
    camera = scene.camera
    origin = tuple(x * factor for x in camera.origin)
    return scene.model_copy(update={"camera": camera.model_copy(update={"origin": origin})})


def test_the_last_bits_do_not_matter(scene: ResolvedScene) -> None:
    other = moved(scene, math.nextafter(1.0, 2.0))
    assert other != scene
    assert fingerprint(other) == fingerprint(scene)


def test_what_a_check_could_see_does(scene: ResolvedScene) -> None:
    assert fingerprint(moved(scene, 1 + 1e-8)) != fingerprint(scene)
    film = scene.film.model_copy(update={"width": scene.film.width + 1})
    assert fingerprint(scene.model_copy(update={"film": film})) != fingerprint(scene)
    media = (scene.media[0], scene.media[1].model_copy(update={"ior": 1.5 + 1e-8}))
    assert fingerprint(scene.model_copy(update={"media": media})) != fingerprint(scene)


def test_the_kind_of_a_thing_matters_though_it_is_a_default(scene: ResolvedScene) -> None:
    surface = scene.surfaces[0]
    frame = surface.shape.frame
    shapes = (
        resolved.Rectangle(frame=frame, size=(2, 2)),
        resolved.Disk(frame=frame, radius=2),
    )
    kinds = {
        fingerprint(
            scene.model_copy(update={"surfaces": (surface.model_copy(update={"shape": shape}),)})
        )
        for shape in shapes
    }
    assert len(kinds) == 2


def test_a_field_that_the_format_gains_changes_no_scene(scene: ResolvedScene) -> None:
    class Richer(ResolvedScene):
        humidity: float = 0.4

    richer = Richer.model_validate(scene.model_dump())
    assert fingerprint(richer) == fingerprint(scene)
    wetter = Richer.model_validate(scene.model_dump() | {"humidity": 0.9})
    assert fingerprint(wetter) != fingerprint(scene)
