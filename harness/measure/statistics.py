"""Judging pixels that are noisy: means of many, and the chance of a false alarm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harness.expected import Float
from harness.measure.comparison import Comparison, Unmeasurable

# Pixels per bin: enough for the mean's error to be normal.
BIN = 256


def binned(value: Float, true: Float, order: NDArray[np.intp], level: float) -> Comparison:
    """`value` against `true`, each (m, 3), in means over bins of consecutive pixels of `order`.

    Each bin's standard error comes from the scatter of its own pixels, so nothing has to be known
    of the renderer's sampling. Judged by Student's t; `level` is the chance of a false alarm over
    all bins and channels together (Šidák 1967).
    """
    from scipy.special import stdtrit

    if len(order) < BIN:
        raise Unmeasurable(f"{len(order)} pixels are too few: a bin needs {BIN}")
    bins = np.array_split(order, len(order) // BIN)
    residual = np.array([(value[b] - true[b]).mean(axis=0) for b in bins])
    scatter = np.array([(value[b] - true[b]).std(axis=0, ddof=1) / np.sqrt(len(b)) for b in bins])
    per_test = 1 - (1 - level) ** (1 / residual.size)
    limit = -float(stdtrit(BIN - 1, per_test / 2))
    if not np.isfinite(residual).all():
        raise Unmeasurable("a measured pixel is not finite")
    # Where all samples of a bin fell alike it shows no scatter, though one more sample of its 64
    # per pixel could have fallen otherwise.
    error = limit * np.maximum(scatter, 1 / (BIN * 64))
    k, channel = np.unravel_index(int((np.abs(residual) / error).argmax()), residual.shape)
    return Comparison(
        float(value[bins[k], channel].mean()),
        float(true[bins[k], channel].mean()),
        float(error[k, channel]),
        bool(np.all(np.abs(residual) <= error)),
        f"{limit:.2f} standard errors of a bin's mean: Student's t with {BIN - 1} degrees of "
        f"freedom, level {level:g} over all {residual.size} means",
        detail={
            "max": float(np.abs(residual).max()),
            "rms": float(np.sqrt((residual**2).mean())),
            "bins": len(bins),
            "rays": len(order),
        },
    )
