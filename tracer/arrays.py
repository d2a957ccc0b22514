"""A scene as flat arrays of numbers, the form that the kernels read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracer.apart import OpenShape, alone, apart
from tracer.boxes import LINK, NODE
from tracer.errors import SceneError
from tracer.faces import face_row
from tracer.mesh import Mesh, require_closed
from tracer.patterns import Constant, Pattern, Picture, pattern_row
from tracer.scene import (
    Diffuse,
    DirectionalLight,
    Emissive,
    Material,
    Medium,
    Mirror,
    Phong,
    PointLight,
    Scene,
    Shape,
    Solid,
    SolidShape,
    Surface,
    ThinSlab,
    Translucent,
)
from tracer.shapes import COLUMNS, HOLLOW, Disk, Plane, Quadric, Rectangle, Sphere, bound_row
from tracer.shared import Bound, Surfaces
from tracer.solids import Cell, Compound, compound_rows
from tracer.tree import Tree, grow_tree, lined_up

Floats = NDArray[np.float64]

# Kinds of shapes, and of what they bound.
SPHERE, CELL, COMPOUND, MESH, RECTANGLE, DISK = range(6)
DIELECTRIC, EMISSIVE, DIFFUSE, MIRROR, TRANSLUCENT, THIN_SLAB = range(6)
POINT, DIRECTIONAL = 0.0, 1.0

# Columns of Arrays.objects. A mesh's FIRST is its root node, its COUNT its first triangle.
# MEDIUM and EXTERIOR are what a thin slab is made of and what is around it. In a solid, the k-th of
# them, the medium is k + 1, so that it also says in which solid a ray is. ALONE says whether
# nothing else comes near it (see `tracer.apart`).
SHAPE, FIRST, COUNT, MATERIAL, MEDIUM, EXTERIOR, PATTERN, NORMALS, ALONE = range(9)
AMBIENT = 0  # the medium around all solids


class Arrays(NamedTuple):
    """One row of `objects`, `balls` and `materials` per solid, then per surface.

    Solids are in the order of their rank: where several overlap, the first is there.
    """

    objects: NDArray[np.int64]  # (n, 9)
    balls: Floats  # (n, 4): centre and squared radius of a sphere around it
    materials: Floats  # (n, 9): two colours, thickness, highlight and its exponent
    rows: Floats  # shapes
    media: Floats  # (m, 5): ior, absorption, 1 where it disperses
    solids: int
    apart: bool  # no two solids overlap or touch
    patterns: Floats
    texels: Floats
    lights: Floats  # (l, 7): position, intensity, POINT; or where from, irradiance, DIRECTIONAL
    background: Floats  # (1, 9): a pattern's row
    nodes: NDArray[np.uint8]  # of all meshes' trees
    triangles: Floats
    normals: Floats


class _Flattener:
    """Collects rows while it walks over a scene."""

    def __init__(self) -> None:
        self.objects: list[list[int]] = []
        self.balls: list[list[float]] = []
        self.materials: list[list[float]] = []
        self.rows: list[list[float]] = []
        self.patterns: list[list[float]] = []
        self.texels: list[Floats] = [np.empty((0, 3))]
        self.trees: list[Tree] = []
        self.faces: dict[int, OpenShape] = {}  # by object
        self.nodes = self.triangles = self.normals = self.texel_count = 0
        self.surface_count = 0
        self.medium_count = 1  # in the order of `media_of`

    def solids(self, solids: list[Solid]) -> None:
        """Solids in the order of their rank."""
        surfaces = Surfaces()
        found = [
            [surfaces.find(bound, _reach(solid.shape)) for bound in _bounds(solid.shape)]
            for solid in solids
        ]
        times = Counter(abs(number) for bounds in found for _, number in bounds)
        self.surface_count = surfaces.count
        self.medium_count += len(solids)
        for k, (solid, bounds) in enumerate(zip(solids, found, strict=True)):
            shape = solid.shape
            if isinstance(shape, Mesh):
                require_closed(shape, solid.name)
            if isinstance(shape, Sphere) and times[abs(bounds[0][1])] > 1:
                # As other solids meet that surface, to the last bit.
                shape = Cell((bounds[0][0],), shape.center, shape.radius)
            self._object(shape, DIELECTRIC, (1 + k, AMBIENT), -1, [0.0] * 7, bounds)

    def surface(self, surface: Surface) -> None:
        kind, media, pattern, row = self._material(surface)
        bounds = _bounds(surface.shape)
        numbers = range(self.surface_count + 1, self.surface_count + 1 + len(bounds))
        self.surface_count += len(bounds)
        found = list(zip(bounds, numbers, strict=True))
        self._object(surface.shape, kind, media, pattern, row, found)

    def _material(self, surface: Surface) -> tuple[int, tuple[int, int], int, list[float]]:
        material: Material = surface.material
        none = (0.0, 0.0, 0.0)
        match material:
            case Emissive(pattern):
                flat = isinstance(surface.shape, Rectangle | Disk)
                if not flat and not isinstance(pattern, Constant):
                    raise SceneError(
                        f"{surface.name}: only rectangles and disks can show a pattern, "
                        f"a {type(surface.shape).__name__.lower()} emits a constant radiance"
                    )
                self.patterns.append(self.pattern(pattern))
                return EMISSIVE, (0, 0), len(self.patterns) - 1, [0.0] * 7
            case Diffuse(reflectance):
                return DIFFUSE, (0, 0), -1, [*reflectance, *none, 0.0]
            case Phong(reflectance, specular, exponent):
                return DIFFUSE, (0, 0), -1, [*reflectance, *none, 0.0, specular, exponent]
            case Mirror(reflectance):
                return MIRROR, (0, 0), -1, [*reflectance, *none, 0.0]
            case Translucent(color, filtered, clear):
                passes = [filtered * c + clear for c in color]
                stays = [(1.0 - filtered - clear) * c for c in color]
                return TRANSLUCENT, (0, 0), -1, [*passes, *stays, 0.0]
            case ThinSlab(thickness=thickness):
                if not isinstance(surface.shape, Rectangle | Disk):
                    raise SceneError(f"{surface.name}: a thin slab must be a rectangle or a disk")
                media = self.medium_count, self.medium_count + 1
                self.medium_count += 2
                return THIN_SLAB, media, -1, [*none, *none, thickness]

    def pattern(self, pattern: Pattern) -> list[float]:
        row = pattern_row(pattern, self.texel_count)
        if isinstance(pattern, Picture):
            self.texels.append(pattern.pixels.reshape(-1, 3))
            self.texel_count += len(self.texels[-1])
        return row

    def _object(
        self,
        shape: Shape,
        material: int,
        media: tuple[int, int],
        pattern: int,
        material_row: list[float],
        found: list[tuple[Bound, int]],
    ) -> None:
        """`found` has the shape's bounds and the numbers of the surfaces that they are."""
        first, count, normals = len(self.rows), max(1, len(found)), -1
        ball = [0.0, 0.0, 0.0, np.inf]
        rows = [bound_row(bound, number) for bound, number in found]
        match shape:
            case Sphere(center, radius):
                kind, rows, ball = SPHERE, [[*center, radius]], _ball(center, radius * radius)
            case Cell(_, center, radius):
                kind, ball = CELL, _ball(center, radius * radius)
            case Compound(where, center, radius):
                kind, ball = COMPOUND, _ball(center, radius * radius)
                for row, decisions in zip(rows, compound_rows(where)[1], strict=True):
                    row += [0.0] * (HOLLOW - len(row)) + decisions
            case Rectangle() | Disk() | Plane():
                self.faces[len(self.objects)] = shape
                kind, rows = DISK if isinstance(shape, Disk) else RECTANGLE, [face_row(shape)]
            case Mesh():
                kind, first, count = MESH, self.nodes, self.triangles
                normals = self._tree(grow_tree(shape.vertices, shape.triangles, shape.normals))
                ball = _ball_around(shape.vertices)
        self.rows += rows
        self.objects.append([kind, first, count, material, *media, pattern, normals])
        self.balls.append(ball)
        self.materials.append(material_row)

    def _tree(self, tree: Tree) -> int:
        """Moves a tree behind the ones that are there; returns the row of its first normal."""
        children = tree.links[:, LINK:]
        children += np.where(children >= 0, self.nodes, -8 * self.triangles).astype(np.int32)
        first_normal = self.normals if len(tree.normals) else -1
        self.trees.append(tree)
        self.nodes += len(tree.nodes)
        self.triangles += len(tree.triangles)
        self.normals += len(tree.normals)
        return first_normal


def ranked(solids: tuple[Solid, ...]) -> list[Solid]:
    """By falling priority, and of equal ones the smaller before the larger."""
    return sorted(solids, key=lambda solid: (-solid.priority, _size(solid.shape)))


def _bounds(shape: Shape) -> list[Bound]:
    match shape:
        case Sphere(center, radius):
            return [Quadric(center, (0.0, 0.0, 1.0), radius * radius, 0.0, -1.0)]
        case Cell(bounds):
            return list(bounds)
        case Compound(where):
            return compound_rows(where)[0]
    return []


def _reach(shape: Shape) -> float:
    """How large coordinates of an analytic shape get."""
    match shape:
        case Sphere(center, radius) | Cell(_, center, radius) | Compound(_, center, radius):
            return max(map(abs, center)) + radius
    return 0.0


def _size(shape: SolidShape) -> float:
    """The radius of a sphere around it."""
    if isinstance(shape, Mesh):
        return float(np.linalg.norm(np.ptp(shape.vertices, axis=0))) / 2.0
    return shape.radius


def media_of(scene: Scene) -> list[Medium]:
    """The media of a scene: around everything, in its solids, in and around its thin slabs."""
    found = [scene.ambient, *(solid.medium for solid in ranked(scene.solids))]
    for surface in scene.surfaces:
        if isinstance(surface.material, ThinSlab):
            found += [surface.material.medium, surface.material.exterior]
    return found


def media_table(media: list[Medium], wavelength: float) -> Floats:
    """The one table of `Arrays` that depends on the wavelength."""
    rows = [
        [m.index(wavelength), *m.absorption, float(not isinstance(m.ior, float | int))]
        for m in media
    ]
    return _table(rows, 5)


def _light(light: PointLight | DirectionalLight) -> list[float]:
    if isinstance(light, PointLight):
        return [*light.position, *light.intensity, POINT]
    return [*(-x for x in light.direction), *light.irradiance, DIRECTIONAL]


def _ball(center: Iterable[float], radius_squared: float) -> list[float]:
    """Centre and squared radius, with room for rounding."""
    return [*center, radius_squared * (1.0 + 1e-9)]


def _ball_around(points: Floats) -> list[float]:
    """Centre and squared radius of a ball that holds the points; not the smallest one."""
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    return _ball(center.tolist(), float(((points - center) ** 2).sum(axis=1).max()))


def _table(rows: list[list[float]], columns: int) -> Floats:
    table = np.zeros((len(rows), columns))
    for k, row in enumerate(rows):
        table[k, : len(row)] = row
    return table


_kept: list[tuple[Scene, Arrays]] = []  # the last scene and its arrays


def flatten(scene: Scene) -> Arrays:
    """Raises SceneError for what cannot be traced.

    The last scene's arrays are kept, so that following rays through it in turn grows its trees
    once. The numpy arrays of a scene must not be changed afterwards.
    """
    for known, arrays in _kept:
        if known is scene:
            return arrays
    arrays = _flatten(scene)
    _kept[:] = [(scene, arrays)]
    return arrays


def _flatten(scene: Scene) -> Arrays:
    media = media_of(scene)
    into = _Flattener()
    into.solids(ranked(scene.solids))
    for surface in scene.surfaces:
        into.surface(surface)
    around = scene.background
    background = into.pattern(around if isinstance(around, Picture) else Constant(around))
    trees = into.trees or [_NO_TREE]
    nodes = np.concatenate(
        [tree.nodes for tree in trees], out=lined_up(sum(len(tree.nodes) for tree in trees))
    )
    objects = np.zeros((len(into.objects), 9), np.int64)
    objects[:, :ALONE] = np.array(into.objects).reshape(-1, ALONE)
    solids = [solid.shape for solid in ranked(scene.solids)]
    objects[: len(solids), ALONE] = alone(solids, into.balls, into.faces)
    return Arrays(
        objects=objects,
        balls=_table(into.balls, 4),
        materials=_table(into.materials, 9),
        rows=_table(into.rows, COLUMNS),
        media=media_table(media, scene.wavelength),
        solids=len(solids),
        apart=apart(into.balls, len(solids)),
        patterns=_table(into.patterns, 9),
        texels=np.ascontiguousarray(np.concatenate(into.texels), float),
        lights=_table([_light(light) for light in scene.lights], 7),
        background=_table([background], 9),
        nodes=nodes,
        triangles=np.concatenate([tree.triangles for tree in trees]),
        normals=np.concatenate([tree.normals for tree in trees]),
    )


_NO_TREE = Tree(np.empty((0, NODE), np.uint8), np.empty((0, 9)), np.empty((0, 9)))
