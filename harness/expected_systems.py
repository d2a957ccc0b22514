"""Closed forms of whole systems: balls, lenses, rainbows, pools, and surfaces that image perfectly.

As in `harness.expected`, nothing here imports a renderer or the tracer, and angles are radians.
Indices are relative to what is around: n = ior inside / ior outside. Derivations stand with each.
"""

from __future__ import annotations

import numpy as np

from harness.expected import Float, refract

# --- what is round about an axis, and corner cubes ------------------------------------------------


def skewness(point: Float, direction: Float, axis: Float, n: Float | float) -> Float:
    """Index times (r x d) . a of rays (m, 3) through `point`, from any point of the `axis` a.

    Snell's law says that n d changes at a surface by a vector along its normal. The normal of a
    surface that is round about a meets a or is parallel to it, so (r x N) . a = 0, and nothing is
    added; between surfaces r moves along d, which adds nothing either. So each ray keeps it, and
    with it the distribution of etendue over skewness: H. Ries, N. Shatz, J. Bortz, W. Spirkl, J.
    Opt. Soc. Am. A 14, 2855 (1997). Its size is n times the distance from the axis times the sine
    of the angle to it.
    """
    return np.asarray(n * (np.cross(point, direction) @ axis))


def corner_cube_return(
    direction: Float, front: Float, first: Float, second: Float, n: Float
) -> Float:
    """Directions (m, 3) of rays out of a corner cube with one wrong angle, of index `n` (m,).

    `front` is the front's normal towards the ray, `first` and `second` those of the faces that are
    not square, in the order in which the ray meets them. Reflected in both it turns by twice the
    angle between them, around their edge k: by pi - 2 e, sin(e) = first . second. The third face is
    square to both, hence to k, and turns k round; so all three reverse the ray and turn it by 2 e
    around k, backwards. Seen at right angles to the front, where k makes the angle acos(1 / sqrt 3)
    with the ray, the ray comes back 2 sqrt(2 / 3) n e off for small e, 1.63 n e as in P. R. Yoder,
    J. Opt. Soc. Am. 48, 496 (1958).
    """
    one = np.ones_like(n)
    inside, _ = refract(direction, front, one, n)
    edge = np.cross(first, second)
    cosine = np.linalg.norm(edge, axis=1, keepdims=True)
    sine = np.einsum("ij,ij->i", first, second)[:, None]
    edge = edge / cosine
    # Rodrigues's formula for -2 e around the edge.
    cos2, sin2 = cosine**2 - sine**2, -2 * sine * cosine
    along = np.einsum("ij,ij->i", edge, inside)[:, None] * edge
    turned = along + (inside - along) * cos2 + np.cross(edge, inside) * sin2
    out, _ = refract(-turned, -front, n, one)
    return out


# --- a ball of radius R ---------------------------------------------------------------------------


def ball_focal_length(radius: float, n: float) -> float:
    """N R / (2 (n - 1)), from the centre: Hecht, Optics, 5th ed., section 6.1, as a thick lens."""
    return n * radius / (2 * (n - 1))


def ball_crossing(height: Float, radius: float, n: float) -> Float:
    """Where a ray parallel to the axis, `height` above it, crosses the axis, from the centre.

    It is turned by i - r at both surfaces, i = asin(h / R), r = asin(h / (n R)), and passes the
    centre at distance h before and after, by symmetry; so L = h / sin 2 (i - r). Domain 0 < h < R,
    h < n R; NaN elsewhere.
    """
    with np.errstate(invalid="ignore"):
        turned = 2 * (np.arcsin(height / radius) - np.arcsin(height / (n * radius)))
    return np.asarray(height / np.sin(turned))


def rainbow_deviation(height: Float, radius: float, n: float, reflections: int) -> Float:
    """Total turn of a ray that is reflected k times inside a ball: 2 i - 2 (k + 1) r + k pi."""
    i, r = np.arcsin(height / radius), np.arcsin(height / (n * radius))
    return np.asarray(2 * i - 2 * (reflections + 1) * r + reflections * np.pi)


def rainbow_least_deviation(n: float, reflections: int) -> float:
    """The stationary turn: dD/di = 0 where cos^2 i = (n^2 - 1) / (k (k + 2)).

    M. Born and E. Wolf, Principles of Optics, 7th ed., section 4.7 (exercise); Descartes 1637. The
    primary bow (k = 1) stands at 180 degrees minus it. Domain n^2 - 1 < k (k + 2).
    """
    cos2 = (n * n - 1) / (reflections * (reflections + 2))
    sin_i = np.sqrt(1 - cos2)
    return float(rainbow_deviation(np.asarray(sin_i), 1.0, n, reflections))


def aplanatic_object(radius: float, n: float) -> float:
    """R / n: a point inside a sphere, that far from its centre, is imaged without aberration."""
    return radius / n


def aplanatic_image(radius: float, n: float) -> float:
    """N R, from the centre, on the same side: Born & Wolf, section 4.2.3 (Weierstrass).

    For P on the sphere, O at R / n and I at n R on one radius, triangles COP and CPI are similar,
    so sin(OPC) / sin(CPI) = 1 / n for every P: Snell's law, and all rays from O leave as from I.
    """
    return radius * n


# --- lenses ---------------------------------------------------------------------------------------


def lens_power(r1: float, r2: float, n: float, thickness: float) -> float:
    """1 / f = (n - 1) (1/R1 - 1/R2 + (n - 1) d / (n R1 R2)): Hecht, section 6.1, equation 6.2.

    R is positive where the centre of curvature lies beyond the surface, infinite for a flat face.
    """
    return (n - 1) * (1 / r1 - 1 / r2 + (n - 1) * thickness / (n * r1 * r2))


def lens_back_focal_length(r1: float, r2: float, n: float, thickness: float) -> float:
    """From the last vertex: f (1 - (n - 1) d / (n R1)): Hecht, section 6.1."""
    return (1 - (n - 1) * thickness / (n * r1)) / lens_power(r1, r2, n, thickness)


def cartesian_ellipsoid_conic(n: float) -> float:
    """-1 / n^2, the conic constant of a surface that focuses parallel light inside a medium n.

    Born & Wolf, section 4.2.2: equal optical path from a plane wave to a point makes an ellipsoid
    of eccentricity 1 / n.
    """
    return -1 / n**2


def cartesian_ellipsoid_focus(vertex_radius: float, n: float) -> float:
    """N R / (n - 1), from the vertex, inside the medium; for rays of any height."""
    return n * vertex_radius / (n - 1)


def cartesian_hyperboloid_conic(n: float) -> float:
    """-n^2, of the exit face of a plano-convex lens that focuses parallel light perfectly."""
    return -(n**2)


def cartesian_hyperboloid_focus(vertex_radius: float, n: float) -> float:
    """R / (n - 1), from the exit vertex."""
    return vertex_radius / (n - 1)


# --- a pool ---------------------------------------------------------------------------------------


def sagittal_depth(theta: Float, depth: float, n: float) -> Float:
    """Apparent depth across the plane of incidence: d cos / sqrt(n^2 - sin^2), `theta` in air.

    All rays from a point at depth d that leave at one angle cross the vertical above it in one
    point: d tan(theta_t) = d_s tan(theta).
    """
    s = np.sin(theta)
    return np.asarray(depth * np.cos(theta) / np.sqrt(n**2 - s**2))


def tangential_depth(theta: Float, depth: float, n: float) -> Float:
    """Apparent depth in the plane of incidence: d n^2 cos^3 / (n^2 - sin^2)^(3/2).

    Neighbouring rays of one plane cross where d (tan(theta_t)) / d (tan(theta)) says; from Snell's
    law, d theta_t / d theta = cos / (n cos_t), so d_t = d cos^3(theta) / (n cos^3(theta_t)).
    """
    s = np.sin(theta)
    return np.asarray(depth * n**2 * np.cos(theta) ** 3 / (n**2 - s**2) ** 1.5)


# --- glass ----------------------------------------------------------------------------------------


def abbe_number(ior_f: float, ior_d: float, ior_c: float) -> float:
    """(n_d - 1) / (n_F - n_C)."""
    return (ior_d - 1) / (ior_f - ior_c)


def parallel_slab_light(reflectance: Float, left: Float) -> tuple[Float, Float]:
    """Reflected and transmitted part of a slab, all internal reflections: geometric series.

    T = (1 - R)^2 a / (1 - R^2 a^2), R_all = R (1 + a T), with a what one crossing leaves of the
    light; Hecht, section 9.6.1, in powers. For nature: once for s and p each, then the mean.
    """
    passed = (1 - reflectance) ** 2 * left / (1 - (reflectance * left) ** 2)
    return np.asarray(reflectance * (1 + left * passed)), np.asarray(passed)
