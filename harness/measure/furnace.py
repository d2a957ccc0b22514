"""A white furnace: lossless glass in a world that shines alike everywhere cannot be seen.

Conservation of energy is the truth here, R + T = 1 at every interface, so no path has to be known.
The tree of closed forms says what a recursion of limited depth may leave out, pixel by pixel.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from harness.measure.comparison import FREE_OF_INDEX, Comparison, Unmeasurable
from harness.measure.images import Pixels
from harness.measure.precision import Precision
from harness.measure.probe_truth import ROUNDINGS
from harness.measure.statistics import Noise, binned
from harness.scene.resolved import Panorama, ResolvedScene
from harness.truth.camera import primary_rays
from harness.truth.paths import ClosedForm
from harness.truth.tree import AllLight, light_around

# Renderers in float32 start a ray as far from the surface that it leaves; shorter ways they lose.
STEP_OFF = 2e-4
FLOAT32 = float(np.finfo(np.float32).eps)


def is_furnace(scene: ResolvedScene) -> bool:
    """Whether the scene is nothing but solids before a background."""
    alike = not isinstance(scene.background, Panorama)
    return alike and bool(scene.solids) and not scene.surfaces and not scene.lights


@lru_cache(maxsize=1)  # all renderers of a case are held against it, one after the other
def _furnace(scene: ResolvedScene) -> AllLight:
    limits = scene.transport
    rays, depth, least = primary_rays(scene), limits.max_depth, limits.min_weight
    return light_around(ClosedForm(scene), rays, depth, least, natural=False)


def energy(
    scene: ResolvedScene,
    picture: Pixels,
    quantum: float,
    precision: Precision,
    noise: Noise | None,
) -> Comparison:
    """The radiance of every pixel against the background's."""
    if any(any(medium.absorption) for medium in scene.media):
        raise Unmeasurable("a furnace tells nothing of glass that absorbs")
    if not np.isfinite(picture).all():
        raise Unmeasurable("the picture holds values that are not finite")
    true = np.array(scene.background)  # no panorama: see is_furnace
    depth, least = scene.transport.max_depth, scene.transport.min_weight
    light = _furnace(scene)
    measured = picture.reshape(-1, 3).astype(np.float64)
    keep = np.ones(len(measured), bool)
    if precision.arithmetic >= FLOAT32:
        keep = light.closest > STEP_OFF
    if noise is not None:
        # A path that is cut brings nothing, so only pixels in which hardly any is count.
        rows = np.flatnonzero(keep & (light.cut < 1e-4))
        comparison = binned(measured, np.broadcast_to(true, measured.shape), rows, noise)
        comparison.detail.update(FREE_OF_INDEX)
        return comparison
    # Paths of the least weight that is followed are followed by one and not by another.
    rounding = ROUNDINGS * depth * precision.arithmetic / 2
    tolerance = (quantum + np.maximum(light.cut, 0) + 2 * least * depth + rounding) * true.max()
    error = np.abs(measured - true).max(axis=1)
    k = int(np.argmax(np.where(keep, error / tolerance, -1)))
    channel = int(np.argmax(np.abs(measured[k] - true)))
    width = scene.film.width
    return Comparison(
        float(measured[k, channel]), float(true[channel]), float(tolerance[k]),
        bool(np.all(error[keep] <= tolerance[keep])),
        "quantum of the image + what the limit of depth may cut in this pixel + weights too small "
        "to be followed + 8 eps per segment",
        detail={"max": float(error[keep].max()), "rms": float(np.sqrt((error[keep] ** 2).mean())),
                "excluded_close": int((~keep).sum()), "largest_cut": float(light.cut[keep].max()),
                "worst_pixel_x": k % width, "worst_pixel_y": k // width, **FREE_OF_INDEX},
    )  # fmt: skip
