"""Closed forms: what physics says that a renderer must show.

Nothing here imports a renderer or the tracer. The formulas are the textbook ones;
`harness.truth.paths` chains them along a stated path through a scene.

Angles are radians unless a name says otherwise; directions are unit vectors along travel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

# --- scalar formulas ------------------------------------------------------------------------------


def snell_angle(theta_i: Float, ior_i: float, ior_t: float) -> Float:
    """Angle of refraction, asin(ior_i sin(theta_i) / ior_t); NaN beyond the critical angle."""
    with np.errstate(invalid="ignore"):
        return np.arcsin(ior_i * np.sin(theta_i) / ior_t)


def critical_angle(ior_i: float, ior_t: float) -> float:
    """asin(ior_t / ior_i), for light inside the denser medium (ior_i > ior_t)."""
    return float(np.arcsin(ior_t / ior_i))


def brewster_angle(ior_i: float, ior_t: float) -> float:
    """atan(ior_t / ior_i): there the reflected and the refracted ray are perpendicular."""
    return float(np.arctan2(ior_t, ior_i))


def brewster_reflectance(ior_i: float, ior_t: float) -> float:
    """Unpolarised reflectance at Brewster's angle, where R_p = 0: R_s / 2, Hecht section 4.6.3.

    With n = ior_t / ior_i, cos(theta_i) = sin(theta_t) = 1 / sqrt(1 + n^2), so
    r_s = (1 - n^2) / (1 + n^2).
    """
    n2 = (ior_t / ior_i) ** 2
    return float(((1 - n2) / (1 + n2)) ** 2 / 2)


def lecture_table_angle(theta_i: Float) -> Float:
    """The lecture's printed theta_r: two thirds of theta_i. An erratum, kept to recognise it."""
    return 2.0 / 3.0 * theta_i


def slab_offset(theta_i: Float, thickness: float, ior: float) -> Float:
    """Sideways shift of a ray by a slab of relative index `ior`: Hecht, Optics, section 4.4.

    d = t sin(theta_i) (1 - cos(theta_i) / sqrt(n^2 - sin^2(theta_i)))
    """
    s = np.sin(theta_i)
    return np.asarray(thickness * s * (1 - np.cos(theta_i) / np.sqrt(ior**2 - s**2)))


def stack_offset(theta_i: Float, layers: Sequence[tuple[float, float]]) -> Float:
    """Sideways shift by parallel `layers` of (thickness, relative index).

    The sum of their own shifts, cos(i) sum t (tan i - tan t_k); a gap of index 1 adds nothing.
    """
    s, c = np.sin(theta_i), np.cos(theta_i)
    shift = np.zeros_like(np.asarray(theta_i, np.float64))
    for thickness, ior in layers:
        shift = shift + thickness * s * (1 - c / np.sqrt(ior**2 - s**2))
    return np.asarray(shift)


def prism_deviation(theta_i: Float, apex: float, ior: float) -> Float:
    """Deviation of a ray in the principal plane: Born & Wolf, section 4.7.2; NaN where TIR.

    delta = i + asin(sin A sqrt(n^2 - sin^2 i) - cos A sin i) - A
    """
    s = np.sin(theta_i)
    with np.errstate(invalid="ignore"):
        exit_angle = np.arcsin(np.sin(apex) * np.sqrt(ior**2 - s**2) - np.cos(apex) * s)
    return np.asarray(theta_i + exit_angle - apex)


def prism_minimum_deviation(apex: float, ior: float) -> float:
    """2 asin(n sin(A/2)) - A."""
    return float(2 * np.arcsin(ior * np.sin(apex / 2)) - apex)


def prism_first_transmitting_angle(apex: float, ior: float) -> float:
    """Smallest angle of incidence that is not totally reflected at the exit face."""
    return float(np.arcsin(ior * np.sin(apex - np.arcsin(1 / ior))))


def fresnel(cos_theta_i: Float, ior_i: Float, ior_t: Float) -> Float:
    """Unpolarised power reflectance (R_s + R_p) / 2; 1 under total internal reflection.

    Hecht, section 4.6.2. `cos_theta_i` >= 0.
    """
    eta = np.asarray(ior_i / ior_t)
    # sin^2(theta_t) = eta^2 (1 - cos^2); factored as in Kahan's difference of squares, so that
    # nothing is lost near the critical angle.
    cos2_t = (1 - eta) * (1 + eta) + (eta * cos_theta_i) ** 2
    total = cos2_t <= 0
    cos_t = np.sqrt(np.where(total, 1.0, cos2_t))
    r_s = (eta * cos_theta_i - cos_t) / (eta * cos_theta_i + cos_t)
    r_p = (cos_theta_i - eta * cos_t) / (cos_theta_i + eta * cos_t)
    return np.where(total, 1.0, (r_s**2 + r_p**2) / 2)


def lengths(vectors: Float) -> Float:
    """(m,) of `vectors` (m, 3). As np.linalg.norm along an axis, in a third of its time."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))


def cross(a: Float, b: Float) -> Float:
    """(m, 3) products of `a` and `b`, (m, 3). As np.cross, bit for bit, in a fraction of its time.

    That one moves axes about to serve arrays of any shape, which costs more than the product.
    """
    ax, ay, az = a[:, 0], a[:, 1], a[:, 2]
    bx, by, bz = b[:, 0], b[:, 1], b[:, 2]
    product = np.empty(a.shape)
    product[:, 0] = ay * bz - az * by
    product[:, 1] = az * bx - ax * bz
    product[:, 2] = ax * by - ay * bx
    return product


def refract(
    direction: Float, n: Float, ior_i: Float, ior_t: Float
) -> tuple[Float, NDArray[np.bool_]]:
    """Snell's law in vector form, and where there is total internal reflection instead.

    `n` faces the incoming ray (direction . n < 0). T = eta D + (eta c - cos_t) N with c = -D . N;
    `direction`, `n` are (m, 3), the indices (m,). Lecture: "Refraction - No Trigonometry", with
    the signs of its erratum put right.
    """
    eta = np.asarray(ior_i / ior_t)[:, None]
    c = -np.einsum("ij,ij->i", direction, n)[:, None]
    cos2_t = (1 - eta) * (1 + eta) + (eta * c) ** 2
    total = cos2_t[:, 0] <= 0
    cos_t = np.sqrt(np.maximum(cos2_t, 0))
    bent = eta * direction + (eta * c - cos_t) * n
    return bent / lengths(bent)[:, None], total


def reflect(direction: Float, n: Float) -> Float:
    """D - 2 (D . N) N."""
    return np.asarray(direction - 2 * np.einsum("ij,ij->i", direction, n)[:, None] * n)
