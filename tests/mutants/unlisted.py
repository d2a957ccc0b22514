"""Faults that no hypothesis knows, and controls: right, though they look wrong.

They are what real renderers do by accident rather than by a misread formula: a state that leaks, a
table that is too coarse, a guard that guards too much.
"""

from __future__ import annotations

import numpy as np
import student
from faults import at_angle, by_ratio, fault, parts, schlick
from renderer import Rules
from student import dot, unit

# --- where rays go --------------------------------------------------------------------------------


@fault
class Twisted(Rules):  # refracted rays are turned about the normal
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        bent, total = by_ratio(d, n, ior_i / ior_t)
        along = bent - dot(bent, n)[:, None] * n
        turned = np.cos(self.a) * along + np.sin(self.a) * np.cross(n, along)
        return unit(turned + dot(bent, n)[:, None] * n), total


@fault
class CoarseNormals(Rules):  # directions kept in a few bits
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        bent, total = by_ratio(d, n, ior_i / ior_t)
        return unit(np.rint(bent / self.a) * self.a), total


@fault
class IndexByAngle(Rules):  # an index that grows with the angle of incidence
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        _, s, _ = parts(d, n)
        eta = ior_i / ior_t
        return by_ratio(d, n, np.where(entering, eta / (1 + self.a * s**6), eta))


@fault
class StaleNormal(Rules):  # refracts with the normal of the surface before: it was not updated
    def recalled(self, n, d, before):
        known = np.isfinite(before[:, 0])
        before = np.where(known[:, None], before, n)
        return np.where((dot(d, before) > 0)[:, None], -before, before)


@fault
class PoppedTwice(Rules):  # leaving an inner solid, the stack of media forgets the outer one, too
    def indices(self, inner, outer, entering, shape):
        here, beyond = super().indices(inner, outer, entering, shape)
        return here, np.where(entering, beyond, 1.0)


@fault
class PoleNormals(Rules):  # a sphere's normals within a of a pole are those of the pole
    def shape_normal(self, outward, shape):
        if shape["type"] != "sphere":
            return outward
        polar = np.abs(outward[:, 2]) > 1 - self.a
        pole = np.stack([0 * outward[:, 2], 0 * outward[:, 2], np.sign(outward[:, 2])], axis=1)
        return np.where(polar[:, None], pole, outward)


@fault
class GridPositions(Rules):  # places on surfaces are kept on a grid
    too_near = 1e-6

    def start(self, p, d, n):
        moved = np.rint(p / self.a) * self.a - p
        return p + moved - dot(moved, n)[:, None] * n


@fault
class TirEarly(Rules):  # reflects all light where a little would still pass
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        bent, total = by_ratio(d, n, ior_i / ior_t)
        return bent, total | (np.abs(dot(bent, n)) < self.a)


@fault
class FarRoot(Rules):  # rays that graze a sphere meet its far side first
    def __init__(self, a):
        super().__init__(a)
        nearest = student.hit_sphere

        def hit(sphere, origins, directions):
            t, n = nearest(sphere, origins, directions)
            center = np.array(sphere["center"])
            grazes = np.isfinite(t) & (dot(directions, n) < 0) & (dot(directions, n) > -a)
            far = 2 * dot(center - origins, directions) - t
            t = np.where(grazes, far, t)
            point = origins + np.where(np.isfinite(t), t, 0)[:, None] * directions
            return t, unit(point - center)

        student.HIT["sphere"] = hit


@fault
class TableLookup(Rules):  # the arc sine from a table of a entries
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        _, s, _ = parts(d, n)
        sine = ior_i / ior_t * s
        entries = np.linspace(0, 1, int(self.a) + 1)
        theta = np.interp(np.minimum(sine, 1), entries, np.arcsin(entries))
        return at_angle(d, n, np.where(sine >= 1, np.nan, theta))


@fault
class IndexRounded(Rules):  # to multiples of a, as in a file of materials
    def indices(self, inner, outer, entering, shape):
        inner, outer = (np.rint(n / self.a) * self.a for n in (inner, outer))
        return super().indices(inner, outer, entering, shape)


@fault
class IndexDrifts(Rules):  # a state that leaks: by a more with every image after the eighth
    images = 0

    def max_depth(self, depth):
        self.images += 1
        return depth

    def indices(self, inner, outer, entering, shape):
        drift = 1 + self.a * max(0, self.images - 8)
        inner, outer = (np.where(n == 1, 1, n * drift) for n in (inner, outer))
        return super().indices(inner, outer, entering, shape)


@fault
class ClipFar(Rules):  # what is farther than a is not there
    def __init__(self, a):
        super().__init__(a)
        for kind, nearest in list(student.HIT.items()):

            def hit(shape, origins, directions, nearest=nearest):
                t, n = nearest(shape, origins, directions)
                return np.where(t > a, np.inf, t), n

            student.HIT[kind] = hit


# --- how much light they bring --------------------------------------------------------------------


@fault
class FresnelSquared(Rules):  # reflectance of amplitudes, |r|, for that of power
    def polarised(self, cos_i, cos_t, ior_i, ior_t):
        s, p = super().polarised(cos_i, cos_t, ior_i, ior_t)
        return np.sqrt(s), np.sqrt(p)


@fault
class AbsorptionSaturates(Rules):  # 1 / (1 + depth) for exp(-depth)
    def absorbed(self, sigma, length, d, n, forward, ends_in_reflection):
        return np.log1p(sigma * length[:, None])


@fault
class FresnelSwappedOut(Rules):  # the two indices swapped on the way out alone
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        right = super().reflectance(cos_i, ior_i, ior_t, entering)
        swapped = super().reflectance(cos_i, ior_t, ior_i, entering)
        return np.where(entering | (right >= 1), right, swapped)


@fault
class ChannelsSwapped(Rules):  # red is absorbed as blue, and blue as red
    def absorbed(self, sigma, length, d, n, forward, ends_in_reflection):
        return sigma[:, ::-1] * length[:, None]


@fault
class FresnelMean(Rules):  # the mean of amplitudes, squared, for the mean of powers
    def polarised(self, cos_i, cos_t, ior_i, ior_t):
        s, p = super().polarised(cos_i, cos_t, ior_i, ior_t)
        mean = ((np.sqrt(s) + np.sqrt(p)) / 2) ** 2
        return mean, mean


@fault
class HalfSchlick(Rules):  # a of Schlick's approximation mixed in
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        right = super().reflectance(cos_i, ior_i, ior_t, entering)
        cos_t = np.sqrt(np.maximum(1 - (ior_i / ior_t) ** 2 * (1 - cos_i**2), 0))
        near = np.where(cos_t > 0, schlick(np.minimum(cos_i, cos_t), ior_i, ior_t), 1.0)
        return (1 - self.a) * right + self.a * near


@fault
class CosineClamped(Rules):  # never below a, lest something be divided by zero
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        right = super().reflectance(cos_i, ior_i, ior_t, entering)
        clamped = super().reflectance(np.maximum(cos_i, self.a), ior_i, ior_t, entering)
        return np.where(right >= 1, 1.0, clamped)


@fault
class WeakDropped(Rules):  # lobes below a are not followed, and nobody gets their light
    def weights(self, R, total, ior_i, ior_t, cos_i):
        reflected, on = super().weights(R, total, ior_i, ior_t, cos_i)
        return np.where(reflected < self.a, 0.0, reflected), np.where(on < self.a, 0.0, on)


@fault
class ReflectedMediumLost(Rules):  # what was reflected inside is taken to be outside
    def absorbed(self, sigma, length, d, n, forward, ends_in_reflection):
        reflected = dot(d, np.nan_to_num(n)) > 0
        return sigma * np.where(reflected, 0.0, length)[:, None]


# --- what the file holds --------------------------------------------------------------------------


@fault
class RowsFlicker(Rules):  # one random number for all pixels of a row
    def shown(self, image):
        rows = np.random.default_rng(7).uniform(-1, 1, len(image))
        return image * (1 + self.a * rows)[:, None, None]


@fault
class OldImage(Rules):  # delivers the image of the request before, where it has the same size
    before = None

    def shown(self, image):
        old = self.before
        self.before = image
        return image if old is None or old.shape != image.shape else old


@fault
class TileSeams(Rules):  # the last column of each tile of 16 is that to its left
    def shown(self, image):
        image = image.copy()
        seams = np.arange(15, image.shape[1], 16)
        image[:, seams] = image[:, seams - 1]
        return image


@fault
class BlocksLost(Rules):  # each image after the eighth lacks one block of 8 x 8
    images = 0

    def shown(self, image):
        self.images += 1
        if self.images <= 8:
            return image
        image = image.copy()
        places = np.random.default_rng(self.images)
        y, x = (8 * places.integers(size // 8) for size in image.shape[:2])
        image[y : y + 8, x : x + 8] = 0
        return image


# --- controls: right, though they look wrong ------------------------------------------------------


@fault
class ControlRelativeR0(Rules):
    """Schlick's R0 by the relative index; Fresnel's equations by the ratio alone are the same."""

    def reflectance(self, cos_i, ior_i, ior_t, entering):
        return super().reflectance(cos_i, np.ones_like(ior_i), ior_t / ior_i, entering)


@fault
class ControlSignOfRp(Rules):
    """The sign of r_p is squared away."""

    def polarised(self, cos_i, cos_t, ior_i, ior_t):
        s, _ = super().polarised(cos_i, cos_t, ior_i, ior_t)
        with np.errstate(invalid="ignore"):
            r_p = (ior_i * cos_t - ior_t * cos_i) / (ior_t * cos_i + ior_i * cos_t)
        return s, np.nan_to_num(r_p) ** 2


@fault
class ControlN2Elsewhere(Rules):
    """Radiance is scaled at each interface, and the film takes it out again where it matters."""

    claims = ("radiance-n2",)

    def weights(self, R, total, ior_i, ior_t, cos_i):
        return R, np.where(total, 0.0, (1 - R) * (ior_i / ior_t) ** 2)


@fault
class ControlSnellsWindow(Rules):
    """Refraction by angles: all of the upper half space within 97 degrees under water is right."""

    def bend(self, d, n, ior_i, ior_t, entering, leg):
        _, s, _ = parts(d, n)
        with np.errstate(invalid="ignore"):
            return at_angle(d, n, np.arcsin(ior_i / ior_t * s))
