"""Triangle meshes from files: PLY, OBJ and STL, read by trimesh."""

from __future__ import annotations

import io
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from harness.scene.files import KEY, read_beside
from harness.scene.findings import Finding, KeyPath, SceneInvalid, quoted
from harness.scene.meshparts import TAG, Tags, faces_of, named_tags, obj_part, obj_tags, ply_tags
from harness.scene.model import Case, MeshFile
from harness.scene.tessellation import Points, Triangles

FORMATS = ("ply", "obj", "stl")
MOST_PARTS = 10  # that a message lists
LARGEST_FILE = 64 * 2**20  # bytes
MOST_TRIANGLES = 500_000  # some 100 bytes each in scene.json


def read_mesh(folder: Path, name: str, part: str | None = None) -> tuple[Points, Triangles]:
    """Vertices and triangles of a mesh file beside a scene file, polygons split into triangles.

    With `part`, the faces of that one of its solids (see `meshparts`). Vertices at the same place
    become one, because STL has none in common and OBJ splits them at seams of texture. Raises
    SceneInvalid at the keys ``file`` and ``part``.
    """
    data, kind = _read(folder, name)
    try:
        vertices, triangles = _parsed(data, kind, part)
    except SceneInvalid:
        raise
    except Exception as error:  # trimesh raises whatever its parsers stumble over
        message = f"not a readable {kind.upper()} mesh: {type(error).__name__}: {error}"
        raise SceneInvalid(Finding(KEY, _one_line(message), quoted(name))) from error
    if len(triangles) > MOST_TRIANGLES:
        message = f"{len(triangles)} triangles"
        raise SceneInvalid(Finding(KEY, message, quoted(name), f"≤ {MOST_TRIANGLES}"))
    if part is not None:  # without the vertices of other parts
        used, corners = np.unique(triangles, return_inverse=True)
        vertices, triangles = vertices[used], corners.reshape(-1, 3)
    return _joined(vertices, triangles)


def parts_of(folder: Path, name: str) -> list[str]:
    """The solids that a mesh file says its faces belong to; none where it does not say.

    Raises SceneInvalid where the file cannot be read at all; its content may make no sense.
    """
    data, kind = _read(folder, name)
    try:
        if kind == "obj":
            return named_tags(obj_tags(data.decode(errors="replace"))[0])
        if kind == "ply":
            return named_tags(_ply_faces(_loaded(data, kind))[1])
    except Exception:  # as in `read_mesh`, which says so
        return []
    return []


def hint_of_parts(shape: MeshFile, folder: Path) -> str | None:
    """What to say of a file that has several solids, where none of them was named."""
    parts = parts_of(folder, shape.file) if shape.part is None else []
    return f"`part`, one of {', '.join(parts[:MOST_PARTS])}" if len(parts) > 1 else None


def parts_left_out(case: Case, folder: Path) -> list[Finding]:
    """Parts of mesh files that no solid or surface has, where another part of the file is used."""
    places: dict[str, KeyPath] = {}
    used: dict[str, set[str]] = {}
    shapes: dict[KeyPath, object] = {("solids", k): s.shape for k, s in enumerate(case.solids)}
    shapes |= {("surfaces", k): s.shape for k, s in enumerate(case.surfaces)}
    for place, shape in shapes.items():
        if isinstance(shape, MeshFile) and shape.part is not None:
            places.setdefault(shape.file, (*place, "shape", "file"))
            used.setdefault(shape.file, set()).add(shape.part)
    findings = []
    for file, parts in used.items():
        left = [name for name in parts_of(folder, file) if name not in parts]
        if left:
            names = ", ".join(map(quoted, left[:MOST_PARTS]))
            message = f"no solid or surface has its {'parts' if len(left) > 1 else 'part'} {names}"
            expected = f"one with part = {quoted(left[0])}"
            findings.append(Finding(places[file], message, quoted(file), expected))
    return findings


def _read(folder: Path, name: str) -> tuple[bytes, str]:
    """(content, format)."""
    kind = PurePosixPath(name).suffix.lstrip(".").lower()
    if kind not in FORMATS:
        expected = "a .ply, .obj or .stl file"
        raise SceneInvalid(Finding(KEY, "unknown mesh format", quoted(name), expected))
    return read_beside(folder, name, LARGEST_FILE), kind


def _loaded(data: bytes, kind: str) -> Any:
    import trimesh

    # Without a resolver nothing that the file names, such as textures, is opened.
    return trimesh.load_mesh(io.BytesIO(data), file_type=kind, process=False, skip_materials=True)


def _parsed(data: bytes, kind: str, part: str | None) -> tuple[Points, Triangles]:
    if part is not None and kind == "obj":
        data = obj_part(data.decode(errors="replace"), part).encode()
    mesh = _loaded(data, kind)
    vertices = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    if part is not None and kind != "obj":
        polygons, tags = _ply_faces(mesh) if kind == "ply" else ([], [])
        own = np.flatnonzero(faces_of(part, tags))
        triangles = np.array([fan for k in own for fan in _fan(polygons[k])], dtype=np.int64)
    else:
        triangles = np.array(mesh.faces, dtype=np.int64).reshape(-1, 3)
    if not len(triangles):
        raise ValueError("no faces")
    if not np.isfinite(vertices).all():
        raise ValueError("coordinates that are not finite")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise ValueError("faces of vertices that there are not")
    return vertices, triangles


def _ply_faces(mesh: Any) -> tuple[list[list[int]], Tags]:
    """The polygons of a PLY file and their tags, in the order of the file."""
    faces = mesh.metadata["_ply_raw"]["face"]["data"]
    if TAG not in faces:
        return [], []
    corners = next(faces[key] for key in ("vertex_indices", "vertex_index") if key in faces)
    polygons = [np.asarray(corner).reshape(-1).tolist() for corner in corners]
    return polygons, ply_tags(np.asarray(faces[TAG], dtype=np.int64))


def _fan(polygon: list[int]) -> list[tuple[int, int, int]]:
    return [(polygon[0], polygon[k], polygon[k + 1]) for k in range(1, len(polygon) - 1)]


def _joined(vertices: Points, triangles: Triangles) -> tuple[Points, Triangles]:
    """One vertex per place, in the order of their first use in the file."""
    _, first, inverse = np.unique(vertices + 0.0, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return vertices[first[order]], rank[inverse.reshape(-1)[triangles]]


def _one_line(text: str) -> str:
    return " ".join(text.split())[:200]
