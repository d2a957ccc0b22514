"""What lies inside what: which solid contains a point or another solid, and forbidden overlaps."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from harness.scene import resolved
from harness.scene.regions import depth, ends, profile, region
from harness.scene.tessellation import distance, winding
from harness.scene.vectors import any_frame

Points = NDArray[np.float64]  # (n, 3)

ON_SURFACE = 1e-12  # of the coordinates: some roundings
MOST_WORK = 2_000_000  # points x triangles that one comparison of solids may take


class Relation(enum.Enum):
    """Of solid a to solid b. Solids that only touch are APART."""

    APART = enum.auto()
    INSIDE = enum.auto()
    AROUND = enum.auto()
    OVERLAP = enum.auto()


def signed_distance(
    shape: resolved.SolidShape | resolved.Plane, points: Points
) -> NDArray[np.float64]:
    """Negative inside, positive outside, 0 on the surface; (n,) in scene units.

    A lower bound of the distance outside edges of convex solids and cylinders, exact elsewhere.
    """
    match shape:
        case resolved.Sphere():
            away = np.linalg.norm(points - np.array(shape.center), axis=1)
            return np.asarray(away - shape.radius)
        case resolved.Convex():
            planes = np.array(shape.planes)
            return np.asarray(np.max(points @ planes[:, :3].T - planes[:, 3], axis=1))
        case resolved.Cylinder():
            axis = np.array(shape.frame.z)
            local = points - np.array(shape.frame.origin)
            along = local @ axis
            across = np.linalg.norm(local - along[:, None] * axis, axis=1)
            return np.asarray(np.maximum(across - shape.radius, np.abs(along) - shape.height / 2))
        case resolved.Cone() | resolved.Lens() | resolved.Csg() | resolved.Plane():
            return depth(region(shape), points)
        case resolved.Mesh():
            vertices, triangles = np.array(shape.vertices), np.array(shape.triangles)
            inside = winding(points, vertices, triangles) > 0.5
            return distance(points, vertices, triangles) * np.where(inside, -1.0, 1.0)


def bounds(shape: resolved.SurfaceShape) -> tuple[Points, Points]:
    """Smallest and largest coordinates of a shape, each (3,); of a plane, infinite ones."""
    match shape:
        case resolved.Sphere():
            center = np.array(shape.center)
            return center - shape.radius, center + shape.radius
        case resolved.Convex() | resolved.Mesh():
            vertices = np.array(shape.vertices)
            return vertices.min(axis=0), vertices.max(axis=0)
        case resolved.Rectangle():
            axes = np.array([shape.frame.x, shape.frame.y])
            reach = np.abs(axes.T) @ (np.array(shape.size) / 2)
        case resolved.Disk():
            reach = shape.radius * _across(shape.frame)
        case resolved.Cylinder():
            reach = shape.radius * _across(shape.frame)
            reach = reach + shape.height / 2 * np.abs(np.array(shape.frame.z))
        case resolved.Cone():
            return _around_rings(
                shape.frame, [(0.0, shape.radius), (shape.height, shape.top_radius)]
            )
        case resolved.Plane():
            return np.full(3, -np.inf), np.full(3, np.inf)
        case resolved.Csg():
            return _bounds_of_all(shape)
        case resolved.Lens():
            return _around_rings(shape.frame, [(z, shape.aperture) for z in ends(shape)])
    origin = np.array(shape.frame.origin)
    return origin - reach, origin + reach


def _bounds_of_all(shape: resolved.Csg) -> tuple[Points, Points]:
    lows, highs = zip(*map(bounds, shape.parts), strict=True)
    match shape.operation:
        case "union":
            return np.min(lows, axis=0), np.max(highs, axis=0)
        case "intersection":
            return np.max(lows, axis=0), np.min(highs, axis=0)
        case "difference":
            return lows[0], highs[0]


def _around_rings(
    frame: resolved.Frame, rings: Sequence[tuple[float, float]]
) -> tuple[Points, Points]:
    """The bounds of circles around the frame's z axis, each at a height with a radius."""
    axis, across, origin = np.array(frame.z), _across(frame), np.array(frame.origin)
    low = np.min([origin + height * axis - radius * across for height, radius in rings], axis=0)
    high = np.max([origin + height * axis + radius * across for height, radius in rings], axis=0)
    return low, high


def _across(frame: resolved.Frame) -> Points:
    """How far a unit disk in the frame's x-y plane reaches along each world axis."""
    return np.asarray(np.hypot(np.array(frame.x), np.array(frame.y)))


def relation(a: resolved.SolidShape, b: resolved.SolidShape, tolerance: float) -> Relation:
    """How two solids lie to each other, by points of their surfaces and by crossing edges.

    Exact between spheres, and between spheres and polyhedra; in other pairs a shallow overlap
    between the sample points may go unseen. What is nearer than `tolerance` touches.
    """
    (a_low, a_high), (b_low, b_high) = bounds(a), bounds(b)
    if np.any(a_low > b_high) or np.any(b_low > a_high):
        return Relation.APART
    a_middle, b_middle = (a_low + a_high) / 2, (b_low + b_high) / 2
    of_a = _depths(b, _samples(a, b_middle), tolerance)
    of_b = _depths(a, _samples(b, a_middle), tolerance)
    a_in, a_out = (of_a < -tolerance).any(), (of_a > tolerance).any()
    b_in, b_out = (of_b < -tolerance).any(), (of_b > tolerance).any()
    if (a_in and a_out) or (b_in and b_out) or (a_in and b_in):
        return Relation.OVERLAP
    if not (a_in or a_out or b_in or b_out):
        return Relation.OVERLAP  # the same solid twice
    if _crossing(a, b, tolerance) or _crossing(b, a, tolerance):
        return Relation.OVERLAP
    if a_in:
        return Relation.INSIDE
    return Relation.AROUND if b_in else Relation.APART


def _depths(shape: resolved.SolidShape, points: Points, tolerance: float) -> NDArray[np.float64]:
    """Signed distances, infinite beyond the shape's bounds; of a large mesh, to some points."""
    low, high = bounds(shape)
    near = np.all((points >= low - tolerance) & (points <= high + tolerance), axis=1)
    depths = np.full(len(points), np.inf)
    if isinstance(shape, resolved.Mesh):
        most = max(8, MOST_WORK // len(shape.triangles))
        chosen = np.flatnonzero(near)
        chosen = chosen[:: max(1, -(-len(chosen) // most))]
        depths[near] = 0.0
        depths[chosen] = signed_distance(shape, points[chosen])
    else:
        depths[near] = signed_distance(shape, points[near])
    return depths


def surface_points(shape: resolved.SolidShape) -> Points:
    """Points spread over the surface of a shape; none where nothing is left of a composed one."""
    low, high = bounds(shape)
    return _samples(shape, (low + high) / 2)


# --- sample points --------------------------------------------------------------------------------


def _samples(shape: resolved.SolidShape, towards: Points) -> Points:
    """Points on the surface of `shape`, among them the ones nearest to `towards` on a sphere."""
    match shape:
        case resolved.Sphere():
            center = np.array(shape.center)
            line = towards - center
            size = np.linalg.norm(line)
            # The points nearest to and farthest from another sphere decide alone.
            ends = [line / size, -line / size] if size > 0 else []
            return center + shape.radius * np.array([*ends, *_sphere_directions()])
        case resolved.Convex():
            return _polyhedron_samples(shape)
        case resolved.Cylinder():
            half = shape.height / 2
            levels = [(z, shape.radius) for z in np.linspace(-half, half, 9)]
            return _ring_samples(shape.frame, [*levels, (-half, 0.0), (half, 0.0)])
        case resolved.Cone():
            narrower, share = shape.top_radius - shape.radius, np.linspace(0, 1, 9)
            levels = [(shape.height * s, shape.radius + narrower * s) for s in share]
            return _ring_samples(shape.frame, [*levels, (0.0, 0.0), (shape.height, 0.0)])
        case resolved.Lens():
            return _ring_samples(shape.frame, _lens_rings(shape))
        case resolved.Csg():
            return _composed_samples(shape, towards)
        case resolved.Mesh():
            vertices = np.array(shape.vertices)
            middles = vertices[np.array(shape.triangles)].mean(axis=1)
            return np.concatenate([vertices, middles])


def _composed_samples(shape: resolved.Csg, towards: Points) -> Points:
    """Points of its parts' surfaces that are on its own."""
    low, high = bounds(shape)
    points = np.concatenate(
        [
            _plane_samples(part, (low + high) / 2, float(np.linalg.norm(high - low)) / 2)
            if isinstance(part, resolved.Plane)
            else _samples(part, towards)
            for part in _leaves(shape)
        ]
    )
    within = ON_SURFACE * np.abs(points).max()
    where = region(shape)
    return np.asarray(points[np.abs(depth(where, points)) <= within])


def _leaves(shape: resolved.Csg) -> Iterator[resolved.Part]:
    """The parts of a composed solid that are not composed themselves."""
    for part in shape.parts:
        if isinstance(part, resolved.Csg):
            yield from _leaves(part)
        else:
            yield part


def _plane_samples(plane: resolved.Plane, center: Points, radius: float) -> Points:
    """Points of a plane within a ball, on circles about the foot of its centre."""
    n = np.array(plane.normal)
    foot = center + (plane.offset - center @ n) * n
    frame = any_frame(tuple(foot.tolist()), plane.normal)
    assert frame is not None  # a plane's normal is a unit vector
    return _ring_samples(frame, [(0.0, radius * share) for share in np.linspace(0, 1, 9)])


def _sphere_directions() -> Points:
    """The six axes and 64 evenly spread directions (a Fibonacci lattice)."""
    k = np.arange(64) + 0.5
    z, turn = 1 - k / 32, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z * z)
    spread = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    return np.concatenate([np.eye(3), -np.eye(3), spread])


def _polyhedron_samples(shape: resolved.Convex) -> Points:
    vertices = np.array(shape.vertices)
    along = np.linspace(0, 1, 9)[:, None]
    edges = [
        vertices[i] + along * (vertices[j] - vertices[i])
        for face in shape.faces
        for i, j in zip(face, (*face[1:], face[0]), strict=True)
        if i < j
    ]
    middles = [vertices[list(face)].mean(axis=0, keepdims=True) for face in shape.faces]
    return np.concatenate([vertices, *edges, *middles])


def _ring_samples(frame: resolved.Frame, rings: Sequence[tuple[float, float]]) -> Points:
    """Points on circles around the frame's z axis, each at a height with a radius."""
    turn = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    across = np.outer(np.cos(turn), frame.x) + np.outer(np.sin(turn), frame.y)
    axis = np.array(frame.z)
    circles = [radius * across + height * axis for height, radius in rings]
    return np.asarray(np.concatenate(circles) + frame.origin)


def _lens_rings(shape: resolved.Lens) -> list[tuple[float, float]]:
    heights = shape.aperture * np.sqrt(np.linspace(0, 1, 9))
    faces = [(profile(shape, k, r), r) for k in range(2) for r in heights.tolist()]
    front, back = (profile(shape, k, shape.aperture) for k in range(2))
    return [*faces, *((z, shape.aperture) for z in np.linspace(front, back, 5))]


# --- crossings of surfaces ------------------------------------------------------------------------


def _triangles(shape: resolved.SolidShape) -> tuple[Points, NDArray[np.int64]] | None:
    """A polyhedron's vertices and triangles; None for round shapes."""
    if isinstance(shape, resolved.Mesh):
        return np.array(shape.vertices), np.array(shape.triangles, dtype=np.int64)
    if isinstance(shape, resolved.Convex):
        fans = [(f[0], f[k], f[k + 1]) for f in shape.faces for k in range(1, len(f) - 1)]
        return np.array(shape.vertices), np.array(fans, dtype=np.int64)
    return None


def _crossing(a: resolved.SolidShape, b: resolved.SolidShape, tolerance: float) -> bool:
    """Whether polyhedron b passes through the surface of a sphere, or its surface cuts edges of a.

    False for other pairs.
    """
    if isinstance(a, resolved.Sphere):
        return _cuts_sphere(a, b, tolerance)
    edges = _triangles(a)
    if edges is None:
        return False
    corners = edges[0][edges[1]]
    starts, ends = corners.reshape(-1, 3), corners[:, [1, 2, 0]].reshape(-1, 3)
    if isinstance(b, resolved.Convex):
        outside = (signed_distance(b, edges[0]) > tolerance).any()
        return bool(outside) and _enters(starts, ends, b, tolerance)
    if isinstance(b, resolved.Mesh) and len(starts) * len(b.triangles) <= MOST_WORK:
        return _pierced(starts, ends, np.array(b.vertices)[np.array(b.triangles)], tolerance)
    return False


def _cuts_sphere(a: resolved.Sphere, b: resolved.SolidShape, tolerance: float) -> bool:
    polyhedron = _triangles(b)
    if polyhedron is None:
        return False
    center = np.array([a.center])
    nearest = distance(center, *polyhedron)[0]
    farthest = np.linalg.norm(polyhedron[0] - center, axis=1).max()
    return bool(nearest < a.radius - tolerance and farthest > a.radius + tolerance)


def _enters(starts: Points, ends: Points, solid: resolved.Convex, tolerance: float) -> bool:
    """Whether a part of any segment is deeper than `tolerance` inside a convex solid."""
    planes = np.array(solid.planes)
    before = starts @ planes[:, :3].T - planes[:, 3] + tolerance
    after = ends @ planes[:, :3].T - planes[:, 3] + tolerance
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = before / (before - after)
    first = np.where((before >= 0) & (after < 0), crossing, 0.0).max(axis=1)
    last = np.where((before < 0) & (after >= 0), crossing, 1.0).min(axis=1)
    beside = ((before >= 0) & (after >= 0)).any(axis=1)
    return bool((~beside & (first < last)).any())


def _pierced(starts: Points, ends: Points, triangles: Points, tolerance: float) -> bool:
    """Whether any segment passes from one side of a triangle to the other, inside of it."""
    a, b, c = (triangles[:, k] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    heights = np.sum(normals * a, axis=1)
    before, after = starts @ normals.T - heights, ends @ normals.T - heights
    down = (before > tolerance) & (after < -tolerance)
    up = (before < -tolerance) & (after > tolerance)
    segment, triangle = np.nonzero(down | up)
    share = before[segment, triangle] / (before - after)[segment, triangle]
    hit = starts[segment] + share[:, None] * (ends - starts)[segment]
    inside = np.ones(len(hit), dtype=bool)
    for one, other in ((a, b), (b, c), (c, a)):
        inward = np.cross(normals, other - one)
        inward = inward / np.linalg.norm(inward, axis=1, keepdims=True)
        inside &= np.sum((hit - one[triangle]) * inward[triangle], axis=1) > tolerance
    return bool(inside.any())
