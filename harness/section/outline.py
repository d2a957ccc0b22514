"""Where a plane cuts a solid: closed outlines in the plane's own coordinates.

Solids of flat faces are cut edge by edge, exactly. All others are contoured: the signed distance
is sampled on a grid, every crossing of a grid line is refined to the surface, and where the
surface has a corner between two crossings, it is put where their tangents meet (as in L. Kobbelt
et al., Feature sensitive surface extraction, SIGGRAPH 2001). That needs nothing of a solid but its
signed distance, so it works for any closed one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.scene.containment import bounds, signed_distance
from harness.scene.resolved import Convex, Disk, Frame, Mesh, Plane, Rectangle, SolidShape
from harness.scene.vectors import any_frame

Points = NDArray[np.float64]
Field = Callable[[Points], NDArray[np.float64]]

CELLS = 160  # of the grid along its longer side
HALVINGS = 30
FAR = 1e6  # scene units
CORNER = 0.9  # cosine between two normals below which there is a corner between them


@dataclass(frozen=True, eq=False)
class Cut:
    """A plane through `origin` along the orthonormal `x` and `y`."""

    origin: Points
    x: Points
    y: Points

    @property
    def n(self) -> Points:
        return np.asarray(np.cross(self.x, self.y))

    def project(self, points: Points) -> Points:
        """World points (n, 3) in the plane's coordinates, (n, 2)."""
        local = points - self.origin
        return np.stack([local @ self.x, local @ self.y], axis=-1)

    def lift(self, points: Points) -> Points:
        """The world points (n, 3) of coordinates (n, 2)."""
        return np.asarray(self.origin + points[:, :1] * self.x + points[:, 1:] * self.y)


@dataclass(frozen=True)
class Window:
    """A part of a plane, in scene units along its axes."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def width(self) -> float:
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        return self.y1 - self.y0


def outline(shape: SolidShape, cut: Cut, window: Window) -> list[Points]:
    """Closed loops (n, 2), without the first point repeated; holes are loops of their own.

    Right within `window`; beyond it a loop may close as it likes.
    """
    if isinstance(shape, Mesh):
        return _slice(np.array(shape.vertices), np.array(shape.triangles), cut)
    if isinstance(shape, Convex):
        fans = [(f[0], f[k], f[k + 1]) for f in shape.faces for k in range(1, len(f) - 1)]
        return _slice(np.array(shape.vertices), np.array(fans), cut)
    return _contour(shape, cut, window)


def along_face(shape: object, cut: Cut) -> Points | None:
    """The segment (2, 2) in which an open face meets the plane; None where it does not.

    Of a face that goes on for ever, as much as is `FAR` to both sides.
    """
    frame = _frame_of(shape)
    if frame is None:
        return None
    x, y, z = (np.array(axis) for axis in (frame.x, frame.y, frame.z))
    line = np.cross(cut.n, z)
    if np.linalg.norm(line) < 1e-9:
        return None
    line = line / np.linalg.norm(line)
    across = np.cross(z, line)  # in the face, towards the plane
    center = np.array(frame.origin)
    foot = center - (center - cut.origin) @ cut.n / (across @ cut.n) * across
    start = np.array([(foot - center) @ x, (foot - center) @ y])
    slope = np.array([line @ x, line @ y])
    if isinstance(shape, Plane):
        reach = FAR * np.array([-1.0, 1.0])
    elif isinstance(shape, Disk):
        half = shape.radius**2 - start @ start + (start @ slope) ** 2
        if half <= 0:
            return None
        reach = -(start @ slope) + np.sqrt(half) * np.array([-1.0, 1.0])
    elif isinstance(shape, Rectangle):
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = (np.array([[-0.5], [0.5]]) * np.array(shape.size) - start) / slope
        ends = np.where(np.isfinite(ends), np.sort(ends, axis=0), np.array([[-np.inf], [np.inf]]))
        beside = (np.abs(slope) < 1e-12) & (np.abs(start) > np.array(shape.size) / 2)
        reach = np.array([ends[0].max(), ends[1].min()])
        if beside.any() or reach[0] >= reach[1]:
            return None
    return cut.project(foot + reach[:, None] * line)


def _frame_of(shape: object) -> Frame | None:
    """The frame of an open face, its z axis towards the front."""
    if isinstance(shape, Plane):
        x, y, z = (shape.offset * c for c in shape.normal)
        return any_frame((x, y, z), shape.normal)
    return shape.frame if isinstance(shape, Rectangle | Disk) else None


# --- flat faces -----------------------------------------------------------------------------------


def _slice(vertices: Points, triangles: NDArray[np.int64], cut: Cut) -> list[Points]:
    """Each edge that passes through the plane has a point on the outline, each triangle a piece.

    A vertex in the plane counts as above it, so there are no special cases.
    """
    height = (vertices - cut.origin) @ cut.n
    above = height >= 0
    crossing = triangles[(above[triangles].sum(axis=1) % 3) > 0]
    edges = np.stack([crossing, np.roll(crossing, -1, axis=1)], axis=2)
    edges = edges[above[edges[..., 0]] != above[edges[..., 1]]].reshape(-1, 2, 2)
    names = np.sort(edges, axis=2)
    unique, index = np.unique(names.reshape(-1, 2), axis=0, return_inverse=True)
    ends = height[unique]
    share = ends[:, :1] / (ends[:, :1] - ends[:, 1:])
    points = vertices[unique[:, 0]] * (1 - share) + vertices[unique[:, 1]] * share
    flat = cut.project(points)
    neighbours: list[list[int]] = [[] for _ in unique]
    for a, b in index.reshape(-1, 2).tolist():
        neighbours[a].append(b)
        neighbours[b].append(a)
    return [flat[loop] for loop in _loops(neighbours)]


def _loops(neighbours: list[list[int]]) -> list[list[int]]:
    """The closed walks of a graph in which every point has two neighbours."""
    left = set(range(len(neighbours)))
    loops = []
    while left:
        at = left.pop()
        loop = [at]
        while ahead := [k for k in neighbours[at] if k in left]:
            at = ahead[0]
            left.discard(at)
            loop.append(at)
        if len(loop) > 2:
            loops.append(loop)
    return loops


# --- anything that has an inside ------------------------------------------------------------------


def _contour(shape: SolidShape, cut: Cut, window: Window) -> list[Points]:
    low, high = _reach(shape, cut, window)
    if np.any(low >= high):
        return []
    step = float((high - low).max()) / CELLS
    low = low - 2 * step
    counts = np.ceil((high + 2 * step - low) / step).astype(int) + 1

    def at(grid: Points) -> NDArray[np.float64]:
        return signed_distance(shape, cut.lift(low + step * grid))

    columns, rows = np.meshgrid(np.arange(counts[0]), np.arange(counts[1]), indexing="ij")
    grid = np.stack([columns.ravel(), rows.ravel()], axis=1).astype(float)
    field = at(grid).reshape(counts)
    field[[0, -1]] = step  # so that what goes on beyond the window closes there
    field[:, [0, -1]] = step

    from skimage.measure import find_contours

    loops = []
    for raw in find_contours(field, 0.0):  # type: ignore[no-untyped-call]
        corner = _sharpened(at, _refined(at, raw[:-1]))
        loops.append(low + step * corner)
    return loops


def _reach(shape: SolidShape, cut: Cut, window: Window) -> tuple[Points, Points]:
    """The part of the plane where the shape's bounding box and the window overlap."""
    a, b = bounds(shape)
    corners = np.array([[(a, b)[i >> k & 1][k] for k in range(3)] for i in range(8)])
    flat = cut.project(corners)
    beyond = 0.1 * max(window.width, window.height)
    low = np.maximum(flat.min(axis=0), np.array([window.x0, window.y0]) - beyond)
    high = np.minimum(flat.max(axis=0), np.array([window.x1, window.y1]) + beyond)
    return low, high


def _refined(at: Field, points: Points) -> Points:
    """Moves crossings of grid lines onto the surface, by halving."""
    a, b = np.floor(points), np.ceil(points)
    inside = at(a) < 0
    for _ in range(HALVINGS):
        middle = (a + b) / 2
        same = (at(middle) < 0) == inside
        a, b = np.where(same[:, None], middle, a), np.where(same[:, None], b, middle)
    return np.asarray((a + b) / 2)


def _sharpened(at: Field, points: Points) -> Points:
    """With a corner inserted wherever the normals of two neighbours differ much."""
    steps = 1e-3 * np.eye(2)
    slope = np.stack([at(points + step) - at(points - step) for step in steps], axis=1)
    n = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-300)
    after, n_after = np.roll(points, -1, axis=0), np.roll(n, -1, axis=0)
    turn = n[:, 0] * n_after[:, 1] - n[:, 1] * n_after[:, 0]
    sharp = (np.sum(n * n_after, axis=1) < CORNER) & (np.abs(turn) > 1e-6)
    a, b = np.sum(n * points, axis=1), np.sum(n_after * after, axis=1)
    meet = a * n_after[:, 1] - b * n[:, 1], b * n[:, 0] - a * n_after[:, 0]
    corner = np.stack(meet, axis=1) / np.where(sharp, turn, 1.0)[:, None]
    sharp &= np.linalg.norm(corner - (points + after) / 2, axis=1) < 3
    where = np.flatnonzero(sharp)
    return np.insert(points, where + 1, corner[where], axis=0)
