"""Causes that give rays the wrong weight where they meet a surface, or at the film."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from harness.diagnosis.hypothesis import Fitted, Hypothesis, Values, plus_minus, says
from harness.diagnosis.worlds import World
from harness.expected import Float, fresnel
from harness.renderers.base import Rays, Status
from harness.truth.law import Interface, Mask
from harness.truth.paths import TruePaths

Reflectance = Callable[[Interface], Float]


def _reflecting(name: str, R: Reflectance, text: str) -> Hypothesis:
    return Hypothesis(name, lambda w, _: w.with_law(reflectance=R), says(text))


# --- Fresnel factors ------------------------------------------------------------------------------


def _polarised(at: Interface) -> tuple[Float, Float, Mask]:
    """R_s, R_p and where reflection is total."""
    c, eta = at.cos_theta_i, at.ior_i / at.ior_t
    square = (1 - eta) * (1 + eta) + (eta * c) ** 2
    cos_t = np.sqrt(np.maximum(square, 0))
    r_s = (eta * c - cos_t) / (eta * c + cos_t)
    r_p = (c - eta * cos_t) / (c + eta * cos_t)
    return r_s**2, r_p**2, np.asarray(square <= 0)


def _mixed_polarisation(world: World, a: Values) -> World:
    def reflectance(at: Interface) -> Float:
        s, p, total = _polarised(at)
        return np.where(total, 1.0, a[0] * s + (1 - a[0]) * p)

    return world.with_law(reflectance=reflectance)


def _says_polarisation(fit: Fitted) -> str:
    if fit.near(1):
        return "weighs light as if it were s-polarised"
    if fit.near(0):
        return "weighs light as if it were p-polarised"
    return f"mixes {fit} of s with the rest of p polarisation instead of halves"


def _schlick(at: Interface, c: Float) -> Float:
    r0 = ((at.ior_i - at.ior_t) / (at.ior_i + at.ior_t)) ** 2
    _, _, total = _polarised(at)
    return np.where(total, 1.0, r0 + (1 - r0) * (1 - c) ** 5)


def _schlick_outside(at: Interface) -> Float:
    """By the cosine in the thinner medium, as it should be."""
    eta, c = at.ior_i / at.ior_t, at.cos_theta_i
    cos_t = np.sqrt(np.maximum(1 - eta**2 * (1 - c**2), 0))
    return _schlick(at, np.where(eta > 1, cos_t, c))


def _schlick_inside(at: Interface) -> Float:
    return _schlick(at, at.cos_theta_i)


def _half_denominator(world: World, a: Values) -> World:
    def reflectance(at: Interface) -> Float:
        _, p, total = _polarised(at)
        c, eta = at.cos_theta_i, at.ior_i / at.ior_t
        cos_t = np.sqrt(np.maximum(1 - eta**2 * (1 - c**2), 0))
        wrong_n = at.ior_t + a[0] * (at.ior_i - at.ior_t)
        r_s = (at.ior_i * c - at.ior_t * cos_t) / (at.ior_i * c + wrong_n * cos_t)
        return np.where(total, 1.0, (r_s**2 + p) / 2)

    return world.with_law(reflectance=reflectance)


def _of_other_index(world: World, wrong: Callable[[Interface], Interface]) -> World:
    """Fresnel factors, and with them total reflection, of other indices than refraction has."""
    law = world.law

    def reflectance(at: Interface) -> Float:
        other = wrong(at)
        return fresnel(other.cos_theta_i, other.ior_i, other.ior_t)

    def bend(at: Interface) -> tuple[Float, Mask]:
        bent, total = law.bend(at)
        return bent, np.asarray(total | (reflectance(at) >= 1))

    return world.with_law(reflectance=reflectance, bend=bend)


def _fresnel_index(world: World, a: Values) -> World:
    def wrong(at: Interface) -> Interface:
        denser = at.ior_i > at.ior_t
        return replace(
            at,
            ior_i=np.where(denser, at.ior_i * (1 + a[0]), at.ior_i),
            ior_t=np.where(denser, at.ior_t, at.ior_t * (1 + a[0])),
        )

    return _of_other_index(world, wrong)


def _fresnel_fixed(world: World, a: Values) -> World:
    def wrong(at: Interface) -> Interface:
        return replace(
            at,
            ior_i=np.where(at.entering, at.ior_i, a[0]),
            ior_t=np.where(at.entering, a[0], at.ior_t),
        )

    return _of_other_index(world, wrong)


def _says_fresnel_index(fit: Fitted) -> str:
    if len(fit.iors) == 1:
        n = fit.iors[0]
        wrong = plus_minus(n * (1 + fit.values[0]), n * fit.errors[0])
        return f"weighs light by the Fresnel factors of n = {wrong} (the scene says {n:.6g})"
    return f"weighs light by the Fresnel factors of indices {1 + fit.values[0]:.5g} times as large"


def _fresnel_swapped(world: World, _: Values) -> World:
    return _of_other_index(world, lambda at: replace(at, ior_i=at.ior_t, ior_t=at.ior_i))


def _constant(world: World, a: Values) -> World:
    def reflectance(at: Interface) -> Float:
        _, _, total = _polarised(at)
        return np.where(total, 1.0, a[0])

    return world.with_law(reflectance=reflectance)


def _clear_inner_exit(world: World, _: Values) -> World:
    """No reflection where a ray leaves a solid that lies within another."""
    surroundings, law = world.scene.media[0].ior, world.law

    def reflectance(at: Interface) -> Float:
        inner = ~at.entering & (np.abs(at.ior_t - surroundings) > 1e-9)
        _, _, total = _polarised(at)
        return np.where(inner & ~total, 0.0, law.reflectance(at))

    return world.with_law(reflectance=reflectance)


def _clear_one_way(entering: bool) -> Reflectance:
    """No reflection where rays enter a solid, or where they leave one; total reflection stays."""

    def reflectance(at: Interface) -> Float:
        _, _, total = _polarised(at)
        clear = (at.entering == entering) & ~total
        return np.where(clear, 0.0, fresnel(at.cos_theta_i, at.ior_i, at.ior_t))

    return reflectance


def _nested(world: World) -> bool:
    return any(solid.exterior for solid in world.scene.solids)


def _transmission_power(world: World, a: Values) -> World:
    return world.with_law(transmittance=lambda _, R: np.maximum(1 - R, 0) ** a[0])


def _says_transmission(fit: Fitted) -> str:
    if fit.near(0):
        return "does not take reflected light from the transmitted (conserve_energy is missing)"
    if fit.near(2):
        return "multiplies transmitted light by T twice"
    return f"weighs transmitted light by T to the power {fit}"


def _lobe_power(world: World, a: Values) -> World:
    law = world.law
    return world.with_law(
        reflectance=lambda at: law.reflectance(at) ** a[0],
        transmittance=lambda at, _: np.maximum(1 - law.reflectance(at), 0) ** a[0],
    )


def _dark_tir(world: World, a: Values) -> World:
    def reflectance(at: Interface) -> Float:
        _, _, total = _polarised(at)
        return np.where(total, 1 - a[0], fresnel(at.cos_theta_i, at.ior_i, at.ior_t))

    return world.with_law(reflectance=reflectance)


def _dark_where_equal(world: World, _: Values) -> World:
    law = world.law

    def none(at: Interface, R: Float) -> Float:
        return np.where(np.abs(at.ior_i - at.ior_t) < 1e-3, 0.0, law.transmittance(at, R))

    return world.with_law(transmittance=none)


def _equal_somewhere(world: World) -> bool:
    media = world.scene.media
    return any(abs(media[s.medium].ior - media[s.exterior].ior) < 1e-3 for s in world.scene.solids)


# --- radiance as a whole --------------------------------------------------------------------------


def _n2(world: World, a: Values) -> World:
    return replace(world, n2=world.n2 + 2 * a[0])


def _says_n2(fit: Fitted) -> str:
    if fit.near(1):
        return "scales radiance with the square of the index once more than it claims"
    if fit.near(-1):
        return "leaves out the square of the index with which it claims to scale radiance"
    power = plus_minus(2 * fit.values[0], 2 * fit.errors[0])
    return f"scales radiance with the index to a power that is {power} too large"


def _depth_cap(world: World, a: Values) -> World:
    def finish(_: Rays, paths: TruePaths) -> TruePaths:
        if len(world.setting.path) <= a[0]:
            return paths
        return replace(paths, status=np.full_like(paths.status, Status.CUT))

    return replace(world, finish=finish)


def _nan_at_normal(world: World, a: Values) -> World:
    def finish(_: Rays, paths: TruePaths) -> TruePaths:
        upright = (paths.cos_theta_i > 1 - a[0]).any(axis=1)
        return replace(paths, weight=np.where(upright, np.nan, paths.weight))

    return replace(world, finish=finish)


BRIGHTNESS = (
    _reflecting(
        "schlick", _schlick_outside, "uses Schlick's approximation for Fresnel's equations"
    ),
    _reflecting(
        "schlick-inside", _schlick_inside,
        "uses Schlick's approximation with the cosine inside the glass on the way out",
    ),
    Hypothesis(
        "polarisation", _mixed_polarisation, _says_polarisation,
        ((1.0,), (0.0,), (0.45,)), "s share",
    ),
    Hypothesis(
        "transmission-power", _transmission_power, _says_transmission, ((0.0,), (2.0,), (1.05,)),
        "power of T",
    ),
    Hypothesis(
        "lobe-power", _lobe_power,
        lambda f: "weighs each lobe once more by the chance of choosing it" if f.near(2)
        else f"weighs each lobe by its share to the power {f}",
        ((2.0,), (1.05,)), "power",
    ),
    Hypothesis(
        "fresnel-swapped", _fresnel_swapped, says("swaps the two indices in Fresnel's equations")
    ),
    Hypothesis(
        "constant-reflectance", _constant,
        lambda f: f"reflects {plus_minus(100 * f.values[0], 100 * f.errors[0])} % at every angle",
        ((0.04,), (0.0,)), "R",
    ),
    Hypothesis(
        "fresnel-index", _fresnel_index, _says_fresnel_index,
        ((-0.267,), (0.05,), (-0.05,)), "relative error", kin="fresnel-index",
    ),
    Hypothesis(
        "fresnel-fixed", _fresnel_fixed,
        lambda f: f"weighs light by the Fresnel factors of n = {f}, whatever the scene says",
        ((1.1,), (1.5,)), "n", kin="fresnel-index",
    ),
    Hypothesis(
        "inner-exit-clear", _clear_inner_exit,
        says("reflects nothing where a ray leaves an inner solid"), applies=_nested,
    ),
    _reflecting(
        "exit-clear", _clear_one_way(entering=False),
        "reflects nothing where rays leave a solid: Fresnel's equations count on entry alone",
    ),
    _reflecting(
        "entry-clear", _clear_one_way(entering=True),
        "reflects nothing where rays enter a solid: Fresnel's equations count on exit alone",
    ),
    Hypothesis(
        "rs-denominator", _half_denominator,
        lambda f: "uses the incident index twice in the denominator of r_s" if f.near(1)
        else f"mixes {f} of the incident index into the other one in the denominator of r_s",
        ((1.0,), (0.1,)), "share",
    ),
    Hypothesis(
        "tir-dark", _dark_tir,
        lambda f: "drops totally reflected rays: they end black" if f.near(1)
        else f"loses {f} of the light in total reflection",
        ((1.0,), (0.1,)), "loss",
    ),
    Hypothesis(
        "equal-indices-dark", _dark_where_equal,
        says("shows black where both indices are the same"), applies=_equal_somewhere,
    ),
    Hypothesis("radiance-n2", _n2, _says_n2, ((1.0,), (-1.0,), (0.05,)), "excess power / 2"),
    Hypothesis(
        "recursion-depth", _depth_cap,
        lambda f: f"stops after {f.values[0]:.0f} surfaces at most: its recursion is too shallow",
        tuple((float(k),) for k in range(11, -1, -1)), "surfaces", continuous=False,
    ),
    Hypothesis(
        "nan-at-normal", _nan_at_normal,
        says("gives NaN at normal incidence, where a rounded cosine exceeds 1"),
        ((1e-15,), (1e-12,), (1e-9,), (1e-6,)), "1 - cos", continuous=False,
    ),
    Hypothesis(
        "gain", lambda w, a: replace(w, shown=lambda level: a[0] * level),
        lambda f: f"shows {f} times the radiance", ((2.0,), (0.5,), (1.05,)), "factor",
    ),
    Hypothesis(
        "gamma", lambda w, a: replace(w, shown=lambda v: np.maximum(v, 0) ** (1 / a[0])),
        lambda f: f"shows radiance encoded with a gamma of {f}", ((2.2,), (0.4545,)), "gamma",
    ),
)  # fmt: skip
