"""A scene as flat arrays of numbers, the form that the kernels read."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracer.errors import SceneError
from tracer.mesh import LEFT, RIGHT, WORDS, Mesh, Tree, grow_tree, require_closed
from tracer.patterns import Constant, Pattern, Picture, pattern_row
from tracer.scene import (
    VACUUM,
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
    Surface,
    ThinSlab,
    Translucent,
)
from tracer.shapes import COLUMNS, Disk, Rectangle, Sphere, bound_row, face_row
from tracer.solids import Cell, Compound, compound_rows

Floats = NDArray[np.float64]

# Kinds of shapes, and of what they bound.
SPHERE, CELL, COMPOUND, MESH, RECTANGLE, DISK = range(6)
DIELECTRIC, EMISSIVE, DIFFUSE, MIRROR, TRANSLUCENT, THIN_SLAB = range(6)
POINT, DIRECTIONAL = 0.0, 1.0

# Columns of Arrays.objects. A mesh's FIRST is its root node, its COUNT its first triangle.
SHAPE, FIRST, COUNT, MATERIAL, MEDIUM, EXTERIOR, PATTERN, NORMALS = range(8)


class Arrays(NamedTuple):
    """One row of `objects`, `balls` and `materials` per solid, then per surface."""

    objects: NDArray[np.int64]  # (n, 8)
    balls: Floats  # (n, 4): centre and squared radius of a sphere around it
    materials: Floats  # (n, 9): two colours, thickness, highlight and its exponent
    rows: Floats  # shapes
    media: Floats  # (m, 5): ior, absorption, 1 where it disperses
    patterns: Floats
    texels: Floats
    lights: Floats  # (l, 7): position, intensity, POINT; or where from, irradiance, DIRECTIONAL
    background: Floats  # (1, 9): a pattern's row
    nodes: NDArray[np.float32]  # of all meshes' trees
    links: NDArray[np.int32]  # the same memory
    triangles: Floats
    normals: Floats


class _Flattener:
    """Collects rows while it walks over a scene."""

    def __init__(self, media: list[Medium]) -> None:
        self.objects: list[list[int]] = []
        self.balls: list[list[float]] = []
        self.materials: list[list[float]] = []
        self.rows: list[list[float]] = []
        self.media = media
        self.patterns: list[list[float]] = []
        self.texels: list[Floats] = [np.empty((0, 3))]
        self.trees: list[Tree] = []
        self.nodes = self.triangles = self.normals = self.texel_count = 0

    def medium(self, medium: Medium) -> int:
        return self.media.index(medium)

    def solid(self, solid: Solid) -> None:
        if isinstance(solid.shape, Mesh):
            require_closed(solid.shape, solid.name)
        media = self.medium(solid.medium), self.medium(solid.exterior)
        self._object(solid.shape, DIELECTRIC, media, -1, [0.0] * 7)

    def surface(self, surface: Surface) -> None:
        kind, media, pattern, row = self._material(surface)
        self._object(surface.shape, kind, media, pattern, row)

    def _material(self, surface: Surface) -> tuple[int, tuple[int, int], int, list[float]]:
        material: Material = surface.material
        none = (0.0, 0.0, 0.0)
        match material:
            case Emissive(pattern):
                flat = isinstance(surface.shape, Rectangle | Disk)
                if not flat and not isinstance(pattern, Constant):
                    raise SceneError(
                        f"{surface.name}: only rectangles and disks can show a pattern, "
                        f"a {type(surface.shape).__name__} emits a constant radiance"
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
            case ThinSlab(medium, thickness, exterior):
                if not isinstance(surface.shape, Rectangle | Disk):
                    raise SceneError(f"{surface.name}: a thin slab must be a rectangle or a disk")
                media = self.medium(medium), self.medium(exterior)
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
    ) -> None:
        first, count, normals = len(self.rows), 1, -1
        ball = [0.0, 0.0, 0.0, np.inf]
        match shape:
            case Sphere(center, radius):
                kind = SPHERE
                self.rows.append([*center, radius])
            case Cell(bounds, center, radius):
                kind, count = CELL, len(bounds)
                ball = [*center, radius * radius * (1.0 + 1e-9)]
                self.rows += [bound_row(bound) for bound in bounds]
            case Compound(where, center, radius):
                rows = compound_rows(where)
                kind, count = COMPOUND, len(rows)
                ball = [*center, radius * radius * (1.0 + 1e-9)]
                self.rows += rows
            case Rectangle() | Disk():
                kind = DISK if isinstance(shape, Disk) else RECTANGLE
                self.rows.append(face_row(shape))
            case Mesh():
                kind, first, count = MESH, self.nodes, self.triangles
                normals = self._tree(grow_tree(shape))
        self.objects.append([kind, first, count, material, *media, pattern, normals])
        self.balls.append(ball)
        self.materials.append(material_row)

    def _tree(self, tree: Tree) -> int:
        """Moves a tree behind the ones that are there; returns the row of its first normal."""
        children = tree.links[:, LEFT : RIGHT + 1]
        children += np.where(children >= 0, self.nodes, -8 * self.triangles).astype(np.int32)
        first_normal = self.normals if len(tree.normals) else -1
        self.trees.append(tree)
        self.nodes += len(tree.nodes)
        self.triangles += len(tree.triangles)
        self.normals += len(tree.normals)
        return first_normal


def media_of(scene: Scene) -> list[Medium]:
    """All media of a scene, each once; the camera's first."""
    found = [scene.around_camera, VACUUM]
    for solid in scene.solids:
        found += [solid.medium, solid.exterior]
    for surface in scene.surfaces:
        if isinstance(surface.material, ThinSlab):
            found += [surface.material.medium, surface.material.exterior]
    return list(dict.fromkeys(found))


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


def _table(rows: list[list[float]], columns: int) -> Floats:
    table = np.zeros((len(rows), columns))
    for k, row in enumerate(rows):
        table[k, : len(row)] = row
    return table


_kept: list[tuple[Scene, Arrays]] = []  # the last scene and its arrays


def flatten(scene: Scene) -> Arrays:
    """Raises SceneError for what cannot be traced. `media[0]` is what the camera stands in.

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
    into = _Flattener(media)
    for solid in scene.solids:
        into.solid(solid)
    for surface in scene.surfaces:
        into.surface(surface)
    around = scene.background
    background = into.pattern(around if isinstance(around, Picture) else Constant(around))
    trees = into.trees or [_NO_TREE]
    nodes = np.concatenate([tree.nodes for tree in trees])
    return Arrays(
        objects=np.array(into.objects, np.int64).reshape(-1, 8),
        balls=_table(into.balls, 4),
        materials=_table(into.materials, 9),
        rows=_table(into.rows, COLUMNS),
        media=media_table(media, scene.wavelength),
        patterns=_table(into.patterns, 9),
        texels=np.ascontiguousarray(np.concatenate(into.texels), float),
        lights=_table([_light(light) for light in scene.lights], 7),
        background=_table([background], 9),
        nodes=nodes,
        links=nodes.view(np.int32),
        triangles=np.concatenate([tree.triangles for tree in trees]),
        normals=np.concatenate([tree.normals for tree in trees]),
    )


_NO_TREE = Tree(np.empty((0, WORDS), np.float32), np.empty((0, 9)), np.empty((0, 9)))
