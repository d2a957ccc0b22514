"""What rays meet: Mitsuba's shapes, and solids that Mitsuba has no shapes for.

Mitsuba has neither lenses nor cones nor composed solids, and does not know what is where solids
overlap or share a face. Their boundaries are found here, in closed form and double precision, from
the description that the harness keeps of them in `regions`; refraction and Fresnel's equations at
them are Mitsuba's, by a BSDF that it makes for each pair of media.

Imported only in the process that hosts Mitsuba, after an LLVM variant was chosen.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from harness.errors import RendererUnsupported
from harness.renderers.mitsuba_lobes import Interface, Tables
from harness.scene import resolved as rs
from harness.scene.arrangement import Group, grouped, meeting
from harness.scene.regions import Both, HalfSpace, Region, Round, Side
from harness.translate.mitsuba import interface
from harness.translate.mitsuba_shapes import not_in_mitsuba

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
        groups = _ours(scene)
        if groups and scene.lights:
            name = scene.solids[groups[0].members[0]].name
            raise RendererUnsupported(f"solid {name!r}: shadows of what Mitsuba lacks")
        interfaces = [_interfaces(scene, group) for group in groups]
        self.tables = Tables(live, scene, list(itertools.chain(*interfaces)))
        first, self._groups = self.tables.first, []
        for group, own in zip(groups, interfaces, strict=True):
            self._groups.append(_Group(scene, group, first, own))
            first += len(own)

    def meet(self, origin: Any, direction: Any, active: Any) -> Met:
        """The nearest thing along a ray that is unit to single precision."""
        si = self.live.ray_intersect(mi.Ray3f(origin, direction), active)
        bsdf, number = si.bsdf(), dr.reinterpret_array(mi.UInt32, si.shape)
        if not self._groups:
            return Met(si, bsdf, number)
        o, d = mi.Point3d(origin), mi.Vector3d(direction)
        best = dr.select(si.is_valid(), mi.Float64(si.t), dr.inf)
        normal, own = mi.Vector3d(0), mi.Bool(False)
        pointer: Any = dr.reinterpret_array(mi.UInt32, bsdf)
        for group in self._groups:
            t, n, which = group.meet(o, d)
            nearer = active & (t < best)
            best, normal = dr.select(nearer, t, best), dr.select(nearer, n, normal)
            pointer = dr.select(nearer, group.bsdf(which, nearer), pointer)
            number = dr.select(nearer, group.first + which, number)
            own |= nearer
        si.t = dr.select(own, mi.Float(best), si.t)
        si.p = dr.select(own, mi.Point3f(dr.fma(best, d, o)), si.p)
        si.n = dr.select(own, mi.Normal3f(normal), si.n)
        si.sh_frame = dr.select(own, mi.Frame3f(si.n), si.sh_frame)
        si.wi = dr.select(own, si.to_local(-direction), si.wi)
        si.shape = dr.select(own, dr.zeros(mi.ShapePtr), si.shape)  # so that it does not shine
        return Met(si, dr.reinterpret_array(mi.BSDFPtr, pointer), number)


def _ours(scene: rs.ResolvedScene) -> list[Group]:
    """What Mitsuba is not told of: solids that meet, together, and others each by itself."""
    together = meeting(scene.solids)
    for k in itertools.chain(*together):
        if isinstance(scene.solids[k].shape, rs.Mesh):
            name = scene.solids[k].name
            raise RendererUnsupported(f"solid {name!r}: mitsuba-exact has no meshes that overlap")
    met = set(itertools.chain(*together))
    alone = [(k,) for k, s in enumerate(scene.solids) if not_in_mitsuba(s) and k not in met]
    return [grouped(scene.solids, members) for members in sorted([*alone, *together])]


def _interfaces(scene: rs.ResolvedScene, group: Group) -> list[Interface]:
    """Of each pair of solids of a group, and of each with what is around: what is on both sides.

    In the order of `_pair`.
    """
    media = [*(scene.solids[k].medium for k in group.members), group.around]
    return [
        Interface(k, media[i], media[j])
        for i, k in enumerate(group.members)
        for j in range(i + 1, len(media))
    ]


def _pair(inside: Any, outside: Any, count: int) -> Any:
    """The number of the pair (inside, outside) of 0 to count - 1, the former the lesser."""
    return inside * (2 * count - 1 - inside) // 2 + outside - inside - 1


class _Group:
    """Solids that meet, or one: their distinct bounds, and how each is composed of these."""

    def __init__(
        self, scene: rs.ResolvedScene, group: Group, first: int, interfaces: Sequence[Interface]
    ) -> None:
        self._bsdfs = [mi.load_dict(interface(scene, i.inside, i.outside)) for i in interfaces]
        pointers: list[Any] = [dr.reinterpret_array(mi.UInt32, mi.BSDFPtr(b)) for b in self._bsdfs]
        self._pointers = mi.UInt32([pointer[0] for pointer in pointers])
        self.first = dr.opaque(mi.UInt32, first)
        self._bounds: list[Bound] = []
        self._solids = [self._numbered(where) for where in group.regions]
        if len(self._bounds) > MOST_BOUNDS:
            names = " and ".join(repr(scene.solids[k].name) for k in group.members)
            raise RendererUnsupported(
                f"solid {names} has {len(self._bounds)} faces; mitsuba-exact finds its way "
                f"through {MOST_BOUNDS}"
            )
        self._surfaces = [
            _Plane(bound) if isinstance(bound, HalfSpace) else _Quadric(bound)
            for bound in self._bounds
        ]

    def meet(self, o: Any, d: Any) -> tuple[Any, Any, Any]:
        """(t, unit normal, pair of solids) of the nearest interface ahead.

        A crossing of a bound is an interface if it makes a difference to what is there on which
        side of that bound one is. The normal points to the lower of the two in priority: out of a
        solid that is alone.
        """
        best, normal, which = mi.Float64(dr.inf), mi.Vector3d(0), mi.UInt32(0)
        for k, surface in enumerate(self._surfaces):
            for t, there in surface.crossings(o, d):
                p = dr.fma(t, d, o)
                sides = [s.inside(p) for s in self._surfaces]
                sides[k] = mi.Bool(True)
                with_it = self._topmost(sides)
                sides[k] = mi.Bool(False)
                without = self._topmost(sides)
                nearer = there & (t > 0) & (t < best) & (with_it != without)
                n = surface.normal(p)
                best = dr.select(nearer, t, best)
                normal = dr.select(nearer, dr.select(with_it < without, n, -n), normal)
                inner, outer = dr.minimum(with_it, without), dr.maximum(with_it, without)
                which = dr.select(nearer, _pair(inner, outer, len(self._solids) + 1), which)
        return best, normal, which

    def bsdf(self, which: Any, active: Any) -> Any:
        return dr.gather(mi.UInt32, self._pointers, which, active)

    def _topmost(self, sides: list[Any]) -> Any:
        """The first of the solids that the point is in; their number, where it is in none."""
        found = mi.UInt32(len(self._solids))
        for k, where in reversed(list(enumerate(self._solids))):
            found = dr.select(self._inside(where, sides), k, found)
        return found

    def _numbered(self, where: Region) -> Region:
        """Collects the bounds. Those of two solids that are one surface are one already.

        So no gap opens between what shares a face: what is on which side is decided once.
        """
        if not isinstance(where, Side):
            return type(where)(tuple(map(self._numbered, where.parts)))
        if where.bound not in self._bounds:
            self._bounds.append(where.bound)
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
