"""Solids that touch or overlap, in a form in which POV-Ray has one interface where they meet.

POV-Ray keeps a list of the solids that a ray is in (ComputeRefraction in trace.cpp). When the ray
enters a solid, it is refracted from the medium of the last one in the list; when it leaves a solid
that is not the last one, it goes straight on. So where two solids meet, each is made to reach
some `GAP` into the other: from either side the ray first enters what it is going to, refracted and
weighed by Fresnel's equations as it should be, and then leaves behind what it comes from, by a face
that is made to show nothing from within. Faces in one place, of which POV-Ray would drop one, there
are none.

For a solid S of a group, of which H are the ones of higher priority, this is
``grown(S) - shrunk(H)`` within ``S + all others``. The faces of the former are those that it
reaches into others by, and have a clear inside. Those of the latter are where the solid ends in
what is around the group; they are exact. Where bounds of two solids are the same surface, one of
them is moved so far (`APART`) that the other one decides.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace

from harness.errors import RendererUnsupported
from harness.scene.arrangement import Group, centred
from harness.scene.contact import sides
from harness.scene.regions import Both, Either, HalfSpace, Region, Round, Side, along, complement

# Four of POV-Ray's hit floors, in scaled units (see `povray_fit`).
GAP = 4e-4
# More than two solids reach into each other, which is up to 2 GAP each.
APART = 6 * GAP

Move = Callable[[Side], float]


def within_group(group: Group, member: int, reach: float) -> tuple[Both, Either]:
    """(where a solid is and reaches into others, where it and all others are).

    `member` is its place in the group, whose coordinates are at most `reach`. The solid is what is
    in both. Raises RendererUnsupported for composed solids with parts that touch.
    """
    own, others = group.regions[member], _all_but(group, member)
    higher = group.regions[:member]
    count = len(group.members)

    def depth(other: int) -> float:
        """How far the solid reaches into another one; each pair has a depth of its own."""
        return GAP * (1 + (member * count + other) / count**2)

    def outwards(side: Side) -> float:
        return APART if any(_has(other, _back(side)) for other in higher) else depth(member)

    def inwards(other: int) -> Move:
        return lambda side: APART if _has(own, side) else -depth(other)

    def aside(side: Side) -> float:
        return APART if _has(own, _back(side)) else -APART if _has(own, side) else 0.0

    for k, where in zip(group.members, group.regions, strict=True):
        _require_no_seam(k, where)
    cut = [moved(where, inwards(h), reach) for h, where in enumerate(higher)]
    cut += _seams(higher, inwards, reach)
    inner = Both((moved(own, outwards, reach), *map(complement, cut)))
    return inner, Either((own, *(moved(where, aside, reach) for where in others)))


def _all_but(group: Group, member: int) -> list[Region]:
    return [where for k, where in enumerate(group.regions) if k != member]


def _has(where: Region, side: Side) -> bool:
    return side in sides(where)


def _back(side: Side) -> Side:
    return replace(side, outside=not side.outside)


def _require_no_seam(solid: int, where: Region) -> None:
    """Where parts of one solid share a face, moving both would open a gap."""
    own = set(sides(where))
    if any(_back(side) in own for side in own):
        raise RendererUnsupported(
            f"solid {solid} touches others and has parts that touch each other, "
            "between which POV-Ray would see a gap"
        )


def _seams(
    solids: tuple[Region, ...], inwards: Callable[[int], Move], reach: float
) -> Iterator[Region]:
    """What lies about the faces that two solids share, which are no faces of both together."""
    for (i, a), (j, b) in itertools.combinations(enumerate(solids), 2):
        for side in set(sides(a)):
            if _has(b, _back(side)):
                yield Both((
                    moved(a, _except(side, inwards(i)), reach),
                    moved(b, _except(_back(side), inwards(j)), reach),
                ))  # fmt: skip


def _except(seam: Side, move: Move) -> Move:
    return lambda side: APART if side == seam else move(side)


# --- moved bounds ---------------------------------------------------------------------------------


def moved(where: Region, by: Move, reach: float) -> Region:
    """A region whose bounds are moved, each outwards by a distance of its own.

    Bounds of other conics move by that or more. Coordinates are at most `reach`.
    """
    if isinstance(where, Side):
        distance = by(where)
        outwards = -distance if where.outside else distance
        return Side(_moved(where.bound, outwards, reach), where.outside)
    return type(where)(tuple(moved(part, by, reach) for part in where.parts))


def _moved(bound: HalfSpace | Round, by: float, reach: float) -> HalfSpace | Round:
    if isinstance(bound, HalfSpace):
        return HalfSpace(bound.normal, bound.offset + by)
    bound = centred(bound)
    if bound.b == 0 and bound.c in (0, -1):  # a cylinder or a sphere
        return replace(bound, a=(math.sqrt(bound.a) + by) ** 2)
    bend = bound.b**2 - 4 * bound.a * bound.c
    if bound.c > 0 and abs(bend) <= 1e-9 * bound.b**2 + 1e-300:  # a cone: along its axis
        sine = math.sqrt(bound.c / (1 + bound.c))
        return replace(bound, origin=along(bound.origin, -by / sine, bound.axis))
    # rho^2 - (a + b z + c z^2) grows by its gradient, whose square is this on the surface.
    steepest = math.sqrt(bend + max(0.0, 4 * (1 + bound.c)) * reach**2)
    return replace(bound, a=bound.a + by * steepest)
