"""Rays followed through Mitsuba's public scene and BSDF API, both lobes, without sampling.

Everything stays in Dr.Jit arrays. An image is one kernel: each lane follows the whole tree of its
pixel's ray, depth first, with a small stack of its own, so that the order of summation and with it
every bit of the result is the same in every run. All that changes from scene to scene is opaque to
the compiler (`dr.opaque`), so that scenes of the same structure share one kernel.

Imported only in the process that hosts Mitsuba, after an LLVM variant was chosen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, make_dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from harness.renderers.mitsuba_lobes import (
    INTERFACE,
    OFFSET,
    SURFACE,
    Lobe,
    Tables,
    attenuation,
    landing,
    onward,
    reflected,
)
from harness.renderers.mitsuba_world import Met, World
from harness.scene import resolved as rs


@dataclass(frozen=True)
class Limits:
    """How far the tree of a ray is followed; opaque to the compiler but for `stack`.

    A lighter child is followed before the heavier one, so what waits on the stack at least halves
    the energy of what is followed: the stack grows by one per factor of two down to `energy`, or
    per segment down to `depth`. Below 2^-63 nothing is followed, whatever the scene allows: a
    single precision sum cannot hold it.
    """

    depth: Any
    energy: Any
    reflection: Any
    transmission: Any
    stack: int

    @classmethod
    def of(cls, transport: rs.Transport) -> Limits:
        energy = max(transport.min_weight, 2.0**-63)
        height = min(transport.max_depth, math.ceil(-math.log2(energy)))
        return cls(
            dr.opaque(mi.UInt32, transport.max_depth),
            dr.opaque(mi.Float, energy),
            dr.opaque(mi.Bool, transport.reflection),
            dr.opaque(mi.Bool, transport.transmission),
            32 if height < 32 else 64,  # two sizes, so two kernels
        )


def render(live: Any, scene: rs.ResolvedScene, origins: Any, directions: Any) -> NDArray[Any]:
    """Radiance (n, 3) float64 seen along each ray; `origins` and `directions` are Dr.Jit arrays.

    Follows both lobes of every interface to transport.max_depth and transport.min_weight.
    """
    world, limits, glow = World(live, scene), Limits.of(scene.transport), Glow.of(live, scene)
    tables = world.tables
    Node = _node_type()

    def visit(node: Any, stack: Any, waiting: Any, radiance: Any, active: Any) -> tuple[Any, ...]:
        met = world.meet(node.origin, node.direction, active)
        si = met.si
        # From where the segment begins, which is OFFSET before the ray but at the camera.
        length = si.t + dr.select(node.depth == 1, 0.0, OFFSET)
        node.weight *= attenuation(tables.sigma(node.medium), length)
        radiance += mi.Color3d(node.weight) * glow.seen(tables, node, met, active)

        go = active & si.is_valid() & (node.depth < limits.depth)
        reflection, through = _children(Node, tables, limits, node, met, go)
        both = (reflection.energy > 0) & (through.energy > 0)
        lighter = reflection.energy < through.energy
        stack.write(dr.select(lighter, through, reflection), waiting, both)
        next_node = dr.select(dr.select(both, lighter, reflection.energy > 0), reflection, through)
        ended = next_node.energy <= 0
        waiting = dr.select(both, waiting + 1, waiting)
        resumed = active & ended & (waiting > 0)
        waiting = dr.select(resumed, waiting - 1, waiting)
        node = dr.select(resumed, stack.read(waiting, resumed), next_node)
        return node, stack, waiting, radiance, active & (~ended | resumed)

    first = Node(
        origin=mi.Point3f(origins),
        direction=mi.Vector3f(directions),
        weight=mi.Color3f(1),
        energy=mi.Float(1),
        depth=mi.UInt32(1),
        medium=dr.opaque(mi.UInt32, scene.camera.medium),
    )
    stack = dr.alloc_local(Node, limits.stack, value=dr.zeros(Node))
    n = dr.width(origins)
    # As wide as the rays from the start: an index of width 1 is compiled as one for all lanes.
    waiting, everyone = dr.zeros(mi.UInt32, n), dr.full(mi.Bool, True, n)
    state = (first, stack, waiting, dr.zeros(mi.Color3d, n), everyone)
    result = dr.while_loop(state, lambda *s: s[-1], visit, label="follow")
    pixels: NDArray[Any] = np.array(result[3]).T
    return pixels


def _node_type() -> Any:
    """A ray that waits to be followed. Its arrays' types depend on the variant."""
    fields = {
        "origin": mi.Point3f,
        "direction": mi.Vector3f,
        "weight": mi.Color3f,  # Mitsuba's throughput
        "energy": mi.Float,  # its largest channel, without radiance's squares of indices
        "depth": mi.UInt32,  # segments from the camera to where this one ends
        "medium": mi.UInt32,
    }
    return make_dataclass("Node", fields.items())


def _children(
    Node: Any, tables: Tables, limits: Limits, node: Any, met: Met, active: Any
) -> tuple[Any, Any]:
    """What is reflected and what goes on; energy 0 where nothing does or it is to be cut."""
    si, bsdf, number = met
    reflection = reflected(si, bsdf, active)
    through = onward(si, bsdf, node.direction, active)
    interface = tables.kind(number, active) == INTERFACE
    total = through.energy <= 0
    follow_reflection = active & (limits.reflection | total | ~interface)
    follow_through = active & (limits.transmission | ~interface)
    point = dr.fma(si.t, node.direction, node.origin)

    def child(lobe: Lobe, follow: Any) -> Any:
        energy = node.energy * lobe.energy
        return Node(
            origin=dr.fma(OFFSET, lobe.direction, point),
            direction=lobe.direction,
            weight=node.weight * lobe.weight,
            energy=dr.select(follow & (energy >= limits.energy), energy, 0),
            depth=node.depth + 1,
            medium=tables.medium_beyond(number, si, lobe.direction, node.medium, active),
        )

    return child(reflection, follow_reflection), child(through, follow_through)


@dataclass(frozen=True)
class Glow:
    """Emitters where rays meet them, and point and directional lights on what is diffuse."""

    live: Any
    lights: list[Any]
    code: Code | None

    @classmethod
    def of(cls, live: Any, scene: rs.ResolvedScene) -> Glow:
        lights = [
            light
            for light in live.emitters()
            if mi.has_flag(light.flags(), mi.EmitterFlags.DeltaPosition)
            or mi.has_flag(light.flags(), mi.EmitterFlags.DeltaDirection)
        ]
        return cls(live, lights, Code.of(scene))

    def seen(self, tables: Tables, node: Any, met: Met, active: Any) -> Any:
        """Radiance (Color3d) that leaves `si` towards the ray, or comes from the background."""
        si, _, number = met
        radiance = mi.Color3d(si.emitter(self.live, active).eval(si, active))
        hit = active & si.is_valid()
        if self.code is not None:
            coded = (
                hit
                & (tables.kind(number, hit) == SURFACE)
                & (tables.index(number, hit) == self.code.surface)
                & (mi.Frame3f.cos_theta(si.wi) > 0)
            )
            radiance = dr.select(coded, self.code.radiance(landing(node, si)), radiance)
        for light in self.lights:
            radiance += mi.Color3d(self._lit(light, tables, node, si, hit))
        return radiance

    def _lit(self, light: Any, tables: Tables, node: Any, si: Any, hit: Any) -> Any:
        bsdf = si.bsdf()
        diffuse = hit & mi.has_flag(bsdf.flags(), mi.BSDFFlags.DiffuseReflection)
        sample, irradiance = light.sample_direction(si, mi.Point2f(0.5), diffuse)
        value = bsdf.eval(mi.BSDFContext(), si, si.to_local(sample.d), diffuse)
        start = dr.fma(OFFSET, sample.d, si.p)
        shadow = mi.Ray3f(mi.Ray3f(start, sample.d), sample.dist - 2 * OFFSET)
        visible = diffuse & (dr.max(value) > 0)
        visible &= ~self.live.ray_test(shadow, visible)
        sigma = tables.sigma(node.medium)
        return dr.select(visible, value * irradiance * attenuation(sigma, sample.dist), 0.0)


@dataclass(frozen=True)
class Code:
    """A position code, evaluated where Mitsuba's ray lands instead of looked up in a texture.

    `surface` is its index; the coarse code is gradient . (point - origin) + 1/2.
    """

    surface: Any
    origin: Any
    gradient: Any
    cells: Any
    amplitude: Any

    @classmethod
    def of(cls, scene: rs.ResolvedScene) -> Code | None:
        for k, surface in enumerate(scene.surfaces):
            match surface.shape, surface.material:
                case rs.Rectangle() as face, rs.Emissive(pattern=rs.PositionCode() as code):
                    across = face.frame.x if code.axis == "u" else face.frame.y
                    size = face.size[0] if code.axis == "u" else face.size[1]
                    return cls(
                        dr.opaque(mi.UInt32, k),
                        mi.Point3d(*(dr.opaque(mi.Float64, x) for x in face.frame.origin)),
                        mi.Vector3d(*(dr.opaque(mi.Float64, x / size) for x in across)),
                        dr.opaque(mi.Float64, code.cells),
                        dr.opaque(mi.Float64, code.amplitude),
                    )
        return None

    def radiance(self, point: Any) -> Any:
        coarse = dr.dot(point - self.origin, self.gradient) + 0.5
        fine = coarse * self.cells
        return self.amplitude * mi.Color3d(coarse, fine - dr.floor(fine), 1.0)
