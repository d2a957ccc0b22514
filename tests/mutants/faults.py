"""The faults: each exchanges one rule of `renderer.Rules`. P numbers are those of bugs that real
renderers had; `mutants.py` names the threads.

Written apart from `harness.diagnosis`, mostly by other formulas, so that neither vouches for the
other. `a` is the fault's size; 0 is right unless said otherwise.
"""

from __future__ import annotations

import re

import numpy as np
import renderer
import student
from renderer import Rules
from student import dot, unit

FAULTS: dict[str, type[Rules]] = {"none": Rules}


def fault(cls: type[Rules]) -> type[Rules]:
    """Registers a fault under the name of its class: RatioInverted is ratio-inverted."""
    FAULTS[re.sub(r"(?<!^)(?=[A-Z])", "-", cls.__name__).lower()] = cls
    return cls


def by_ratio(d, n, eta):
    """Snell's law for a given ratio of indices."""
    bent, R = student.refract(d, n, eta, np.ones_like(eta))
    return bent, R >= 1


def parts(d, n):
    """Cosine, sine and the unit vector along the surface."""
    c = np.clip(-dot(d, n), -1, 1)
    along = d + c[:, None] * n
    s = np.linalg.norm(along, axis=1)
    return c, s, along / np.maximum(s, 1e-300)[:, None]


def at_angle(d, n, theta):
    """The direction at `theta` from -n; NaN is total reflection."""
    _, _, along = parts(d, n)
    total = ~(np.abs(theta) < np.pi / 2)
    theta = np.where(total, 0, theta)
    return np.sin(theta)[:, None] * along - np.cos(theta)[:, None] * n, total


# --- directions -----------------------------------------------------------------------------------


@fault
class RatioInverted(Rules):  # P1
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        return by_ratio(d, n, (ior_i / ior_t) ** (1 - 2 * self.a))


@fault
class NotSquared(Rules):  # P2
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        eta = ior_i / ior_t
        c, s, _ = parts(d, n)
        k = 1 - eta ** (2 - self.a) * s**2
        bent = eta[:, None] * d + (eta * c - np.sqrt(np.maximum(k, 0)))[:, None] * n
        return unit(bent), k <= 0


@fault
class SideIgnored(Rules):  # P3: the normal is not turned round for a ray from inside
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        outward = np.where(entering[:, None], n, -n)
        eta = ior_i / ior_t
        c = -dot(d, outward)
        k = 1 - eta**2 * (1 - c**2)
        bent = eta[:, None] * d + (eta * c - np.sqrt(np.maximum(k, 0)))[:, None] * outward
        return unit(bent), k <= 0


@fault
class RatioNotSwapped(Rules):
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        return by_ratio(d, n, np.where(entering, ior_i / ior_t, ior_t / ior_i))


@fault
class NotUnit(Rules):  # P4
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        d = (1 + self.a) * d
        eta, c = ior_i / ior_t, -dot(d, n)
        k = 1 - eta**2 * (1 - c**2)
        bent = eta[:, None] * d + (eta * c - np.sqrt(np.maximum(k, 0)))[:, None] * n
        return unit(bent), k <= 0


@fault
class IndexHardcoded(Rules):  # P5
    def indices(self, inner, outer, entering, shape):
        wrong = np.where(outer == 1, outer, self.pulled(outer))
        return super().indices(self.pulled(inner), wrong, entering, shape)

    def pulled(self, n):
        return (1 - self.a) * n + 1.5 * self.a


@fault
class IndexOff(Rules):
    def indices(self, inner, outer, entering, shape):
        wrong = np.where(outer == 1, outer, outer * (1 + self.a))
        return super().indices(inner * (1 + self.a), wrong, entering, shape)


@fault
class AmbientAir(Rules):  # P6
    def indices(self, inner, outer, entering, shape):
        return super().indices(inner, 1 + (1 - self.a) * (outer - 1), entering, shape)


@fault
class Linear(Rules):
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        c, s, _ = parts(d, n)
        return at_angle(d, n, np.arctan2(s, c) * ior_i / ior_t)


@fault
class PrintedTable(Rules):
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        c, s, _ = parts(d, n)
        return at_angle(d, n, np.arctan2(s, c) * 2 / 3)


@fault
class Tangents(Rules):  # tan in the place of sin
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        c, s, _ = parts(d, n)
        return at_angle(d, n, np.arctan(ior_i / ior_t * s / np.maximum(c, 1e-12)))


@fault
class Degrees(Rules):
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        c, s, _ = parts(d, n)
        in_degrees = np.arctan2(s, c) * 180 / np.pi
        return at_angle(d, n, np.arcsin(ior_i / ior_t * np.sin(in_degrees)))


@fault
class WIsDirection(Rules):
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        bent, total = by_ratio(d, n, ior_i / ior_t)
        normal_part = dot(bent, n)[:, None] * n
        return 2 * normal_part - bent, total


@fault
class Straight(Rules):
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        return d, np.zeros(len(d), bool)


@fault
class NeverLeaves(Rules):  # P20
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        bent, total = by_ratio(d, n, ior_i / ior_t)
        return np.where(entering[:, None], bent, d), total & entering


@fault
class StraightIn(Rules):  # refracts on the way out only
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        bent, total = by_ratio(d, n, ior_i / ior_t)
        return np.where(entering[:, None], d, bent), total & ~entering


@fault
class GapSwallowed(Rules):  # P18: surfaces nearer than a are not found, and parity is lost
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        bent, total = by_ratio(d, n, ior_i / ior_t)
        lost = ~entering & (leg < self.a)
        return np.where(lost[:, None], d, bent), total & ~lost


@fault
class TirLeaks(Rules):
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        eta = ior_i / ior_t
        _, s, along = parts(d, n)
        k = np.sqrt(np.abs(1 - (eta * s) ** 2))
        return unit((eta * s)[:, None] * along - k[:, None] * n), np.zeros(len(d), bool)

    def reflectance(self, cos_i, ior_i, ior_t, entering):
        return np.minimum(super().reflectance(cos_i, ior_i, ior_t, entering), 0.99)


@fault
class TirClamped(Rules):  # max(k, 0) under the root and no test: half of the light goes astray
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        bent, total = by_ratio(d, n, ior_i / ior_t)
        _, _, along = parts(d, n)
        return np.where(total[:, None], along, bent), np.zeros(len(d), bool)

    def reflectance(self, cos_i, ior_i, ior_t, entering):
        right = super().reflectance(cos_i, ior_i, ior_t, entering)
        return np.where(right < 1, right, 0.5)


@fault
class NormalNudge(Rules):  # P19
    def start(self, p, d, n):
        return p + self.a * np.sign(dot(d, n))[:, None] * n


@fault
class NormalNudgeRelative(Rules):  # P19, by a share of the coordinates, as floats are spaced
    def start(self, p, d, n):
        size = self.a * (1 + np.abs(p).max(axis=1))
        return p + (size * np.sign(dot(d, n)))[:, None] * n


@fault
class StartAhead(Rules):  # along the ray: it goes on where it should, and absorbs less
    def start(self, p, d, n):
        return p + self.a * d


@fault
class NormalsByMatrix(Rules):  # P23: meshes only, as if made by a stretch of y
    def shape_normal(self, outward, shape):
        if shape["type"] != "mesh":
            return outward
        return unit(outward * np.array([1, (1 + self.a) ** 2, 1]))


@fault
class MeshInsideOut(Rules):
    def indices(self, inner, outer, entering, shape):
        if shape["type"] == "mesh":
            inner, outer = outer, inner
        return super().indices(inner, outer, entering, shape)


@fault
class MeshMirrored(Rules):  # read as left-handed: axis a points the other way
    def __init__(self, a):
        super().__init__(a)
        flip = np.where(np.arange(3) == int(a), -1, 1)

        def hit(mesh, origins, directions):
            vertices = (np.array(mesh["vertices"]) * flip).tolist()
            wound = np.array(mesh["triangles"])[:, ::-1].tolist()
            mirrored = mesh | {"vertices": vertices, "triangles": wound}
            return renderer.hit_mesh(mirrored, origins, directions)

        student.HIT["mesh"] = hit


@fault
class MeshLeaks(Rules):  # P24
    def __init__(self, a):
        super().__init__(a)
        student.HIT["mesh"] = lambda mesh, o, d: renderer.hit_mesh(mesh, o, d, margin=a)


@fault
class ThinOffset(Rules):  # 1 is right
    def thin_offset(self, shift):
        return self.a * shift


@fault
class Turned(Rules):  # refracted rays are turned by a radians away from the normal
    def bend(self, d, n, ior_i, ior_t, entering, leg):
        bent, total = by_ratio(d, n, ior_i / ior_t)
        c, s, along = parts(bent, n)
        theta = np.arctan2(s, c) + self.a
        return np.sin(theta)[:, None] * along - np.cos(theta)[:, None] * n, total


# --- light ----------------------------------------------------------------------------------------


@fault
class TirBlack(Rules):  # P7
    def weights(self, R, total, ior_i, ior_t, cos_i):
        return np.where(total, 1 - self.a, R), np.where(total, 0.0, 1 - R)


@fault
class FresnelHardcoded(Rules):  # P8
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        n = np.where(entering, ior_t, ior_i)
        wrong = n + self.a * (1.1 - n)
        i, t = np.where(entering, ior_i, wrong), np.where(entering, wrong, ior_t)
        return super().reflectance(cos_i, i, t, entering)


@fault
class FresnelIndexOff(Rules):  # a weight by another index than directions, in proportion
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        denser = 1 + self.a
        i, t = np.where(entering, ior_i, ior_i * denser), np.where(entering, ior_t * denser, ior_t)
        return super().reflectance(cos_i, i, t, entering)


@fault
class ExitClear(Rules):
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        right = super().reflectance(cos_i, ior_i, ior_t, entering)
        return np.where(~entering & (right < 1), 0.0, right)


@fault
class EntryClear(Rules):
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        right = super().reflectance(cos_i, ior_i, ior_t, entering)
        return np.where(entering & (right < 1), 0.0, right)


@fault
class NanAtNormal(Rules):  # P9: sqrt(1 - cos^2) of a cosine that is not clamped
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        R = super().reflectance(cos_i, ior_i, ior_t, entering)
        return np.where(cos_i + self.a > 1, np.nan, R)


def schlick(c, ior_i, ior_t):
    r0 = ((ior_i - ior_t) / (ior_i + ior_t)) ** 2
    return r0 + (1 - r0) * (1 - c) ** 5


@fault
class SchlickRight(Rules):
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        cos_t = np.sqrt(np.maximum(1 - (ior_i / ior_t) ** 2 * (1 - cos_i**2), 0))
        return np.where(cos_t > 0, schlick(np.minimum(cos_i, cos_t), ior_i, ior_t), 1.0)


@fault
class SchlickWrongCosine(Rules):  # P10
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        return schlick(cos_i, ior_i, ior_t)


@fault
class RsDenominator(Rules):  # P11
    def polarised(self, cos_i, cos_t, ior_i, ior_t):
        _, p = super().polarised(cos_i, cos_t, ior_i, ior_t)
        wrong = ior_t + self.a * (ior_i - ior_t)
        r_s = (ior_i * cos_i - ior_t * cos_t) / (ior_i * cos_i + wrong * cos_t)
        return r_s**2, p


@fault
class FresnelSwapped(Rules):  # P12
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        return super().reflectance(cos_i, ior_t, ior_i, entering)


@fault
class TransmissionPower(Rules):  # P13: T^(1 + a); -1 lacks conserve_energy
    def weights(self, R, total, ior_i, ior_t, cos_i):
        return R, np.where(total, 0.0, np.maximum(1 - R, 0) ** (1 + self.a))


@fault
class N2Scaling(Rules):  # P14
    def weights(self, R, total, ior_i, ior_t, cos_i):
        return R, np.where(total, 0.0, (1 - R) * (ior_i / ior_t) ** (2 * self.a))


@fault
class N2Missing(Rules):  # P14, by one who claims it
    claims = ("radiance-n2",)


@fault
class SelectionProbability(Rules):  # P15
    def weights(self, R, total, ior_i, ior_t, cos_i):
        return R ** (1 + self.a), np.where(total, 0.0, np.maximum(1 - R, 0) ** (1 + self.a))


@fault
class DepthCapped(Rules):  # P16: no more than a surfaces
    def max_depth(self, depth):
        return min(depth, int(self.a) + 1)


@fault
class EqualIndicesBlack(Rules):  # P17
    def weights(self, R, total, ior_i, ior_t, cos_i):
        same = np.abs(ior_i - ior_t) < self.a
        return R, np.where(total | same, 0.0, 1 - R)


@fault
class OnePolarisation(Rules):  # the share of s; 1/2 is right
    def polarised(self, cos_i, cos_t, ior_i, ior_t):
        s, p = super().polarised(cos_i, cos_t, ior_i, ior_t)
        mixed = self.a * s + (1 - self.a) * p
        return mixed, mixed


@fault
class FresnelOff(Rules):  # by a, of a light of 1
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        right = super().reflectance(cos_i, ior_i, ior_t, entering)
        return np.where(right < 1, np.clip(right + self.a, 0, 1), 1.0)


@fault
class InnerExitClear(Rules):
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        right = super().reflectance(cos_i, ior_i, ior_t, entering)
        return np.where(~entering & (ior_t != 1) & (right < 1), 0.0, right)


@fault
class ReflectsConstantly(Rules):
    def reflectance(self, cos_i, ior_i, ior_t, entering):
        right = super().reflectance(cos_i, ior_i, ior_t, entering)
        return np.where(right < 1, self.a, 1.0)


# --- absorption -----------------------------------------------------------------------------------


@fault
class AbsorptionComplement(Rules):  # P21: 1 - colour is left of each unit
    def absorbed(self, sigma, length, d, n, forward, ends_in_reflection):
        left = np.where(sigma > 0, 1 - np.exp(-sigma), 1.0)
        wrong = np.where(sigma > 0, -np.log(np.maximum(left, 1e-300)), 0.0)
        return ((1 - self.a) * sigma + self.a * wrong) * length[:, None]


@fault
class AbsorptionDepth(Rules):  # P22: along the normal
    def absorbed(self, sigma, length, d, n, forward, ends_in_reflection):
        cos = np.where(np.isnan(n[:, 0]), 1.0, np.abs(dot(d, np.nan_to_num(n))))
        return sigma * (length * cos**self.a)[:, None]


@fault
class AbsorptionViewDepth(Rules):  # P22: along the camera's axis
    def absorbed(self, sigma, length, d, n, forward, ends_in_reflection):
        return sigma * (length * np.abs(d @ forward) ** self.a)[:, None]


@fault
class AbsorptionScaled(Rules):  # 1 is right
    def absorbed(self, sigma, length, d, n, forward, ends_in_reflection):
        return self.a * sigma * length[:, None]


@fault
class AbsorptionLegs(Rules):
    def absorbed(self, sigma, length, d, n, forward, ends_in_reflection):
        return sigma * length[:, None] * (0.0 if ends_in_reflection else 1.0)


# --- cameras and films ----------------------------------------------------------------------------


def through(camera, width, height, x, y):
    """Rays through the places (x, y) of the film, in pixels."""
    k = camera.get("tan_half_fov_x", 0)
    right, up, forward, origin = (
        np.array(camera[key]) for key in ("right", "up", "forward", "origin")
    )
    across, down = 2 * x / width - 1, (1 - 2 * y / height) * height / width
    aside = across[:, None] * right + down[:, None] * up
    if camera["type"] == "perspective":
        return np.broadcast_to(origin, aside.shape), unit(forward + k * aside)
    return origin + camera["width"] / 2 * aside, np.broadcast_to(forward, aside.shape)


def centres(width, height):
    i, j = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return i.ravel(), j.ravel()


@fault
class PixelShift(Rules):  # P25
    def camera_rays(self, camera, width, height):
        x, y = centres(width, height)
        return through(camera, width, height, x + self.a, y)


@fault
class LastPixel(Rules):  # P26
    def camera_rays(self, camera, width, height):
        x, y = centres(width, height)
        a = self.a
        return through(camera, width, height, x * width / (width - a), y * height / (height - a))


@fault
class FovOfPortrait(Rules):  # P27: wrong only where the film is higher than wide
    def camera_rays(self, camera, width, height):
        x, y = centres(width, height)
        scale = (width / height) ** self.a if width < height else 1.0
        x, y = width / 2 + scale * (x - width / 2), height / 2 + scale * (y - height / 2)
        return through(camera, width, height, x, y)


@fault
class FovOfHeight(Rules):  # for the height on every film
    def camera_rays(self, camera, width, height):
        x, y = centres(width, height)
        scale = width / height
        x, y = width / 2 + scale * (x - width / 2), height / 2 + scale * (y - height / 2)
        return through(camera, width, height, x, y)


@fault
class Mirrored(Rules):
    def shown(self, image):
        return image[:, ::-1]


@fault
class UpsideDown(Rules):
    def shown(self, image):
        return image[::-1]


@fault
class Rotated(Rules):
    def shown(self, image):
        return image[::-1, ::-1]


@fault
class Gamma(Rules):  # 1 is right
    def shown(self, image):
        return np.maximum(image, 0) ** (1 / self.a)


@fault
class Brighter(Rules):  # 1 is right
    def shown(self, image):
        return self.a * image
