"""Causes in the camera: other rays than those through the centres of the pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.diagnosis.hypothesis import Change, Fitted, Hypothesis, Values, plus_minus, says
from harness.diagnosis.worlds import World
from harness.expected import Float
from harness.renderers.base import Rays
from harness.scene.resolved import Orthographic


def _looking(world: World, x: Float, y: Float) -> World:
    """The world with rays through (x, y) of the film, in pixels from its top left."""
    camera, film = world.scene.camera, world.scene.film
    across = 2 * x / film.width - 1
    down = (1 - 2 * y / film.height) * film.height / film.width
    right, up, forward = (np.array(v) for v in (camera.right, camera.up, camera.forward))
    aside = across[:, None] * right + down[:, None] * up
    if isinstance(camera, Orthographic):
        origins = np.array(camera.origin) + camera.width / 2 * aside
        return replace(world, rays=Rays(origins, np.broadcast_to(forward, origins.shape)))
    directions = forward + camera.tan_half_fov_x * aside
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return replace(world, rays=Rays(world.setting.rays.origins, directions))


def _centres(world: World) -> tuple[Float, Float]:
    row, column = np.divmod(world.setting.pixel, world.scene.film.width)
    return np.asarray(column + 0.5, np.float64), np.asarray(row + 0.5, np.float64)


def _shifted(world: World, a: Values) -> World:
    x, y = _centres(world)
    return _looking(world, x + a[0], y + a[1])


def _scaled(world: World, a: Values) -> World:
    film = world.scene.film
    x, y = _centres(world)
    return _looking(
        world, film.width / 2 + a[0] * (x - film.width / 2),
        film.height / 2 + a[0] * (y - film.height / 2),
    )  # fmt: skip


def _by_height(world: World, a: Values) -> World:
    """The field of view that is meant for the width is taken for the height."""
    film = world.scene.film
    return _scaled(world, (float(np.float64(film.width / film.height) ** a[0]),))


def _portrait(world: World) -> bool:
    return world.scene.film.width < world.scene.film.height


def _landscape(world: World) -> bool:
    return world.scene.film.width > world.scene.film.height


def _says_axis(fit: Fitted) -> str:
    if fit.near(1):
        return "takes the field of view along the film's height instead of its width"
    return f"scales the field of view by width / height to the power {fit}"


def _stretched(world: World, a: Values) -> World:
    """Pixels are counted as if there were a[0] fewer in each direction."""
    film = world.scene.film
    x, y = _centres(world)
    return _looking(
        world,
        x * film.width / (film.width - a[0]),
        y * film.height / max(film.height - a[0], 1e-3),
    )


def _mirrored(x_too: bool, y_too: bool) -> Change:
    def world(world: World, _: Values) -> World:
        film = world.scene.film
        x, y = _centres(world)
        return _looking(world, film.width - x if x_too else x, film.height - y if y_too else y)

    return world


def _says_shift(fit: Fitted) -> str:
    (dx, dy), (ex, ey) = fit.values, fit.errors
    half = any(abs(abs(d) - 0.5) < 0.02 for d in (dx, dy))
    which = " (half a pixel)" if half else ""
    return (
        f"looks {plus_minus(dx, ex)} pixels to the right and {plus_minus(dy, ey)} down of each "
        f"pixel's centre{which}"
    )


SEEING = (
    Hypothesis("mirrored-x", _mirrored(True, False), says("mirrors its image in x")),
    Hypothesis("mirrored-y", _mirrored(False, True), says("mirrors its image in y")),
    Hypothesis("rotated-180", _mirrored(True, True), says("turns its image by 180 degrees")),
    Hypothesis(
        "pixel-shift", _shifted, _says_shift,
        ((0.5, 0.5), (-0.5, -0.5), (0.5, 0.0), (0.0, 0.5), (0.01, 0.0)), "shift", "pixels",
    ),
    Hypothesis(
        "fov-axis", _by_height, _says_axis, ((1.0,), (0.1,)), "power of the aspect",
        applies=_portrait,
    ),
    Hypothesis(
        "fov-axis-landscape", _by_height, _says_axis, ((1.0,), (0.1,)), "power of the aspect",
        applies=_landscape,
    ),
    Hypothesis(
        "last-pixel", _stretched,
        lambda f: "divides by the number of pixels less one" if f.near(1)
        else f"counts {f} pixels too few across the film",
        ((1.0,), (0.05,)), "pixels",
    ),
    Hypothesis(
        "field-of-view", _scaled,
        lambda f: f"shows {f} times the field that it should", ((1.01,), (0.99,), (1.5,), (0.67,)),
        "factor",
    ),
)  # fmt: skip
