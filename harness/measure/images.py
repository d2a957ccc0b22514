"""Figures of image pairs. Every metric has its one implementation here.

Images are (H, W, 3) linear radiance. `keep` (H, W) marks the pixels that count; SSIM looks at
windows and therefore at the whole image.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float

Pixels = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Steepest slopes of CIE Lab in linear radiance, on its linear segment (CIE 15:2018, 8.2.1): L* by
# 903.3, a* by 500 * 7.787 / X_n, b* by 200 * 7.787 / Z_n. CIEDE2000 weighs lightness by at most 1
# and chroma differences of neutral colours by at most 1.5 (its G term), so their norm bounds it.
LAB_SLOPE = float(np.hypot(903.3, 1.5 * np.hypot(500 * 7.787 / 0.9505, 200 * 7.787 / 1.089)))


def ssim(a: Pixels, b: Pixels, data_range: float) -> float:
    """Structural similarity in the setting of Wang et al. 2004: Gaussian weights of sigma 1.5."""
    from skimage.metrics import structural_similarity

    return float(
        structural_similarity(  # type: ignore[no-untyped-call]
            a.astype(np.float64), b.astype(np.float64), data_range=data_range, channel_axis=-1,
            gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
        )
    )  # fmt: skip


def difference(a: Pixels, b: Pixels) -> Float:
    """|a - b| per pixel, the largest of the channels: (H, W)."""
    return np.asarray(np.abs(a.astype(np.float64) - b.astype(np.float64)).max(axis=-1))


def rmse(a: Pixels, b: Pixels, keep: Mask) -> float:
    """Root of the mean squared difference over pixels and channels."""
    gap = (a.astype(np.float64) - b.astype(np.float64))[keep]
    return float(np.sqrt(np.mean(gap**2)))


def psnr(a: Pixels, b: Pixels, keep: Mask, data_range: float) -> float:
    """20 log10(range / rmse), dB; infinite where the images are equal."""
    error = rmse(a, b, keep)
    return float(np.inf) if error == 0 else float(20 * np.log10(data_range / error))


def delta_e(a: Pixels, b: Pixels) -> Float:
    """CIEDE2000 per pixel (H, W), of linear Rec. 709 under D65."""
    import colour

    def lab(pixels: Pixels) -> Float:
        xyz = colour.RGB_to_XYZ(
            np.clip(pixels.astype(np.float64), 0, None), "sRGB", apply_cctf_decoding=False
        )
        return np.asarray(colour.XYZ_to_Lab(xyz))

    return np.asarray(colour.difference.delta_E_CIE2000(lab(a), lab(b)))


def box_downsample(pixels: Pixels, factor: int) -> Pixels:
    """Means of factor x factor blocks."""
    height, width = pixels.shape[0] // factor, pixels.shape[1] // factor
    blocks = pixels[: height * factor, : width * factor].astype(np.float64)
    means = blocks.reshape(height, factor, width, factor, -1).mean(axis=(1, 3))
    return np.asarray(means, np.float32)
