"""Wedges, cones and lenses of a scene file as shapes of numbers.

Every function raises SceneInvalid with key paths relative to the shape.
"""

from __future__ import annotations

import math

import numpy as np

from harness.scene import model, resolved
from harness.scene.findings import Finding, SceneInvalid, quoted
from harness.scene.regions import sag

RINGS = np.linspace(0.0, 1.0, 65)  # heights at which a lens must have a thickness, over its edge


def cone(shape: model.Cone, placed: resolved.Frame) -> resolved.Cone:
    if shape.top_radius > shape.radius:
        raise SceneInvalid(
            Finding(
                ("top_radius",),
                "a cone narrows along its axis",
                quoted(shape.top_radius),
                f"at most radius = {quoted(shape.radius)}, or the opposite axis",
            )
        )
    return resolved.Cone(
        frame=placed, radius=shape.radius, top_radius=shape.top_radius, height=shape.height
    )


def lens(shape: model.Lens, placed: resolved.Frame) -> resolved.Lens:
    aperture = shape.diameter / 2
    for k, (radius, conic) in enumerate(zip(shape.radii, shape.conics, strict=True)):
        if not abs(radius) > 0:
            raise SceneInvalid(
                Finding(
                    ("radii", k),
                    "no radius of curvature",
                    quoted(radius),
                    "positive where the centre lies in the direction of axis, inf for a plane",
                )
            )
        reach = _reach(radius, conic)
        if aperture > reach:
            raise SceneInvalid(
                Finding(
                    ("diameter",),
                    f"wider than its {'front' if k == 0 else 'back'} face reaches",
                    quoted(shape.diameter),
                    f"at most {2 * reach:.10g}",
                )
            )
    heights = aperture * RINGS
    front = _profile(shape.radii[0], shape.conics[0], heights)
    back = shape.thickness + _profile(shape.radii[1], shape.conics[1], heights)
    thinnest = int(np.argmin(back - front))
    if back[thinnest] - front[thinnest] < -1e-12 * shape.thickness:
        raise SceneInvalid(
            Finding(
                ("thickness",),
                f"its faces cross {heights[thinnest]:.4g} from the axis",
                quoted(shape.thickness),
                f"at least {shape.thickness + float((front - back).max()):.10g}, "
                "or a smaller diameter",
            )
        )
    first, second = (radius if math.isfinite(radius) else None for radius in shape.radii)
    return resolved.Lens(
        frame=placed,
        thickness=shape.thickness,
        radii=(first, second),
        conics=shape.conics,
        aperture=aperture,
    )


def _reach(radius: float, conic: float) -> float:
    """How far from its axis a conic goes: to the equator of a sphere or an ellipsoid."""
    return abs(radius) / math.sqrt(1 + conic) if conic > -1 else math.inf


def _profile(radius: float, conic: float, heights: np.ndarray) -> np.ndarray:
    """Where a face is along the axis, from its vertex."""
    if math.isinf(radius):
        return np.zeros_like(heights)
    deep = [sag(radius, conic, min(height, _reach(radius, conic))) for height in heights.tolist()]
    return np.copysign(deep, radius)
