"""Where single rays go: each along one prescribed way through the scene's interfaces."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tracer.arrays import (
    DIELECTRIC,
    EXTERIOR,
    MATERIAL,
    MEDIUM,
    MESH,
    MIRROR,
    NORMALS,
    SHAPE,
    THIN_SLAB,
    TRANSLUCENT,
    Arrays,
    Floats,
    flatten,
    ranked,
)
from tracer.compiled import compiled, inlined, merged
from tracer.errors import SceneError
from tracer.hit import NOTHING, UNKNOWN, hit_point, mesh_hits_ahead, nearest_hit, new_stack
from tracer.optics import reflect
from tracer.scene import Scene
from tracer.shapes import vec_at
from tracer.surface import interface, thin_slab, upright
from tracer.threads import Work, for_bands
from tracer.vector import Vec, dot, scale
from tracer.walk import Lanes, new_lanes

MOST_LEGS = 32  # of a main way that are kept
NO_LEG = -2
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
    point.

    The rest is there only if vertices are asked for, and padded with NaN (`solid` with NO_LEG):
    `vertices` (n, legs + 1, 3) from the origin on. Per leg between two of them, `solid` (n, legs)
    is the index into scene.solids of what it goes through, -1 outside of all; and at the leg's end
    `cos_theta_i`, `cos_theta_t` and `reflectance` (n, legs) are those of the interface, cos_theta_t
    NaN in total internal reflection.
    """

    status: NDArray[np.int8]
    surface: NDArray[np.int32]
    point: Floats
    direction: Floats
    weight: Floats
    optical_length: Floats
    vertices: Floats
    solid: NDArray[np.int32]
    cos_theta_i: Floats
    cos_theta_t: Floats
    reflectance: Floats


OF_LEGS = ("vertices", "solid", "cos_theta_i", "cos_theta_t", "reflectance")


class Beyond(NamedTuple):
    """How a ray goes on from where it met something: from `p` along `d`.

    `status` is GOING if it does. `factor` is what its weight is multiplied by, `optical` the
    optical length that a thin slab adds; the rest is NaN where no interface is.
    """

    status: int
    p: Vec
    d: Vec
    factor: float
    optical: float
    cos_theta_i: float
    cos_theta_t: float
    reflectance: float


@inlined
def _put(table: Floats, row: int, v: Vec) -> None:
    table[row, 0], table[row, 1], table[row, 2] = v[0], v[1], v[2]


@merged
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
) -> Beyond:
    """Takes the lobe that the path's letter asks for, where it exists.

    `twice` says that the next letter asks for transmission too, which a thin slab needs.
    """
    wi = scale(-1.0, d)
    material = scene.objects[hit, MATERIAL]
    if material == DIELECTRIC:
        ior_i, ior_t = scene.media[medium, 0], scene.media[beyond, 0]
        if scene.objects[hit, NORMALS] >= 0:
            n = upright(wi, n, geometric, ior_i, ior_t)
        transmits, R, wr, wt = interface(wi, n, ior_i, ior_t)
        cos_i, cos_t = dot(wi, n), -dot(wt, n) if transmits else np.nan
        if not transmit:
            return Beyond(GOING, p, wr, R, 0.0, cos_i, cos_t, R)
        if not transmits:
            return Beyond(TIR, p, wr, 1.0, 0.0, cos_i, cos_t, R)
        return Beyond(GOING, p, wt, 1.0 - R, 0.0, cos_i, cos_t, R)
    if material == THIN_SLAB:
        transmits, R, wr, p_t, length, back = thin_slab(scene, hit, p, d, n, entering)
        cos_i = dot(wi, n)
        if not transmit:
            return Beyond(GOING, p, wr, R, 0.0, cos_i, np.nan, R)
        if not transmits:
            return Beyond(TIR, p, wr, 1.0, 0.0, cos_i, np.nan, R)
        outside, inside = scene.objects[hit, EXTERIOR], scene.objects[hit, MEDIUM]
        optical = scene.media[inside, 0] * length - scene.media[outside, 0] * back
        passed = (1.0 - R) * (1.0 - R)
        return Beyond(GOING if twice else CUT, p_t, d, passed, optical, cos_i, np.nan, R)
    if material == MIRROR and not transmit:
        return Beyond(GOING, p, reflect(wi, n), 1.0, 0.0, dot(wi, n), np.nan, np.nan)
    going = material == TRANSLUCENT and transmit
    return Beyond(GOING if going else MISS, p, d, 1.0, 0.0, dot(wi, n), np.nan, np.nan)


@merged
def _follow_one(
    scene: Arrays,
    o: Vec,
    d: Vec,
    letters: NDArray[np.uint8],
    main: bool,
    max_depth: int,
    found: Paths,
    row: int,
    known: Floats,
    stack: Floats,
) -> tuple[int, int, Vec, Vec, float, float]:
    """(status, object or NOTHING, last point, last direction, weight, optical length).

    Along `letters`; or if `main` the main way, until something is met that ends it. Its legs are
    written to a row of `found`, as many as there is room for.
    """
    legs = found.solid.shape[1]
    weight, optical, medium = 1.0, 0.0, UNKNOWN
    left, left_face, inward = NOTHING, -1, False
    step, corners = 0, 0
    while True:
        corners = _keep(found.vertices, row, corners, o)
        hit, face, t, entering, medium, beyond = nearest_hit(
            scene, o, d, medium, left, left_face, inward, known, stack
        )
        known = known[:0]
        leg = corners - 1
        if leg < legs:
            found.solid[row, leg] = medium
        if hit == NOTHING:
            return MISS, NOTHING, o, d, weight, optical
        p, n, geometric = hit_point(scene, o, t, d, hit, face, entering)
        material = scene.objects[hit, MATERIAL]
        optical += scene.media[medium, 0] * t

        opaque = material != DIELECTRIC and material != THIN_SLAB
        if main:
            complete = opaque and material != MIRROR and material != TRANSLUCENT
        else:
            complete = step == len(letters)
        if complete or step + 1 >= max_depth:
            _keep(found.vertices, row, corners, p)
            return HIT if complete and opaque else CUT, hit, p, d, weight, optical
        transmit = material != MIRROR if main else letters[step] == TRANSMIT
        twice = main or (step + 1 < len(letters) and letters[step + 1] == TRANSMIT)
        status, o, d, factor, more, cos_theta_i, cos_theta_t, reflectance = _take(
            scene, hit, entering, p, n, geometric, d, medium, beyond, transmit, twice
        )
        if leg < legs:
            found.cos_theta_i[row, leg], found.cos_theta_t[row, leg] = cos_theta_i, cos_theta_t
            found.reflectance[row, leg] = reflectance
        weight *= factor
        optical += more
        if main and status == TIR:
            status, transmit = GOING, False
        if status != GOING:
            _keep(found.vertices, row, corners, p)
            return status, hit, p, d, weight, optical
        step += 1
        if transmit and material == THIN_SLAB:
            corners = _keep(found.vertices, row, corners, p)
            step += 1
        if transmit and material == DIELECTRIC:
            medium = beyond
        left, left_face, inward = hit, face, entering == transmit


@inlined
def _keep(vertices: Floats, row: int, corners: int, p: Vec) -> int:
    """Writes a vertex where vertices are asked for; the number of vertices so far."""
    if corners < vertices.shape[1]:
        for k in range(3):
            vertices[row, corners, k] = p[k]
    return corners + 1


@compiled
def _follow(
    scene: Arrays,
    solids: int,
    origins: Floats,
    directions: Floats,
    letters: NDArray[np.uint8],
    main: bool,
    max_depth: int,
    begin: int,
    end: int,
    found: Paths,
    ahead: Floats,
    lanes: Lanes,
    stack: Floats,
) -> None:
    """`ahead` (end - begin, meshes, 3), `lanes` and `stack` are scratch."""
    mesh_hits_ahead(scene, origins[begin:end], directions[begin:end], ahead, lanes)
    for i in range(begin, end):
        o, d = vec_at(origins, i, 0), vec_at(directions, i, 0)
        row = min(i, len(found.solid) - 1)  # or else all share one that is empty
        status, hit, p, d, weight, length = _follow_one(
            scene, o, d, letters, main, max_depth, found, row, ahead[i - begin], stack
        )
        found.status[i], found.weight[i], found.optical_length[i] = status, weight, length
        found.surface[i] = hit - solids if status == HIT else -1
        _put(found.direction, i, d)
        if status == HIT:
            _put(found.point, i, p)


def follow(
    scene: Scene,
    origins: ArrayLike,
    directions: ArrayLike,
    path: str | None = None,
    *,
    vertices: bool = False,
    threads: int | None = None,
) -> Paths:
    """Follows rays along `path`, a letter per interface: T transmit, R reflect.

    `origins` and unit `directions` are (n, 3). Rays may start in any medium. After the last letter
    a ray must land on a surface. A thin slab is two interfaces, a mirror takes an R and a
    translucent surface a T. Without `path` rays take the main way, through whatever transmits and
    back from whatever does not, until they land or have `max_depth` segments.

    `vertices` asks for all that happens on the way, of the main way for up to MOST_LEGS segments.
    Raises SceneError for a scene or rays that cannot be traced.
    """
    o = np.ascontiguousarray(origins, float).reshape(-1, 3)
    d = np.ascontiguousarray(directions, float).reshape(-1, 3)
    _require_rays(o, d)
    if path is not None and set(path) - {"T", "R"}:
        raise SceneError(f"a path is made of the letters T and R, not {path!r}")
    n, solids, max_depth = len(o), len(scene.solids), scene.transport.max_depth
    legs = min(max_depth, MOST_LEGS) if path is None else len(path) + 1
    found = _empty(n, legs, vertices)
    arrays = flatten(scene)
    letters = np.frombuffer((path or "").encode(), np.uint8).copy()
    main = path is None
    meshes = int((arrays.objects[:, SHAPE] == MESH).sum())

    def worker() -> Work:
        ahead, lanes, stack = np.empty((BAND, meshes, 3)), new_lanes(), new_stack(arrays)

        def some(begin: int, end: int) -> None:
            scratch = ahead[: end - begin], lanes, stack
            _follow(arrays, solids, o, d, letters, main, max_depth, begin, end, found, *scratch)

        return some

    for_bands(worker, n, BAND, threads)
    if not vertices:
        return found._replace(**{name: getattr(found, name)[:0] for name in OF_LEGS})
    places = {id(solid): k for k, solid in enumerate(scene.solids)}
    order = [places[id(solid)] for solid in ranked(scene.solids)]
    names = np.array([-1, *order, NO_LEG], np.int32)  # by medium; NO_LEG is the last
    return found._replace(solid=names[found.solid])


def _empty(n: int, legs: int, log: bool) -> Paths:
    """Room for n rays; without `log`, for the legs of none."""
    rows, legs = (n, legs) if log else (1, 0)
    per_leg = (np.full((rows, legs), np.nan) for _ in range(3))
    return Paths(
        np.empty(n, np.int8),
        np.empty(n, np.int32),
        np.full((n, 3), np.nan),
        np.empty((n, 3)),
        np.empty(n),
        np.empty(n),
        np.full((rows, legs + 1 if log else 0, 3), np.nan),
        np.full((rows, legs), -1, np.int32),
        *per_leg,
    )


@compiled
def _first_bad_ray(origins: Floats, directions: Floats) -> int:
    """The first whose origin is not finite or whose direction is not of unit length; or -1."""
    for i in range(len(origins)):
        o, d = vec_at(origins, i, 0), vec_at(directions, i, 0)
        finite = abs(o[0]) < np.inf and abs(o[1]) < np.inf and abs(o[2]) < np.inf
        if not (finite and abs(math.sqrt(dot(d, d)) - 1.0) < 1e-9):
            return i
    return -1


def _require_rays(origins: Floats, directions: Floats) -> None:
    if origins.shape != directions.shape:
        raise SceneError(f"{len(origins)} origins, but {len(directions)} directions")
    k = _first_bad_ray(origins, directions)
    if k >= 0:
        raise SceneError(
            f"ray {k} needs a finite origin and a unit direction, "
            f"not {origins[k].tolist()} and {directions[k].tolist()}"
        )
