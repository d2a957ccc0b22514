"""What rays meet: Mitsuba's shapes, and solids that Mitsuba has no shapes for.

Mitsuba has neither lenses nor cones nor composed solids. Their boundaries are found here, in closed
form and double precision, from the description that the harness keeps of them in `regions`;
refraction and Fresnel's equations at them are Mitsuba's, by a BSDF that it makes for them.

Imported only in the process that hosts Mitsuba, after an LLVM variant was chosen.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from harness.errors import RendererUnsupported
from harness.renderers.mitsuba_lobes import Tables
from harness.scene import resolved as rs
from harness.scene.regions import Both, HalfSpace, Region, Round, Side, region
from harness.translate.mitsuba import interface
from harness.translate.mitsuba_shapes import composed

Bound = HalfSpace | Round
# Each is compared with each at every crossing, and all of it is compiled.
MOST_BOUNDS = 24


class Met(NamedTuple):
    """Mitsuba's interaction, the BSDF there, and what `Tables` knows the solid or surface by."""

    si: Any
    bsdf: Any
    number: Any


class World:
    """Everything in a (scaled) scene; `live` is Mitsuba's part of it."""

    def __init__(self, live: Any, scene: rs.ResolvedScene) -> None:
        self.live = live
        chosen = [k for k, solid in enumerate(scene.solids) if composed(solid.shape)]
        if chosen and scene.lights:
            raise RendererUnsupported(
                f"solid {scene.solids[chosen[0]].name!r}: shadows of shapes that Mitsuba lacks"
            )
        self.tables = Tables(live, scene, chosen)
        self._bsdfs = [mi.load_dict(interface(scene, scene.solids[k])) for k in chosen]
        self._solids = [
            _Solid(scene.solids[k], bsdf, self.tables.first + j)
            for j, (k, bsdf) in enumerate(zip(chosen, self._bsdfs, strict=True))
        ]

    def meet(self, origin: Any, direction: Any, active: Any) -> Met:
        """The nearest thing along a ray that is unit to single precision."""
        si = self.live.ray_intersect(mi.Ray3f(origin, direction), active)
        bsdf, number = si.bsdf(), dr.reinterpret_array(mi.UInt32, si.shape)
        if not self._solids:
            return Met(si, bsdf, number)
        o, d = mi.Point3d(origin), mi.Vector3d(direction)
        best = dr.select(si.is_valid(), mi.Float64(si.t), dr.inf)
        normal, own = mi.Vector3d(0), mi.Bool(False)
        pointer: Any = dr.reinterpret_array(mi.UInt32, bsdf)
        for solid in self._solids:
            t, n = solid.meet(o, d)
            nearer = active & (t < best)
            best, normal = dr.select(nearer, t, best), dr.select(nearer, n, normal)
            pointer = dr.select(nearer, solid.bsdf, pointer)
            number = dr.select(nearer, solid.number, number)
            own |= nearer
        si.t = dr.select(own, mi.Float(best), si.t)
        si.p = dr.select(own, mi.Point3f(dr.fma(best, d, o)), si.p)
        si.n = dr.select(own, mi.Normal3f(normal), si.n)
        si.sh_frame = dr.select(own, mi.Frame3f(si.n), si.sh_frame)
        si.wi = dr.select(own, si.to_local(-direction), si.wi)
        si.shape = dr.select(own, dr.zeros(mi.ShapePtr), si.shape)  # so that it does not shine
        return Met(si, dr.reinterpret_array(mi.BSDFPtr, pointer), number)


class _Solid:
    """One solid: its distinct bounds, and how it is composed of their insides and outsides."""

    def __init__(self, solid: rs.Solid, bsdf: Any, number: int) -> None:
        assert not isinstance(solid.shape, rs.Mesh)
        pointer: Any = dr.reinterpret_array(mi.UInt32, mi.BSDFPtr(bsdf))
        self.bsdf = dr.opaque(mi.UInt32, pointer[0])
        self.number = dr.opaque(mi.UInt32, number)
        self._bounds: list[Bound] = []
        self._where = self._numbered(region(solid.shape))
        if len(self._bounds) > MOST_BOUNDS:
            raise RendererUnsupported(
                f"solid {solid.name!r} has {len(self._bounds)} faces; mitsuba-exact finds its way "
                f"through {MOST_BOUNDS}"
            )
        self._surfaces = [
            _Plane(bound) if isinstance(bound, HalfSpace) else _Quadric(bound)
            for bound in self._bounds
        ]

    def meet(self, o: Any, d: Any) -> tuple[Any, Any]:
        """(t, outward unit normal) of the nearest crossing of the solid's boundary ahead.

        A crossing of a bound is one of the solid if it makes a difference to the solid there on
        which side of that bound one is.
        """
        best, normal = mi.Float64(dr.inf), mi.Vector3d(0)
        for k, surface in enumerate(self._surfaces):
            for t, there in surface.crossings(o, d):
                p = dr.fma(t, d, o)
                sides = [s.inside(p) for s in self._surfaces]
                sides[k] = mi.Bool(True)
                with_it = self._inside(self._where, sides)
                sides[k] = mi.Bool(False)
                without = self._inside(self._where, sides)
                nearer = there & (t > 0) & (t < best) & (with_it != without)
                n = surface.normal(p)
                best = dr.select(nearer, t, best)
                normal = dr.select(nearer, dr.select(with_it, n, -n), normal)
        return best, normal

    def _numbered(self, where: Region) -> Region:
        """Collects the bounds. Two half-spaces that share their plane become one, and its outside.

        So no gap opens between parts that share a face: what is on which side is decided once.
        """
        if not isinstance(where, Side):
            return type(where)(tuple(map(self._numbered, where.parts)))
        bound = where.bound
        if isinstance(bound, HalfSpace):
            x, y, z = bound.normal
            opposite = HalfSpace((-x, -y, -z), -bound.offset)
            if opposite in self._bounds:
                return Side(opposite, not where.outside)
        if bound not in self._bounds:
            self._bounds.append(bound)
        return where

    def _inside(self, where: Region, sides: list[Any]) -> Any:
        if isinstance(where, Side):
            inside = sides[self._bounds.index(where.bound)]
            return ~inside if where.outside else inside
        parts = [self._inside(part, sides) for part in where.parts]
        together = parts[0]
        for part in parts[1:]:
            together = together & part if isinstance(where, Both) else together | part
        return together


def _opaque(values: tuple[float, float, float]) -> Any:
    return mi.Vector3d(*(dr.opaque(mi.Float64, x) for x in values))


class _Plane:
    def __init__(self, bound: HalfSpace) -> None:
        self._n, self._offset = _opaque(bound.normal), dr.opaque(mi.Float64, bound.offset)

    def inside(self, p: Any) -> Any:
        return dr.dot(self._n, p) <= self._offset

    def crossings(self, o: Any, d: Any) -> list[tuple[Any, Any]]:
        """(t, whether there is one) of each crossing."""
        approach = dr.dot(self._n, d)
        return [((self._offset - dr.dot(self._n, o)) / approach, approach != 0)]

    def normal(self, _point: Any) -> Any:
        return self._n


class _Quadric:
    """Inside is where rho^2 <= a + b z + c z^2, and for c > 0 beyond the middle of its halves."""

    def __init__(self, bound: Round) -> None:
        self._origin, self._axis = _opaque(bound.origin), _opaque(bound.axis)
        self._a, self._half_b = (dr.opaque(mi.Float64, x) for x in (bound.a, bound.b / 2))
        self._e = dr.opaque(mi.Float64, 1 + bound.c)
        middle = -bound.b / (2 * bound.c) if bound.c > 0 else -dr.inf
        self._middle = dr.opaque(mi.Float64, middle)

    def inside(self, p: Any) -> Any:
        q = p - self._origin
        z = dr.dot(q, self._axis)
        within = dr.dot(q, q) <= self._a + (2 * self._half_b + self._e * z) * z
        return within & (z > self._middle)

    def crossings(self, o: Any, d: Any) -> list[tuple[Any, Any]]:
        """(t, whether there is one); from the point of the ray that is next to the origin."""
        shift = dr.dot(self._origin - o, d) / dr.dot(d, d)
        q = dr.fma(shift, d, o) - self._origin
        z, dz = dr.dot(q, self._axis), dr.dot(d, self._axis)
        a = dr.dot(d, d) - self._e * dz * dz
        b = dr.dot(q, d) - (self._e * z + self._half_b) * dz
        c = dr.dot(q, q) - (self._e * z + 2 * self._half_b) * z - self._a
        rest = b * b - a * c
        s = -b - dr.copysign(dr.sqrt(dr.maximum(rest, 0.0)), b)
        found = []
        for t, meant in ((s / a, a != 0), (c / s, s != 0)):
            ahead = dr.fma(t, dz, z) > self._middle
            found.append((t + shift, meant & (rest >= 0) & ahead))
        return found

    def normal(self, p: Any) -> Any:
        q = p - self._origin
        gradient = q - (self._e * dr.dot(q, self._axis) + self._half_b) * self._axis
        size = dr.norm(gradient)
        return dr.select(size > 0, gradient / size, -self._axis)  # the tip of a cone
