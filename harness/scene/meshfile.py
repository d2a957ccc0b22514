"""Triangle meshes from files: PLY, OBJ and STL, read by trimesh."""

from __future__ import annotations

import io
from pathlib import Path, PurePosixPath

import numpy as np

from harness.scene.files import KEY, read_beside
from harness.scene.findings import Finding, SceneInvalid, quoted
from harness.scene.tessellation import Points, Triangles

FORMATS = ("ply", "obj", "stl")
LARGEST_FILE = 64 * 2**20  # bytes
MOST_TRIANGLES = 500_000  # some 100 bytes each in scene.json


def read_mesh(folder: Path, name: str) -> tuple[Points, Triangles]:
    """Vertices and triangles of a mesh file beside a scene file, polygons split into triangles.

    Vertices at the same place become one, because STL has none in common and OBJ splits them at
    seams of texture. Raises SceneInvalid at the key ``file``.
    """
    kind = PurePosixPath(name).suffix.lstrip(".").lower()
    if kind not in FORMATS:
        expected = "a .ply, .obj or .stl file"
        raise SceneInvalid(Finding(KEY, "unknown mesh format", quoted(name), expected))
    data = read_beside(folder, name, LARGEST_FILE)
    try:
        vertices, triangles = _parsed(data, kind)
    except Exception as error:  # trimesh raises whatever its parsers stumble over
        message = f"not a readable {kind.upper()} mesh: {type(error).__name__}: {error}"
        raise SceneInvalid(Finding(KEY, _one_line(message), quoted(name))) from error
    if len(triangles) > MOST_TRIANGLES:
        message = f"{len(triangles)} triangles"
        raise SceneInvalid(Finding(KEY, message, quoted(name), f"≤ {MOST_TRIANGLES}"))
    return _joined(vertices, triangles)


def _parsed(data: bytes, kind: str) -> tuple[Points, Triangles]:
    import trimesh

    # Without a resolver nothing that the file names, such as textures, is opened.
    mesh = trimesh.load_mesh(io.BytesIO(data), file_type=kind, process=False, skip_materials=True)
    vertices = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    triangles = np.array(mesh.faces, dtype=np.int64).reshape(-1, 3)
    if not len(triangles):
        raise ValueError("no faces")
    if not np.isfinite(vertices).all():
        raise ValueError("coordinates that are not finite")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise ValueError("faces of vertices that there are not")
    return vertices, triangles


def _joined(vertices: Points, triangles: Triangles) -> tuple[Points, Triangles]:
    """One vertex per place, in the order of their first use in the file."""
    _, first, inverse = np.unique(vertices + 0.0, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return vertices[first[order]], rank[inverse.reshape(-1)[triangles]]


def _one_line(text: str) -> str:
    return " ".join(text.split())[:200]
