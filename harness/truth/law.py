"""What happens to rays at an interface and between two: physics, or what a wrong renderer does.

`harness.truth.paths` follows rays by a `Law`. Its defaults are the closed forms of
`harness.expected`. A diagnosis puts one rule of a wrong renderer in the place of one of them, and
asks whether the images come out as measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from harness import expected
from harness.expected import Float

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Interface:
    """m rays that arrive at an interface along `direction` (m, 3), at `point` (m, 3).

    `n` (m, 3) faces the rays. `ior_i` and `ior_t` (m,) are the absolute indices on this side and
    beyond, `entering` (m,) tells whether a solid begins here, `leg` (m,) how long the way from the
    last interface was, and `on_mesh` (m,) whether the surface is made of triangles.
    """

    point: Float
    direction: Float
    n: Float
    ior_i: Float
    ior_t: Float
    entering: Mask
    leg: Float
    on_mesh: Mask

    @cached_property
    def cos_theta_i(self) -> Float:
        return np.asarray(np.clip(-np.einsum("ij,ij->i", self.direction, self.n), 0, 1))


@dataclass(frozen=True)
class Leg:
    """A straight way of `length` (m,) along `direction` in media that absorb `sigma` (m, 3).

    `n` (m, 3) is the normal at its start, None at the camera. `ends_in` is the letter of what
    comes next: T, R, or nothing where the ray lands.
    """

    length: Float
    direction: Float
    sigma: Float
    n: Float | None
    ends_in: str


def snell(at: Interface) -> tuple[Float, Mask]:
    """Refracted directions, and where there is total internal reflection instead."""
    return expected.refract(at.direction, at.n, at.ior_i, at.ior_t)


def fresnel(at: Interface) -> Float:
    """Unpolarised reflectance."""
    return expected.fresnel(at.cos_theta_i, at.ior_i, at.ior_t)


def beer(leg: Leg) -> Float:
    """Optical depth (m, 3)."""
    return leg.length[:, None] * leg.sigma


@dataclass(frozen=True)
class Law:
    """Each rule on its own, for all rays at once; the defaults are physics.

    `normal` is what becomes of an interface's normals, given which are a mesh's, `start` where a
    ray goes on that leaves an interface along its second argument, `transmittance` what weighs a
    transmitted ray, given R. `depth` is 0 in media that do not absorb, where it may not be asked.
    """

    normal: Callable[[Float, Mask], Float] = lambda n, _: n
    bend: Callable[[Interface], tuple[Float, Mask]] = snell
    reflectance: Callable[[Interface], Float] = fresnel
    transmittance: Callable[[Interface, Float], Float] = lambda _, R: np.asarray(1 - R)
    start: Callable[[Interface, Float], Float] = lambda at, _: at.point
    depth: Callable[[Leg], Float] = beer


PHYSICS = Law()
