"""The truth of every measured ray: the closed forms of `harness.expected`, chained along a path.

A path has a letter per interface, T for transmitted and R for reflected. Where solids are nested or
apart each interface is one root of one line-solid intersection, and nothing has to be searched or
thresholded. Where they share faces or overlap, roots within rounding are one interface, and where
a solid of higher priority is on both sides there is none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float, reflect
from harness.renderers.base import Rays, Status
from harness.scene.containment import bounds
from harness.scene.resolved import Mesh, Rectangle, ResolvedScene
from harness.truth.chord import Body
from harness.truth.intervals import Chord
from harness.truth.law import PHYSICS, Interface, Law, Leg

# Two roots for one face, each from a few roundings of the scene's coordinates.
MEETING = 64 * np.finfo(float).eps


@dataclass(frozen=True)
class TruePaths:
    """What physics says of m rays after the last interface of their path.

    `status` is HIT (not ended early), MISS (no such interface) or TIR. `origin` and `direction`
    (m, 3) are the ray that leaves the last interface, in `medium` (m,). `weight` is the product of
    the Fresnel factors and `absorbed` (m, 3) the optical depth so far. Per interface k:
    `cos_theta_i` (m, letters), `eta_i_over_t` (m, letters; 1 where it is reflected), `total`
    (m, letters) where all light is reflected, `interface` (m, letters, 3) and `n` (m, letters, 3)
    facing the ray.
    `inside` (solids, m) says which solids the ray is in, and `ahead` (m,) how far away the next
    interface is; infinite where there is none.
    """

    status: NDArray[np.int8]
    origin: Float
    direction: Float
    medium: NDArray[np.intp]
    weight: Float
    absorbed: Float
    cos_theta_i: Float
    eta_i_over_t: Float
    total: NDArray[np.bool_]
    interface: Float
    n: Float
    inside: NDArray[np.bool_]
    ahead: Float


@dataclass(frozen=True)
class Landing:
    """Where true paths meet a plane: `point` (m, 3) is NaN unless `status` is HIT.

    `transmission` (m, 3) is what absorption left of the light, Fresnel factors not included.
    """

    status: NDArray[np.int8]
    point: Float
    transmission: Float


@dataclass(frozen=True)
class Boundary:
    """The next boundary on each of m rays: distance `t` (infinite where there is none), normal `n`
    facing the ray, and the medium `beyond` it. `before` and `behind` it, both (solids, m), the ray
    is in these solids: they differ in more than one where solids share a face.
    """

    t: Float
    n: Float
    beyond: NDArray[np.intp]
    before: NDArray[np.bool_]
    behind: NDArray[np.bool_]


class ClosedForm:
    """A scene prepared for exact tracing. Raises ValueError where it has no closed form.

    `law` is physics, or what a renderer might do in its place.
    """

    def __init__(self, scene: ResolvedScene, law: Law = PHYSICS) -> None:
        self.scene, self.law = scene, law
        self._bodies = [Body(solid) for solid in scene.solids]
        meeting = [np.abs(bounds(solid.shape)).max() for solid in scene.solids if solid.meets]
        self._meeting, self._extent = bool(meeting), float(max(meeting, default=0.0))
        self._meshes = np.array([isinstance(s.shape, Mesh) for s in scene.solids] or [False])
        self._absorbs = any(max(medium.absorption) > 0 for medium in scene.media)

    def follow(self, rays: Rays, path: str) -> TruePaths:
        """Rays from the camera along `path`."""
        scene, bodies, law = self.scene, self._bodies, self.law
        m, count = len(rays.origins), len(path)
        rows = np.arange(m)
        o, d = rays.origins, rays.directions
        status = np.full(m, Status.HIT, np.int8)
        weight, absorbed = np.ones(m), np.zeros((m, 3))
        cos_i, eta = np.full((m, count), np.nan), np.ones((m, count))
        whole = np.zeros((m, count), bool)
        interface, normals = [np.empty((m, 0, 3))], [np.empty((m, 0, 3))]
        ior = np.array([medium.ior for medium in scene.media])
        sigma = np.array([medium.absorption for medium in scene.media])
        chords = [body.chords(o, d) for body in bodies]
        inside = _enclosing(chords, m)
        medium = np.full(m, scene.camera.medium, np.intp)

        for k, letter in enumerate(path):
            at_once = None
            if self._meeting:
                t, n, which, at_once = self._visible_interface(o, d, inside)
            else:
                if k:
                    chords = [body.chords(o, d) for body in bodies]
                t, n, which = _next_interface(chords, inside)
            status[(status == Status.HIT) & ~np.isfinite(t)] = Status.MISS
            live = status == Status.HIT
            t = np.where(live, t, 0.0)
            o = o + t[:, None] * d
            start = normals[-1][:, 0] if k else None
            if self._absorbs:
                absorbed += law.depth(Leg(t, d, sigma[medium], start, letter))
            facing = np.where((np.einsum("ij,ij->i", d, n) > 0)[:, None], -n, n)
            facing = law.normal(facing, self._meshes[which])
            leaving = inside[which, rows] if bodies else live
            if at_once is None:
                beyond = np.where(live, _beyond(bodies, which, leaving), 0)
            else:
                beyond = np.where(live, self._filling(inside ^ at_once), 0)
            at = Interface(o, d, facing, ior[medium], ior[beyond], ~leaving, t, self._meshes[which])
            c, reflectance = at.cos_theta_i, law.reflectance(at)
            cos_i[:, k] = np.where(live, c, np.nan)
            interface.append(np.where(live[:, None], o, np.nan)[:, None])
            normals.append(np.where(live[:, None], facing, np.nan)[:, None])
            whole[:, k] = live & (reflectance >= 1)
            if letter == "R":
                weight *= np.where(live, reflectance, 1.0)
                d = np.where(live[:, None], reflect(d, facing), d)
                o = law.start(at, d)
                continue
            eta[:, k] = ior[medium] / ior[beyond]
            bent, total = law.bend(at)
            status[live & total] = Status.TIR
            live &= ~total
            weight *= np.where(live, law.transmittance(at, reflectance), 1.0)
            d = np.where(live[:, None], bent, d)
            o = law.start(at, d)
            if at_once is None:
                inside[which[live], np.flatnonzero(live)] ^= True
            else:
                inside ^= at_once & live
            medium = np.where(live, beyond, medium)
        return TruePaths(
            status, o, d, medium, weight, absorbed, cos_i, eta, whole,
            np.concatenate(interface, axis=1), np.concatenate(normals, axis=1), inside,
            self._ahead(o, d, inside),
        )  # fmt: skip

    def land(self, paths: TruePaths, plane: Rectangle) -> Landing:
        """Where the rays meet `plane`: MISS beside it, CUT where another interface comes first."""
        start = paths.n[:, -1] if paths.n.shape[1] else None
        return self.meet(
            plane, paths.origin, paths.direction, paths.ahead, paths.medium, paths.absorbed,
            paths.status, start,
        )  # fmt: skip

    def meet(
        self,
        plane: Rectangle,
        o: Float,
        d: Float,
        ahead: Float,
        medium: NDArray[np.intp],
        absorbed: Float,
        status: NDArray[np.int8] | None = None,
        start: Float | None = None,
    ) -> Landing:
        """The same for rays from `o` along `d`, each (m, 3), whose next interface is `ahead`.

        `start` is the normal of the interface that they come from.
        """
        frame = plane.frame
        status = np.full(len(o), Status.HIT, np.int8) if status is None else status.copy()
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((np.array(frame.origin) - o) @ np.array(frame.z)) / (d @ np.array(frame.z))
            point = o + t[:, None] * d
            local = point - np.array(frame.origin)
            x, y = local @ np.array(frame.x), local @ np.array(frame.y)
            on = (t > 0) & (np.abs(x) <= plane.size[0] / 2) & (np.abs(y) <= plane.size[1] / 2)
        status[(status == Status.HIT) & ~on] = Status.MISS
        status[(status == Status.HIT) & (ahead < t)] = Status.CUT
        landed = status == Status.HIT
        point[~landed] = np.nan
        if not self._absorbs:
            return Landing(status, point, np.ones((len(o), 3)))
        sigma = np.array([medium.absorption for medium in self.scene.media])
        leg = Leg(np.where(landed, t, 0.0), d, sigma[medium], start, "")
        depth = absorbed + self.law.depth(leg)
        return Landing(status, point, np.exp(-depth))

    def enclosed(self, rays: Rays) -> NDArray[np.bool_]:
        """(solids, m) which solids the rays start in."""
        chords = [body.chords(rays.origins, rays.directions) for body in self._bodies]
        return _enclosing(chords, len(rays.origins))

    def _ahead(self, o: Float, d: Float, inside: NDArray[np.bool_]) -> Float:
        """(m,) how far away the next boundary is."""
        if self._meeting:
            return self._visible_interface(o, d, inside.copy())[0]
        return _next_interface([body.chords(o, d) for body in self._bodies], inside)[0]

    def next_interface(self, o: Float, d: Float, inside: NDArray[np.bool_]) -> Boundary:
        """The next boundary of rays from `o` along `d` that are in the solids `inside`."""
        rows = np.arange(len(o))
        if self._meeting:
            inside = inside.copy()
            t, n, _, at_once = self._visible_interface(o, d, inside)
            behind = inside ^ at_once
            beyond = self._filling(behind)
        else:
            t, n, which = _next_interface([body.chords(o, d) for body in self._bodies], inside)
            leaving = inside[which, rows] if self._bodies else np.zeros(len(o), bool)
            beyond, behind = _beyond(self._bodies, which, leaving), inside.copy()
            if self._bodies:
                behind[which, rows] ^= True
        facing = np.where((np.einsum("ij,ij->i", d, n) > 0)[:, None], -n, n)
        return Boundary(t, facing, beyond, inside, behind)

    def _visible_interface(
        self, o: Float, d: Float, inside: NDArray[np.bool_]
    ) -> tuple[Float, Float, NDArray[np.intp], NDArray[np.bool_]]:
        """(distance, outward normal, solid, solids (solids, m) that are crossed together there).

        Flips in `inside` whatever boundaries are passed on the way that are hidden.
        """
        rounding = MEETING * self._extent
        way, pending = np.zeros(len(o)), np.ones(len(o), bool)
        normal, solid = np.zeros((len(o), 3)), np.zeros(len(o), np.intp)
        at_once = np.zeros_like(inside)
        for _ in range(2 * len(self._bodies) + 1):
            place = o + np.where(np.isfinite(way), way, 0.0)[:, None] * d
            chords = [body.chords(place, d) for body in self._bodies]
            t, n, which = _next_interface(chords, inside)
            alone = [_next_interface([c], i[None])[0] for c, i in zip(chords, inside, strict=True)]
            with np.errstate(invalid="ignore"):
                crossed = np.isfinite(t) & (np.abs(np.array(alone) - t) <= rounding)
            hidden = self._topmost(inside) == self._topmost(inside ^ crossed)
            way = np.where(pending, way + t, way)
            normal, solid = np.where(pending[:, None], n, normal), np.where(pending, which, solid)
            at_once = np.where(pending, crossed, at_once)
            pending &= hidden & np.isfinite(t)
            inside ^= crossed & pending
            if not pending.any():
                break
        return way, normal, solid, at_once

    def _topmost(self, inside: NDArray[np.bool_]) -> NDArray[np.intp]:
        """The solid that fills where all of `inside` (solids, m) are; -1 outside of all."""
        order = np.argsort([-body.solid.priority for body in self._bodies], kind="stable")
        return np.where(inside.any(axis=0), order[inside[order].argmax(axis=0)], -1)

    def _filling(self, inside: NDArray[np.bool_]) -> NDArray[np.intp]:
        """The medium there."""
        media = np.array([*(body.solid.medium for body in self._bodies), 0])
        return np.asarray(media[self._topmost(inside)])


def _enclosing(chords: list[list[Chord]], m: int) -> NDArray[np.bool_]:
    """(solids, m) which solids lines start in."""
    within = [np.any([(c.t_in < 0) & (c.t_out > 0) for c in parts], axis=0) for parts in chords]
    return np.array(within, bool).reshape(len(chords), m)


def _next_interface(
    chords: list[list[Chord]], inside: NDArray[np.bool_]
) -> tuple[Float, Float, NDArray[np.intp]]:
    """Distance, outward normal and solid of the next boundary; infinite where there is none.

    Which roots of a solid count is known from whether the ray is inside it, so no distance has to
    be thresholded and a slab of any thinness is seen.
    """
    m = inside.shape[1]
    best, normal, which = np.full(m, np.inf), np.zeros((m, 3)), np.zeros(m, np.intp)
    for k, (parts, within) in enumerate(zip(chords, inside, strict=True)):
        for c in parts:
            there = c.t_in < c.t_out
            if len(parts) == 1:  # convex: whoever is inside leaves by its one exit
                leaves = np.where(within, c.t_out, np.inf)
            else:
                leaves = np.where(within & there & (c.t_out > 0), c.t_out, np.inf)
            t = np.where(within, leaves, np.where(there & (c.t_in > 0), c.t_in, np.inf))
            n = np.where(within[:, None], c.n_out, c.n_in)
            if k == 0 and c is parts[0]:  # alone so far; where it is missed, no normal counts
                best, normal = t, n
                continue
            nearer = t < best
            best = np.where(nearer, t, best)
            normal, which = np.where(nearer[:, None], n, normal), np.where(nearer, k, which)
    return best, normal, which


def _beyond(
    bodies: list[Body], which: NDArray[np.intp], leaving: NDArray[np.bool_]
) -> NDArray[np.intp]:
    """The medium on the far side of each boundary."""
    if not bodies:
        return np.zeros(len(which), np.intp)
    inner = np.array([body.solid.medium for body in bodies])
    outer = np.array([body.solid.exterior for body in bodies])
    return np.where(leaving, outer[which], inner[which])
