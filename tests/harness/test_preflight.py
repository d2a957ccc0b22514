"""The preflight passes a renderer that is right, and names what is wrong with one that is not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from harness.expected import Float
from harness.preflight import FINEST, FLOAT32, FLOAT64, Preflight, preflight, stored_as
from harness.probe.chart import chart, srgb_decode, srgb_encode
from harness.renderers.base import Capability, RenderSettings
from harness.scene.resolved import ResolvedScene
from tests.fakes import FakeRenderer
from tests.fakes.student import CAPABILITIES, averaging, student

WIDTH, HEIGHT = chart().film.width, chart().film.height
ASPECT = HEIGHT / WIDTH
Vector = tuple[float, float, float]


def calibrated(renderer: FakeRenderer) -> Preflight:
    return preflight(renderer, RenderSettings())


def findings(renderer: FakeRenderer) -> str:
    return "; ".join(calibrated(renderer).findings)


# --- what is right --------------------------------------------------------------------------------


def test_a_perfect_renderer_passes() -> None:
    found = calibrated(student())
    assert found.findings == ()
    # Its only errors are the roundings to float32 of values below 1 and their own.
    assert found.quantum == FLOAT32
    assert found.epsilon == FLOAT64
    assert not found.noisy
    assert found.cells == FINEST
    # A fine code off by at most 2 quanta over a level of 0.9, in a cell.
    assert found.position_error <= 2 * FLOAT32 / 0.9 / FINEST


def stored_in(bits: int) -> Callable[[Float], Float]:
    steps = 2**bits - 1
    return lambda pixels: np.round(pixels * steps) / steps


def stored_as_srgb(pixels: Float) -> Float:
    """8 bits, encoded by IEC 61966-2-1 and decoded again, as an 8-bit PNG is read."""
    return srgb_decode(np.round(srgb_encode(pixels) * 255) / 255)


@pytest.mark.parametrize(
    ("shows", "least", "most"),
    [
        # Half a step, found from 36,864 values, and a percent more.
        (stored_in(8), 0.99 * 0.5 / 255, 1.01 * (0.5 / 255 + FLOAT32)),
        (stored_in(16), 0.99 * 0.5 / 65535, 1.01 * (0.5 / 65535 + FLOAT32)),
        # sRGB is steepest at the top: 2.4 / 1.055 times half a step.
        (stored_as_srgb, 0.9 / 255, 1.01 * (0.5 / 255 * 2.4 / 1.055 + FLOAT32)),
        # Half a step of the binade below 1, whether or not the chart's brightest pixels met it.
        (lambda p: p.astype(np.float16).astype(float), 2.0**-12, 1.01 * 2.0**-12),
    ],
    ids=["8 bit", "16 bit", "8 bit sRGB", "half floats"],
)
def test_coarse_images_pass_with_coarse_figures(
    shows: Callable[[Float], Float], least: float, most: float
) -> None:
    found = calibrated(student(shows=shows))
    assert found.findings == ()
    assert least <= found.quantum <= most
    assert 1 <= found.cells <= 0.3 / (8 * found.quantum)
    assert found.position_error <= 2 * 2 * found.quantum / 0.9 / found.cells


def test_what_does_not_say_double_is_taken_for_single_precision() -> None:
    found = calibrated(student(capabilities=CAPABILITIES - {Capability.DOUBLE}))
    assert found.epsilon == FLOAT32


def test_a_renderer_that_samples_is_noisy_and_its_codes_tell_its_quantum() -> None:
    noise = iter(np.random.default_rng(3).normal(0, 1, (4, HEIGHT, WIDTH, 3)))
    asked = []

    def shows(pixels: Float) -> Float:
        """Noise in the two ramps; codes are sampled at pixel centres."""
        asked.append(1)
        return pixels + (1e-3 * next(noise) if len(asked) <= 2 else 0)

    found = calibrated(student(shows=shows, capabilities=CAPABILITIES - {Capability.PIXEL_CENTRES}))
    assert found.findings == ()
    assert found.noisy
    assert found.quantum == FLOAT32


# --- what is wrong with the camera ----------------------------------------------------------------


def camera(**change: Callable[..., Vector | float]) -> Callable[[ResolvedScene], ResolvedScene]:
    """A scene with another camera: each argument makes a field from the camera."""

    def sees(scene: ResolvedScene) -> ResolvedScene:
        update = {key: make(scene.camera) for key, make in change.items()}
        return scene.model_copy(update={"camera": scene.camera.model_copy(update=update)})

    return sees


def times(factor: float, vector: Vector) -> Vector:
    return factor * vector[0], factor * vector[1], factor * vector[2]


def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def moved(dx: float, dy: float) -> Callable[[ResolvedScene], ResolvedScene]:
    """Rays go through points (dx, dy) pixels to the right of and below the pixel centres."""

    def forward(c: object) -> Vector:
        pixel = 2 * c.tan_half_fov_x / WIDTH  # type: ignore[attr-defined]
        aside = plus(times(dx * pixel, c.right), times(-dy * pixel, c.up))  # type: ignore[attr-defined]
        return plus(c.forward, aside)  # type: ignore[attr-defined]

    return camera(forward=forward)


CAMERAS = {
    "mirrored in x": camera(right=lambda c: times(-1, c.right)),
    "mirrored in y": camera(up=lambda c: times(-1, c.up)),
    "rotated by 180": camera(right=lambda c: times(-1, c.right), up=lambda c: times(-1, c.up)),
    "rotated by 90": camera(right=lambda c: c.up, up=lambda c: times(-1, c.right)),
    "rotated by 90 degrees or transposed": camera(right=lambda c: c.up, up=lambda c: c.right),
    "shifted by (-0.5000, +0.0000) pixels (half a pixel)": moved(0.5, 0),
    "shifted by (+0.5000, +0.5000) pixels (half a pixel)": moved(-0.5, -0.5),
    "shifted by (+0.0000, -1.0000) pixels": moved(0, 1),
    "shifted by (-0.0500, +0.0000) pixels": moved(0.05, 0),
    "field of view is taken along the vertical axis": camera(
        tan_half_fov_x=lambda c: c.tan_half_fov_x / ASPECT
    ),
    "field of view is scaled by height / width": camera(
        tan_half_fov_x=lambda c: c.tan_half_fov_x * ASPECT
    ),
    "field of view is taken along the diagonal": camera(
        tan_half_fov_x=lambda c: c.tan_half_fov_x / np.hypot(1, ASPECT)
    ),
    "field of view is off: the image shows 1.1000 times the width": camera(
        tan_half_fov_x=lambda c: 1.1 * c.tan_half_fov_x
    ),
    # 4 : 3 whatever the film is, as a camera that is not told
    "aspect is wrong: x is scaled by 1.0000, y by 1.1250": camera(up=lambda c: times(1.125, c.up)),
    "aspect is wrong: x is scaled by 1.5000, y by 1.0000": camera(
        right=lambda c: times(1.5, c.right)
    ),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_a_wrong_camera_is_named(name: str) -> None:
    found = findings(student(sees=CAMERAS[name]))
    assert name in found
    assert len(found.split("; ")) == 1  # and nothing else is blamed


def test_an_image_of_an_earlier_request_is_not_taken_for_a_mirrored_one() -> None:
    before: list[Float] = []

    def late(pixels: Float) -> Float:
        before.append(pixels)
        return before[max(0, len(before) - 2)]

    found = findings(student(shows=late))
    assert "earlier request" in found
    assert "mirrored" not in found


@pytest.mark.parametrize(("slant", "wrong"), [(0.01, False), (0.2, True)])
def test_a_sheared_image_is_not_taken_for_a_shifted_one(slant: float, wrong: bool) -> None:
    sheared = camera(up=lambda c: plus(c.up, times(slant, c.right)))
    assert ("sheared or turned" in findings(student(sees=sheared))) is wrong


def test_a_shift_too_small_for_ramps_is_found_in_the_codes() -> None:
    assert "shifted by (-0.0050, +0.0000) pixels" in findings(student(sees=moved(0.005, 0)))


# --- what is wrong with the pixels ----------------------------------------------------------------


def holding(value: float) -> Callable[[Float], Float]:
    def shows(pixels: Float) -> Float:
        pixels = pixels.copy()
        pixels[3, 4, 1] = value
        return pixels

    return shows


SEAMS = np.arange(WIDTH) % 16 == 15

PIXELS: dict[str, Callable[[Float], Float]] = {
    "sRGB-encoded": srgb_encode,
    "gamma-encoded with 2.2": lambda p: p ** (1 / 2.2),
    "gamma-encoded with 1.8": lambda p: p ** (1 / 1.8),
    "decoded twice": srgb_decode,
    "scaled: radiance is 3.142 times": lambda p: p * np.pi,
    "scaled: radiance is 0.5 times": lambda p: p / 2,
    "divide by 255": lambda p: p * 255,
    "clipped at 0.8": lambda p: np.minimum(p, 0.8),
    "clipped at 0.6": lambda p: np.minimum(p, 0.6),
    "clipped at 0.4": lambda p: np.minimum(p, 0.4),
    "channels in the order blue, green, red": lambda p: p[..., ::-1],
    "black": np.zeros_like,
    "not finite": holding(np.nan),
    "values that are not finite": holding(np.inf),
    "shape (65, 96, 3)": lambda p: np.concatenate([p, p[:1]]),
    "shape (64, 96)": lambda p: p[..., 0],
    "by no known encoding": lambda p: p**3,
    "image shows 0.3 everywhere": lambda p: 0.3 + 0 * p,
    "off in 1 of 6144 pixels of the chart by more than 8 bits excuse: by": holding(0.0),
    "off in 384 of 6144 pixels": lambda p: np.where(SEAMS[:, None], np.roll(p, 1, 1), p),
}


@pytest.mark.parametrize("name", PIXELS)
def test_wrong_pixels_are_named(name: str) -> None:
    found = findings(student(shows=PIXELS[name]))
    assert name in found
    assert len(found.split("; ")) == 1


def test_an_emitter_that_faces_away_is_named() -> None:
    """Mitsuba's rectangles shine to one side only."""

    def turned(scene: ResolvedScene) -> ResolvedScene:
        front = scene.camera.forward[2] < 0
        return scene.model_copy(update={"surfaces": scene.surfaces if not front else ()})

    assert "an emitter may be seen from behind" in findings(student(sees=turned))


def test_a_mirrored_image_with_gamma_has_two_findings() -> None:
    found = calibrated(student(sees=CAMERAS["mirrored in x"], shows=srgb_encode)).findings
    assert len(found) == 2
    assert "sRGB-encoded" in found[0]
    assert "mirrored in x" in found[1]


# --- what shows only in the codes -----------------------------------------------------------------


def in_codes(change: Callable[[Float], Float]) -> Callable[[Float], Float]:
    """`change` applied to position codes, which have no pixel of radiance 0.5 in blue."""
    return lambda p: p if abs(float(np.median(p[..., 2])) - 0.5) < 0.1 else change(p)


CODES: dict[str, Callable[[Float], Float]] = {
    "6144 of 6144 pixels of a bare position code do not decode": np.zeros_like,
    "1 of 6144 pixels of a bare position code do not decode": holding(np.nan),
    "shape (64, 95, 3)": lambda p: p[:, 1:],
    "pixels of a bare position code do not decode": lambda p: np.minimum(p, 0.85),
}


@pytest.mark.parametrize("name", CODES)
def test_what_is_wrong_with_codes_alone_is_named(name: str) -> None:
    assert name in findings(student(shows=in_codes(CODES[name])))


def test_codes_without_their_fine_part_do_not_calibrate() -> None:
    """A renderer that smooths what it shows would lose the fine code's jumps."""

    def smoothed(pixels: Float) -> Float:
        return (pixels + np.roll(pixels, 1, axis=1)) / 2

    assert "do not decode" in findings(student(shows=in_codes(smoothed)))


@pytest.mark.parametrize(
    ("pixels", "said"),
    [
        (lambda x: x.astype(np.float32), "floats"),
        (lambda x: x.astype(np.float16), "half floats"),
        (lambda x: np.round(x * 65535) / 65535, "16 bits"),
        (lambda x: np.round(x * 255) / 255, "8 bits"),
        (lambda x: srgb_decode(np.round(srgb_encode(x) * 255) / 255), "8 bits, not linear"),
    ],
    ids=["float32", "half", "16-bit", "8-bit", "8-bit sRGB"],
)
def test_the_format_of_values_is_named(pixels: Callable[[Float], Float], said: str) -> None:
    """By the largest error of values between 0.1 and 1, as on the chart."""
    true = np.linspace(0.1, 1.0, 36001)
    assert stored_as(1.01 * float(np.abs(pixels(true) - true).max())) == said


# --- means over pixels ----------------------------------------------------------------------------


def test_anti_aliasing_is_named_where_pixel_centres_are_claimed() -> None:
    found = findings(averaging())
    assert "pixels show means over their areas" in found
    assert "do not claim pixel-centres" in found


def test_who_does_not_claim_pixel_centres_may_average() -> None:
    found = calibrated(averaging(capabilities=CAPABILITIES - {Capability.PIXEL_CENTRES}))
    assert found.findings == ()
    assert found.averages
    assert found.cells == 1
    assert found.facts()["pixels"] == "means over their areas"


def test_means_over_half_of_a_pixel_are_still_shifted() -> None:
    """Not what averaging can do: the mean of a pixel lies in its middle."""
    aside = averaging(sees=moved(0.3, 0), capabilities=CAPABILITIES - {Capability.PIXEL_CENTRES})
    assert "shifted by" in findings(aside)
