"""The truth of a probe: every ray of the camera, where it lands, and how sensitive that is.

Sensitivity turns a renderer's precision into a tolerance for each ray. It is the derivative of the
landing point and direction with respect to the ray that started, taken from the truth itself by
differences, so it knows curvature, grazing incidence and the neighbourhood of total reflection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.camera import primary_rays
from harness.expected import Float
from harness.renderers.base import Rays, Status
from harness.scene.resolved import Rectangle, ResolvedScene
from harness.truth import ClosedForm, Landing, TruePaths

# Step of the differences, relative to the scene's extent. Larger than any float32 renderer's own
# error, so that a ray within that error of an edge is recognised as grazing it.
STEP = 1e-5
# Roundings in sequence in one intersection and one refraction: root, point, normal, cosine,
# square root, two products and a sum. The same 8 as in the bound 8 eps on a refracted direction.
ROUNDINGS = 8


@dataclass(frozen=True)
class ProbeTruth:
    """Truth of all m rays of one probe.

    `grazing` (m,) marks rays that change their fate when shifted by `STEP`: they say nothing.
    Condition numbers: `point_by_origin` is the largest shift of the landing point per unit shift
    of the origin, `point_by_direction` (units per rad), and so on.
    """

    scene: ResolvedScene
    rays: Rays
    path: str
    planes: tuple[Rectangle, ...]
    paths: TruePaths
    landings: tuple[Landing, ...]
    grazing: NDArray[np.bool_]
    point_by_origin: Float
    point_by_direction: Float
    direction_by_origin: Float
    direction_by_direction: Float
    level_by_origin: Float
    level_by_direction: Float
    extent: float

    @property
    def theta_i(self) -> Float:
        """Angle of incidence at the first interface, radians; NaN where there is none."""
        return np.asarray(np.arccos(self.paths.cos_theta_i[:, 0]))

    @property
    def central_row(self) -> NDArray[np.bool_]:
        """The rays of the middle row of the image, which curves are drawn from."""
        film = self.scene.film
        rows = np.arange(film.height * film.width) // film.width
        return np.asarray(rows == film.height // 2)

    @property
    def level(self) -> Float:
        """(m, 3) what the path leaves of radiance 1: Fresnel factors times absorption."""
        return np.asarray(self.paths.weight[:, None] * self.landings[0].transmission)

    def level_tolerance(self, epsilon: float) -> Float:
        """Bound on the level's error for arithmetic of relative precision epsilon."""
        steps = ROUNDINGS * (len(self.path) + 1) * epsilon
        return steps * (self.extent * self.level_by_origin + self.level_by_direction + 1)

    def point_tolerance(self, epsilon: float) -> Float:
        """Bound on the landing point's error, units; `epsilon` is the relative precision."""
        steps = ROUNDINGS * (len(self.path) + 1) * epsilon
        return steps * (self.extent * self.point_by_origin + self.point_by_direction + self.extent)

    def direction_tolerance(self, epsilon: float) -> Float:
        """Bound on the direction's error, rad."""
        steps = ROUNDINGS * (len(self.path) + 1) * epsilon
        return steps * (self.extent * self.direction_by_origin + self.direction_by_direction + 1)


def probe_truth(scene: ResolvedScene, path: str, planes: tuple[Rectangle, ...]) -> ProbeTruth:
    """Raises ValueError where the scene has no closed form."""
    rays = primary_rays(scene)
    exact = ClosedForm(scene)
    paths = exact.follow(rays, path)
    landings = tuple(exact.land(paths, plane) for plane in planes)
    extent = _extent(rays, landings)
    grazing = np.zeros(len(rays.origins), bool)
    squares = {key: np.zeros(len(grazing)) for key in ("po", "pd", "do", "dd", "lo", "ld")}
    for kind, shifted in _shifted(rays, STEP * extent):
        other = exact.follow(shifted, path)
        other_landings = [exact.land(other, plane) for plane in planes]
        grazing |= _fate_differs(paths, other)
        step = STEP * extent if kind == "o" else STEP
        squares["d" + kind] += _rate(paths.direction, other.direction, step)
        level = paths.weight[:, None] * landings[0].transmission
        other_level = other.weight[:, None] * other_landings[0].transmission
        squares["l" + kind] += _rate(level, other_level, step)
        worst = np.zeros(len(grazing))
        for mine, theirs in zip(landings, other_landings, strict=True):
            grazing |= mine.status != theirs.status
            worst = np.fmax(worst, _rate(mine.point, theirs.point, step))
        squares["p" + kind] += worst
    roots = {key: np.sqrt(value) for key, value in squares.items()}
    return ProbeTruth(
        scene, rays, path, planes, paths, landings, grazing,
        roots["po"], roots["pd"], roots["do"], roots["dd"], roots["lo"], roots["ld"], extent,
    )  # fmt: skip


def _extent(rays: Rays, landings: tuple[Landing, ...]) -> float:
    """The largest coordinate that arithmetic along the rays has to carry."""
    points = [landing.point[landing.status == Status.HIT] for landing in landings]
    values = [np.abs(rays.origins).max(), *(np.abs(p).max() for p in points if p.size)]
    return float(max(1.0, *values))


def _shifted(rays: Rays, step: float) -> list[tuple[str, Rays]]:
    """The rays shifted sideways ("o") and tilted ("d"), each along two perpendicular axes."""
    d = rays.directions
    helper = np.where((np.abs(d[:, :1]) < 0.6), [[1.0, 0, 0]], [[0, 1.0, 0]])
    e1 = np.cross(d, helper)
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    e2 = np.cross(d, e1)
    out = []
    for e in (e1, e2):
        out.append(("o", Rays(rays.origins + step * e, d)))
        tilted = d + STEP * e
        tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
        out.append(("d", Rays(rays.origins, tilted)))
    return out


def _fate_differs(a: TruePaths, b: TruePaths) -> NDArray[np.bool_]:
    """Another status, or another face: a normal that turned by more than the step explains."""
    with np.errstate(invalid="ignore"):
        turn = 1 - np.einsum("ijk,ijk->ij", a.n, b.n)
    return np.asarray((a.status != b.status) | np.any(turn > 1e-4, axis=1))


def _rate(a: Float, b: Float, step: float) -> Float:
    """Squared length of (b - a) / step; 0 where either is missing."""
    change = np.linalg.norm(b - a, axis=1) / step
    return np.asarray(np.where(np.isfinite(change), change, 0.0) ** 2)
