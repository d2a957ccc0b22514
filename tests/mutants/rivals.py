"""The rules by which other projects compare a picture with a reference, as they state them.

Each takes the picture, the reference, both linear (H, W, 3) and shown as sRGB where the rule wants
that, and tells whether the rule calls them different. The reference is the same renderer without
its fault: no rule is asked to bridge two renderers.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from harness.expected import Float
from harness.measure.images import ssim
from harness.probe.chart import srgb_encode

SAMPLES = 256


def _shown(x: Float) -> Float:
    return np.asarray(np.clip(srgb_encode(np.clip(x, 0, 1)), 0, 1))


def anari_cts(a: Float, b: Float) -> bool:
    """Khronos ANARI-SDK, cts: SSIM above 0.70 and PSNR above 20 dB pass."""
    x, y = _shown(a), _shown(b)
    psnr = -10 * np.log10(max(float(np.mean((x - y) ** 2)), 1e-30))
    return not (ssim(x.astype(np.float32), y.astype(np.float32), 1.0) > 0.70 and psnr > 20)


def blender(a: Float, b: Float) -> bool:
    """Blender, tests/python/modules/render_report.py: more than 1% of pixels off by 0.016."""
    return bool((np.abs(_shown(a) - _shown(b)).max(axis=-1) > 0.016).mean() > 0.01)


def oiio(a: Float, b: Float) -> bool:
    """OpenImageIO, testsuite: 0.02% of pixels off by 0.004, or any by 0.012."""
    gap = np.abs(_shown(a) - _shown(b)).max(axis=-1)
    return bool((gap > 0.004).mean() > 0.0002 or gap.max() > 0.012)


def pytest_mpl(a: Float, b: Float) -> bool:
    """pytest-mpl and matplotlib.testing: RMS above 2 of 255."""
    gap = np.round(_shown(a) * 255) - np.round(_shown(b) * 255)
    return bool(np.sqrt(np.mean(gap**2)) > 2)


def mitsuba_z_test(a: Float, b: Float) -> bool:
    """Mitsuba 3, tests/test_renders.py: z-test per pixel at 1% with Šidák's correction.

    It passes where 99.75% of the pixels do. The pictures get the noise of 256 samples per pixel
    that choose between light and dark, which is what its variances would be.
    """
    from scipy.special import ndtr

    noise = np.random.default_rng(1)
    top = float(max(a.max(), b.max()))
    variance = np.maximum(b * (top - b), 1e-4) / SAMPLES
    noisy = a + noise.normal(size=a.shape) * np.sqrt(variance)
    z = np.abs(noisy - b) / np.sqrt(variance)
    p = 2 * ndtr(-z)
    alpha = 1 - (1 - 0.01) ** (1 / p.size)
    return bool((p > alpha).mean() <= 0.9975)


_FLIP = """
import sys, numpy, flip_evaluator
a, b = numpy.load(sys.argv[1]), numpy.load(sys.argv[2])
print(float(flip_evaluator.evaluate(b, a, "LDR", inputsRGB=True)[1]))
"""


def flip(a: Float, b: Float) -> bool | None:
    """NVIDIA FLIP (flip-evaluator, `make rivals`): a mean above 0.05. None where it is not there.

    In a process of its own, which it can end.
    """
    with tempfile.TemporaryDirectory() as folder:
        files = [str(Path(folder) / f"{k}.npy") for k in "ab"]
        for file, x in zip(files, (a, b), strict=True):
            np.save(file, _shown(x).astype(np.float32))
        done = subprocess.run(
            [sys.executable, "-c", _FLIP, *files], capture_output=True, text=True, check=False
        )
    return float(done.stdout) > 0.05 if done.returncode == 0 and done.stdout.strip() else None


RIVALS: dict[str, Callable[[Float, Float], bool | None]] = {
    "ANARI-CTS": anari_cts,
    "Blender": blender,
    "Mitsuba z-test": mitsuba_z_test,
    "OIIO": oiio,
    "pytest-mpl": pytest_mpl,
    "FLIP": flip,
}
