"""Solids made of triangles, and where a ray meets one.

"Models must be complete: no holes! All faces (triangles) must be tagged to a solid." A mesh that
bounds a medium is refused unless every edge joins exactly two triangles that agree on outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracer.compiled import called, inlined
from tracer.errors import SceneError
from tracer.shapes import vec_at
from tracer.vector import Vec, add, cross, dot, normalise, scale, sub

Floats = NDArray[np.float64]

INF = np.inf


@dataclass(frozen=True, eq=False)
class Mesh:
    """`vertices` (V, 3), `triangles` (T, 3) counter-clockwise from outside.

    With unit `normals` (V, 3) rays refract at the interpolated normal, without at the triangle's.
    """

    vertices: Floats
    triangles: NDArray[np.int64]
    normals: Floats | None = None

    def __post_init__(self) -> None:
        count = len(self.vertices)
        if len(self.triangles) == 0:
            raise SceneError("a mesh needs triangles")
        if self.triangles.min() < 0 or self.triangles.max() >= count:
            raise SceneError(f"a mesh of {count} vertices has indices outside 0..{count - 1}")
        if not np.isfinite(self.vertices).all():
            raise SceneError("a mesh has vertices that are not finite")
        if self.normals is not None and len(self.normals) != count:
            raise SceneError(f"{count} vertices need {count} normals, not {len(self.normals)}")


def edge_defects(mesh: Mesh) -> list[tuple[int, int, str]]:
    """All (vertex, vertex, what is wrong) that keep a mesh from being closed and oriented."""
    t = mesh.triangles.astype(np.int64)
    a, b = t.ravel(), np.roll(t, -1, axis=1).ravel()
    count = len(mesh.vertices)
    edges, times = np.unique(a * count + b, return_counts=True)
    reverse = edges % count * count + edges // count
    at = np.minimum(np.searchsorted(edges, reverse), len(edges) - 1)
    opposite = np.where(edges[at] == reverse, times[at], 0)
    defects = []
    for k in np.nonzero((times != 1) | (opposite != 1))[0].tolist():
        around = int(times[k] + opposite[k])
        what = {1: "borders a hole", 2: "joins faces that disagree on outside"}.get(
            around, f"joins {around} faces"
        )
        defects.append((int(edges[k] // count), int(edges[k] % count), what))
    return defects


def require_closed(mesh: Mesh, name: str) -> None:
    """Raises SceneError naming the first offending edges, or a mesh that is inside out."""
    defects = edge_defects(mesh)
    if defects:
        some = "; ".join(f"edge {a}-{b} {what}" for a, b, what in defects[:5])
        raise SceneError(f"{name}: not a closed solid, {len(defects)} bad edges: {some}")
    from_within = mesh.vertices - mesh.vertices.mean(axis=0)  # far from it, volumes cancel
    a, b, c = (from_within[mesh.triangles[:, k]] for k in range(3))
    if float(np.einsum("ij,ij->", a, np.cross(b, c))) <= 0.0:
        raise SceneError(f"{name}: triangles must be counter-clockwise from outside")


# --- one triangle ---------------------------------------------------------------------------------


@inlined
def corners(table: Floats, triangle: int) -> tuple[Vec, Vec, Vec]:
    """Of a triangle, or what else there are three vectors of in a row."""
    return vec_at(table, triangle, 0), vec_at(table, triangle, 3), vec_at(table, triangle, 6)


@inlined
def triangle_distance(
    o: Vec, d: Vec, triangles: Floats, triangle: int, side: int, slack: float, t_max: float
) -> tuple[float, int]:
    """(distance, side): side +1 where the ray comes from outside, -1 from inside, 0 if missed.

    Only hits from `side` count, unless it is 0, and only those before `t_max`; most triangles fail
    one of these before anything is divided. A ray that begins within `slack` of the triangle's
    plane, on either side, meets it at 0.

    Watertight: corners are first projected along the ray, each by itself and always alike. In that
    plane the edge functions change nothing but their sign when an edge is taken the other way
    round, so no ray slips between two neighbours; and as they are small where a corner is near the
    ray, with errors as small, none slips through a corner between the triangles around it.
    S. Woop, C. Benthin, I. Wald, Watertight ray/triangle intersection, JCGT 2, 2013.
    """
    a, b, c = corners(triangles, triangle)
    a, b, c = sub(a, o), sub(b, o), sub(c, o)
    n = cross(sub(b, a), sub(c, a))
    height, approach = dot(n, a), dot(n, d)
    from_side = -1
    if approach < 0.0:
        height, approach, from_side = -height, -approach, 1
    within = slack * (abs(n[0]) + abs(n[1]) + abs(n[2]))
    if side == -from_side or approach == 0.0 or not -within < height < t_max * approach:
        return INF, 0
    (ax, ay), (bx, by), (cx, cy) = projected(a, d), projected(b, d), projected(c, d)
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    if min(u, v, w) < 0.0 < max(u, v, w):
        return INF, 0
    return 0.0 if height < within else height / approach, from_side


@inlined
def middle(triangles: Floats, triangle: int) -> Vec:
    a, b, c = corners(triangles, triangle)
    return scale(1.0 / 3.0, add(a, add(b, c)))


@inlined
def projected(v: Vec, d: Vec) -> tuple[float, float]:
    """Where a line along `d` through `v` meets a plane; not to scale, and maybe mirrored."""
    x, y, z = abs(d[0]), abs(d[1]), abs(d[2])
    if z >= x and z >= y:
        return d[2] * v[0] - d[0] * v[2], d[2] * v[1] - d[1] * v[2]
    if x >= y:
        return d[0] * v[1] - d[1] * v[0], d[0] * v[2] - d[2] * v[0]
    return d[1] * v[2] - d[2] * v[1], d[1] * v[0] - d[0] * v[1]


@inlined
def rises(triangles: Floats, one: int, other: int) -> float:
    """Above 0 where the outside of triangle `one` holds most of `other`: their edge is reflex."""
    a, b, c = corners(triangles, one)
    n, (p, q, r) = cross(sub(b, a), sub(c, a)), corners(triangles, other)
    return dot(n, sub(p, a)) + dot(n, sub(q, a)) + dot(n, sub(r, a))


@inlined
def triangle_normal(triangles: Floats, triangle: int) -> Vec:
    a, b, c = corners(triangles, triangle)
    return normalise(cross(sub(b, a), sub(c, a)))


@called
def smooth_normal(p: Vec, triangles: Floats, triangle: int, normals: Floats, row: int) -> Vec:
    """The normals of the corners, weighted by the barycentric coordinates of `p`."""
    a, b, c = corners(triangles, triangle)
    n = cross(sub(b, a), sub(c, a))
    weight_a = dot(n, cross(sub(b, p), sub(c, p)))
    weight_b = dot(n, cross(sub(c, p), sub(a, p)))
    weight_c = dot(n, cross(sub(a, p), sub(b, p)))
    n_a, n_b, n_c = corners(normals, row)
    mean = add(scale(weight_a, n_a), add(scale(weight_b, n_b), scale(weight_c, n_c)))
    return normalise(mean)
