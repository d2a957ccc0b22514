"""Rays of Mitsuba's own camera through pixel centres.

Imported only in the process that hosts Mitsuba, after an LLVM variant was chosen.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from harness.scene.resolved import ResolvedScene
from harness.translate.mitsuba import NEAR_CLIP


def centre_rays(live: Any, scene: ResolvedScene) -> Any:
    """The rays of all pixels, row by row from the top left, starting at the camera itself.

    Mitsuba starts them at its near plane. They are taken back to the camera, since what is
    absorbed on the way is part of the image.
    """
    film = scene.film
    width, height = dr.opaque(mi.UInt32, film.width), dr.opaque(mi.UInt32, film.height)
    pixel = dr.arange(mi.UInt32, film.width * film.height)
    x, y = mi.Float(pixel % width) + 0.5, mi.Float(pixel // width) + 0.5
    sensor = live.sensors()[0]
    position = mi.Point2f(x / mi.Float(width), y / mi.Float(height))
    rays, _ = sensor.sample_ray(0.0, 0.5, position, mi.Point2f(0.5))
    forward = mi.Vector3f(*scene.camera.forward)
    rays.o -= rays.d * (NEAR_CLIP / dr.dot(rays.d, forward))
    dr.eval(rays)
    return rays
