"""Every face of a resolved polyhedron is listed counter-clockwise as seen from outside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from harness.scene import model
from harness.scene.shapes import solid_shape

SHAPES = [
    model.Box(type="box", size=(1, 2, 3)),
    model.Slab(type="slab", thickness=0.5, normal=(1, 2, -3)),
    model.Prism(type="prism", apex_angle=40, side=1, length=2),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.type)
def test_faces_turn_their_planes_normal(shape: model.Box | model.Slab | model.Prism) -> None:
    convex = solid_shape(shape, Path())
    assert convex.type == "convex"
    vertices = np.array(convex.vertices)
    for face, plane in zip(convex.faces, convex.planes, strict=True):
        a, b, c = vertices[list(face[:3])]
        assert np.cross(b - a, c - a) @ plane[:3] > 0
        assert np.allclose(vertices[list(face)] @ plane[:3], plane[3], atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.type)
def test_the_same_solid_as_polygons_has_positive_volume(
    shape: model.Box | model.Slab | model.Prism,
) -> None:
    mesh = solid_shape(model.AsMesh(type="polygons", of=shape), Path())
    assert mesh.type == "mesh"
    vertices, triangles = np.array(mesh.vertices), np.array(mesh.triangles)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0
