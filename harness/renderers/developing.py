"""Pixels as weighed means of samples, for renderers that see through pixel centres alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from harness.renderers.base import Float, Image
from harness.scene.resolved import Film, ResolvedScene

EDGE = 4.0  # sigmas, beyond which a sample does not count


def of_samples(scene: ResolvedScene) -> ResolvedScene:
    """The scene on a film of which each pixel is a sample."""
    film = scene.film
    fine = Film(width=film.width * film.samples, height=film.height * film.samples)
    return scene.model_copy(update={"film": fine})


def developed(image: Image, film: Film) -> Image:
    """From an image of samples that of pixels."""
    down, across = (_weights(n, film) for n in (film.height, film.width))
    pixels = np.einsum("is,stc->itc", down, image.pixels.astype(np.float64))
    pixels = np.einsum("jt,itc->ijc", across, pixels)
    return replace(image, pixels=pixels.astype(np.float32))


def _weights(pixels: int, film: Film) -> Float:
    """(pixels, samples) along one axis; rows sum to 1."""
    middles = (np.arange(pixels * film.samples) + 0.5) / film.samples
    r = np.abs(middles - (np.arange(pixels)[:, None] + 0.5))
    weights: NDArray[np.float64] = (r < 0.5).astype(np.float64)
    if film.sigma is not None:
        cut = np.exp(-(EDGE**2) / 2)
        weights = np.maximum(0.0, np.exp(-0.5 * (r / film.sigma) ** 2) - cut)
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
