"""Meshes that are not the surface of one solid are refused, with the first faces or edges."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from harness.scene.mesh import closed_solid_problems, volume
from harness.scene.tessellation import (
    distance,
    icosphere,
    placed,
    vertex_normals,
    winding,
)
from harness.scene.vectors import IDENTITY

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

# A unit cube: corner k has coordinate i at 1 where bit i of k is set.
CUBE = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)], dtype=np.float64)
SIDES = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
TRIANGLES = np.array([t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))])


def only(vertices: Array, triangles: Faces) -> str:
    (problem,) = closed_solid_problems(vertices, triangles)
    return problem


def test_closed_solids_have_no_problems() -> None:
    assert closed_solid_problems(CUBE, TRIANGLES) == []
    assert closed_solid_problems(CUBE * 1e-6 + 1, TRIANGLES) == []
    assert closed_solid_problems(*icosphere(4)) == []
    assert volume(CUBE, TRIANGLES) == pytest.approx(1)


def test_a_ring_is_a_solid() -> None:
    # A square torus: the outline of a cell, swept around.
    turns, cell = 12, [(2, 0), (3, 0), (3, 1), (2, 1)]
    angles = np.arange(turns) * 2 * np.pi / turns
    vertices = np.array([(r * math.cos(t), r * math.sin(t), z) for t in angles for r, z in cell])
    triangles = []
    for k in range(turns):
        for i in range(4):
            a, b = 4 * k + i, 4 * k + (i + 1) % 4
            c, d = (4 * (k + 1) + (i + 1) % 4) % (4 * turns), (4 * (k + 1) + i) % (4 * turns)
            triangles += [(a, d, c), (a, c, b)]
    faces = np.array(triangles)
    if volume(vertices, faces) < 0:
        faces = faces[:, ::-1]
    assert closed_solid_problems(vertices, faces) == []
    # Pappus: area of the polygonal ring's section times its way, for a prism around a 12-gon.
    annulus = turns / 2 * math.sin(2 * math.pi / turns) * (3**2 - 2**2)
    assert volume(vertices, faces) == pytest.approx(annulus)


def test_every_missing_face_is_a_hole_along_its_edges() -> None:
    for k, (a, b, c) in enumerate(TRIANGLES):
        problem = only(CUBE, np.delete(TRIANGLES, k, axis=0))
        assert problem.startswith("hole along edge: ")
        for one, other in ((a, b), (b, c), (c, a)):
            assert f"{one}-{other}, " in problem or f"{other}-{one}, " in problem


def test_every_flipped_face_is_found_at_its_edges() -> None:
    for k in range(len(TRIANGLES)):
        faces = TRIANGLES.copy()
        faces[k] = faces[k][::-1]
        problem = only(CUBE, faces)
        assert problem.startswith("flipped face at edge: ")
        # Each of its three edges is listed with the faces on both sides of it.
        owners = [part.rsplit("of faces ", 1)[1] for part in problem.split("; ")]
        assert all(str(k) in part.split(", ") for part in owners)


def test_a_mesh_inside_out_is_found() -> None:
    assert only(CUBE, TRIANGLES[:, ::-1]).startswith("inside out (its volume is -1)")


def test_edges_of_more_than_two_faces_are_found() -> None:
    # A fin on the edge 0-1, with a face on either side of it so that nothing is open.
    vertices = np.vstack([CUBE, [[0.5, -1, -1]]])
    two_sided = np.vstack([TRIANGLES, [[0, 1, 8], [1, 0, 8]]])
    assert only(vertices, two_sided).startswith("duplicate face: 13 (1, 0, 8) as face 12")
    fin = closed_solid_problems(vertices, np.vstack([TRIANGLES, [[0, 1, 8]]]))
    assert [problem.split(":")[0] for problem in fin] == [
        "hole along edge", "edge of more than two faces",
    ]  # fmt: skip
    second = CUBE * [1, -1, -1]  # turned by 180 degrees about the edge 0-1, which both share
    joined = np.where(TRIANGLES < 2, TRIANGLES, TRIANGLES + 6)
    problem = only(np.vstack([CUBE, second[2:]]), np.vstack([TRIANGLES, joined]))
    assert problem.startswith("edge of more than two faces: 0-1, (0, 0, 0) to (1, 0, 0), of faces")


def test_several_solids_are_told_apart() -> None:
    two = np.vstack([CUBE, CUBE + 3])
    problem = only(two, np.vstack([TRIANGLES, TRIANGLES + 8]))
    assert problem.startswith("2 separate solids in one mesh, which begin at: 0 (0, 4, 6)")
    assert "12 (8, 12, 14) at (3, 3, 3)" in problem
    hollow = np.vstack([CUBE, CUBE * 0.5 + 0.25])
    assert "2 separate solids" in only(hollow, np.vstack([TRIANGLES, TRIANGLES[:, ::-1] + 8]))


def test_degenerate_and_impossible_faces_are_found() -> None:
    line = np.vstack([TRIANGLES, [[0, 1, 1]]])
    assert only(CUBE, line) == "degenerate face without area: 12 (0, 1, 1)"
    middle = np.vstack([CUBE, [[0.5, 0, 0]]])
    assert only(middle, np.vstack([TRIANGLES, [[0, 8, 1]]])).startswith("degenerate face")
    lost = np.vstack([TRIANGLES, [[0, 1, 8], [0, -1, 2]]])
    assert only(CUBE, lost) == ("face of a vertex that there is not: 12 (0, 1, 8); 13 (0, -1, 2)")
    wild = CUBE.copy()
    wild[3] = np.nan
    assert only(wild, TRIANGLES) == "vertex that is not finite: vertex 3"
    assert "at least 4" in only(CUBE, TRIANGLES[:3])
    assert "at least 4" in only(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype=np.float64)
    sheet = np.array([[0, 1, 2], [1, 3, 2], [0, 2, 3], [0, 3, 1]])
    assert only(flat, sheet) == "encloses no volume"


def test_vertices_at_one_place_are_hinted_at() -> None:
    soup = CUBE[TRIANGLES].reshape(-1, 3)
    problem = only(soup, np.arange(36).reshape(-1, 3))
    assert problem.endswith("and 33 more; vertex 3 is where vertex 0 is")


@given(st.data())
def test_random_faces_are_never_taken_for_a_solid_unless_they_are(data: st.DataObject) -> None:
    faces = np.array(
        data.draw(st.lists(st.tuples(*[st.integers(0, 7)] * 3), min_size=0, max_size=14))
    ).reshape(-1, 3)
    if closed_solid_problems(CUBE, faces) == []:
        # Divergence theorem: a closed surface has no total area vector.
        corners = CUBE[faces]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
        assert np.allclose(area, 0)
        assert volume(CUBE, faces) > 0


@given(
    point=st.tuples(*[st.floats(-2, 3)] * 3),
)
def test_winding_and_distance_of_a_cube_are_those_of_its_formula(
    point: tuple[float, float, float],
) -> None:
    # Distance to a box: the part outside of it, or the nearest face.
    q = np.abs(np.array(point) - 0.5) - 0.5
    exact = np.linalg.norm(np.maximum(q, 0)) + min(q.max(), 0)
    found = distance(np.array([point]), CUBE, TRIANGLES)[0]
    assert found == pytest.approx(abs(exact), abs=1e-14)
    if abs(exact) > 1e-9:
        inside = winding(np.array([point]), CUBE, TRIANGLES)[0]
        assert inside == pytest.approx(1.0 if exact < 0 else 0.0, abs=1e-6)


def test_normals_do_not_depend_on_the_triangulation() -> None:
    # Three perpendicular faces meet at every corner of a cube, however they are split.
    normals = vertex_normals(CUBE, TRIANGLES)
    assert np.allclose(normals, (2 * CUBE - 1) / math.sqrt(3), rtol=0, atol=1e-15)


def test_places_are_what_matrices_say() -> None:
    turn = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert placed(np.array([[1.0, 2.0, 3.0]]), turn, (10.0, 20.0, 30.0)).tolist() == [[8, 21, 33]]
    assert placed(CUBE, IDENTITY, (0.0, 0.0, 0.0)).tolist() == CUBE.tolist()
