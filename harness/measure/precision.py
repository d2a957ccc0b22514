"""How exact a renderer's numbers are, apart from its images."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Precision:
    """Relative spacing of the numbers that a renderer computes with, and of those it stores.

    POV-Ray, for one, computes in float64 but keeps indices of refraction and the vertices of meshes
    in float32.
    """

    arithmetic: float
    data: float
