"""Lenses, cones and wedges of scene files: their faces by textbook formulas, and their mistakes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings

from harness.scene.containment import Relation, bounds, relation, signed_distance
from harness.scene.resolved import Cone, Lens
from tests.harness.test_resolve import Document, problems_of, scene, solid, sphere
from tests.strategies import cones, lenses

EPS = np.finfo(float).eps


def lens(**keys: object) -> Document:
    return {"type": "lens", "thickness": 1, "radii": [4, -3], "diameter": 2, **keys}


def on_face(shape: Lens, face: int) -> np.ndarray:
    """Points where r^2 - 2 R z + (1 + k) z^2 = 0, z from the vertex, on rays around the axis."""
    radius, conic = shape.radii[face], shape.conics[face]
    heights = shape.aperture * np.array([0, 0.3, 0.7, 0.999])
    z = np.zeros(4)
    if radius is not None:
        for k, r in enumerate(heights):
            roots = np.roots([1 + conic, -2 * radius, r * r]).real
            z[k] = roots[np.argmin(np.abs(roots))]
    frame, turn = shape.frame, np.linspace(0, 6, 7)
    across = np.outer(np.cos(turn), frame.x) + np.outer(np.sin(turn), frame.y)
    axial = (z + face * shape.thickness)[:, None, None] * np.array(frame.z)
    points = np.array(frame.origin) + axial + heights[:, None, None] * across
    return np.asarray(points.reshape(-1, 3))


@settings(max_examples=60, deadline=None)
@given(lenses())
def test_faces_are_where_their_equations_say(document: Document) -> None:
    shape = solid(document)
    assert isinstance(shape, Lens)
    low, high = bounds(shape)
    for face in range(2):
        points = on_face(shape, face)
        away = signed_distance(shape, points)
        # numpy's roots are good to the root of epsilon next to a double one.
        assert np.abs(away).max() <= 1e-7
        inwards = (1 - 2 * face) * 1e-4 * np.array(shape.frame.z)
        assert (signed_distance(shape, points + inwards) < 0).all()
        assert (signed_distance(shape, points - inwards) > 0).all()
        assert (points >= low - 1e-7).all()
        assert (points <= high + 1e-7).all()


@settings(max_examples=60, deadline=None)
@given(cones())
def test_a_cone_narrows_from_its_base(document: Document) -> None:
    shape = solid(document)
    assert isinstance(shape, Cone)
    frame = shape.frame
    for share in (0.0, 0.25, 0.9):
        radius = shape.radius + share * (shape.top_radius - shape.radius)
        rim = np.array(frame.origin) + share * shape.height * np.array(frame.z)
        point = rim + radius * np.array(frame.x)
        assert abs(signed_distance(shape, point[None])[0]) <= 100 * EPS
    low, high = bounds(shape)
    base = np.array(frame.origin) - shape.radius * np.array(frame.y)
    assert (base >= low - 20 * EPS).all()
    assert (base <= high + 20 * EPS).all()


def test_a_wedge_grows_thicker_upwards() -> None:
    wedge = solid({"type": "wedge", "thickness": 1, "angle": 10, "size": [2, 2], "up": [1, 0, 0]})
    front, back = np.array(wedge.planes[5]), np.array(wedge.planes[4])
    assert front.tolist() == [0, 0, 1, 0]
    assert math.degrees(math.acos(-front[:3] @ back[:3])) == pytest.approx(10, abs=1e-12)
    slope = math.tan(math.radians(10))
    for x in (-1, 0, 1):
        corner = np.array([x, 0.5, -1 - x * slope])
        assert corner @ back[:3] == pytest.approx(back[3], abs=4 * EPS)


def test_what_lies_inside_a_lens() -> None:
    thick = solid(lens(thickness=2))
    inside = solid(sphere(0.5, 0, 0, -1))
    beside = solid(sphere(0.5, 3, 0, -1))
    assert relation(inside, thick, 1e-9) == Relation.INSIDE
    assert relation(beside, thick, 1e-9) == Relation.APART
    # A ball in the hollow of a lens does not overlap it.
    hollow = solid(lens(radii=[-1.25, 1.25]))
    assert relation(solid(sphere(0.3, 0, 0, 0.305)), hollow, 1e-9) == Relation.APART
    assert relation(solid(sphere(0.3, 0, 0, 0.2)), hollow, 1e-9) == Relation.OVERLAP


def test_composed_solids_are_sets() -> None:
    """A point is in a composed solid as its parts say, by the signs of their distances."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-1.5, 1.5, (4000, 3))
    a, b, c = (
        sphere(1),
        {"type": "box", "size": [1, 2, 1]},
        {"type": "cone", "radius": 1, "height": 1},
    )
    inside = [signed_distance(solid(part), points) < 0 for part in (a, b, c)]
    for name, expected in (
        ("union", inside[0] | inside[1] | inside[2]),
        ("intersection", inside[0] & inside[1] & inside[2]),
        ("difference", inside[0] & ~inside[1] & ~inside[2]),
    ):
        shape = solid({"type": name, "of": [a, b, c]})
        assert ((signed_distance(shape, points) < 0) == expected).all()
        low, high = bounds(shape)
        assert (points[expected] >= low).all()
        assert (points[expected] <= high).all()


MISTAKES = {
    "crossing faces": (
        lens(radii=[2, -2], thickness=0.1),
        ("solids[0].shape.thickness", "its faces cross 1 from the axis"),
    ),
    "a face that ends": (
        lens(radii=[-0.9, 3]),
        ("solids[0].shape.diameter", "wider than its front face reaches"),
    ),
    "no radius": (lens(radii=[0, 3]), ("solids[0].shape.radii[0]", "no radius of curvature")),
    "NaN": (lens(radii=[1, math.nan]), ("solids[0].shape.radii[1]", "no radius of curvature")),
    "a cone that widens": (
        {"type": "cone", "radius": 1, "top_radius": 2, "height": 1},
        ("solids[0].shape.top_radius", "a cone narrows along its axis"),
    ),
    "a wedge that ends": (
        {"type": "wedge", "thickness": 0.1, "angle": 20, "size": [1, 1]},
        ("solids[0].shape.thickness", "too thin for its angle"),
    ),
    "nothing left": (
        {"type": "intersection", "of": [sphere(1), sphere(1, 3)]},
        ("solids[0].shape", "nothing is left of it"),
    ),
    "a mistake in a part": (
        {"type": "union", "of": [sphere(1), lens(radii=[-0.9, 3])]},
        ("solids[0].shape.of[1].diameter", "wider than its front face reaches"),
    ),
    "no axis": (lens(axis=[0, 0, 0]), ("solids[0].shape.axis", "has no direction")),
}


@pytest.mark.parametrize(("shape", "problem"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_one_message(shape: Document, problem: tuple[str, str]) -> None:
    assert problems_of(scene(shape)) == [problem]
