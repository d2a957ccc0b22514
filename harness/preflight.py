"""Calibration: is a renderer's camera, scale and encoding what the translator believes?

Before any score counts, each renderer shows a chart without glass. What differs from the chart's
closed form is named in words (mirrored, shifted by half a pixel, gamma encoded, …), and what
remains is the renderer's own resolution, from which every later tolerance is derived.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harness.camera import primary_rays
from harness.expected import Float
from harness.probe.decode import decode, finest_cells
from harness.probe.scenes import AMPLITUDE, AXES, code_scene
from harness.renderers.base import Capability, Image, Renderer, RenderSettings
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

# The chart's brightest radiance is 1, so that its quantum is that of a scene of radiance 1.
LOW, HIGH, MIDDLE = 0.1, 1.0, 0.5
# The weakest light a probe path is expected to leave; codes are made as fine as it allows.
WEAKEST = 0.3
FINEST = 4096
FLOAT32 = float(np.finfo(np.float32).eps)
FLOAT64 = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Preflight:
    """What calibration found.

    `quantum` bounds the error of a radiance value, `cells` is the finest usable position code,
    `position_error` the largest error of a decoded position relative to the plane's size,
    `epsilon` the relative precision of the arithmetic. `findings` is empty where all is well.
    """

    quantum: float
    cells: int
    position_error: float
    epsilon: float
    noisy: bool
    findings: tuple[str, ...] = ()

    @property
    def code_quantum(self) -> float:
        """Bound on the error of a code's channels: quantum, and the renderer's own evaluation.

        A coordinate u and the product cells * u are each rounded once, which shows in the fine
        channel as cells * epsilon: the same as a quantum of epsilon in the coarse one.
        """
        return self.quantum + 2 * self.epsilon

    def facts(self) -> dict[str, float | int | str]:
        """For the record."""
        return {
            "quantum": self.quantum,
            "code_cells": self.cells,
            "position_resolution": self.position_error,
            "epsilon": self.epsilon,
        }


def chart(width: int = 96, height: int = 64) -> ResolvedScene:
    """The chart's scene without its surface: nothing in it is symmetric, so nothing hides."""
    forward = np.array([0.0, 0.0, -1.0])
    camera = Perspective(
        origin=(0.3, -0.2, 5.0), right=(1, 0, 0), up=(0, 1, 0), forward=tuple(forward),
        tan_half_fov_x=0.6,
    )  # fmt: skip
    return ResolvedScene(
        film=Film(width=width, height=height),
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


def true_coordinates(scene: ResolvedScene) -> tuple[Float, Float]:
    """(u, v) of the chart, each (H, W), where the pixels look."""
    rays, rectangle = primary_rays(scene), plane()
    t = (rectangle.frame.origin[2] - rays.origins[:, 2]) / rays.directions[:, 2]
    point = rays.origins + t[:, None] * rays.directions - np.array(rectangle.frame.origin)
    shape = (scene.film.height, scene.film.width)
    u, v = (point[:, k] / rectangle.size[k] + 0.5 for k in range(2))
    return u.reshape(shape), v.reshape(shape)


def preflight(renderer: Renderer, settings: RenderSettings) -> Preflight:
    """Calibrates `renderer`. Raises RendererError where it does not render at all."""
    noisy = Capability.PIXEL_CENTRES not in renderer.capabilities
    epsilon = FLOAT64 if Capability.DOUBLE in renderer.capabilities else FLOAT32
    images = {axis: renderer.render(ramp_scene(axis), settings) for axis in AXES}
    findings = examine(images)
    if findings:
        return Preflight(np.nan, 1, np.nan, epsilon, noisy, findings)
    quantum = _quantum(images, noisy)
    cells = finest_cells(quantum + 2 * epsilon, WEAKEST, FINEST)
    codes = {
        axis: renderer.render(code_scene(chart(), plane(), axis, cells, ""), settings)
        for axis in AXES
    }
    if noisy:
        # Codes are sampled at pixel centres even where pictures are not: the constant channel of
        # a bare plane tells how exact a radiance is.
        level = np.concatenate([codes[axis].pixels[..., 2].ravel() for axis in AXES])
        quantum = max(1.01 * float(np.abs(level - AMPLITUDE).max()), FLOAT32)
    position_error = 0.0
    for axis, true in zip(AXES, true_coordinates(chart()), strict=True):
        decoded = decode(codes[axis].pixels, cells, AMPLITUDE, quantum + 2 * epsilon)
        error = np.abs(decoded.coordinate - true.ravel())
        if np.isnan(error).any():
            lost = f"{int(np.isnan(error).sum())} of {error.size} pixels of a bare position code"
            return Preflight(quantum, cells, np.nan, epsilon, noisy, (f"{lost} do not decode",))
        position_error = max(position_error, float(error.max()))
    if position_error > 0.5 / chart().film.width:
        findings = (f"position codes are off by {position_error:.2g} of the plane",)
    return Preflight(quantum, cells, position_error, epsilon, noisy, findings)


def _quantum(images: dict[str, Image], noisy: bool) -> float:
    """Largest error of a value of the chart.

    The largest of N errors spread evenly up to a bound falls short of it by 1/N of it; 1% covers
    that for the chart's 36,864 values. A renderer of floats has at least their rounding.
    """
    if noisy:
        return FLOAT32
    worst = max(
        float(np.abs(images[axis].pixels.astype(np.float64) - _true_ramp(axis)).max())
        for axis in AXES
    )
    return max(1.01 * worst, FLOAT32)


def _true_ramp(axis: str) -> Float:
    u, v = true_coordinates(chart())
    c = u if axis == "u" else v
    rise = LOW + (HIGH - LOW) * c
    return np.stack([rise, LOW + HIGH - rise, np.full_like(rise, MIDDLE)], axis=-1)


# --- what is wrong, in words ----------------------------------------------------------------------


def examine(images: dict[str, Image]) -> tuple[str, ...]:
    """Findings about the two ramp images, keyed by axis; empty where they match the chart."""
    film = chart().film
    for axis in AXES:
        pixels = images[axis].pixels
        if pixels.shape != (film.height, film.width, 3):
            return (f"image has shape {pixels.shape}, expected {(film.height, film.width, 3)}",)
        if not np.isfinite(pixels).all():
            return ("image holds values that are not finite",)
    values = {axis: images[axis].pixels.astype(np.float64) for axis in AXES}
    findings, linear = _encoding(values)
    return (*findings, *_geometry(linear))


def srgb_decode(value: Float) -> Float:
    """IEC 61966-2-1."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def _encoding(values: dict[str, Float]) -> tuple[tuple[str, ...], dict[str, Float]]:
    """Finds the encoding under which blue is constant and red + green adds up, and undoes it."""
    pair = np.stack([values[axis] for axis in AXES])
    blue = float(np.median(pair[..., 2]))
    if blue <= 1e-3:
        return ("the chart is black: an emitter may be seen from behind",), values

    def misfit(decoded: Float) -> float:
        total = decoded[..., 0] + decoded[..., 1]
        return float(
            np.median(np.abs(decoded[..., 2] - MIDDLE)) + np.median(np.abs(total - LOW - HIGH))
        )

    if misfit(pair) < 0.01:
        return (), values
    candidates = {
        "sRGB-encoded": srgb_decode(pair),
        "gamma-encoded with 2.2": np.clip(pair, 0, None) ** 2.2,
        "gamma-encoded with 1.8": np.clip(pair, 0, None) ** 1.8,
        "decoded twice, as if it had been sRGB": _srgb_encode(pair),
        f"scaled: radiance is {blue / MIDDLE:.4g} times what it should be": pair * MIDDLE / blue,
        "given as bytes: divide by 255": pair / 255,
    }
    if float(np.quantile(pair, 0.999) - np.quantile(pair, 0.9)) < 1e-6:
        return (f"clipped at {pair.max():.4g}",), values
    name, decoded = min(candidates.items(), key=lambda item: misfit(item[1]))
    if misfit(decoded) > 0.01:
        return (f"radiance is wrong: mid-grey 0.5 is {blue:.4g}, by no known encoding",), values
    return (f"image is {name}",), dict(zip(AXES, decoded, strict=True))


def _srgb_encode(value: Float) -> Float:
    v = np.clip(value, 0, None)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)


def _geometry(values: dict[str, Float]) -> tuple[str, ...]:
    """Fits u and v over the pixel grid: a plane chart before a pinhole is affine in pixels."""
    film = chart().film
    true = dict(zip(AXES, true_coordinates(chart()), strict=True))
    measured = {axis: (values[axis][..., 0] - LOW) / (HIGH - LOW) for axis in AXES}
    (ux, uy, u0), (vx, vy, v0) = (_affine(measured[axis]) for axis in AXES)
    (tx, _, t0), (_, sy, s0) = (_affine(true[axis]) for axis in AXES)
    if abs(ux) < 0.2 * abs(uy) and abs(vy) < 0.2 * abs(vx):
        return ("image is rotated by 90 degrees or transposed",)
    findings = []
    if ux < 0 and vy * sy < 0:
        return ("image is rotated by 180 degrees",)
    if ux < 0:
        return ("image is mirrored in x",)
    if vy * sy < 0:
        return ("image is mirrored in y (rows run from the bottom)",)
    scale_x, scale_y = ux / tx, vy / sy
    shift_slack, scale_slack = _slack(measured, true)
    aspect = film.height / film.width
    if abs(scale_x - 1) > scale_slack and abs(scale_x - scale_y) < scale_slack:
        for name, factor in (("vertical", 1 / aspect), ("larger", 1.0), ("smaller", 1 / aspect)):
            if abs(scale_x - factor) < 0.01:
                return (f"field of view is taken along the {name} axis instead of x",)
        return (f"field of view is off: the image shows {scale_x:.4f} times the width it should",)
    if abs(scale_x - scale_y) > scale_slack:
        findings.append(f"aspect is wrong: x is scaled by {scale_x:.4f}, y by {scale_y:.4f}")
    center_x, center_y = (film.width - 1) / 2, (film.height - 1) / 2
    shift_x = (ux * center_x + uy * center_y + u0 - tx * center_x - t0) / tx
    shift_y = (vx * center_x + vy * center_y + v0 - sy * center_y - s0) / sy
    if max(abs(shift_x), abs(shift_y)) > shift_slack:
        half = " (half a pixel)" if max(abs(shift_x), abs(shift_y)) < 0.75 else ""
        findings.append(
            f"image is shifted by ({-shift_x:+.3f}, {-shift_y:+.3f}) pixels{half}: "
            "rays must go through pixel centres"
        )
    residual = measured["u"] - true["u"]
    if not findings and float(np.median(np.abs(residual - np.median(residual)))) > 0.01:
        findings.append("image is distorted: the chart is not where a pinhole shows it")
    return tuple(findings)


def _slack(measured: dict[str, Float], true: dict[str, Float]) -> tuple[float, float]:
    """Largest shift in pixels, and relative scale, that the image's coarseness can feign.

    Never less than 0.02 pixels and 0.3%. Pixels of a column are rounded alike, so a fit over W
    columns of rms residual r knows a shift to r / slope / sqrt(W) pixels and a relative scale to
    sqrt(12) / W of that; five standard errors are allowed.
    """
    errors = []
    for axis in AXES:
        height, width = true[axis].shape
        y, x = np.mgrid[:height, :width]
        a, b, c = _affine(measured[axis])
        residual = float(np.std(measured[axis] - (a * x + b * y + c)))
        slope = max(abs(a), abs(b))
        errors.append(residual / max(slope, 1e-12) / np.sqrt(min(width, height)))
    shift = 5 * float(max(errors))
    film = chart().film
    scale = shift * np.sqrt(12) / min(film.width, film.height)
    return max(0.02, shift), max(0.003, float(scale))


def _affine(values: Float) -> tuple[float, float, float]:
    """Coefficients of x, y and 1 in the least-squares fit over the pixel grid."""
    height, width = values.shape
    y, x = np.mgrid[:height, :width]
    design = np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])
    a, b, c = np.linalg.lstsq(design, values.ravel(), rcond=None)[0]
    return float(a), float(b), float(c)
