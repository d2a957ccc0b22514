"""A live Mitsuba scene from the description of `harness.translate.mitsuba`.

Imported only in the process that hosts Mitsuba, after its variant was chosen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.translate.mitsuba_shapes import Node


@dataclass(frozen=True)
class Live:
    """A `mitsuba.Scene`, and its absorbing media by the description's keys."""

    scene: Any
    media: dict[str, Any]


def load(mi: Any, description: Node) -> Live:
    """Makes a description live; `mi` is the mitsuba module with its variant set.

    Shapes keep the description's keys as their ids: nothing is merged or deduplicated.
    """
    media = {
        name: mi.load_dict(_plain(mi, node, {}))
        for name, node in description.items()
        if name.startswith("medium_")
    }
    scene = {
        name: _mesh(mi, name, node, media) if _is_mesh(node) else _plain(mi, node, media)
        for name, node in description.items()
        if name not in media
    }
    return Live(mi.load_dict(scene, optimize=False), media)


def _is_mesh(node: Any) -> bool:
    return isinstance(node, dict) and node["type"] == "mesh"


def _plain(mi: Any, node: Any, media: dict[str, Any]) -> Any:
    """`node` with Mitsuba's objects for transforms, pixels and references to media."""
    if not isinstance(node, dict):
        return node
    if node["type"] == "ref":
        return media[node["id"]]
    result = {}
    for key, value in node.items():
        if key in ("to_world", "to_uv"):
            result[key] = mi.ScalarTransform4f(value)
        elif key == "pixels":
            if node["type"] == "envmap":
                result["bitmap"] = mi.Bitmap(value)
            else:
                result["data"] = mi.TensorXf(value)
        else:
            result[key] = _plain(mi, value, media)
    return result


def _mesh(mi: Any, name: str, node: Node, media: dict[str, Any]) -> Any:
    properties = mi.Properties()
    for key in ("bsdf", "emitter", "interior", "exterior"):
        if key in node:
            child = _plain(mi, node[key], media)
            properties[key] = mi.load_dict(child) if isinstance(child, dict) else child
    mesh = mi.Mesh(
        name,
        vertex_count=len(node["vertices"]),
        face_count=len(node["triangles"]),
        props=properties,
        has_vertex_normals="normals" in node,
        has_vertex_texcoords="texcoords" in node,
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = _own(mi, node["vertices"])
    parameters["faces"] = _own(mi, node["triangles"])
    if "normals" in node:
        parameters["vertex_normals"] = _own(mi, node["normals"])
    if "texcoords" in node:
        parameters["vertex_texcoords"] = _own(mi, node["texcoords"])
    parameters.update()
    mesh.set_id(name)
    return mesh


def _own(mi: Any, array: NDArray[Any]) -> Any:
    """The flat array in memory of Dr.Jit's.

    Dr.Jit compiles other code for memory that is less aligned than its own, as numpy's can be: the
    kernels of one and the same scene would differ from run to run.
    """
    import drjit as dr

    flat = np.ravel(array)
    if not dr.is_jit_v(mi.Float):
        return flat
    kind = mi.UInt32 if flat.dtype == np.uint32 else mi.Float
    own = dr.empty(kind, len(flat))
    dr.scatter(own, kind(flat), dr.arange(mi.UInt32, len(flat)))
    dr.eval(own)
    return own
