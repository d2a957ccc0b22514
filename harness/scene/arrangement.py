"""Solids that touch or overlap, together: which they are, and the bounds that they share.

Where glass touches water there is one interface. Whoever looks for it has to know that the glass's
bound and the water's are the same surface, though their numbers differ by rounding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.scene import resolved
from harness.scene.containment import bounds
from harness.scene.regions import HalfSpace, Region, Round, Side, region
from harness.scene.resolved import Vec3

# Of the group's coordinates: what is nearer is the same surface; as for `share_a_face`.
SAME = 1e-9


@dataclass(frozen=True)
class Group:
    """Solids that meet, directly or by way of others, highest priority first.

    `members` are indices into scene.solids, and `regions` their points: bounds of theirs that are
    the same surface are equal. `around` is the medium around all of them.
    """

    members: tuple[int, ...]
    regions: tuple[Region, ...]
    around: int


def meeting(solids: Sequence[resolved.Solid]) -> list[tuple[int, ...]]:
    """The groups of solids that meet, each by rising index."""
    groups: list[tuple[int, ...]] = []
    seen: set[int] = set()
    for first, solid in enumerate(solids):
        if first in seen or not solid.meets:
            continue
        found, waiting = {first}, [first]
        while waiting:
            new = set(solids[waiting.pop()].meets) - found
            found |= new
            waiting += new
        seen |= found
        groups.append(tuple(sorted(found)))
    return groups


def grouped(solids: Sequence[resolved.Solid], members: Sequence[int]) -> Group:
    """The group of these solids, none of which is a mesh."""
    order = sorted(members, key=lambda k: -solids[k].priority)
    boxes = {k: bounds(solids[k].shape) for k in order}
    # What contains all others, if any does, has the largest box.
    outermost = max(order, key=lambda k: float(np.prod(boxes[k][1] - boxes[k][0])))
    reach = float(np.max(np.abs([boxes[k] for k in order])))
    shared = Shared(reach)
    shapes = [solids[k].shape for k in order]
    regions = [shared.of(region(s)) for s in shapes if not isinstance(s, resolved.Mesh)]
    assert len(regions) == len(order), "a mesh has no bounds"
    return Group(tuple(order), tuple(regions), solids[outermost].exterior)


class Shared:
    """All different bounds so far, of regions whose coordinates go up to `reach`."""

    def __init__(self, reach: float) -> None:
        self._reach = reach
        self._known: list[HalfSpace | Round] = []

    def of(self, where: Region) -> Region:
        """The same region, in the numbers of the bounds that were there before."""
        if not isinstance(where, Side):
            return type(where)(tuple(map(self.of, where.parts)))
        for known in self._known:
            if _same(known, where.bound, self._reach):
                return replace(where, bound=known)
            if isinstance(where.bound, HalfSpace) and _same(
                known, _turned_round(where.bound), self._reach
            ):
                return Side(known, not where.outside)
        self._known.append(where.bound)
        return where


def _turned_round(plane: HalfSpace) -> HalfSpace:
    x, y, z = plane.normal
    return HalfSpace((-x, -y, -z), -plane.offset)


def _same(a: HalfSpace | Round, b: HalfSpace | Round, reach: float) -> bool:
    """Whether two bounds are one surface where coordinates are at most `reach`."""
    within = SAME * reach
    if isinstance(a, HalfSpace) or isinstance(b, HalfSpace):
        return (
            isinstance(a, HalfSpace)
            and isinstance(b, HalfSpace)
            and abs(a.offset - b.offset) <= within
            and math.dist(a.normal, b.normal) <= SAME
        )
    a, b = centred(a), centred(b)
    apart = np.subtract(b.origin, a.origin)
    if _is_ball(a) and _is_ball(b):
        return bool(np.linalg.norm(apart) <= within) and _alike(a, b, within)
    if _is_pipe(a) and _is_pipe(b):
        off_axis = np.linalg.norm(np.cross(apart, a.axis))
        parallel = np.linalg.norm(np.cross(a.axis, b.axis)) <= SAME
        return bool(off_axis <= within and parallel) and _alike(a, b, within)
    return (
        bool(np.linalg.norm(apart) <= within)
        and math.dist(a.axis, b.axis) <= SAME
        and abs(a.a - b.a) <= within * reach
        and abs(a.b - b.b) <= within
        and abs(a.c - b.c) <= SAME
    )


def _alike(a: Round, b: Round, within: float) -> bool:
    return abs(math.sqrt(a.a) - math.sqrt(b.a)) <= within


def _is_ball(bound: Round) -> bool:
    return bound.b == 0 and bound.c == -1


def _is_pipe(bound: Round) -> bool:
    return bound.b == 0 and bound.c == 0


def centred(bound: Round) -> Round:
    """A sphere that is given from its vertex, from its centre."""
    if bound.c != -1 or bound.b == 0:
        return bound
    half: float = bound.b / 2
    x, y, z = (o + half * a for o, a in zip(bound.origin, bound.axis, strict=True))
    origin: Vec3 = x, y, z
    return Round(origin, bound.axis, bound.a + half * half, 0.0, -1.0)
