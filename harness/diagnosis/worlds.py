"""A world: the scene as a renderer has it, its rays, its laws, and what it makes of the result.

The right world is a setting without changes. A hypothesis is a function that changes one thing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from harness.diagnosis.evidence import Evidence, Landings, Levels, Setting
from harness.expected import Float
from harness.renderers.base import Rays, Status
from harness.scene.resolved import ResolvedScene
from harness.truth.law import PHYSICS, Law
from harness.truth.paths import ClosedForm, TruePaths


@dataclass(frozen=True)
class World:
    """`finish` changes the rays that leave the glass, `shown` the light that they bring.

    `n2` is the power of (ior at the camera / ior at the light) that scales radiance. `lost` tells
    of which rays (m,) the world cannot say what becomes of them.
    """

    setting: Setting
    scene: ResolvedScene
    rays: Rays
    law: Law = PHYSICS
    finish: Callable[[Rays, TruePaths], TruePaths] = lambda _, paths: paths
    shown: Callable[[Float], Float] = lambda level: level
    n2: float = 0.0
    lost: Callable[[TruePaths], NDArray[np.bool_]] | None = None

    @classmethod
    def right(cls, setting: Setting) -> World:
        """The world as physics and the renderer's own claims have it."""
        return cls(setting, setting.scene, setting.rays, n2=2.0 if setting.n2 else 0.0)

    def with_law(self, **rules: object) -> World:
        """The world with some of its laws exchanged."""
        return replace(self, law=replace(self.law, **rules))  # type: ignore[arg-type]


def misfit(world: World, evidence: Evidence) -> Float:
    """What the world predicts minus what was measured, in tolerances, for each ray (m, figures).

    A ray that lands where it should be dark, or the other way round, is as wrong as one that lands
    a tenth of the plane aside. One of which the world says nothing is off by its tolerance.
    """
    form = ClosedForm(world.scene, world.law)
    with np.errstate(all="ignore"):
        paths = form.follow(world.rays, evidence.setting.path)
        paths = world.finish(world.rays, _turned_back(form, world.rays, paths))
        if isinstance(evidence, Levels):
            found = _of_levels(world, form, paths, evidence)
        else:
            found = _of_landings(form, paths, evidence)
        return found if world.lost is None else np.where(world.lost(paths)[:, None], 1.0, found)


def _turned_back(form: ClosedForm, rays: Rays, paths: TruePaths) -> TruePaths:
    """The paths, and where no light gets in at the first interface that of the reflection.

    No renderer has another ray to follow there, so it shows where this one leads, whatever path
    was asked for.
    """
    turned = (paths.status == Status.TIR) & paths.total[:, :1].any(axis=1)
    if not turned.any():
        return paths
    back = form.follow(rays, "R")
    turned &= back.weight > 0

    each = turned[:, None]
    return replace(
        paths,
        status=np.where(turned, back.status, paths.status),
        origin=np.where(each, back.origin, paths.origin),
        direction=np.where(each, back.direction, paths.direction),
        medium=np.where(turned, back.medium, paths.medium),
        weight=np.where(turned, back.weight, paths.weight),
        absorbed=np.where(each, back.absorbed, paths.absorbed),
        inside=np.where(turned, back.inside, paths.inside),
        ahead=np.where(turned, back.ahead, paths.ahead),
    )


def _of_levels(world: World, form: ClosedForm, paths: TruePaths, evidence: Levels) -> Float:
    landing = form.land(paths, evidence.setting.planes[0])
    ior = np.array([medium.ior for medium in world.scene.media])
    scale = (ior[world.scene.camera.medium] / ior[paths.medium]) ** world.n2
    level = (paths.weight * scale)[:, None] * landing.transmission
    level = world.shown(np.where((landing.status == Status.HIT)[:, None], level, 0.0))
    gap = (level - evidence.level) / evidence.tolerance
    # Where the image holds no number, a prediction is right that has none either.
    nowhere = ~np.isfinite(evidence.level)
    same = np.isnan(level) == nowhere
    wrong = 0.1 / evidence.tolerance
    return np.where(nowhere | np.isnan(level), np.where(same, 0.0, wrong), gap)


def _of_landings(form: ClosedForm, paths: TruePaths, evidence: Landings) -> Float:
    planes = evidence.setting.planes
    on = [form.land(paths, plane) for plane in planes]
    lands = np.all([landing.status == Status.HIT for landing in on], axis=0)
    both = lands & evidence.seen
    gap = (on[0].point - evidence.point) / evidence.point_tolerance[:, None]
    figures = [gap]
    if evidence.direction is not None:
        turn = paths.direction - evidence.direction
        figures.append(turn / evidence.direction_tolerance[:, None])
    aside = 0.1 * max(planes[0].size) / evidence.point_tolerance
    # Where physics lets no light pass, a wrong law of directions does not say whether any does.
    unsaid = lands & ~(paths.weight > 0)
    other = np.where((lands == evidence.seen) | unsaid, 0.0, aside)
    found = np.concatenate(figures, axis=1)
    return np.where(both[:, None], np.nan_to_num(found), other[:, None])
