"""The truth of a probe: every ray of the camera, where it lands, and how sensitive that is.

Sensitivity turns a renderer's precision into a tolerance for each ray. It is the derivative of the
landing point and direction with respect to the ray that started, taken from the truth itself by
differences, so it knows curvature, grazing incidence and the neighbourhood of total reflection.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from typing import Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float, cross, lengths
from harness.measure.precision import Precision
from harness.renderers.base import Rays, Status
from harness.scene.containment import bounds
from harness.scene.resolved import Rectangle, ResolvedScene
from harness.truth.camera import primary_rays
from harness.truth.law import Interface, Law, fresnel, snell
from harness.truth.paths import ClosedForm, Landing, TruePaths
from harness.truth.tree import AllLight, branches, light_on, natural_weight

# Step of the differences, relative to the scene's extent. Larger than any float32 renderer's own
# error, so that a ray within that error of an edge is recognised as grazing it.
STEP = 1e-5
# Roundings in sequence, each of half an epsilon: of a point in one intersection (distance, product,
# sum), relative to the coordinates involved, and of a direction in one refraction (normal, cosine,
# its square, difference, root, two products, sum), relative to 1.
POINT_ROUNDINGS = 3
ROUNDINGS = 8


@dataclass(frozen=True)
class Condition:
    """How much a result changes with what it is made from, per ray (m,).

    Per unit by which the ray's origin moves, per radian by which it tilts, and per relative change
    of all indices of refraction.
    """

    by_origin: Float
    by_direction: Float
    by_index: Float

    def bound(self, own: float, steps: Float, extent: float, precision: Precision) -> Float:
        """Bound on the error of a result that itself is rounded by `own` roundings.

        `steps` (m,) is how many times the start's rounding all roundings along the way amount to.
        """
        unit = precision.arithmetic / 2
        start = POINT_ROUNDINGS * extent * self.by_origin + ROUNDINGS * self.by_direction
        return np.asarray(unit * (own + steps * start) + precision.data / 2 * self.by_index)


@dataclass(frozen=True, eq=False)
class ProbeTruth:
    """Truth of all m rays of one probe.

    `grazing` (m,) marks rays that change their fate when shifted by `STEP`: they say nothing.
    `extent` is the largest coordinate that arithmetic along the rays has to carry.
    """

    scene: ResolvedScene
    rays: Rays
    path: str
    planes: tuple[Rectangle, ...]
    paths: TruePaths
    landings: tuple[Landing, ...]
    grazing: NDArray[np.bool_]
    extent: float
    point: Condition
    direction: Condition
    weight: Condition

    @property
    def ambiguous(self) -> NDArray[np.bool_]:
        """(m,) rays of which another part lands on a plane too, by a path no longer than this one.

        Only a renderer that cannot switch lobes off shows it, and then both codes mix: near the rim
        of a ball, for one, what is reflected goes on to the backdrop behind it.
        """
        return self._elsewhere[0]

    @property
    def ambiguous_when_total(self) -> NDArray[np.bool_]:
        """(m,) the same where a renderer reflects nothing but what is totally reflected."""
        return self._elsewhere[1]

    @cached_property
    def total(self) -> NDArray[np.bool_]:
        """(m,) rays that are totally reflected wherever their path says R."""
        reflects = np.array([letter == "R" for letter in self.path])
        arrives = self.paths.status == Status.HIT
        return np.asarray(arrives & self.paths.total[:, reflects].all(axis=1))

    @cached_property
    def _elsewhere(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(m,) rays of which another path lands on a plane, and that by total reflections alone."""
        exact, m = ClosedForm(self.scene), len(self.grazing)
        by_any, by_total = np.zeros(m, bool), np.zeros(m, bool)
        for branch in branches(exact, self.rays, len(self.path) + 1):
            if branch.path != self.path:
                way = (branch.origin, branch.direction, branch.ahead)
                for plane in self.planes:
                    landing = exact.meet(plane, *way, branch.medium, branch.absorbed)
                    landed = landing.status == Status.HIT
                    by_any[branch.rows] |= landed
                    by_total[branch.rows] |= landed & branch.certain
        return by_any, by_total

    def conditions(self, used: NDArray[np.bool_]) -> dict[str, float | int | str]:
        """Condition numbers of the rays `used`, at worst: by a relative change of all indices.

        Of the landing point in units, of the direction in radians, of the path's light.
        """
        rates = {"point": self.point, "direction": self.direction, "level": self.weight}
        return {
            f"condition_{what}": float(np.max(rate.by_index[used], initial=0.0))
            for what, rate in rates.items()
        }

    @cached_property
    def natural_level(self) -> Float:
        """(m, 3) what the path leaves of radiance 1 in nature, where light is polarised."""
        weight = natural_weight(ClosedForm(self.scene), self.rays, self.path)
        return np.asarray(weight[:, None] * self.landings[0].transmission)

    @cached_property
    def all_light(self) -> AllLight:
        """What all paths together bring of the first plane's light, to the scene's depth."""
        return self.all_light_of(self.rays, n2=False)

    @cached_property
    def all_light_n2(self) -> AllLight:
        """The same where radiance scales with the square of the index."""
        plain = self.all_light
        return self.all_light_of(self.rays, n2=True) if plain.abroad else plain

    def all_light_of(self, rays: Rays, n2: bool, natural: bool = True) -> AllLight:
        """The same of other rays of the camera."""
        limits = self.scene.transport
        return light_on(
            ClosedForm(self.scene),
            rays,
            self.planes[0],
            limits.max_depth,
            limits.min_weight,
            n2,
            natural,
        )

    @cached_property
    def theta_i(self) -> Float:
        """Angle of incidence at the first interface, radians; NaN where there is none."""
        return np.asarray(np.arccos(self.paths.cos_theta_i[:, 0]))

    @property
    def central_row(self) -> NDArray[np.bool_]:
        """The rays of the middle row of the image, which curves are drawn from."""
        film = self.scene.film
        rows = np.arange(film.height * film.width) // film.width
        return np.asarray(rows == film.height // 2)

    @cached_property
    def level(self) -> Float:
        """(m, 3) what the path leaves of radiance 1: Fresnel factors times absorption."""
        return np.asarray(self.paths.weight[:, None] * self.landings[0].transmission)

    @cached_property
    def _steps(self) -> Float:
        """(m,) the roundings at the start and after each interface, all as if made at the start.

        An angle grows by A = (n_i cos_i) / (n_t cos_t) in the plane of incidence and by n_i / n_t
        across it (Snell's law, differentiated). One made after an interface has missed that
        growth, so seen from the start it counts 1 / A times.
        """
        eta, cos_i = self.paths.eta_i_over_t, self.paths.cos_theta_i
        with np.errstate(invalid="ignore"):
            cos_t = np.sqrt(1 - eta**2 * (1 - cos_i**2))
            shrinkage = np.fmax(cos_t / cos_i, 1.0) / eta
        shrinkage = np.where(np.isfinite(shrinkage), shrinkage, 1.0)
        return np.asarray(1 + np.cumprod(shrinkage, axis=1).sum(axis=1))

    def point_tolerance(self, precision: Precision) -> Float:
        """Bound on the landing point's error, units."""
        own = POINT_ROUNDINGS * self.extent
        return self.point.bound(own, self._steps, self.extent, precision)

    def direction_tolerance(self, precision: Precision) -> Float:
        """Bound on the direction's error, rad."""
        return self.direction.bound(ROUNDINGS, self._steps, self.extent, precision)

    def level_tolerance(self, precision: Precision) -> Float:
        """Bound on the level's error."""
        return self.weight.bound(ROUNDINGS, self._steps, self.extent, precision)


Asked = ParamSpec("Asked")
Made = TypeVar("Made")


def kept(
    make: Callable[Concatenate[ProbeTruth, Asked], Made],
) -> Callable[Concatenate[ProbeTruth, Asked], Made]:
    """What `make` makes of a truth is kept for as long as that is: all renderers ask for the same.

    Nobody may change what is returned.
    """
    known: WeakKeyDictionary[ProbeTruth, dict[object, Made]] = WeakKeyDictionary()

    @wraps(make)
    def once(truth: ProbeTruth, /, *args: Asked.args, **named: Asked.kwargs) -> Made:
        of_this = known.setdefault(truth, {})
        key = (args, *sorted(named.items()))
        if key not in of_this:
            of_this[key] = make(truth, *args, **named)
        return of_this[key]

    return once


def probe_truth(scene: ResolvedScene, path: str, planes: tuple[Rectangle, ...]) -> ProbeTruth:
    """Raises ValueError where the scene has no closed form."""
    rays = primary_rays(scene)
    exact = ClosedForm(scene)
    paths = exact.follow(rays, path)
    landings = tuple(exact.land(paths, plane) for plane in planes)
    extent = _extent(scene, rays, landings)
    level = paths.weight[:, None] * landings[0].transmission
    grazing = np.zeros(len(rays.origins), bool)
    none = np.zeros(len(grazing))
    # Rates of change by cause, for point, direction and level. Shifts across the ray and tilts are
    # components, so they add up as lengths; roundings of several indices, in full.
    rates = {cause: [none.copy() for _ in range(3)] for cause in ("origin", "direction", "index")}
    trials = [(cause, exact, moved, step) for cause, moved, step in _shifted(rays, STEP * extent)]
    trials += [("index", ClosedForm(denser), rays, step) for denser, step in _denser(scene)]
    if any(solid.meets for solid in scene.solids):
        trials.append(("index", ClosedForm(scene, _stepped_ratios(scene)), rays, STEP))
    for cause, form, shifted, step in trials:
        other = form.follow(shifted, path)
        grazing |= _fate_differs(paths, other)
        others = [form.land(other, plane) for plane in planes]
        worst = none
        for mine, theirs in zip(landings, others, strict=True):
            grazing |= mine.status != theirs.status
            worst = np.fmax(worst, _rate(mine.point, theirs.point, step))
        other_level = other.weight[:, None] * others[0].transmission
        changes = (
            worst,
            _rate(paths.direction, other.direction, step),
            _rate(level, other_level, step),
        )
        add = np.add if cause == "index" else np.hypot
        rates[cause] = [add(a, b) for a, b in zip(rates[cause], changes, strict=True)]
    point, direction, weight = (
        Condition(*(rates[cause][k] for cause in ("origin", "direction", "index")))
        for k in range(3)
    )
    return ProbeTruth(
        scene, rays, path, planes, paths, landings, grazing, extent, point, direction, weight
    )


def _denser(scene: ResolvedScene) -> Iterator[tuple[ResolvedScene, float]]:
    """Each index but that of the surroundings larger by `STEP`, and the step to divide by.

    Where one medium lies within another, renderers may store the ratio of the two, which is rounded
    once more; hence half the step.
    """
    for k, medium in enumerate(scene.media):
        mine = [solid for solid in scene.solids if solid.medium == k]
        if k and mine:
            denser = medium.model_copy(update={"ior": medium.ior * (1 + STEP)})
            media = (*scene.media[:k], denser, *scene.media[k + 1 :])
            nested = any(solid.exterior for solid in mine) or k in {
                s.exterior for s in scene.solids
            }
            yield scene.model_copy(update={"media": media}), STEP / 2 if nested else STEP
    # The surroundings' own, where they are not 1 and so are rounded too.
    if scene.media[0].ior != 1.0:
        outer = scene.media[0].model_copy(update={"ior": scene.media[0].ior * (1 + STEP)})
        yield scene.model_copy(update={"media": (outer, *scene.media[1:])}), STEP


def _stepped_ratios(scene: ResolvedScene) -> Law:
    """Every ratio of two solids' indices, which may be stored and so be rounded, off by `STEP`.

    Behind parallel faces the indices themselves cancel, but their ratios do not.
    """
    outer = scene.media[0].ior

    def stepped(at: Interface) -> Interface:
        between = (at.ior_i != outer) & (at.ior_t != outer)
        return replace(at, ior_t=at.ior_t * np.where(between, 1 + STEP, 1.0))

    return Law(bend=lambda at: snell(stepped(at)), reflectance=lambda at: fresnel(stepped(at)))


def _extent(scene: ResolvedScene, rays: Rays, landings: tuple[Landing, ...]) -> float:
    """The largest coordinate that arithmetic along the rays has to carry.

    The solids' own count too: a triangle's point of intersection is as exact as its corners allow.
    """
    points = [landing.point[landing.status == Status.HIT] for landing in landings]
    values = [np.abs(rays.origins).max(), *(np.abs(p).max() for p in points if p.size)]
    values += [np.abs(bounds(solid.shape)).max() for solid in scene.solids]
    return float(max(values))


def _shifted(rays: Rays, step: float) -> list[tuple[str, Rays, float]]:
    """The rays moved sideways by `step` and tilted by `STEP`, along two perpendicular axes.

    They are tilted the other way, so that an edge is found on whichever side of the ray it is.
    """
    d = rays.directions
    helper = np.where((np.abs(d[:, :1]) < 0.6), [[1.0, 0, 0]], [[0, 1.0, 0]])
    e1 = cross(d, helper)
    e1 /= lengths(e1)[:, None]
    e2 = cross(d, e1)
    out = []
    for e in (e1, e2):
        out.append(("origin", Rays(rays.origins + step * e, d), step))
        tilted = d - STEP * e
        tilted /= lengths(tilted)[:, None]
        out.append(("direction", Rays(rays.origins, tilted), STEP))
    return out


def _fate_differs(a: TruePaths, b: TruePaths) -> NDArray[np.bool_]:
    """Another status, or another face: a normal that turned by more than the step explains."""
    with np.errstate(invalid="ignore"):
        turn = 1 - np.einsum("ijk,ijk->ij", a.n, b.n)
    return np.asarray((a.status != b.status) | np.any(turn > 1e-4, axis=1))


def _rate(a: Float, b: Float, step: float) -> Float:
    """Length of (b - a) / step; 0 where either is missing."""
    change = lengths(b - a) / step
    return np.asarray(np.where(np.isfinite(change), change, 0.0))
