"""Causes that send rays the wrong way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from harness.diagnosis.hypothesis import Fitted, Hypothesis, Values, percent, plus_minus, says
from harness.diagnosis.meshes import has_mesh, leaking_mesh, mirrored_mesh, stretched_normals
from harness.diagnosis.worlds import World
from harness.expected import Float, lecture_table_angle, refract
from harness.renderers.base import Rays
from harness.truth.law import Interface, Mask, snell
from harness.truth.paths import TruePaths

Bend = Callable[[Interface], tuple[Float, Mask]]


def _with_indices(world: World, change: Callable[[float], float]) -> World:
    """Surroundings of 1 are no medium whose index anybody reads; others are."""
    around = world.scene.media[0].ior
    return _with_media(world, change, 0 if around != 1 else 1)


def _with_media(world: World, change: Callable[[float], float], first: int) -> World:
    media = [
        m.model_copy(update={"ior": max(1e-3, change(m.ior))}) if k >= first else m
        for k, m in enumerate(world.scene.media)
    ]
    return replace(world, scene=world.scene.model_copy(update={"media": tuple(media)}))


# --- the index ------------------------------------------------------------------------------------


def _index(world: World, a: Values) -> World:
    return _with_indices(world, lambda n: n * (1 + a[0]))


def _solids_index(world: World, a: Values) -> World:
    return _with_media(world, lambda n: n * (1 + a[0]), 1)


def _says_index(fit: Fitted, whose: str = "every index") -> str:
    if len(fit.iors) == 1:
        n = fit.iors[0]
        wrong = plus_minus(n * (1 + fit.values[0]), n * fit.errors[0])
        return f"refracts as if n = {wrong} (the scene says {n:.6g})"
    way = "small" if fit.values[0] < 0 else "large"
    return f"refracts as if {whose} were {percent(fit.values[0], fit.errors[0])} too {way}"


def _fixed_index(world: World, a: Values) -> World:
    return _with_indices(world, lambda _: a[0])


def _pulled_index(world: World, a: Values) -> World:
    return _with_indices(world, lambda n: n + a[0] * (1.5 - n))


def _ambient_is_air(world: World, a: Values) -> World:
    def thinner(at: Interface) -> Interface:
        def pulled(n: Float) -> Float:
            return np.asarray(1 + (1 - a[0]) * (n - 1))

        return replace(
            at,
            ior_i=np.where(at.entering, pulled(at.ior_i), at.ior_i),
            ior_t=np.where(at.entering, at.ior_t, pulled(at.ior_t)),
        )

    law = world.law
    return world.with_law(
        bend=lambda at: law.bend(thinner(at)), reflectance=lambda at: law.reflectance(thinner(at))
    )


def _dense_exterior(world: World) -> bool:
    scene = world.scene
    return any(abs(scene.media[solid.exterior].ior - 1) > 1e-3 for solid in scene.solids)


# --- the law of refraction ------------------------------------------------------------------------


def _along(at: Interface, tangential: Float, square: Float) -> tuple[Float, Mask]:
    """The direction with `tangential` times the incident one's part along the surface.

    `square` is that of the part along the normal; where it is negative there is none.
    """
    c = np.einsum("ij,ij->i", at.direction, at.n)[:, None]
    along = at.direction - c * at.n
    bent = tangential[:, None] * along - np.sqrt(np.maximum(square, 0))[:, None] * at.n
    return bent / np.linalg.norm(bent, axis=1, keepdims=True), np.asarray(square <= 0)


def _sin2(at: Interface) -> Float:
    return np.asarray(1 - at.cos_theta_i**2)


def _inverted(at: Interface) -> tuple[Float, Mask]:
    return refract(at.direction, at.n, at.ior_t, at.ior_i)


def _power(world: World, a: Values) -> World:
    def bend(at: Interface) -> tuple[Float, Mask]:
        eta = (at.ior_i / at.ior_t) ** (1 - 2 * a[0])
        return refract(at.direction, at.n, eta, np.ones_like(eta))

    return _bent_by(world, bend)


def _unsquared(world: World, a: Values) -> World:
    def bend(at: Interface) -> tuple[Float, Mask]:
        eta = at.ior_i / at.ior_t
        return _along(at, eta, 1 - eta ** (2 - a[0]) * _sin2(at))

    return _bent_by(world, bend)


def _by_angle(at: Interface, theta_t: Float) -> tuple[Float, Mask]:
    """The direction at `theta_t` from the normal; NaN is total reflection."""
    sin_i = np.sqrt(_sin2(at))
    total = ~(np.abs(theta_t) < np.pi / 2)
    theta = np.where(total, 0.0, theta_t)
    tangential = np.sin(theta) / np.maximum(sin_i, 1e-12)
    bent, _ = _along(at, tangential, np.cos(theta) ** 2)
    return bent, total


def _linear(at: Interface) -> Float:
    return _by_angle(at, np.arccos(at.cos_theta_i) * at.ior_i / at.ior_t)[0]


def _table(at: Interface) -> Float:
    """The lecture's printed table for every surface, whatever the indices."""
    return _by_angle(at, lecture_table_angle(np.arccos(at.cos_theta_i)))[0]


def _degrees(at: Interface) -> tuple[Float, Mask]:
    s = at.ior_i / at.ior_t * np.sin(np.degrees(np.arccos(at.cos_theta_i)))
    return _by_angle(at, np.arcsin(s))


def _reversed_tangent(at: Interface) -> tuple[Float, Mask]:
    eta = at.ior_i / at.ior_t
    return _along(at, -eta, 1 - eta**2 * _sin2(at))


def _no_flip(at: Interface) -> tuple[Float, Mask]:
    """On the way out the normal points away from where the ray comes from."""
    outward = np.where(at.entering[:, None], at.n, -at.n)
    eta = at.ior_i / at.ior_t
    square = 1 - eta**2 * _sin2(at)
    c = -np.einsum("ij,ij->i", at.direction, outward)
    bent = eta[:, None] * at.direction + (
        (eta * c - np.sqrt(np.maximum(square, 0)))[:, None] * outward
    )
    return bent / np.linalg.norm(bent, axis=1, keepdims=True), np.asarray(square <= 0)


def _no_swap(at: Interface) -> tuple[Float, Mask]:
    """On the way out the ratio of indices is that of the way in."""
    ior_i = np.where(at.entering, at.ior_i, at.ior_t)
    ior_t = np.where(at.entering, at.ior_t, at.ior_i)
    return refract(at.direction, at.n, ior_i, ior_t)


def _straight_where(at: Interface, where: Mask) -> tuple[Float, Mask]:
    bent, total = snell(at)
    return np.where(where[:, None], at.direction, bent), np.asarray(total & ~where)


def _swallowed(world: World, a: Values) -> World:
    return world.with_law(bend=lambda at: _straight_where(at, ~at.entering & (at.leg < a[0])))


def _not_unit(world: World, a: Values) -> World:
    def bend(at: Interface) -> tuple[Float, Mask]:
        eta = (at.ior_i / at.ior_t)[:, None]
        d = (1 + a[0]) * at.direction
        c = -np.einsum("ij,ij->i", d, at.n)[:, None]
        square = 1 - eta**2 * (1 - c**2)
        bent = eta * d + (eta * c - np.sqrt(np.maximum(square, 0))) * at.n
        return bent / np.linalg.norm(bent, axis=1, keepdims=True), square[:, 0] <= 0

    return _bent_by(world, bend)


def _leaks(at: Interface) -> tuple[Float, Mask]:
    eta = at.ior_i / at.ior_t
    square = np.abs(1 - eta**2 * _sin2(at))
    return _along(at, eta, square)[0], np.zeros(len(eta), bool)


def _grazes(at: Interface) -> tuple[Float, Mask]:
    return snell(at)[0], np.zeros(len(at.leg), bool)


# --- normals and origins --------------------------------------------------------------------------


def _inside_out(at: Interface) -> tuple[Float, Mask]:
    bent, total = snell(at)
    wrong, wrongly = _inverted(at)
    on = at.on_mesh
    return np.where(on[:, None], wrong, bent), np.where(on, wrongly, total)


def _spawned(world: World, a: Values, fixed: float, growing: float) -> World:
    """Rays start off the surface, along its normal, on the side to which they go.

    By a[0] times (fixed + growing times the largest coordinate).
    """

    def start(at: Interface, d: Float) -> Float:
        side = np.sign(np.einsum("ij,ij->i", d, at.n))[:, None] * at.n
        size = fixed + growing * np.abs(at.point).max(axis=1, keepdims=True)
        return np.asarray(at.point + a[0] * size * side)

    return world.with_law(start=start)


def _ahead(world: World, a: Values) -> World:
    """Rays start a[0] further along their way, which so absorbs less of them."""
    return world.with_law(start=lambda at, d: at.point + a[0] * d)


def _offset(world: World, a: Values) -> World:
    """Where a ray leaves as it came, its sideways shift is a[0] times what it should be."""

    def finish(rays: Rays, paths: TruePaths) -> TruePaths:
        d = rays.directions
        way = paths.origin - rays.origins
        aside = way - np.einsum("ij,ij->i", way, d)[:, None] * d
        same = (np.abs(paths.direction - d).max(axis=1) < 1e-6)[:, None]
        return replace(paths, origin=paths.origin + np.where(same, (a[0] - 1) * aside, 0.0))

    return replace(world, finish=finish)


def _says_offset(fit: Fitted) -> str:
    if fit.near(0):
        return "does not offset the ray: behaves as a pane of zero thickness"
    if fit.near(2):
        return "offsets the ray twice"
    return f"offsets the ray {fit} times as far as it should"


def _bent_by(world: World, bend: Bend) -> World:
    """Refraction by `bend`; where that finds no direction, all light is reflected."""
    law = world.law
    return world.with_law(
        bend=bend, reflectance=lambda at: np.where(bend(at)[1], 1.0, law.reflectance(at))
    )


def _lawless(
    name: str, bend: Bend, text: str, applies: Callable[[World], bool] = lambda _: True
) -> Hypothesis:
    return Hypothesis(name, lambda w, _: _bent_by(w, bend), says(text), applies=applies)


def _lawless_pair(
    name: str, direction: Callable[[Interface], Float], text: str
) -> tuple[Hypothesis, Hypothesis]:
    """A wrong direction where reflection is not total, and one that always exists."""
    return (
        _lawless(
            f"{name}-but-total",
            lambda at: (direction(at), snell(at)[1]),
            f"{text}, but where all light is reflected",
        ),
        _lawless(name, lambda at: (direction(at), np.zeros(len(at.leg), bool)), text),
    )


REFRACTION = (
    Hypothesis(
        "index", _index, _says_index, ((0.0,), (-0.1,), (0.1,), (-0.3,), (0.4,)), "relative error",
        kin="index",
    ),
    _lawless("ratio-inverted", _inverted, "uses the ratio of indices upside down"),
    *_lawless_pair("straight-on", lambda at: at.direction, "does not refract at all"),
    *_lawless_pair("linear", _linear, "takes θt = θi n1/n2, as if all angles were small"),
    *_lawless_pair("table", _table, "takes θt = 2/3 θi, as in the lecture's printed table"),
    _lawless("degrees", _degrees, "gives degrees to a sine that wants radians"),
    _lawless(
        "tangent-reversed", _reversed_tangent,
        "reverses the tangential part: takes the travel direction for the lecture's W",
    ),
    _lawless("no-flip-on-exit", _no_flip, "does not turn the normal round on the way out"),
    _lawless("no-swap-on-exit", _no_swap, "uses the ratio of the way in on the way out, too"),
    _lawless(
        "exit-straight", lambda at: _straight_where(at, ~at.entering),
        "refracts on the way in only: rays leave the glass straight on",
    ),
    _lawless(
        "entry-straight", lambda at: _straight_where(at, at.entering),
        "refracts on the way out only",
    ),
    _lawless("mesh-inside-out", _inside_out, "takes triangle meshes inside out", has_mesh),
    Hypothesis(
        "mesh-leaks", leaking_mesh,
        says("loses rays at the edges of triangles: its meshes are not watertight"),
        tuple((m * 10.0**k,) for k in range(-8, -1) for m in (1, 3)), "barycentric distance",
        continuous=False, applies=has_mesh,
    ),
    _lawless("tir-leaks", _leaks, "lets light out where all of it should be reflected"),
    _lawless(
        "tir-clamped", _grazes, "clamps the root: totally reflected rays graze the surface"
    ),
    Hypothesis(
        "offset", _offset, _says_offset, ((0.0,), (2.0,), (0.9,)), "offset factor",
        applies=lambda world: world.setting.thin,
        prior=lambda setting: -5.0 if setting.thin else 0.0,
    ),
    Hypothesis(
        "ambient-air", _ambient_is_air,
        lambda f: "takes the medium around a solid for air" if f.near(1)
        else f"brings the index around a solid {percent(f.values[0], f.errors[0])} nearer to air's",
        ((1.0,), (0.1,)), "share of air", applies=_dense_exterior,
    ),
    Hypothesis(
        "unsquared", _unsquared,
        lambda f: "does not square the ratio of indices under the root" if f.near(1)
        else "applies the ratio of indices to tangents instead of sines" if f.near(2)
        else f"raises the ratio under the root to {2 - f.values[0]:.4g} instead of squaring it",
        ((1.0,), (0.1,)), "missing power",
    ),
    Hypothesis(
        "directions-not-unit", _not_unit,
        lambda f: f"refracts directions {1 + f.values[0]:.6g} long instead of unit vectors",
        ((0.01,), (-0.01,), (0.2,), (-0.2,)), "excess length",
    ),
    *(stretched_normals(axis) for axis in range(3)),
    *(mirrored_mesh(axis) for axis in range(3)),
    Hypothesis(
        "spawn-normal", lambda w, a: _spawned(w, a, 1, 0),
        lambda f: f"starts rays {f} units off the surface along its normal, not where they hit",
        ((1e-4,), (1e-3,), (1e-2,), (1e-6,), (1e-8,)), "offset", "units",
        kin="spawn",
    ),
    Hypothesis(
        "spawn-normal-relative", lambda w, a: _spawned(w, a, 1, 1),
        lambda f: "starts rays off the surface along its normal, not where they hit, by "
        f"{f} (1 + the largest coordinate)",
        ((1e-4,), (1e-3,)), "relative offset", kin="spawn",
    ),
    Hypothesis(
        # The same of a renderer whose unit of length is a[1] of the scene's.
        "spawn-normal-scaled", lambda w, a: _spawned(w, a, a[1], 1),
        lambda f: "starts rays off the surface along its normal, not where they hit, by "
        f"{f} ({f.values[1]:.2g} + the largest coordinate)",
        tuple((1e-4, 10.0**k) for k in (-6, -4, -2)), "relative offset", kin="spawn",
    ),
    Hypothesis(
        "spawn-ahead", _ahead,
        lambda f: f"starts rays {f} units further along their way, so that less of it absorbs",
        ((1e-4,), (1e-6,), (1e-2,)), "offset", "units",
    ),
    Hypothesis(
        "index-of-solids", _solids_index,
        lambda fit: _says_index(fit, "the index of every solid"), ((0.0,), (-0.1,), (0.1,)),
        "relative error", kin="index",
    ),
    Hypothesis(
        "index-fixed", _fixed_index,
        lambda f: f"refracts as if n = {f}, whatever the scene says", ((1.5,), (1.33,)), "n",
        kin="index",
    ),
    Hypothesis(
        "index-pulled", _pulled_index,
        lambda f: f"mixes {percent(f.values[0], f.errors[0])} of n = 1.5 into every index",
        ((0.1,), (0.9,)), "share", kin="index",
    ),
    Hypothesis(
        "ratio-power", _power,
        lambda f: "raises the ratio of indices to the power "
        + plus_minus(1 - 2 * f.values[0], 2 * f.errors[0]),
        ((0.02,), (0.2,)), "a", kin="index",
    ),
    Hypothesis(
        "near-surfaces-lost", _swallowed,
        lambda f: f"loses surfaces nearer than about {f.values[0]:.0e} units behind another",
        tuple((10.0**k,) for k in range(-8, 1)), "distance", "units", continuous=False,
    ),
)  # fmt: skip
