"""What renderers do to triangles: wrong normals, and gaps between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.diagnosis.edges import nearness
from harness.diagnosis.hypothesis import Fitted, Hypothesis, Values, says
from harness.diagnosis.worlds import World
from harness.expected import Float
from harness.renderers.base import Rays, Status
from harness.scene.resolved import Mesh, Vec3
from harness.truth.law import Mask
from harness.truth.paths import TruePaths


def stretched_normals(axis: int) -> Hypothesis:
    """Normals by a matrix that stretches `axis`, not by its inverse transpose."""

    def world(world: World, a: Values) -> World:
        stretch = np.ones(3)
        stretch[axis] = a[0]

        def normal(n: Float, on_mesh: Mask) -> Float:
            wrong = np.where(on_mesh[:, None], n * stretch, n)
            return np.asarray(wrong / np.linalg.norm(wrong, axis=1, keepdims=True))

        return world.with_law(normal=normal)

    def text(fit: Fitted) -> str:
        scale = np.sqrt(max(fit.values[0], 0))
        return (
            "transforms a mesh's normals as if they were points, by a matrix that stretches "
            f"{'xyz'[axis]} {scale:.4g} times, instead of by its inverse transpose"
        )

    return Hypothesis(
        f"normals-stretched-{'xyz'[axis]}",
        world,
        text,
        ((2.0,), (0.5,), (1.05,)),
        "stretch²",
        applies=has_mesh,
    )


def mirrored_mesh(axis: int) -> Hypothesis:
    """Meshes read as if the axis pointed the other way: inside stays inside, left becomes right."""
    flip = np.where(np.arange(3) == axis, -1.0, 1.0)

    def turned(mesh: Mesh) -> Mesh:
        def flipped(points: tuple[Vec3, ...]) -> tuple[Vec3, ...]:
            return tuple(map(tuple, (np.array(points) * flip).tolist()))

        return mesh.model_copy(
            update={
                "vertices": flipped(mesh.vertices),
                "triangles": tuple((a, c, b) for a, b, c in mesh.triangles),
                "normals": None if mesh.normals is None else flipped(mesh.normals),
            }
        )

    def past(_: Rays, paths: TruePaths) -> TruePaths:
        """Rays that the mesh is not in the way of any more go straight on."""
        missed = (paths.status == Status.MISS) & np.isnan(paths.interface).all(axis=(1, 2))
        return replace(paths, status=np.where(missed, Status.HIT, paths.status).astype(np.int8))

    def world(world: World, _: Values) -> World:
        solids = [
            s.model_copy(update={"shape": turned(s.shape)}) if isinstance(s.shape, Mesh) else s
            for s in world.scene.solids
        ]
        scene = world.scene.model_copy(update={"solids": tuple(solids)})
        return replace(world, scene=scene, finish=past)

    return Hypothesis(
        f"mesh-mirrored-{'xyz'[axis]}", world,
        says(f"reads meshes with the wrong handedness: mirrored in {'xyz'[axis]}"),
        applies=has_mesh,
    )  # fmt: skip


def leaking_mesh(world: World, a: Values) -> World:
    """What becomes of rays within a[0] (barycentric) of a triangle's edge is open."""

    def lost(paths: TruePaths) -> Mask:
        return np.asarray((nearness(world.scene, paths.interface) < a[0]).any(axis=1))

    return replace(world, lost=lost)


def has_mesh(world: World) -> bool:
    """Whether any solid is made of triangles."""
    return any(isinstance(solid.shape, Mesh) for solid in world.scene.solids)
