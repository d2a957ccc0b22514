"""Where single rays go: each along one prescribed way through the scene's interfaces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tracer.arrays import (
    DIELECTRIC,
    EXTERIOR,
    MATERIAL,
    MEDIUM,
    MIRROR,
    NORMALS,
    THIN_SLAB,
    TRANSLUCENT,
    Arrays,
    Floats,
    flatten,
)
from tracer.compiled import compiled, inlined
from tracer.errors import SceneError
from tracer.hit import NOTHING, UNKNOWN, hit_point, nearest_hit, new_stack
from tracer.optics import reflect
from tracer.scene import Scene
from tracer.surface import interface, thin_slab, upright
from tracer.threads import for_bands
from tracer.vector import Vec, scale

BAND = 4096  # rays that a thread takes at a time

# How a ray ended.
HIT = 0  # landed on a surface, its path complete
MISS = 1  # left the scene, or landed before its path was complete
TIR = 2  # was to be transmitted where all light is reflected
CUT = 3  # met another interface after its path was complete, or max_depth
GOING = -1

TRANSMIT = ord("T")


class Paths(NamedTuple):
    """What became of n rays.

    `status` (n,) int8; `surface` (n,) index into scene.surfaces or -1; `point` (n, 3) where the
    ray landed, NaN unless it did; `direction` (n, 3) of its last leg; `weight` (n,) product of the
    Fresnel factors R and 1 - R; `optical_length` (n,) sum of ior times length up to the last
    point; `vertices` (n, len(path) + 2, 3) from the origin on, NaN-padded, and empty unless they
    are asked for.
    """

    status: NDArray[np.int8]
    surface: NDArray[np.int32]
    point: Floats
    direction: Floats
    weight: Floats
    optical_length: Floats
    vertices: Floats


@inlined
def _put(table: Floats, row: int, v: Vec) -> None:
    table[row, 0], table[row, 1], table[row, 2] = v[0], v[1], v[2]


@inlined
def _take(
    scene: Arrays,
    hit: int,
    entering: bool,
    p: Vec,
    n: Vec,
    geometric: Vec,
    d: Vec,
    medium: int,
    beyond: int,
    transmit: bool,
    twice: bool,
) -> tuple[int, Vec, Vec, float, float]:
    """(status, where the ray goes on, direction, weight, optical length) beyond an interface.

    Takes the lobe that the path's letter asks for; `twice` says that the next letter asks for
    transmission too, which a thin slab needs. The status is GOING where the lobe exists.
    """
    wi = scale(-1.0, d)
    material = scene.objects[hit, MATERIAL]
    if material == DIELECTRIC:
        ior_i, ior_t = scene.media[medium, 0], scene.media[beyond, 0]
        if scene.objects[hit, NORMALS] >= 0:
            n = upright(wi, n, geometric, ior_i, ior_t)
        transmits, R, wr, wt = interface(wi, n, ior_i, ior_t)
        if not transmit:
            return GOING, p, wr, R, 0.0
        return (GOING, p, wt, 1.0 - R, 0.0) if transmits else (TIR, p, wr, 1.0, 0.0)
    if material == THIN_SLAB:
        transmits, R, wr, p_t, length, back = thin_slab(scene, hit, p, d, n, entering)
        if not transmit:
            return GOING, p, wr, R, 0.0
        if not transmits:
            return TIR, p, wr, 1.0, 0.0
        outside, inside = scene.objects[hit, EXTERIOR], scene.objects[hit, MEDIUM]
        optical = scene.media[inside, 0] * length - scene.media[outside, 0] * back
        return GOING if twice else CUT, p_t, d, (1.0 - R) * (1.0 - R), optical
    if material == MIRROR and not transmit:
        return GOING, p, reflect(wi, n), 1.0, 0.0
    if material == TRANSLUCENT and transmit:
        return GOING, p, d, 1.0, 0.0
    return MISS, p, d, 1.0, 0.0


@inlined
def _follow_one(
    scene: Arrays,
    o: Vec,
    d: Vec,
    letters: NDArray[np.uint8],
    max_depth: int,
    vertices: Floats,
    stack: Floats,
) -> tuple[int, int, Vec, Vec, float, float]:
    """(status, object or NOTHING, last point, last direction, weight, optical length)."""
    weight, optical, medium = 1.0, 0.0, UNKNOWN
    left, left_face, inward = NOTHING, -1, False
    step, corners = 0, 0
    while True:
        corners = _keep(vertices, corners, o)
        hit, face, t, entering, medium, beyond = nearest_hit(
            scene, o, d, medium, left, left_face, inward, stack
        )
        if hit == NOTHING:
            return MISS, NOTHING, o, d, weight, optical
        p, n, geometric = hit_point(scene, o, t, d, hit, face, entering)
        material = scene.objects[hit, MATERIAL]
        optical += scene.media[medium, 0] * t

        if step == len(letters) or step + 1 >= max_depth:
            _keep(vertices, corners, p)
            landed = step == len(letters) and material not in (DIELECTRIC, THIN_SLAB)
            return HIT if landed else CUT, hit, p, d, weight, optical
        transmit = letters[step] == TRANSMIT
        twice = step + 1 < len(letters) and letters[step + 1] == TRANSMIT
        status, o, d, factor, more = _take(
            scene, hit, entering, p, n, geometric, d, medium, beyond, transmit, twice
        )
        weight *= factor
        optical += more
        if status != GOING:
            _keep(vertices, corners, p)
            return status, hit, p, d, weight, optical
        step += 1
        if transmit and material == THIN_SLAB:
            corners = _keep(vertices, corners, p)
            step += 1
        if transmit and material == DIELECTRIC:
            medium = beyond
        left, left_face, inward = hit, face, entering == transmit


@inlined
def _keep(vertices: Floats, corners: int, p: Vec) -> int:
    """Writes a vertex where vertices are asked for; the number of vertices so far."""
    if corners < len(vertices):
        _put(vertices, corners, p)
    return corners + 1


@compiled
def _follow(
    scene: Arrays,
    solids: int,
    origins: Floats,
    directions: Floats,
    letters: NDArray[np.uint8],
    max_depth: int,
    begin: int,
    end: int,
    found: Paths,
    stack: Floats,
) -> None:
    for i in range(begin, end):
        o = (origins[i, 0], origins[i, 1], origins[i, 2])
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        way = found.vertices[i] if len(found.vertices) else found.vertices[0:0, 0]
        status, hit, p, d, weight, length = _follow_one(scene, o, d, letters, max_depth, way, stack)
        found.status[i], found.weight[i], found.optical_length[i] = status, weight, length
        found.surface[i] = hit - solids if status == HIT else -1
        _put(found.direction, i, d)
        if status == HIT:
            _put(found.point, i, p)


def follow(
    scene: Scene,
    origins: ArrayLike,
    directions: ArrayLike,
    path: str,
    *,
    vertices: bool = False,
    threads: int | None = None,
) -> Paths:
    """Follows rays along `path`, a letter per interface: T transmit, R reflect.

    `origins` and unit `directions` are (n, 3). Rays may start in any medium. After the last letter
    a ray must land on a surface. A thin slab is two interfaces, a mirror takes an R and a
    translucent surface a T. Raises SceneError for a scene or rays that cannot be traced.
    """
    o = np.ascontiguousarray(origins, float).reshape(-1, 3)
    d = np.ascontiguousarray(directions, float).reshape(-1, 3)
    _require_rays(o, d)
    if set(path) - {"T", "R"}:
        raise SceneError(f"a path is made of the letters T and R, not {path!r}")
    n = len(o)
    found = Paths(
        status=np.empty(n, np.int8),
        surface=np.empty(n, np.int32),
        point=np.full((n, 3), np.nan),
        direction=np.empty((n, 3)),
        weight=np.empty(n),
        optical_length=np.empty(n),
        vertices=np.full((n if vertices else 0, len(path) + 2, 3), np.nan),
    )
    arrays = flatten(scene)
    letters = np.frombuffer(path.encode(), np.uint8).copy()

    solids, max_depth = len(scene.solids), scene.transport.max_depth

    def some(begin: int, end: int) -> None:
        _follow(arrays, solids, o, d, letters, max_depth, begin, end, found, new_stack(arrays))

    for_bands(some, n, BAND, threads)
    return found


def _require_rays(origins: Floats, directions: Floats) -> None:
    if origins.shape != directions.shape:
        raise SceneError(f"{len(origins)} origins, but {len(directions)} directions")
    length = np.linalg.norm(directions, axis=1)
    bad = ~(np.abs(length - 1.0) < 1e-9) | ~np.isfinite(origins).all(axis=1)
    if bad.any():
        k = int(np.argmax(bad))
        raise SceneError(
            f"ray {k} needs a finite origin and a unit direction, "
            f"not {origins[k].tolist()} and {directions[k].tolist()}"
        )
