"""Causes that let media absorb too much or too little."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from harness.diagnosis.hypothesis import Fitted, Hypothesis, Values, says
from harness.diagnosis.worlds import World
from harness.expected import Float
from harness.truth.law import Leg


def _absorbs(world: World) -> bool:
    return any(max(medium.absorption) > 0 for medium in world.scene.media)


def _absorbing(world: World, depth: Callable[[Leg], Float]) -> World:
    return world.with_law(depth=depth)


def _absorption_factor(world: World, a: Values) -> World:
    return _absorbing(world, lambda leg: a[0] * leg.length[:, None] * leg.sigma)


def _says_absorption(fit: Fitted) -> str:
    if fit.near(0):
        return "does not absorb light in media"
    special = {
        np.log(10): " (decadic instead of Napierian)",
        1 / np.log(10): " (Napierian taken for decadic)",
        **{10.0**k: " (another unit of length)" for k in (-3, -2, -1, 1, 2, 3)},
    }
    why = next((text for f, text in special.items() if abs(fit.values[0] / f - 1) < 0.01), "")
    return f"absorbs as if the coefficients were {fit} times as large{why}"


def _complement(world: World, a: Values) -> World:
    def depth(leg: Leg) -> Float:
        with np.errstate(divide="ignore"):
            wrong = -np.log(-np.expm1(-leg.sigma))
        mixed = leg.sigma + a[0] * (np.minimum(wrong, 1e3) - leg.sigma)
        return leg.length[:, None] * np.where(leg.sigma > 0, mixed, 0.0)

    return _absorbing(world, depth)


def _by_depth(world: World, a: Values, along_camera: bool) -> World:
    forward = np.array(world.scene.camera.forward)

    def depth(leg: Leg) -> Float:
        towards = np.broadcast_to(forward, leg.direction.shape) if along_camera else leg.n
        if towards is None:
            return leg.length[:, None] * leg.sigma
        cos = np.abs(np.einsum("ij,ij->i", leg.direction, towards))
        return np.asarray((leg.length * cos ** a[0])[:, None] * leg.sigma)

    return _absorbing(world, depth)


def _spared_legs(leg: Leg) -> Float:
    return np.asarray(leg.length[:, None] * leg.sigma * (leg.ends_in != "R"))


ABSORPTION = (
    Hypothesis(
        "absorption", _absorption_factor, _says_absorption,
        ((0.0,), (1.1,), (2.303,), (0.434,), (10.0,), (0.1,)), "factor", applies=_absorbs,
    ),
    Hypothesis(
        "absorption-reflected-legs", lambda w, _: _absorbing(w, _spared_legs),
        says("does not absorb on the ways that end in a reflection"), applies=_absorbs,
    ),
    Hypothesis(
        "absorption-depth", lambda w, a: _by_depth(w, a, False),
        lambda f: "absorbs by the depth along the normal instead of the way of the ray"
        if f.near(1) else f"shortens the absorbing way by the cosine to the power {f}",
        ((1.0,), (0.1,)), "power of cos", applies=_absorbs,
    ),
    Hypothesis(
        "absorption-view-depth", lambda w, a: _by_depth(w, a, True),
        lambda f: "absorbs by the depth along the camera's axis instead of the way of the ray"
        if f.near(1) else f"shortens the absorbing way by the view's cosine to the power {f}",
        ((1.0,), (0.1,)), "power of cos", applies=_absorbs,
    ),
    Hypothesis(
        "absorption-complement", _complement,
        lambda f: "takes 1 - colour for what is left of the light" if f.near(1)
        else f"mixes {f} of 1 - colour into what is left of the light",
        ((1.0,), (0.1,)), "share", applies=_absorbs,
    ),
)  # fmt: skip
