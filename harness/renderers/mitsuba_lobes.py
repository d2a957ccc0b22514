"""Mitsuba's public scene and BSDF API, one lobe at a time and without sampling.

Imported only in the process that hosts Mitsuba, after an LLVM variant was chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from harness.scene import resolved as rs

# Where a ray goes on: p + OFFSET * direction. Along the ray, so that nothing is displaced; unlike
# Mitsuba's own spawn_ray, which leaves along the normal. 50 times the spacing of a float of 16.
OFFSET = 1e-4
SURFACE, INTERFACE = 0, 1


class Interface(NamedTuple):
    """Of a solid that is not in Mitsuba's scene: its index, and the media on both sides."""

    solid: int
    inside: int
    outside: int


class Tables:
    """What a hit shape is, by Mitsuba's number of it: facts that BSDFs do not tell.

    `scene` is the (scaled) scene from which `live` was made. Interfaces that are not in `live` have
    the numbers from `first` on.
    """

    def __init__(
        self, live: Any, scene: rs.ResolvedScene, interfaces: Sequence[Interface] = ()
    ) -> None:
        numbers = np.array(dr.reinterpret_array(mi.UInt32, live.shapes_dr()))
        self.first = int(numbers.max(initial=0)) + 1
        kind, index, inside, outside = np.zeros((4, self.first + len(interfaces)), np.uint32)
        for number, own in enumerate(interfaces, self.first):
            kind[number], index[number] = INTERFACE, own.solid
            inside[number], outside[number] = own.inside, own.outside
        for number, shape in zip(numbers, live.shapes(), strict=True):
            role, k = shape.id().split("_")[:2]
            index[number] = int(k)
            if role == "solid":
                solid = scene.solids[int(k)]
                kind[number] = INTERFACE
                inside[number], outside[number] = solid.medium, solid.exterior
        self._kind, self._index = mi.UInt32(kind), mi.UInt32(index)
        self._inside, self._outside = mi.UInt32(inside), mi.UInt32(outside)
        absorption = np.array([m.absorption for m in scene.media], np.float32)
        self._sigma = [mi.Float(column) for column in absorption.T]
        self._ior = mi.Float(np.array([m.ior for m in scene.media], np.float32))

    def kind(self, number: Any, active: Any) -> Any:
        return dr.gather(mi.UInt32, self._kind, number, active)

    def index(self, number: Any, active: Any) -> Any:
        """Index into scene.surfaces or scene.solids."""
        return dr.gather(mi.UInt32, self._index, number, active)

    def medium_beyond(self, number: Any, si: Any, direction: Any, current: Any, active: Any) -> Any:
        """The medium that a ray is in that leaves `si` along `direction`."""
        inside = dr.gather(mi.UInt32, self._inside, number, active)
        outside = dr.gather(mi.UInt32, self._outside, number, active)
        entered = dr.select(dr.dot(direction, si.n) < 0, inside, outside)
        return dr.select(self.kind(number, active) == INTERFACE, entered, current)

    def sigma(self, medium: Any) -> Any:
        return mi.Color3f(*(dr.gather(mi.Float, column, medium) for column in self._sigma))

    def ior(self, medium: Any) -> Any:
        return dr.gather(mi.Float, self._ior, medium)


@dataclass  # not frozen: dr.select fills in its result
class Lobe:
    """Where light goes on from an interface or surface.

    `weight` is Mitsuba's, a transmitted one divided by the square of the relative index;
    `energy` is the largest of its channels without that factor.
    """

    direction: Any
    weight: Any
    energy: Any


def reflected(si: Any, bsdf: Any, active: Any) -> Lobe:
    delta = mi.BSDFFlags.DeltaReflection
    sample, weight = _sampled(si, bsdf, delta, active)
    return Lobe(si.to_world(sample.wo), weight, dr.max(weight))


def transmitted(si: Any, bsdf: Any, active: Any) -> Lobe:
    delta = mi.BSDFFlags.DeltaTransmission
    sample, weight = _sampled(si, bsdf, delta, active)
    return Lobe(si.to_world(sample.wo), weight, dr.max(weight) * dr.square(sample.eta))


def _sampled(si: Any, bsdf: Any, delta: Any, active: Any) -> tuple[Any, Any]:
    """With one delta lobe to choose from, sampling is evaluation: the random numbers are unused."""
    flags = bsdf.flags()
    # What also has a null lobe is translucent: it is left to `passed`.
    there = active & mi.has_flag(flags, delta) & ~mi.has_flag(flags, mi.BSDFFlags.Null)
    context = mi.BSDFContext(mi.TransportMode.Radiance, int(delta))
    return bsdf.sample(context, si, 0.5, mi.Point2f(0.5), there)  # type: ignore[no-any-return]


def passed(si: Any, bsdf: Any, direction: Any, active: Any) -> Lobe:
    """Straight on through what is translucent."""
    there = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Null)
    weight = dr.select(there, bsdf.eval_null_transmission(si, there), 0.0)
    return Lobe(direction, weight, dr.max(weight))


def onward(si: Any, bsdf: Any, direction: Any, active: Any) -> Lobe:
    """Transmitted by an interface or passed by what is translucent."""
    through = transmitted(si, bsdf, active)
    straight = passed(si, bsdf, direction, active)
    chosen: Lobe = dr.select(mi.has_flag(bsdf.flags(), mi.BSDFFlags.Null), straight, through)
    return chosen


def attenuation(sigma: Any, distance: Any) -> Any:
    """exp(-sigma L), and over an infinite distance 1 where nothing absorbs."""
    return dr.select(sigma > 0, dr.exp(-sigma * distance), 1.0)


def landing(node: Any, si: Any) -> Any:
    """Where the ray meets `si`: on the ray, which double precision does not leave."""
    return dr.fma(mi.Float64(si.t), mi.Vector3d(node.direction), mi.Point3d(node.origin))
