"""Which solid is where several overlap: the innermost, or the one of the highest priority."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from harness.scene import resolved
from harness.scene.contact import share_a_face
from harness.scene.containment import Relation, bounds, relation, signed_distance
from harness.scene.findings import Attempts, Finding, SceneInvalid

Solids = Sequence[resolved.Solid]

# A scene that has more wrong than this is told of these alone.
MOST_FINDINGS = 20
# Comparing two solids takes up to half a millisecond.
MOST_PAIRS = 5_000


def placed(
    solids: Solids, priorities: Sequence[int], tolerance: float
) -> tuple[resolved.Solid, ...]:
    """The solids with what is around them, whom they meet, and priorities that settle all overlaps.

    Raises SceneInvalid where two solids overlap partly and none has a higher priority, where one is
    hidden inside another, and where a mesh shares faces.
    """
    around: list[set[int]] = [set() for _ in solids]
    meets: list[set[int]] = [set() for _ in solids]
    attempts = Attempts()
    for i, j in _near(solids, tolerance):
        if len(attempts.findings) >= MOST_FINDINGS:
            break
        found = relation(solids[i].shape, solids[j].shape, tolerance)
        if found is Relation.INSIDE:
            around[i].add(j)
            attempts.attempt(("solids", i), _not_hidden, solids[j], priorities[i], priorities[j])
        elif found is Relation.AROUND:
            around[j].add(i)
            attempts.attempt(("solids", j), _not_hidden, solids[i], priorities[j], priorities[i])
        elif found is Relation.OVERLAP and priorities[i] == priorities[j]:
            attempts.findings.append(_overlap(solids[i], j))
        touch = share_a_face(solids[i].shape, solids[j].shape, tolerance)
        if touch and any(isinstance(solids[k].shape, resolved.Mesh) for k in (i, j)):
            attempts.findings.append(_mesh_touches(solids[i], j))
        if touch or found is Relation.OVERLAP:
            meets[i].add(j)
            meets[j].add(i)
    attempts.raise_any()
    ranks = [(priority, len(outer)) for priority, outer in zip(priorities, around, strict=True)]
    order = sorted(set(ranks))
    return tuple(
        solid.model_copy(
            update={
                # Of several containers the smallest is the one that lies inside most others.
                "exterior": solids[max(outer, key=lambda j: ranks[j])].medium if outer else 0,
                "priority": order.index(rank),
                "meets": tuple(sorted(neighbours)),
            }
        )
        for solid, outer, rank, neighbours in zip(solids, around, ranks, meets, strict=True)
    )


def _near(solids: Solids, tolerance: float) -> list[tuple[int, int]]:
    """The pairs of solids whose boxes meet; raises SceneInvalid where these are too many."""
    boxes = np.array([bounds(solid.shape) for solid in solids]).reshape(-1, 2, 3)
    pairs = []
    for i, (low, high) in enumerate(boxes):
        later = boxes[i + 1 :]
        meets = np.all((later[:, 0] <= high + tolerance) & (later[:, 1] >= low - tolerance), axis=1)
        pairs += [(i, i + 1 + int(k)) for k in np.flatnonzero(meets)]
        if len(pairs) > MOST_PAIRS:
            message = (
                f"more than {MOST_PAIRS} pairs of solids overlap, or are as near as their boxes"
            )
            raise SceneInvalid(Finding(("solids",), message, f"{len(solids)} solids", "fewer"))
    return pairs


def _not_hidden(outer: resolved.Solid, own: int, others: int) -> None:
    if own < others:
        message = f"hidden: it lies inside solid {outer.name}, which has a higher priority"
        raise SceneInvalid(Finding(("priority",), message, str(own), f"at least {others}"))


def _overlap(first: resolved.Solid, second: int) -> Finding:
    return Finding(
        ("solids", second, "shape"),
        f"overlaps solid {first.name} partly",
        None,
        "solids that are apart, touch, or lie wholly inside each other; "
        "or a higher `priority` of the one that is there",
    )


def _mesh_touches(first: resolved.Solid, second: int) -> Finding:
    return Finding(
        ("solids", second, "shape"),
        f"shares a face with solid {first.name}, and one of them is a mesh",
        None,
        "a gap between them, or analytic shapes, whose shared faces are one interface",
    )


def innermost(solids: Solids, point: Sequence[float], tolerance: float) -> int | None:
    """The solid that is at a point, None outside of all; `solids` as of `placed`.

    Raises ValueError(k) where the point lies on the surface of solid k.
    """
    for k in sorted(range(len(solids)), key=lambda k: -solids[k].priority):
        low, high = bounds(solids[k].shape)
        if np.any(low - tolerance > point) or np.any(high + tolerance < point):
            continue
        away = signed_distance(solids[k].shape, np.array([point], dtype=np.float64))[0]
        if abs(away) <= tolerance:
            raise ValueError(k)
        if away < 0:
            return k
    return None
