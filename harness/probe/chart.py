"""The chart that calibrates renderers, and what is wrong with one that shows it wrongly, in words.

Two images: along u and along v of a plane, red rises and green falls while blue is constant.
Nothing in it is symmetric, so a wrong encoding, camera or orientation each shows in its own way.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float
from harness.probe.scenes import AXES
from harness.renderers.base import Image
from harness.scene.resolved import (
    Emissive,
    Film,
    Frame,
    Medium,
    Perspective,
    Ramp,
    Rectangle,
    ResolvedScene,
    Surface,
    Transport,
)
from harness.truth.camera import primary_rays

Mask = NDArray[np.bool_]

# The chart's brightest radiance is 1, so that its quantum is that of a scene of radiance 1.
LOW, HIGH, MIDDLE = 0.1, 1.0, 0.5
# Below this nothing is lit; the chart's darkest value is a hundred times that.
DARK = 1e-3
# Of values with errors of up to 0.45%, the most that is let through, a median is off by less.
MISFIT = 0.01
# Rows of a pinhole's picture follow the camera's axes. A turn by this much moves corners by more
# than two pixels, which no error of values feigns that is let through.
SKEW = 0.05


def chart() -> ResolvedScene:
    """The chart's scene without its surface: nothing in it is symmetric, so nothing hides."""
    camera = Perspective(
        origin=(0.3, -0.2, 5.0), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1),
        tan_half_fov_x=0.6,
    )  # fmt: skip
    return ResolvedScene(
        film=Film(width=96, height=64),
        camera=camera,
        media=(Medium(name="air", ior=1.0),),
        transport=Transport(max_depth=2, min_weight=0.0),
    )


def plane() -> Rectangle:
    """A little larger than the view, so that its ramps show all values, and off its centre."""
    frame = Frame(origin=(0.5, 0.25, 0.0), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1))
    return Rectangle(frame=frame, size=(6.637, 6.637))


def ramp_scene(axis: str) -> ResolvedScene:
    """Red rises and green falls along `axis`; blue is constant, so an encoding shows itself."""
    ramp = Ramp.model_validate(
        {"start": (LOW, HIGH, MIDDLE), "end": (HIGH, LOW, MIDDLE), "axis": axis}
    )
    surface = Surface(name="chart", shape=plane(), material=Emissive(pattern=ramp))
    return chart().model_copy(update={"surfaces": (surface,)})


def true_coordinates() -> dict[str, Float]:
    """By axis, where on the chart the pixels look, (H, W)."""
    scene, rectangle = chart(), plane()
    rays = primary_rays(scene)
    t = (rectangle.frame.origin[2] - rays.origins[:, 2]) / rays.directions[:, 2]
    point = rays.origins + t[:, None] * rays.directions - np.array(rectangle.frame.origin)
    shape = (scene.film.height, scene.film.width)
    return {
        axis: (point[:, k] / rectangle.size[k] + 0.5).reshape(shape) for k, axis in enumerate(AXES)
    }


def true_ramp(axis: str) -> Float:
    """The image that `ramp_scene(axis)` should give, (H, W, 3)."""
    rise = LOW + (HIGH - LOW) * true_coordinates()[axis]
    return np.stack([rise, LOW + HIGH - rise, np.full_like(rise, MIDDLE)], axis=-1)


# --- what is wrong --------------------------------------------------------------------------------


def examine(images: Mapping[str, Image]) -> tuple[str, ...]:
    """Findings about the two ramp images, by axis; empty where they match the chart."""
    wrong = misshapen(images) or _finite(images)
    if wrong:
        return (wrong,)
    pair = np.stack([images[axis].pixels.astype(np.float64) for axis in AXES])
    unusable = _unusable(pair) or _the_same(pair)
    if unusable:
        return (unusable,)
    encoding, linear = _encoding(pair)
    if linear is None:
        return (encoding,)
    return tuple(filter(None, (encoding, _geometry(linear))))


def misshapen(images: Mapping[str, Image]) -> str:
    """What is wrong with the images' size, or ""."""
    wanted = (chart().film.height, chart().film.width, 3)
    shapes = (image.pixels.shape for image in images.values())
    wrong = next((shape for shape in shapes if shape != wanted), None)
    return f"image has shape {wrong}, expected {wanted}" if wrong else ""


def _finite(images: Mapping[str, Image]) -> str:
    finite = all(np.isfinite(image.pixels).all() for image in images.values())
    return "" if finite else "image holds values that are not finite"


def _unusable(pair: Float) -> str:
    """Why nothing more can be said of the two images (2, H, W, 3), or ""."""
    lit = pair.max(axis=-1) > DARK
    if lit.mean() < 0.05:
        return "the chart is black: an emitter may be seen from behind"
    shown = pair[lit]
    if np.ptp(shown) < 1e-6:
        return f"image shows {shown.max():.4g} everywhere instead of the chart"
    # Of 8-bit values no more than 1 in 200 share the highest one.
    if (shown > shown.max() * (1 - 1e-6)).mean() > 0.02:
        return f"radiance is clipped at {shown.max():.4g}"
    return ""


def _the_same(pair: Float) -> str:
    """Whether both images (2, H, W, 3) show one ramp, or ""."""
    if np.abs(pair[0] - pair[1]).max() > DARK:
        return ""
    return "image does not change with the scene: it may be that of an earlier request"


def srgb_decode(value: Float) -> Float:
    """IEC 61966-2-1."""
    v = np.clip(value, 0, None)
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def srgb_encode(value: Float) -> Float:
    """IEC 61966-2-1."""
    v = np.clip(value, 0, None)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)


def _encoding(pair: Float) -> tuple[str, Float | None]:
    """The encoding under which blue is constant and red + green adds up, and the pair without it.

    "" where there is none; no pair where none is found.
    """
    lit = pair.max(axis=-1) > DARK
    gain = float(np.median(pair[lit][:, 2])) / MIDDLE

    def misfit(decoded: Float) -> float:
        red, green, blue = decoded[lit].T
        return float(np.median(np.abs(blue - MIDDLE)) + np.median(np.abs(red + green - LOW - HIGH)))

    if misfit(pair) < MISFIT:
        return "", pair
    scaled = f"scaled: radiance is {gain:.4g} times what it should be"
    if abs(gain / 255 - 1) < MISFIT:
        scaled = "given as bytes: divide by 255"
    candidates = {
        "sRGB-encoded": srgb_decode(pair),
        "gamma-encoded with 2.2": np.clip(pair, 0, None) ** 2.2,
        "gamma-encoded with 1.8": np.clip(pair, 0, None) ** 1.8,
        "decoded twice, as if it had been sRGB": srgb_encode(pair),
        "given with its channels in the order blue, green, red": pair[..., ::-1],
        scaled: pair / max(gain, DARK),
    }
    name, decoded = min(candidates.items(), key=lambda item: misfit(item[1]))
    if misfit(decoded) > MISFIT:
        return f"radiance is wrong: {MIDDLE} is {gain * MIDDLE:.4g}, by no known encoding", None
    return f"image is {name}", decoded


def _geometry(pair: Float) -> str:
    """What is wrong with the camera, from fits of u and v over the pixel grid, or "".

    A plane chart before a pinhole is affine in pixels. Pixels beside the chart do not count.
    """
    on = np.all(np.abs(pair[..., 2] - MIDDLE) < MIDDLE / 5, axis=0)
    if on.mean() < 0.1:
        return "image is wrong: hardly any pixel shows the chart"
    measured = dict(zip(AXES, (pair[..., 0] - LOW) / (HIGH - LOW), strict=True))
    true = true_coordinates()
    everywhere = np.ones_like(on)
    (ux, uy, u0), (vx, vy, v0) = (affine(measured[axis], on) for axis in AXES)
    (tx, _, t0), (_, sy, s0) = (affine(true[axis], everywhere) for axis in AXES)
    residual = max(_residual(measured[axis], on) for axis in AXES)
    if residual > 0.01:
        return "image is distorted: the chart is not where a pinhole shows it"
    if abs(ux) < 0.2 * abs(uy) and abs(vy) < 0.2 * abs(vx):
        return "image is rotated by 90 degrees or transposed"
    if max(abs(uy / ux), abs(vx / vy)) > SKEW:
        return "image is sheared or turned: its rows and columns are not those of the camera"
    scale_x, scale_y = ux / tx, vy / sy
    if scale_x < 0 and scale_y < 0:
        return "image is rotated by 180 degrees"
    if scale_x < 0:
        return "image is mirrored in x"
    if scale_y < 0:
        return "image is mirrored in y (rows run from the bottom)"
    shift_slack, scale_slack = _slack(residual, min(abs(ux), abs(vy)))
    if abs(scale_x - scale_y) > scale_slack:
        return f"aspect is wrong: x is scaled by {scale_x:.4f}, y by {scale_y:.4f}"
    if abs(scale_x - 1) > scale_slack:
        return _field_of_view(scale_x)
    x, y = (chart().film.width - 1) / 2, (chart().film.height - 1) / 2
    shift_x = (ux * x + uy * y + u0 - tx * x - t0) / tx
    shift_y = (vx * x + vy * y + v0 - sy * y - s0) / sy
    if max(abs(shift_x), abs(shift_y)) > shift_slack:
        return shifted(-shift_x, -shift_y)
    return ""


def _field_of_view(scale: float) -> str:
    aspect = chart().film.height / chart().film.width
    known = {
        1 / aspect: "is taken along the vertical axis instead of x",
        1 / float(np.hypot(1, aspect)): "is taken along the diagonal instead of x",
        aspect: "is scaled by height / width, as if it were given along the vertical axis",
    }
    factor = min(known, key=lambda f: abs(f - scale))
    if abs(factor - scale) < 0.01:
        return f"field of view {known[factor]}"
    return f"field of view is off: the image shows {scale:.4f} times the width it should"


def shifted(dx: float, dy: float) -> str:
    """Says that the image is `dx` pixels too far to the right and `dy` too far down."""
    half = any(abs(abs(d) - 0.5) < 0.05 for d in (dx, dy))
    way = ", ".join(f"{round(d, 4) + 0.0:+.4f}" for d in (dx, dy))
    which = " (half a pixel)" if half else ""
    return f"image is shifted by ({way}) pixels{which}: rays must go through pixel centres"


def _slack(residual: float, slope: float) -> tuple[float, float]:
    """Largest shift in pixels, and relative scale, that the image's coarseness can feign.

    Never less than 0.02 pixels and 0.3%. Pixels of a column are rounded alike, so a fit over W
    columns of rms residual r knows a shift to r / slope / sqrt(W) pixels and a relative scale to
    sqrt(12) / W of that; five standard errors are allowed.
    """
    film = chart().film
    fewest = min(film.width, film.height)
    shift = 5 * residual / max(slope, 1e-12) / np.sqrt(fewest)
    return max(0.02, float(shift)), max(0.003, float(shift * np.sqrt(12) / fewest))


def affine(values: Float, on: Mask) -> tuple[float, float, float]:
    """Coefficients of x, y and 1 in the least-squares fit over the pixels `on` of (H, W)."""
    y, x = np.nonzero(on)
    design = np.column_stack([x, y, np.ones(len(x))])
    a, b, c = np.linalg.lstsq(design, values[on], rcond=None)[0]
    return float(a), float(b), float(c)


def _residual(values: Float, on: Mask) -> float:
    a, b, c = affine(values, on)
    y, x = np.nonzero(on)
    return float(np.std(values[on] - (a * x + b * y + c)))
