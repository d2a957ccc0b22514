"""A section through a scene as a drawing: solids cut by a plane, and the rays through them.

`draw` makes the SVG; `ray_path` turns a ray's vertices into what is drawn, plain data that a
record can hold.
"""

from harness.section.drawing import draw, plane_of, window_of
from harness.section.outline import Cut, Window, outline
from harness.section.paths import ray_path

__all__ = ["Cut", "Window", "draw", "outline", "plane_of", "ray_path", "window_of"]
