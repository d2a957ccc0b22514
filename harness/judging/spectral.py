"""From monochromatic pictures to one in colour.

Every renderer is given one scene per wavelength, in which all media have their index there, and
renders it in red, green and blue as ever. A red, green or blue emitter has a spectrum: those of
I. Mallett and C. Yuksel (Spectral primary decomposition for rendering with sRGB reflectance, EGSR
2019) under daylight D65, so that white is daylight. What arrives at each wavelength is weighed by
that spectrum, seen by the CIE 1931 standard observer, and turned into linear sRGB. All of it is
one 3 x 3 matrix per wavelength, and the matrices add up to the identity: where nothing disperses,
the picture is the one without a spectrum. Saturated colours of a spectrum lie outside sRGB and
are negative in a channel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from harness.errors import RendererError, RendererFailed
from harness.expected import Float
from harness.judging.results import Result
from harness.plan import pass_role
from harness.renderers.base import Image

# With fewer bands than primaries, or with bands all alike, colours cannot be told apart.
ILL_CONDITIONED = 1e3


@cache
def matrices(wavelengths: tuple[float, ...]) -> Float:
    """(n, 3, 3): what the picture at each wavelength, in nm, adds to the picture in colour.

    Raises ValueError where too few of them are visible.
    """
    import colour

    at = np.array(wavelengths)
    tables = (
        colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"],
        colour.SDS_ILLUMINANTS["D65"],
        colour.recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019,
    )
    seen, daylight, primaries = (
        _sampled(np.array(t.wavelengths, float), np.array(t.values), at) for t in tables
    )
    to_rgb = np.array(colour.models.RGB_COLOURSPACE_sRGB.matrix_XYZ_to_RGB)
    width = np.gradient(at)  # of the band that a wavelength stands for
    response = to_rgb @ (seen * width)  # (3, n): linear sRGB of one unit of radiance
    emitted = (primaries * daylight).T  # (n, 3): spectra of the primaries
    white = response @ emitted
    if np.linalg.cond(white) > ILL_CONDITIONED:
        raise ValueError(f"too few visible wavelengths to tell colours apart: {wavelengths}")
    emitted = emitted @ np.linalg.inv(white)
    return np.asarray(response.T[:, :, None] * emitted[:, None, :])


def _sampled(table: Float, values: Float, at: Float) -> Float:
    """Columns of a table (k,) or (k, c) at wavelengths (n,), (c, n); 0 beyond its ends."""
    columns = np.asarray(values, float).reshape(len(table), -1).T
    return np.array([np.interp(at, table, column, left=0, right=0) for column in columns])


def gain(wavelengths: Sequence[float]) -> float:
    """By how much an error of every monochromatic picture can show in the picture in colour."""
    if not wavelengths:
        return 1.0
    return float(np.abs(matrices(tuple(wavelengths))).sum(axis=(0, 2)).max())


def gathered(
    results: Mapping[tuple[str, str], Result], wavelengths: tuple[float, ...]
) -> dict[tuple[str, str], Result]:
    """The results with every picture's monochromatic parts replaced by the picture."""
    left = dict(results)
    if not wavelengths:
        return left
    ending = pass_role("", wavelengths[0])
    for renderer, role in [key for key in results if key[1].endswith(ending)]:
        whole = role.removesuffix(ending)
        parts = [left.pop((renderer, pass_role(whole, w)), None) for w in wavelengths]
        left[renderer, whole] = _whole(parts, wavelengths)
    return left


def _whole(parts: Sequence[Result | None], wavelengths: tuple[float, ...]) -> Result:
    images = []
    for part, wavelength in zip(parts, wavelengths, strict=True):
        if isinstance(part, RendererError):
            return part
        if not isinstance(part, Image):
            return RendererFailed(f"the picture at {wavelength:g} nm was not rendered")
        images.append(part)
    if len({image.pixels.shape for image in images}) > 1:
        return RendererFailed("pictures of one spectrum differ in size")
    return combined(images, matrices(wavelengths))


def combined(images: Sequence[Image], weights: Float) -> Image:
    """The picture in colour; `weights` as `matrices` gives them.

    The passes of a renderer that samples are independent, the channels of one pass are not: their
    standard deviations are added, which overestimates the variance.
    """
    pixels = np.zeros(images[0].pixels.shape)
    variance = np.zeros_like(pixels)
    for image, matrix in zip(images, weights, strict=True):
        pixels += image.pixels.astype(np.float64) @ matrix.T
        if image.variance is not None:
            variance += (np.sqrt(image.variance.astype(np.float64)) @ np.abs(matrix).T) ** 2
    known = all(image.variance is not None for image in images)
    near = [image.closest for image in images if image.closest is not None]
    cuts = [image.cut for image in images if image.cut is not None]
    return Image(
        pixels=pixels.astype(np.float32),
        variance=variance.astype(np.float32) if known else None,
        seconds=sum(image.seconds for image in images),
        log=images[0].log,
        command=images[0].command,
        closest=np.min(near, axis=0) if len(near) == len(images) else None,
        cut=max(cuts) if len(cuts) == len(images) else None,
    )
