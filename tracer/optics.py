"""The lecture: what one ray does at one surface. Start reading here.

Conventions, the same in all functions
--------------------------------------
* `wi` is the unit vector from the surface back to where the ray came from: the lecture's W.
  A ray that travels along `direction` has ``wi = -direction``.
* `n` is the unit normal on the side of `wi`: ``dot(wi, n) >= 0``. The lecture's N.
* `wt` is the direction in which the refracted ray travels: the lecture's T.
* `ior_i` and `ior_t` are the absolute indices of refraction on the incident and on the
  transmitted side; ``mu = ior_i / ior_t``.
* Angles are in radians, from the normal; both cosines are positive.

Total internal reflection is an answer, not an accident: functions that may meet it return
`transmits` first, and where it is False their other result is zero. None returns NaN.
"""

from __future__ import annotations

import math

from tracer.compiled import compiled
from tracer.vector import Vec, add, dot, scale


@compiled
def reflect(wi: Vec, n: Vec) -> Vec:
    """The mirror direction ``2 (N . W) N - W``."""
    c = 2.0 * dot(wi, n)
    return c * n[0] - wi[0], c * n[1] - wi[1], c * n[2] - wi[2]


# --- Snell's law ----------------------------------------------------------------------------------


@compiled
def snell(theta_i: float, ior_i: float, ior_t: float) -> tuple[bool, float]:
    """(transmits, theta_t) by ``sin theta_t = ior_i / ior_t sin theta_i``."""
    sin_theta_t = ior_i * math.sin(theta_i) / ior_t
    if sin_theta_t > 1.0:
        return False, 0.0
    return True, math.asin(sin_theta_t)


@compiled
def cos_transmitted(cos_theta_i: float, ior_i: float, ior_t: float) -> tuple[bool, float]:
    """(transmits, cos theta_t), without trigonometry.

    The lecture's ``1 - mu^2 + mu^2 (W . N)^2`` loses digits where its terms cancel: near the
    critical angle and between nearly equal indices. ``(ior_t - ior_i)(ior_t + ior_i) / ior_t^2``
    is the same number as ``1 - mu^2`` and loses none, because the difference of two indices that
    are close is exact (Sterbenz).
    """
    tangential = ior_i / ior_t * cos_theta_i
    q = (ior_t - ior_i) * (ior_t + ior_i) / (ior_t * ior_t) + tangential * tangential
    # No branch: LLVM takes several roots at once, but none where one may be left out.
    return q >= 0.0, math.sqrt(max(q, 0.0))


@compiled
def transmitted(wi: Vec, n: Vec, cos_theta_i: float, cos_theta_t: float, mu: float) -> Vec:
    """The refracted direction from its cosines: ``(mu cos theta_i - cos theta_t) N - mu W``."""
    b = mu * cos_theta_i - cos_theta_t
    return b * n[0] - mu * wi[0], b * n[1] - mu * wi[1], b * n[2] - mu * wi[2]


@compiled
def refract(wi: Vec, n: Vec, ior_i: float, ior_t: float) -> tuple[bool, Vec]:
    """(transmits, wt): what the tracer uses, exact to a few units in the last place.

    The error stays below ``8 eps max(1, ior_i cos_theta_i / (ior_t cos_theta_t))`` radians; the
    second term is the derivative of theta_t by theta_i, which no formula can avoid.
    """
    cos_theta_i = dot(wi, n)
    transmits, cos_theta_t = cos_transmitted(cos_theta_i, ior_i, ior_t)
    if not transmits:
        return False, (0.0, 0.0, 0.0)
    return True, transmitted(wi, n, cos_theta_i, cos_theta_t, ior_i / ior_t)


@compiled
def refract_with_trigonometry(wi: Vec, n: Vec, ior_i: float, ior_t: float) -> tuple[bool, Vec]:
    """(transmits, wt) as on the slide "Refraction - With Trigonometry"."""
    theta_i = math.acos(min(1.0, dot(wi, n)))
    transmits, theta_t = snell(theta_i, ior_i, ior_t)
    if not transmits:
        return False, (0.0, 0.0, 0.0)
    mu = ior_i / ior_t
    return True, add(scale(mu * math.cos(theta_i) - math.cos(theta_t), n), scale(-mu, wi))


@compiled
def refract_without_trigonometry(wi: Vec, n: Vec, ior_i: float, ior_t: float) -> tuple[bool, Vec]:
    """(transmits, wt) as on the slides "Refraction - No Trigonometry": T = alpha W + beta N."""
    mu = ior_i / ior_t
    radicand = 1.0 - mu * mu + mu * mu * dot(wi, n) * dot(wi, n)
    if radicand < 0.0:
        return False, (0.0, 0.0, 0.0)
    alpha = -mu
    beta = mu * dot(wi, n) - math.sqrt(radicand)
    return True, add(scale(alpha, wi), scale(beta, n))


@compiled
def critical_angle(ior_i: float, ior_t: float) -> float:
    """Beyond it all light is reflected; pi/2 where there is no such angle (ior_i <= ior_t)."""
    return math.asin(min(1.0, ior_t / ior_i))


# --- Fresnel's equations --------------------------------------------------------------------------
# M. Born, E. Wolf, Principles of Optics, 7th ed., section 1.5.2, for the power that is reflected.


@compiled
def fresnel_s(cos_theta_i: float, cos_theta_t: float, ior_i: float, ior_t: float) -> float:
    """Reflectance of light polarised perpendicular to the plane of incidence."""
    a, b = ior_i * cos_theta_i, ior_t * cos_theta_t
    if a + b == 0.0:  # grazing along an interface of equal indices, which is none
        return 0.0
    r = (a - b) / (a + b)
    return r * r


@compiled
def fresnel_p(cos_theta_i: float, cos_theta_t: float, ior_i: float, ior_t: float) -> float:
    """Reflectance of light polarised in the plane of incidence; 0 at Brewster's angle."""
    a, b = ior_t * cos_theta_i, ior_i * cos_theta_t
    if a + b == 0.0:
        return 0.0
    r = (a - b) / (a + b)
    return r * r


@compiled
def fresnel_unpolarised(
    cos_theta_i: float, cos_theta_t: float, ior_i: float, ior_t: float
) -> float:
    """The mean of both polarisations: what a tracer without polarisation reflects."""
    return 0.5 * (
        fresnel_s(cos_theta_i, cos_theta_t, ior_i, ior_t)
        + fresnel_p(cos_theta_i, cos_theta_t, ior_i, ior_t)
    )


@compiled
def reflectance(cos_theta_i: float, ior_i: float, ior_t: float) -> float:
    """Unpolarised reflectance R of an interface, 1 in total internal reflection; T = 1 - R."""
    transmits, cos_theta_t = cos_transmitted(cos_theta_i, ior_i, ior_t)
    if not transmits:
        return 1.0
    return fresnel_unpolarised(cos_theta_i, cos_theta_t, ior_i, ior_t)


@compiled
def brewster_angle(ior_i: float, ior_t: float) -> float:
    """Where the reflected light is wholly s-polarised: ``tan theta = ior_t / ior_i``."""
    return math.atan2(ior_t, ior_i)


# --- Thin faces -----------------------------------------------------------------------------------


@compiled
def thin_slab_offset(theta_i: float, thickness: float, ior: float) -> tuple[bool, float]:
    """(transmits, d): how far a slab shifts a ray sideways; the ray keeps its direction.

    ``d = t sin i (1 - cos i / sqrt(n^2 - sin^2 i))`` with `ior` n relative to the medium on both
    sides; negative for n < 1. Written as one product, so that a slab of nearly no contrast loses
    no digits. Source: E. Hecht, Optics, 5th ed., section 4.4.
    """
    s, c = math.sin(theta_i), math.cos(theta_i)
    q = (ior - s) * (ior + s)
    if q <= 0.0:
        return False, 0.0
    root = math.sqrt(q)
    return True, thickness * s * (ior - 1.0) * (ior + 1.0) / (root * (root + c))


@compiled
def slab_transmittance(R: float, a: float) -> float:
    """What a slab transmits, all internal reflections included.

    `R` is the reflectance of one face and `a` what is left of the light after one crossing:
    ``T = (1 - R)^2 a (1 + R^2 a^2 + ...) = (1 - R)^2 a / (1 - R^2 a^2)``.
    """
    if R * a == 1.0:
        return 0.0
    return (1.0 - R) * (1.0 - R) * a / (1.0 - R * R * a * a)


@compiled
def slab_reflectance(R: float, a: float) -> float:
    """What a slab reflects, all internal reflections included: ``R (1 + a T)``."""
    return R * (1.0 + a * slab_transmittance(R, a))
