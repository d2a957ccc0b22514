"""Pictures of baselines: 16 bits, linear, beside the baseline or in a store elsewhere.

Sixteen bits with a common scale bound the error of every pixel by 1/131070 of the brightest, which
a comparison can add to its floor. Half floats would be as large and thirty times as coarse in the
bright places, and what a comparison is about is absolute radiance.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from harness import imagefile
from harness.baseline.document import StoredImage
from harness.documents import write_bytes
from harness.errors import InputError
from harness.imagefile import Pixels
from harness.record import ImageFile
from harness.temporary import temporary_folder

if TYPE_CHECKING:
    from harness.baseline.store import Store

LARGEST_IN_GIT = 384 * 1024  # bytes of a picture beside its baseline


def keep(source: ImageFile, exr: Path, target: Path, store: Store | None) -> StoredImage:
    """Stores the picture `exr` of a run as `target`, or in `store` where it is too large for git.

    Without a store, a picture that is too large leaves only its hash and its means. Raises
    InputError where the picture is unreadable or has pixels that are not finite.
    """
    pixels, info = imagefile.read(exr, size=(source.width, source.height))
    if info.nonfinite:
        raise InputError.of(f"{info.nonfinite} pixels are not finite", file=exr)
    darkest = float(min(pixels.min(), 0.0))
    scale = float(max(pixels.max() - darkest, 1e-6))
    known = StoredImage(
        role=source.role, pixels_sha256=source.sha256, width=source.width, height=source.height,
        scale=scale, darkest=darkest, mean=source.mean, mean_error=source.mean_error,
    )  # fmt: skip
    data = _encoded((pixels - darkest) / scale)
    digest = hashlib.sha256(data).hexdigest()
    if len(data) <= LARGEST_IN_GIT:
        write_bytes(target, data)
        return known.model_copy(update={"file": target.name, "sha256": digest})
    if store is not None:
        store.put(digest, data)
        return known.model_copy(update={"store": store.url, "sha256": digest})
    return known


def restore(image: StoredImage, data: bytes, name: Path) -> Pixels:
    """(H, W, 3) float32 of the PNG `data`. Raises InputError where it is not what was approved."""
    if hashlib.sha256(data).hexdigest() != image.sha256:
        raise InputError.of("not the picture that was approved: its hash differs", file=name)
    with temporary_folder() as folder:
        file = Path(folder) / "picture.png"
        file.write_bytes(data)
        try:
            pixels, _ = imagefile.read(file, encoding="linear", size=(image.width, image.height))
        except InputError as error:
            raise InputError([replace(problem, file=name) for problem in error.problems]) from error
    return (pixels.astype(np.float64) * image.scale + image.darkest).astype(np.float32)


def _encoded(shares: NDArray[np.floating]) -> bytes:
    """Shares of the whole range, 0 to 1; as floats they round by 1/256 of a step at most."""
    with temporary_folder() as folder:
        file = Path(folder) / "picture.png"
        imagefile.write_png(file, shares.astype(np.float32), bits=16, encoding="linear")
        return file.read_bytes()
