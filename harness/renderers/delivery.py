"""The images that renderers deliver in files: the right size, and no pixel that is no number."""

from __future__ import annotations

import stat
from pathlib import Path

import numpy as np

from harness import imagefile
from harness.errors import ImageNotFinite, InputError, RendererFailed
from harness.imagefile import Encoding, Info, Pixels
from harness.scene.resolved import Film


def delivered(
    path: Path, film: Film, *, log: str, encoding: Encoding | None = None
) -> tuple[Pixels, Info]:
    """The image at `path`. Raises RendererFailed, carrying `log`, where it is not what `film` asks.

    A single NaN or infinity fails the image: no later stage could give it a meaning.
    """
    try:
        kind = path.lstat().st_mode
    except OSError as error:
        raise RendererFailed("wrote no image", log=log) from error
    if not stat.S_ISREG(kind):  # a pipe would be waited for, and a link leads anywhere
        raise RendererFailed("wrote something else than a file as its image", log=log)
    try:
        pixels, info = imagefile.read(path, encoding=encoding, size=(film.width, film.height))
    except InputError as error:
        problem = error.problems[0]
        text = str(problem).removeprefix(f"{problem.file}: ")  # a temporary name tells nobody
        raise RendererFailed(f"wrote an unusable image: {text}", log=log) from error
    if info.nonfinite:
        where = np.flatnonzero(~np.isfinite(pixels).all(axis=2))
        raise ImageNotFinite(where.tolist(), width=film.width, log=log, image=pixels)
    return pixels, info


def described(info: Info) -> str:
    """What a reader of the log should know of the file; nothing where it holds floats."""
    if info.encoding_from == "format":
        return ""
    how = {"declared": "as declared", "file": "as it says", "assumed": "assumed"}
    encoding = f"{info.encoding} ({how[info.encoding_from]})"
    return f"the image came as {info.format.upper()} of {info.bits} bits, {encoding}"
