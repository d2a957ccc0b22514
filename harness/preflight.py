"""Calibration: is a renderer's camera, scale and encoding what the translator believes?

Before any score counts, each renderer shows a chart without glass. What differs from the chart's
closed form is named in words (mirrored, shifted by half a pixel, gamma encoded, …), and what
remains is the renderer's own resolution, from which every later tolerance is derived.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from harness.expected import Float
from harness.probe.chart import (
    affine,
    chart,
    examine,
    misshapen,
    plane,
    ramp_scene,
    shifted,
    srgb_encode,
    true_coordinates,
    true_ramp,
)
from harness.probe.decode import decode, finest_cells
from harness.probe.scenes import AMPLITUDE, AXES, code_scene
from harness.renderers.base import Capability, Image, Renderer, RenderSettings
from harness.scene.resolved import ResolvedScene

# The weakest light a probe path is expected to leave; codes are made as fine as it allows.
WEAKEST = 0.3
# Odd, so that what is symmetric does not fall on the border between two cells.
FINEST = 4095
# The largest error of a radiance that an honest image can have: half a step of 8 bits where sRGB is
# steepest, and a percent. A renderer that is further off is wrong, not coarse.
SRGB_STEEPEST = 2.4 / 1.055
COARSEST = 1.01 * 0.5 / 255 * SRGB_STEEPEST
FLOAT32 = float(np.finfo(np.float32).eps)
FLOAT64 = float(np.finfo(np.float64).eps)


Render = Callable[[ResolvedScene, RenderSettings], Image]


@dataclass(frozen=True)
class Preflight:
    """What calibration found.

    `quantum` bounds the error of a radiance value, `cells` is the finest usable position code,
    `position_error` the largest error of a decoded position relative to the plane's size,
    `epsilon` the relative precision of the arithmetic. `samples` per pixel choose lobes at random,
    where the renderer does that (then it is `noisy`). With `averages`, position codes come as means
    over pixels, so that only coarse ones can be read. `findings` is empty where all is well.
    """

    quantum: float
    cells: int
    position_error: float
    epsilon: float
    samples: int | None
    findings: tuple[str, ...] = ()
    averages: bool = False

    @property
    def noisy(self) -> bool:
        """Whether the renderer samples."""
        return self.samples is not None

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
            "values": stored_as(self.quantum),
            "noise": f"{self.samples} samples per pixel" if self.samples is not None else "none",
            **({"pixels": "means over their areas"} if self.averages else {}),
        }


# Half a step of the formats that images are stored in, and twice that, where a value between 0 and
# 1 is rounded worst: linear 8 and 16 bits, and half floats just below 1.
FORMATS = {"16 bits": 0.5 / 65535, "half floats": 2.0**-12, "8 bits": 0.5 / 255}


def stored_as(quantum: float) -> str:
    """The format, in words, whose rounding is what a renderer's values are off by."""
    if not np.isfinite(quantum):
        return "unknown"
    if quantum <= 8 * FLOAT32:
        return "floats"
    for name, step in FORMATS.items():
        if step / 1.5 < quantum < 1.5 * step:
            return name
    # sRGB is steeper where it is dark, and flatter where it is bright.
    return "8 bits, not linear" if quantum > FORMATS["8 bits"] / 4 else "of no known format"


def preflight(
    renderer: Renderer, settings: RenderSettings, render: Render | None = None
) -> Preflight:
    """Calibrates `renderer`, by `render` where images may come from elsewhere than itself.

    Raises RendererError where it does not render at all.
    """
    render = render or renderer.render
    noisy = Capability.PIXEL_CENTRES not in renderer.capabilities
    samples = settings.samples if noisy else None
    epsilon = FLOAT64 if Capability.DOUBLE in renderer.capabilities else FLOAT32
    images = {axis: render(ramp_scene(axis), settings) for axis in AXES}
    findings = examine(images)
    if findings:
        return Preflight(np.nan, 1, np.nan, epsilon, samples, findings)
    quantum = FLOAT32 if noisy else _quantum(images)
    cells = finest_cells(quantum + 2 * epsilon, WEAKEST, FINEST)
    codes = {axis: render(code_scene(chart(), plane(), axis, cells, ""), settings) for axis in AXES}
    wrong = misshapen(codes)
    if wrong:
        return Preflight(quantum, cells, np.nan, epsilon, samples, (wrong,))
    if noisy:
        # Codes are sampled at pixel centres even where pictures are not: the constant channel of
        # a bare plane tells how exact a radiance is.
        error = np.max([np.abs(codes[axis].pixels[..., 2] - AMPLITUDE) for axis in AXES], axis=0)
        quantum = max(1.01 * float(error.max()), FLOAT32)
    else:
        error = _chart_error(images)
    if not quantum <= COARSEST:
        return Preflight(quantum, cells, np.nan, epsilon, samples, (_too_coarse(error),))
    position_error, findings = _positions(codes, cells, quantum, epsilon)
    if not np.isnan(position_error):  # all codes could be read
        return Preflight(quantum, cells, position_error, epsilon, samples, findings)
    coarse = {axis: render(code_scene(chart(), plane(), axis, 1, ""), settings) for axis in AXES}
    averaged = _averaged(coarse, quantum, epsilon)
    if averaged is None:
        return Preflight(quantum, cells, position_error, epsilon, samples, findings)
    findings = () if noisy else (AVERAGED,)
    return Preflight(quantum, 1, averaged, epsilon, samples, findings, averages=True)


def _quantum(images: Mapping[str, Image]) -> float:
    """Largest error of a value of the chart.

    The largest of N errors spread evenly up to a bound falls short of it by 1/N of it; 1% covers
    that for the chart's 36,864 values. A renderer of floats has at least their rounding. The steps
    of sRGB and of half floats grow with the value, and the chart's brightest pixels are few: a
    picture whose values are such steps has half of the last one, whatever the chart showed.
    """
    steps = _srgb_steps(images)
    last = 0.5 / steps * SRGB_STEEPEST if steps else 0.0
    if _half_floats(images):
        last = FORMATS["half floats"]
    return max(1.01 * float(_chart_error(images).max()), FLOAT32, last)


def _half_floats(images: Mapping[str, Image]) -> bool:
    """Whether all values are such as half floats hold."""
    return all(
        bool(np.all(image.pixels.astype(np.float16).astype(np.float32) == image.pixels))
        for image in images.values()
    )


def _chart_error(images: Mapping[str, Image]) -> Float:
    """(H, W) how far the pixels of the chart are off, in the worse image and the worst channel."""
    errors = [
        np.abs(images[axis].pixels.astype(np.float64) - true_ramp(axis)).max(axis=-1)
        for axis in AXES
    ]
    return np.asarray(np.max(errors, axis=0))


def _srgb_steps(images: Mapping[str, Image]) -> int | None:
    """255 or 65535 where all values are that many steps of sRGB, as files hold them."""
    codes = srgb_encode(np.stack([images[axis].pixels.astype(np.float64) for axis in AXES]))
    for steps in (255, 65535):
        # Being kept in float32 moves a value of 0.1 or more by less than 0.01 steps.
        if (np.abs(codes * steps - np.round(codes * steps)) < 0.02).all():
            return steps
    return None


def _too_coarse(error: Float) -> str:
    """Says how many pixels are off by more than 8 bits excuse: all over, or in a few places."""
    y, x = np.unravel_index(int(np.nan_to_num(error, nan=np.inf).argmax()), error.shape)
    return (
        f"radiance is off in {int((~(error <= COARSEST / 1.01)).sum())} of {error.size} pixels of "
        f"the chart by more than 8 bits excuse: by {error[y, x]:.3g} at ({x}, {y})"
    )


def _positions(
    codes: Mapping[str, Image], cells: int, quantum: float, epsilon: float
) -> tuple[float, tuple[str, ...]]:
    """The largest error of a decoded position, relative to the plane, and what is wrong."""
    errors: dict[str, Float] = {}
    stray = 0.0
    for axis, true in true_coordinates().items():
        decoded = decode(codes[axis].pixels, cells, AMPLITUDE, quantum + 2 * epsilon)
        error = decoded.coordinate - true.ravel()
        if np.isnan(error).any():
            lost = f"{int(np.isnan(error).sum())} of {error.size} pixels of a bare position code"
            return np.nan, (f"{lost} do not decode",)
        stray = max(stray, float((np.abs(error) - decoded.uncertainty).max()))
        errors[axis] = error.reshape(true.shape)
    largest = max(float(np.abs(error).max()) for error in errors.values())
    # A ray's origin, direction and landing point are rounded a few times each, to coordinates no
    # larger than the plane: 16 eps; but a thousandth of a pixel is nobody's fault.
    if stray > max(16 * epsilon, 1e-3 / chart().film.width):
        return largest, (_displaced(errors),)
    return largest, ()


AVERAGED = (
    "pixels show means over their areas, as anti-aliasing makes them: send one ray through the "
    "centre of each, or do not claim pixel-centres"
)


def _averaged(codes: Mapping[str, Image], quantum: float, epsilon: float) -> float | None:
    """The largest error of codes of one cell where all of them are off by less than half a pixel.

    Such are means over pixels of a code that is linear; with more cells the means of the fine part
    say nothing. None where it is something else that is wrong with them.
    """
    largest = 0.0
    for axis, true in true_coordinates().items():
        decoded = decode(codes[axis].pixels, 1, AMPLITUDE, quantum + 2 * epsilon)
        error = np.abs(decoded.coordinate - true.ravel())
        slope_x, slope_y, _ = affine(true, np.ones_like(true, bool))
        if not (error <= (abs(slope_x) + abs(slope_y)) / 2 + decoded.uncertainty).all():
            return None
        largest = max(largest, float(error.max()))
    return largest


def _displaced(errors: Mapping[str, Float]) -> str:
    """Names a shift of all positions, or else their largest error."""
    film = chart().film
    on = np.ones((film.height, film.width), bool)
    slopes = [affine(true, on)[k] for k, true in enumerate(true_coordinates().values())]
    shift = [float(np.median(e)) / slope for e, slope in zip(errors.values(), slopes, strict=True)]
    left = max(
        float(np.abs(e - np.median(e)).max() / abs(slope))
        for e, slope in zip(errors.values(), slopes, strict=True)
    )
    if left < max(map(abs, shift)) / 4:
        return shifted(-shift[0], -shift[1])
    largest = max(float(np.abs(e).max()) for e in errors.values())
    return f"position codes are off by {largest:.2g} of the plane"
