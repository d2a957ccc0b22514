"""Files that a scene file names: they lie in its folder or below, and have a limited size."""

from __future__ import annotations

import os
import stat
from pathlib import Path, PurePosixPath, PureWindowsPath

from harness.errors import nearest
from harness.scene.findings import Finding, SceneInvalid, quoted

KEY = ("file",)


def read_beside(folder: Path, name: str, most: int) -> bytes:
    """The bytes of file `name`, a relative path from `folder`, of at most `most` bytes.

    Raises SceneInvalid at the key ``file`` where it leads out of the folder (symbolic links
    included), is not there, not a file, or too large.
    """
    path = _inside(folder, name)
    try:
        # Without blocking: what looks like a file may be a pipe that nobody writes to.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with os.fdopen(handle, "rb") as file:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise SceneInvalid(Finding(KEY, "not a file", quoted(name)))
            data = file.read(most + 1)
    except OSError as error:
        here = [p.name for p in folder.iterdir()] if folder.is_dir() else []
        message = f"cannot be read: {error.strerror}"
        suggestion = nearest(name, here)
        raise SceneInvalid(Finding(KEY, message, quoted(name), None, suggestion)) from error
    if len(data) > most:
        raise SceneInvalid(Finding(KEY, f"larger than {most} bytes", quoted(name)))
    return data


def _inside(folder: Path, name: str) -> Path:
    outside = SceneInvalid(
        Finding(KEY, "leads out of the scene's folder", quoted(name), "a relative path in it")
    )
    if "\0" in name or not name:
        raise SceneInvalid(Finding(KEY, "not a file name", quoted(name)))
    absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).anchor
    if absolute or ".." in PurePosixPath(name).parts or "\\" in name:
        raise outside
    try:
        root = folder.resolve()
        path = (root / name).resolve()
    except (OSError, RuntimeError) as error:  # a loop of links
        raise SceneInvalid(Finding(KEY, "cannot be read", quoted(name))) from error
    if not path.is_relative_to(root):
        raise outside
    return path
