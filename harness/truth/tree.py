"""The truth of all paths at once: each ray becomes two at every interface, in closed form.

Where `harness.truth.paths` follows one stated path, this follows the whole tree that double
recursion makes, branch by branch, for many rays at a time. It says which other paths share a pixel,
how much light all paths together bring, and what nature would have made of it.

*Nature* is polarised. Natural light is two independent waves, polarised across each other; each is
split into its parts along and across every plane of incidence, and those have Fresnel coefficients
of their own (M. Born and E. Wolf, Principles of Optics, 7th ed., section 1.5.2; after total
internal reflection they are complex, section 1.5.4). A renderer that averages the two at every
interface forgets what the first one did to the light, and is wrong behind the second.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float, cross, fresnel, lengths, reflect, refract
from harness.renderers.base import Rays, Status
from harness.scene.resolved import Rectangle
from harness.truth.paths import Boundary, ClosedForm

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Branch:
    """Those k of the m rays that took `path`, after its last interface.

    `rows` (k,) says which. `weight` (k,) is the product of unpolarised Fresnel factors, `natural`
    (k,) that of polarised light, NaN where nobody asked for it, `absorbed` (k, 3) the optical depth
    so far. `certain` (k,) are those that were reflected nowhere but where all light is. The next
    interface is `ahead` (k,) away, infinite where there is none.
    """

    path: str
    rows: NDArray[np.intp]
    origin: Float
    direction: Float
    medium: NDArray[np.intp]
    weight: Float
    natural: Float
    absorbed: Float
    certain: NDArray[np.bool_]
    ahead: Float


@dataclass(frozen=True)
class _Front:
    """The state of the rays of one branch between two interfaces.

    `field` (k, 2, 3) holds the electric fields of two waves of unit power, polarised across each
    other, in amplitudes whose square is power per beam; it is empty where nobody asked for them.
    """

    path: str
    rows: NDArray[np.intp]
    o: Float
    d: Float
    inside: NDArray[np.bool_]
    medium: NDArray[np.intp]
    weight: Float
    absorbed: Float
    certain: NDArray[np.bool_]
    field: Complex

    def take(self, keep: NDArray[np.bool_]) -> _Front:
        """Only the rays `keep` (k,)."""
        if keep.all():
            return self
        return _Front(
            self.path, self.rows[keep], self.o[keep], self.d[keep], self.inside[:, keep],
            self.medium[keep], self.weight[keep], self.absorbed[keep], self.certain[keep],
            self.field[keep] if len(self.field) else self.field,
        )  # fmt: skip

    def natural(self) -> Float:
        """(k,) the power of both waves, NaN where there are none."""
        if not len(self.field):
            return np.full(len(self.rows), np.nan)
        power = np.einsum("kij,kij->k", self.field, self.field.conj()).real / 2
        return np.asarray(power)


def branches(
    form: ClosedForm,
    rays: Rays,
    depth: int,
    min_weight: float = 0.0,
    along: str | None = None,
    natural: bool = False,
) -> Iterator[Branch]:
    """All branches of at most `depth` segments and at least `min_weight`, depth first.

    With `along`, only those that start as it does. `natural` asks for the weight of polarised
    light, which is half the work.
    """
    inside = form.enclosed(rays)
    m = len(rays.origins)
    start = _Front(
        "", np.arange(m), rays.origins, rays.directions, inside,
        np.full(m, form.scene.camera.medium, np.intp), np.ones(m), np.zeros((m, 3)),
        np.ones(m, bool), _two_waves(rays.directions if natural else rays.directions[:0]),
    )  # fmt: skip
    waiting = [start]
    while waiting:
        front = waiting.pop()
        met = form.next_interface(front.o, front.d, front.inside)
        yield Branch(
            front.path, front.rows, front.o, front.d, front.medium, front.weight, front.natural(),
            front.absorbed, front.certain, met.t,
        )  # fmt: skip
        goes_on = np.isfinite(met.t)
        if len(front.path) + 1 >= depth or not goes_on.any():
            continue
        met = Boundary(
            met.t[goes_on], met.n[goes_on], met.beyond[goes_on],
            met.before[:, goes_on], met.behind[:, goes_on],
        )  # fmt: skip
        for child in _split(form, front.take(goes_on), met):
            child = child.take(child.weight > min_weight) if min_weight else child
            if len(child.rows) and (along is None or along.startswith(child.path)):
                waiting.append(child)


def _split(form: ClosedForm, front: _Front, met: Boundary) -> tuple[_Front, _Front]:
    """Both rays that each ray becomes at its interface; one where there is total reflection."""
    ior = np.array([medium.ior for medium in form.scene.media])
    sigma = np.array([medium.absorption for medium in form.scene.media])
    ior_i, ior_t = ior[front.medium], ior[met.beyond]
    o = front.o + met.t[:, None] * front.d
    absorbed = front.absorbed + met.t[:, None] * sigma[front.medium]
    cos_i = np.clip(-np.einsum("ij,ij->i", front.d, met.n), 0, 1)
    reflectance = fresnel(cos_i, ior_i, ior_t)
    bent, total = refract(front.d, met.n, ior_i, ior_t)
    back = reflect(front.d, met.n)
    waves = len(front.field) > 0
    r, t = _amplitudes(cos_i, ior_i, ior_t) if waves else (front.field, front.field)

    def child(letter: str, d: Float, weight: Float, amplitude: Complex) -> _Front:
        crosses = letter == "T"
        field = _turned(front.field, front.d, d, met.n, amplitude) if waves else front.field
        return _Front(
            front.path + letter, front.rows, o, d,
            met.behind if crosses else met.before, met.beyond if crosses else front.medium,
            front.weight * weight, absorbed,
            front.certain if crosses else front.certain & total, field,
        )  # fmt: skip

    passed = child("T", bent, 1 - reflectance, t).take(~total)
    return child("R", back, reflectance, r), passed


def _amplitudes(cos_i: Float, ior_i: Float, ior_t: Float) -> tuple[Complex, Complex]:
    """(k, 2) Fresnel coefficients of s and p, reflected and transmitted, as roots of power.

    Born & Wolf, 1.5.2, equations 20 and 21; transmitted ones times sqrt(n_t cos_t / n_i cos_i), so
    that their squares are T. cos_t is imaginary under total internal reflection.
    """
    eta = ior_i / ior_t
    # Negative where there is total reflection; the root is i times that of its size.
    cos2_t = (1 - eta) * (1 + eta) + (eta * cos_i) ** 2
    cos_t = np.sqrt(cos2_t.astype(np.complex128))
    r_s = (ior_i * cos_i - ior_t * cos_t) / (ior_i * cos_i + ior_t * cos_t)
    r_p = (ior_t * cos_i - ior_i * cos_t) / (ior_t * cos_i + ior_i * cos_t)
    power = np.sqrt(np.maximum(1 - np.abs(np.stack([r_s, r_p], axis=1)) ** 2, 0.0))
    return np.stack([r_s, r_p], axis=1), power.astype(np.complex128)


def _turned(field: Complex, d: Float, out: Float, n: Float, amplitude: Complex) -> Complex:
    """The fields after an interface: their s parts stay along s, their p parts turn with the ray.

    s = d x n, p = s x d. At normal incidence any s across the ray will do.
    """
    s = cross(d, n)
    length = lengths(s)[:, None]
    s /= np.where(length > 0, length, 1.0)
    if (head_on := ~(length[:, 0] > 1e-12)).any():
        s[head_on] = _across(d[head_on])
    s -= np.einsum("ij,ij->i", s, out)[:, None] * out
    s /= lengths(s)[:, None]
    along_s = np.einsum("kij,kj->ki", field, s) * amplitude[:, :1]
    along_p = np.einsum("kij,kj->ki", field, cross(s, d)) * amplitude[:, 1:]
    turned = along_s[:, :, None] * s[:, None] + along_p[:, :, None] * cross(s, out)[:, None]
    return np.asarray(turned, np.complex128)


def _across(d: Float) -> Float:
    """A unit vector across each direction."""
    helper = np.where(np.abs(d[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]])
    e = cross(d, helper)
    return np.asarray(e / lengths(e)[:, None])


def _two_waves(d: Float) -> Complex:
    e = _across(d)
    return np.stack([e, cross(d, e)], axis=1).astype(np.complex128)


# --- what the tree says ---------------------------------------------------------------------------


def natural_weight(form: ClosedForm, rays: Rays, path: str) -> Float:
    """(m,) the weight of `path` for natural, hence polarised, light; NaN where nothing takes it."""
    weight = np.full(len(rays.origins), np.nan)
    for branch in branches(form, rays, len(path) + 1, along=path, natural=True):
        if branch.path == path:
            weight[branch.rows] = branch.natural
    return weight


@dataclass(frozen=True)
class AllLight:
    """What all paths bring together: `level` (m, 3) by a renderer's unpolarised Fresnel factors,
    `natural` (m, 3) by nature's, NaN where it was not asked for, and `cut` (m,) the weight of paths
    left out: too weak, too long.
    `closest` (m,) is the shortest way between two interfaces on any of them. `abroad` tells whether
    any of the light started in another medium than the camera's.
    """

    level: Float
    natural: Float
    cut: Float
    closest: Float
    abroad: bool


def light_on(
    form: ClosedForm,
    rays: Rays,
    plane: Rectangle,
    depth: int,
    min_weight: float,
    n2: bool = False,
    natural: bool = True,
) -> AllLight:
    """The radiance that rays see of `plane` shining with radiance 1, by all paths together.

    `n2`: radiance scales with the square of the index of the medium that it is in. `natural` asks
    for nature's light, too, which is half the work.
    """
    ior = np.array([medium.ior for medium in form.scene.media])
    per_medium = (ior[form.scene.camera.medium] / ior) ** 2 if n2 else np.ones(len(ior))
    m = len(rays.origins)
    level, polarised, followed = np.zeros((m, 3)), np.zeros((m, 3)), np.zeros(m)
    closest, abroad = np.full(m, np.inf), False
    for branch in branches(form, rays, depth, min_weight, natural=natural):
        if branch.path:
            closest[branch.rows] = np.minimum(closest[branch.rows], branch.ahead)
        landing = form.meet(
            plane, branch.origin, branch.direction, branch.ahead, branch.medium, branch.absorbed
        )
        on = landing.status == Status.HIT
        ends = on | ~np.isfinite(branch.ahead)
        rows, medium = branch.rows[on], branch.medium[on]
        abroad = abroad or bool((medium != form.scene.camera.medium).any())
        left = landing.transmission[on] * per_medium[medium][:, None]
        level[rows] += branch.weight[on, None] * left
        if natural:
            polarised[rows] += branch.natural[on, None] * left
        followed[branch.rows[ends]] += branch.weight[ends]
    polarised = polarised if natural else np.full((m, 3), np.nan)
    return AllLight(level, polarised, 1 - followed, closest, abroad)


def light_around(
    form: ClosedForm, rays: Rays, depth: int, min_weight: float, natural: bool = True
) -> AllLight:
    """The same where everything around shines with radiance 1: a white furnace."""
    m = len(rays.origins)
    level, polarised, followed = np.zeros((m, 3)), np.zeros((m, 3)), np.zeros(m)
    closest, abroad = np.full(m, np.inf), False
    for branch in branches(form, rays, depth, min_weight, natural=natural):
        if branch.path:
            closest[branch.rows] = np.minimum(closest[branch.rows], branch.ahead)
        leaves = ~np.isfinite(branch.ahead)
        rows, left = branch.rows[leaves], np.exp(-branch.absorbed[leaves])
        level[rows] += branch.weight[leaves, None] * left
        if natural:
            polarised[rows] += branch.natural[leaves, None] * left
        followed[rows] += branch.weight[leaves]
        abroad = abroad or bool((branch.medium[leaves] != form.scene.camera.medium).any())
    polarised = polarised if natural else np.full((m, 3), np.nan)
    return AllLight(level, polarised, 1 - followed, closest, abroad)
