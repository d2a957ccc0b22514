"""Mitsuba's XML and its assets, for Mitsuba's own command line: ``mitsuba scene.xml``.

Only numbers and names of ours get into the files; nothing that a scene file says in words does.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from harness.errors import RendererUnsupported
from harness.imagefile import write_exr
from harness.record import write_text
from harness.scene.resolved import ResolvedScene
from harness.translate.mitsuba import describe
from harness.translate.mitsuba_shapes import Node
from harness.translate.mitsuba_textures import CODE_TEXTURE

# What Mitsuba calls the kinds of plugins that `describe` uses.
_TAGS = {
    "integrator": ("path", "volpath", "volpathmis"),
    "sensor": ("perspective", "orthographic"),
    "film": ("hdrfilm",),
    "rfilter": ("box",),
    "sampler": ("independent",),
    "medium": ("homogeneous",),
    "bsdf": ("dielectric", "diffuse", "conductor", "twosided", "blendbsdf", "thindielectric"),
    "texture": ("bitmap",),
    "emitter": ("area", "point", "constant", "envmap"),
    "shape": ("sphere", "rectangle", "disk", "cylinder", "mesh"),
}
_TAG = {plugin: tag for tag, plugins in _TAGS.items() for plugin in plugins}


def write(scene: ResolvedScene, folder: Path, samples: int = 64) -> Path:
    """Writes ``scene.xml``, and beside it PLY meshes and EXR textures; returns the former.

    Raises RendererUnsupported where Mitsuba has no counterpart.
    """
    folder.mkdir(parents=True, exist_ok=True)
    root = ET.Element("scene", version="3.0.0")
    root.append(ET.Comment(" mitsuba -m scalar_rgb scene.xml; or -m llvm_ad_rgb, which is faster "))
    for name, node in _media_first(describe(scene, samples)):
        root.append(_plugin(name, node, folder, "id"))
    ET.indent(root)
    path = folder / "scene.xml"
    write_text(path, ET.tostring(root, encoding="unicode") + "\n")
    return path


def _media_first(description: Node) -> list[tuple[str, Node]]:
    """The parts of the scene, in an order in which references look back."""
    parts = [(name, node) for name, node in description.items() if isinstance(node, dict)]
    return sorted(parts, key=lambda part: not part[0].startswith("medium_"))


def _plugin(name: str, node: Node, folder: Path, naming: str, trail: str = "") -> ET.Element:
    """The element of one plugin, named by its attribute `naming`; assets are named by `trail`."""
    kind, trail = node["type"], f"{trail}-{name}" if trail else name
    if kind == CODE_TEXTURE:
        raise RendererUnsupported("position codes are a texture of ours: Mitsuba's XML has none")
    plugin = "ply" if kind == "mesh" else kind
    element = ET.Element(_TAG[kind], {"type": plugin, naming: name})
    if kind == "mesh":
        _write_ply(node, folder / f"{trail}.ply")
        _value(element, "string", "filename", f"{trail}.ply")
        _value(element, "boolean", "face_normals", str("normals" not in node).lower())
    if kind in ("bitmap", "envmap"):
        write_exr(folder / f"{trail}.exr", node["pixels"])
        _value(element, "string", "filename", f"{trail}.exr")
    for key, value in node.items():
        if key != "type" and not isinstance(value, np.ndarray):
            _property(element, key, value, folder, trail)
    return element


def _property(parent: ET.Element, key: str, value: Any, folder: Path, trail: str) -> None:
    match value:
        case {"type": "ref", "id": target}:
            ET.SubElement(parent, "ref", name=key, id=target)
        case {"type": "rgb", "value": colour}:
            _value(parent, "rgb", key, ", ".join(map(repr, colour)))
        case dict():
            parent.append(_plugin(key, value, folder, "name", trail))
        case bool():
            _value(parent, "boolean", key, str(value).lower())
        case int():
            _value(parent, "integer", key, str(value))
        case float():
            _value(parent, "float", key, repr(value))
        case str():
            _value(parent, "string", key, value)
        case [x, y, z]:
            ET.SubElement(parent, "point", name=key, x=repr(x), y=repr(y), z=repr(z))
        case [_, _, _, _]:
            transform = ET.SubElement(parent, "transform", name=key)
            numbers = " ".join(repr(number) for row in value for number in row)
            ET.SubElement(transform, "matrix", value=numbers)
        case _:
            raise TypeError(f"{key}: no XML for a {type(value).__name__}")


def _value(parent: ET.Element, tag: str, name: str, value: str) -> None:
    ET.SubElement(parent, tag, name=name, value=value)


def _write_ply(mesh: Node, path: Path) -> None:
    """A binary PLY with the mesh's positions, normals and texture coordinates."""
    columns = [("vertices", "xyz"), ("normals", ("nx", "ny", "nz")), ("texcoords", "uv")]
    present = [(key, names) for key, names in columns if key in mesh]
    table = np.hstack([mesh[key] for key, _ in present]).astype("<f4")
    faces = np.empty(len(mesh["triangles"]), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh["triangles"]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(table)}",
        *(f"property float {name}" for _, names in present for name in names),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    path.write_bytes("\n".join(header).encode("ascii") + table.tobytes() + faces.tobytes())
