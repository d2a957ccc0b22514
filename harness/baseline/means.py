"""Noise or change? The means of two pictures of a renderer that samples, with their errors."""

from __future__ import annotations

import math

from harness.baseline.document import StoredImage
from harness.record import ImageFile

# Of three channels, |z| > 4 happens by chance once in 5,000 pictures.
STRIKING = 4.0


def mean_shift(approved: StoredImage, image: ImageFile) -> str:
    """In words, what hash and means say of two pictures of one scene by one renderer.

    The difference of two independent means m with standard errors s has the standard error
    sqrt(s1^2 + s2^2); z is their ratio. Empty where the pictures are the same, or no means are
    known.
    """
    if approved.pixels_sha256 == image.sha256 or not approved.mean or not image.mean:
        return ""
    shifts = [now - then for now, then in zip(image.mean, approved.mean, strict=False)]
    largest = max(shifts, key=abs)
    if not approved.mean_error or not image.mean_error:
        return f"its pixels have changed, their mean by {largest:.3g}"
    errors = [math.hypot(a, b) for a, b in zip(approved.mean_error, image.mean_error, strict=False)]
    z = max((abs(s) / e if e > 0 else math.inf) for s, e in zip(shifts, errors, strict=False))
    if z <= STRIKING:
        return f"noise: its mean has moved by {z:.2g} standard errors"
    return f"no noise: its mean has moved by {largest:.3g}, {z:.3g} standard errors"
