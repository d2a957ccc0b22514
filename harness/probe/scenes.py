"""The scenes that isolate one path.

A probe admits one path only, because codes of two paths in one pixel would mix: the world is black
but for one plane, recursion is just deep enough for the path, and a position code needs no more
than the lobes its path takes.
"""

from __future__ import annotations

from harness.scene.resolved import (
    Constant,
    Emissive,
    Film,
    Mirror,
    PositionCode,
    Ramp,
    Rectangle,
    ResolvedScene,
    Surface,
    ThinSlab,
)

# Below 1, so that no rounding upwards can clip.
AMPLITUDE = 0.9
AXES = ("u", "v")
BOTH_LOBES = {"reflection": True, "transmission": True}


def code_scene(
    scene: ResolvedScene,
    plane: Rectangle,
    axis: str,
    cells: int,
    path: str,
    total_reflection: bool = False,
) -> ResolvedScene:
    """`scene` with nothing luminous but a position code along `axis` of `plane`.

    Lobes that the path does not take are switched off where a renderer can: the weight does not
    matter, because the code's constant channel divides it out. Total reflection is always followed,
    so paths of `total_reflection` do not need the partial one.
    """
    pattern = PositionCode.model_validate({"axis": axis, "cells": cells, "amplitude": AMPLITUDE})
    lobes = _lobes(path, total_reflection)
    return _isolated(scene, plane, Emissive(pattern=pattern), path, lobes)


def ramp_scene(
    scene: ResolvedScene, plane: Rectangle, path: str, total_reflection: bool = False
) -> ResolvedScene:
    """The same for people, in a pattern that any renderer has: red is the coordinate along u."""
    pattern = Ramp(start=(0.0, 0.0, 1.0), end=(1.0, 0.0, 1.0), axis="u")
    lobes = _lobes(path, total_reflection)
    return _isolated(scene, plane, Emissive(pattern=pattern), path, lobes)


def _lobes(path: str, total_reflection: bool) -> dict[str, bool]:
    return {
        "reflection": "R" in path and not total_reflection,
        "transmission": "T" in path or not path,
    }


def light_scene(scene: ResolvedScene, plane: Rectangle, path: str) -> ResolvedScene:
    """`scene` with nothing luminous but radiance 1 on `plane`: a pixel shows the path's weight.

    Both lobes are followed, so that each carries its own Fresnel factor; the depth cuts the rest.
    """
    pattern = Constant(radiance=(1.0, 1.0, 1.0))
    return _isolated(scene, plane, Emissive(pattern=pattern), path, BOTH_LOBES)


def all_light_scene(scene: ResolvedScene, plane: Rectangle) -> ResolvedScene:
    """The same with all paths that the scene's own transport allows."""
    shown = light_scene(scene, plane, "")
    return shown.model_copy(update={"transport": scene.transport})


def _isolated(
    scene: ResolvedScene,
    plane: Rectangle,
    material: Emissive,
    path: str,
    lobes: dict[str, bool],
) -> ResolvedScene:
    kept = tuple(s for s in scene.surfaces if isinstance(s.material, Mirror | ThinSlab))
    probe_plane = Surface(name="probe-plane", shape=plane, material=material)
    # A probe measures one path whatever its weight, so nothing is cut by weight.
    transport = {"max_depth": len(path) + 1, "min_weight": 0.0, **lobes}
    return scene.model_copy(
        update={
            "surfaces": (*kept, probe_plane),
            "lights": (),
            "background": (0.0, 0.0, 0.0),
            "film": Film(width=scene.film.width, height=scene.film.height),
            "transport": scene.transport.model_copy(update=transport),
        }
    )
