"""A ray tracer for refraction, as one lecture tells it, in double precision.

Start with `tracer.optics`: what one ray does at one surface. `render` makes images by double
recursion, `follow` says where single rays go. Importing this package is cheap; what compiles is
imported when it is first asked for.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tracer.camera import Orthographic as Orthographic
    from tracer.camera import Perspective as Perspective
    from tracer.camera import ThinLens as ThinLens
    from tracer.errors import SceneError as SceneError
    from tracer.film import Box as Box
    from tracer.film import Gaussian as Gaussian
    from tracer.film import Sampling as Sampling
    from tracer.image import Render as Render
    from tracer.image import render as render
    from tracer.image import render_spectrum as render_spectrum
    from tracer.mesh import Mesh as Mesh
    from tracer.path import Paths as Paths
    from tracer.path import follow as follow
    from tracer.scene import Medium as Medium
    from tracer.scene import Scene as Scene
    from tracer.scene import Solid as Solid
    from tracer.scene import Surface as Surface

__version__ = "0.1.0"

_HOME = {
    "Orthographic": "camera",
    "Perspective": "camera",
    "ThinLens": "camera",
    "Box": "film",
    "Gaussian": "film",
    "Sampling": "film",
    "SceneError": "errors",
    "Mesh": "mesh",
    "Paths": "path",
    "follow": "path",
    "Render": "image",
    "render": "image",
    "render_spectrum": "image",
    "Medium": "scene",
    "Scene": "scene",
    "Solid": "scene",
    "Surface": "scene",
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'tracer' has no attribute {name!r}")
    return getattr(importlib.import_module(f"tracer.{_HOME[name]}"), name)
