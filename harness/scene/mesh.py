"""Is a triangle mesh the boundary of exactly one solid, and if not, where not?"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Vertices = NDArray[np.float64]  # (n, 3)
Triangles = NDArray[np.int64]  # (m, 3), counter-clockwise from outside

LISTED = 3  # offenders that a message names

# Twice the area over the square of the longest edge, below which a triangle is a line: rounding
# of coordinates that are as long as the edge disturbs this ratio by some 1e-16.
FLAT = 1e-14


def closed_solid_problems(vertices: Vertices, triangles: Triangles) -> list[str]:
    """Why a mesh does not bound exactly one solid; empty where it does.

    Each kind of fault is one message with the first offending faces or edges, by index and
    place. Self-intersections are not looked for.
    """
    vertices = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    triangles = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    problems = _broken(vertices, triangles)
    if problems:
        return problems  # nothing further can be said
    problems = _degenerate(vertices, triangles) + _duplicates(triangles)
    if problems:
        return problems  # edges of such faces would only repeat them
    problems = _open_edges(vertices, triangles)
    if problems:
        return problems
    return _several(vertices, triangles) or _inverted(vertices, triangles)


def volume(vertices: Vertices, triangles: Triangles) -> float:
    """Signed volume: positive where faces run counter-clockwise seen from outside."""
    corners = (vertices - vertices.mean(axis=0))[triangles]
    return float(np.sum(corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])) / 6.0)


def _broken(vertices: Vertices, triangles: Triangles) -> list[str]:
    if len(triangles) < 4:
        return [f"{len(triangles)} faces enclose no solid: a closed mesh has at least 4"]
    lost = np.any((triangles < 0) | (triangles >= len(vertices)), axis=1)
    wild = np.any(~np.isfinite(vertices), axis=1)
    return [
        *_message("face of a vertex that there is not", lost, lambda k: _face(k, triangles)),
        *_message("vertex that is not finite", wild, lambda k: f"vertex {k}"),
    ]


def _degenerate(vertices: Vertices, triangles: Triangles) -> list[str]:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    longest = np.max([np.sum((p - q) ** 2, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    flat = np.linalg.norm(np.cross(b - a, c - a), axis=1) <= FLAT * longest
    return _message("degenerate face without area", flat, lambda k: _face(k, triangles))


def _duplicates(triangles: Triangles) -> list[str]:
    first = _first_alike(np.sort(triangles, axis=1))
    again = first != np.arange(len(triangles))
    return _message("duplicate face", again, lambda k: f"{_face(k, triangles)} as face {first[k]}")


def _first_alike(rows: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.int64]:
    """For each row the index of the first row that is equal to it."""
    _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return np.asarray(first[inverse.reshape(-1)], dtype=np.int64)


def _edges(vertices: Vertices, triangles: Triangles) -> tuple[Triangles, NDArray[np.int64]]:
    """Directed edges (3m, 2), edge k of face k // 3, and for each the number of its segment."""
    directed = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    ends = np.sort(directed, axis=1)
    _, segment = np.unique(ends[:, 0] * len(vertices) + ends[:, 1], return_inverse=True)
    return directed, segment.reshape(-1)


def _open_edges(vertices: Vertices, triangles: Triangles) -> list[str]:
    """Holes, edges of more than two faces, and neighbours that disagree which side is out."""
    directed, segment = _edges(vertices, triangles)
    uses = np.bincount(segment)[segment]
    forward = np.bincount(segment, weights=directed[:, 0] < directed[:, 1])[segment]
    first = _first_alike(segment[:, None]) == np.arange(len(segment))  # each segment once

    def edge(k: int) -> str:
        faces = np.flatnonzero(segment == segment[k]) // 3
        return _edge(directed[k], vertices, faces)

    holes = _message("hole along edge", first & (uses == 1), edge)
    twins = np.flatnonzero(_first_alike(vertices) != np.arange(len(vertices)))
    if holes and len(twins):
        holes[0] += f"; vertex {twins[0]} is where vertex {_first_alike(vertices)[twins[0]]} is"
    return [
        *holes,
        *_message("edge of more than two faces", first & (uses > 2), edge),
        *_message("flipped face at edge", first & (uses == 2) & (forward != 1), edge),
    ]


def _several(vertices: Vertices, triangles: Triangles) -> list[str]:
    """Faces that are not connected through edges belong to different solids."""
    _, segment = _edges(vertices, triangles)
    pairs = np.argsort(segment, kind="stable").reshape(-1, 2) // 3  # the two faces of every edge
    label = np.arange(len(triangles))
    while True:  # each face takes the smallest label around it, and its label's label
        least = label.copy()
        np.minimum.at(least, pairs[:, 0], label[pairs[:, 1]])
        np.minimum.at(least, pairs[:, 1], label[pairs[:, 0]])
        least = least[least]
        if np.array_equal(least, label):
            break
        label = least
    starts = label == np.arange(len(label))
    if starts.sum() == 1:
        return []

    def start(k: int) -> str:
        return f"{_face(k, triangles)} at {_place(vertices[triangles[k, 0]])}"

    return _message(f"{starts.sum()} separate solids in one mesh, which begin at", starts, start)


def _inverted(vertices: Vertices, triangles: Triangles) -> list[str]:
    enclosed = volume(vertices, triangles)
    if abs(enclosed) <= FLAT * float(np.prod(np.ptp(vertices, axis=0))):
        return ["encloses no volume"]
    if enclosed < 0:
        return [
            f"inside out (its volume is {enclosed:.6g}): faces must run counter-clockwise "
            "seen from outside"
        ]
    return []


# --- messages -------------------------------------------------------------------------------------


def _message(what: str, offends: NDArray[np.bool_], describe: Callable[[int], str]) -> list[str]:
    """One message that describes the first offenders; none where there are none."""
    found = np.flatnonzero(offends)
    if not len(found):
        return []
    listed = "; ".join(describe(int(k)) for k in found[:LISTED])
    more = f"; and {len(found) - LISTED} more" if len(found) > LISTED else ""
    return [f"{what}: {listed}{more}"]


def _face(index: int, triangles: Triangles) -> str:
    return f"{index} ({', '.join(map(str, triangles[index]))})"


def _place(vertex: Vertices) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in vertex) + ")"


def _edge(ends: NDArray[np.int64], vertices: Vertices, faces: NDArray[np.int64]) -> str:
    places = " to ".join(_place(vertices[k]) for k in ends)
    owners = ", ".join(map(str, faces[:LISTED])) + (", …" if len(faces) > LISTED else "")
    noun = "face" if len(faces) == 1 else "faces"
    return f"{ends[0]}-{ends[1]}, {places}, of {noun} {owners}"
