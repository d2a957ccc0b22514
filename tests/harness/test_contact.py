"""Solids that touch or overlap, in renderers that know only solids apart or in each other.

Against the truth of all paths together, in a white world: whoever takes a wrong turn, a wrong index
or a wrong share anywhere is off in some pixel.

Tolerances. POV-Ray's images are off by half a step of 16 bits, Mitsuba's sums by some roundings to
single precision. What both hold in single precision (indices; in Mitsuba positions and directions
too) is off by u = 2^-24, which the closed form's own condition number turns into radiance: it is
found by differences, each number being moved alone. Four interfaces have four such roundings.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from harness.errors import RendererUnsupported
from harness.renderers.base import Rays, RenderSettings
from harness.renderers.persistent import WorkerRenderer
from harness.scene import resolved as rs
from harness.scene.arrangement import grouped, meeting
from harness.scene.contact import sides
from harness.scene.containment import surface_points
from harness.scene.regions import depth, region
from harness.translate import povray_stock as stock
from harness.translate.povray import translate
from harness.translate.povray_contact import moved
from harness.truth.paths import ClosedForm
from harness.truth.tree import light_around
from tests.harness.povray_measure import images, needs_povray, step
from tests.harness.povray_scenes import Array, camera, rays
from tests.harness.test_media import MESH, SETS, world
from tests.harness.test_resolve import box, resolved_of, sphere

U = 2.0**-24
DEPTH = 5
LEAST = 1e-5  # weight that is followed

SOLIDS: dict[str, tuple[tuple[Any, ...], ...]] = {
    **{name: solids for name, (solids, _) in SETS.items()},
    "a cone, higher": (
        ("water", box([3, 3, 2])),
        ("glass", {"type": "cone", "center": [0, 0, 0.2], "axis": [0, 0, 1], "radius": 0.8,
                   "height": 1.6}, 1),
    ),
    "a cone, lower": (
        ("water", box([3, 3, 2]), 1),
        ("glass", {"type": "cone", "center": [0, 0, 0.2], "axis": [0, 0, 1], "radius": 0.8,
                   "height": 1.6}),
    ),
    "a doublet of other conics": (
        ("glass", {"type": "lens", "vertex": [0, 0, 0.5], "radii": [3, -2], "conics": [-0.5, -1.7],
                   "thickness": 0.8, "diameter": 2}),
        ("ice", {"type": "lens", "vertex": [0, 0, -0.3], "radii": [-2, -6], "conics": [-1.7, 2],
                 "thickness": 0.3, "diameter": 2}),
    ),
    "two that touch, in a third": (
        ("water", box([3, 3, 2])),
        ("ice", box([0.8, 1, 1], -0.4, 0, 0.7), 1),
        ("glass", box([0.8, 1.2, 1.2], 0.4, 0.1, 0.6), 2),
    ),
    "flush under a plate": (
        ("water", box([3, 3, 2])),
        ("ice", box([1, 1, 1], 0, 0, 0.5)),
        ("glass", box([2, 2.5, 0.5], 0.3, 0.2, 1.25)),
    ),
}  # fmt: skip
VIEWS = {"from above": (1.5, 1.0, 9.0), "from below": (5.0, 1.0, -6.0)}


def white_world(name: str, view: str) -> rs.ResolvedScene:
    scene = resolved_of(world(*SOLIDS[name], surfaces=[], background=[1, 1, 1]))
    transport = scene.transport.model_copy(update={"max_depth": DEPTH, "min_weight": LEAST})
    film = rs.Film(width=40, height=40)
    seen = camera(VIEWS[view], (0, 0, 0), 20)
    return scene.model_copy(update={"camera": seen, "film": film, "transport": transport})


def level(scene: rs.ResolvedScene, some: Rays) -> Array:
    return light_around(ClosedForm(scene), some, DEPTH, LEAST).level[:, 0]


def with_index(scene: rs.ResolvedScene, k: int, ior: float) -> rs.ResolvedScene:
    media = list(scene.media)
    media[k] = media[k].model_copy(update={"ior": ior})
    return scene.model_copy(update={"media": tuple(media)})


def moved_rays(some: Rays) -> Iterator[Rays]:
    reach = np.abs(some.origins).max()
    for axis in np.eye(3):
        yield Rays(some.origins + U * reach * axis, some.directions)
        bent = some.directions + U * axis
        yield Rays(some.origins, bent / np.linalg.norm(bent, axis=1, keepdims=True))


def conditioned(scene: rs.ResolvedScene, some: Rays, *, single: bool) -> tuple[Array, Array]:
    """(the truth, what single precision of indices or of everything does to it)."""
    true, wrong = level(scene, some), np.zeros(len(some.origins))
    for k in {solid.medium for solid in scene.solids}:
        wrong += np.abs(level(with_index(scene, k, scene.media[k].ior * (1 + U)), some) - true)
    for other in moved_rays(some) if single else ():
        wrong += np.abs(level(scene, other) - true)
    return true, (DEPTH - 1) * wrong


@pytest.mark.povray
@needs_povray
@pytest.mark.parametrize("view", VIEWS)
def test_povray_has_one_interface_where_solids_meet(view: str) -> None:
    scenes = [white_world(name, view) for name in SOLIDS]
    for name, scene, pixels in zip(SOLIDS, scenes, images(*scenes), strict=True):
        true, wrong = conditioned(scene, Rays(*rays(scene)), single=False)
        off = np.abs(pixels[:, 0] - true)
        assert (off <= step(scene) + wrong).all(), name


@pytest.mark.mitsuba
@pytest.mark.parametrize("name", SOLIDS)
def test_mitsuba_exact_has_one_interface_where_solids_meet(
    exact: WorkerRenderer, name: str
) -> None:
    scene = white_world(name, "from above")
    pixels = exact.render(scene, RenderSettings(samples=1)).pixels.reshape(-1, 3)
    true, wrong = conditioned(scene, Rays(*rays(scene)), single=True)
    assert (np.abs(pixels[:, 0] - true) <= 64 * U + wrong).all()


def test_povray_is_written_as_users_write_where_that_is_asked() -> None:
    sdl = stock.translate(white_world("a doublet", "from above")).sdl
    assert "interior_texture" not in sdl
    assert sdl.count("interior {") == 2


@pytest.mark.mitsuba
def test_meshes_that_overlap_are_refused(exact: WorkerRenderer) -> None:
    scene = resolved_of(world(("ice", MESH, 1), ("water", box([3, 3, 1], z=0.7))))
    with pytest.raises(RendererUnsupported, match="meshes cannot be cut"):
        translate(scene)
    with pytest.raises(RendererUnsupported, match="no meshes that overlap"):
        exact.render(scene, RenderSettings(samples=1))


def test_composed_solids_with_seams_are_refused_by_povray() -> None:
    seamed = {"type": "union", "of": [box([1, 1, 1], 0.5), box([1, 1, 1], -0.5)]}
    scene = resolved_of(world(("ice", seamed, 1), ("water", box([5, 5, 1], z=-0.2))))
    with pytest.raises(RendererUnsupported, match="parts that touch each other"):
        translate(scene)


# --- what belongs together ------------------------------------------------------------------------


def test_solids_that_meet_by_way_of_others_are_one_group() -> None:
    row = [("ice", box([1, 1, 1], x)) for x in (0, 1, 2, 4)]
    scene = resolved_of(world(*row, ("water", sphere(0.1, 4))))
    assert meeting(scene.solids) == [(0, 1, 2)]
    group = grouped(scene.solids, (0, 1, 2))
    assert group.around == 0
    shared = {side.bound for where in group.regions for side in sides(where)}
    assert len(shared) == 4 + 4  # top, bottom and two sides of all; and four across the row


def test_what_is_around_a_group_is_what_its_outermost_solid_lies_in() -> None:
    document = world(
        ("glass", box([5, 5, 5])), ("water", box([2, 2, 2])), ("ice", box([1, 1, 1], z=0.5))
    )
    scene = resolved_of(document)
    (members,) = meeting(scene.solids)
    assert members == (1, 2)
    assert scene.media[grouped(scene.solids, members).around].name == "glass"


SHAPES = {
    "sphere": sphere(1.3, 0.2, 0.1, 0),
    "cylinder": {"type": "cylinder", "radius": 0.7, "height": 2},
    "cone": {"type": "cone", "radius": 0.8, "height": 1.5},
    "frustum": {"type": "cone", "radius": 0.8, "top_radius": 0.3, "height": 1.5},
    "lens": SOLIDS["a doublet of other conics"][1][1],
    "drilled": {"type": "difference", "of": [box([2, 2, 2]), sphere(0.6)]},
}


@pytest.mark.parametrize("by", [1e-4, -1e-4])
@pytest.mark.parametrize("name", SHAPES)
def test_moved_bounds_are_at_least_that_far_from_the_surface(name: str, by: float) -> None:
    shape = resolved_of(world(("ice", SHAPES[name]))).solids[0].shape
    assert not isinstance(shape, rs.Mesh)
    points = surface_points(shape)
    away = depth(moved(region(shape), lambda _: by, reach=2.0), points)
    # To first order of `by` over the radii of curvature.
    assert (np.sign(away) == -np.sign(by)).all()
    assert np.abs(away).min() >= 0.99 * abs(by)
