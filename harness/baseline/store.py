"""A store of pictures by their hash, outside of git: a folder, or any URL that fsspec knows."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.documents import write_bytes
from harness.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

LARGEST_PICTURE = 64 * 2**20  # bytes
INSTALL = "pip install 'snellcheck[store]'"


class Store:
    """Content under its own SHA-256, so that nothing in it can be mistaken or needs locking."""

    def __init__(self, url: str) -> None:
        """`url` is a folder, or ``s3://…``, ``gs://…``, ``https://…``. Nothing is opened yet."""
        self.url = url

    def put(self, digest: str, data: bytes) -> None:
        """Keeps `data`, unless it is there and whole. Raises InputError where that cannot be."""
        if "://" not in self.url:
            path = Path(self.url) / _name(digest)
            if not (path.is_file() and path.read_bytes() == data):
                write_bytes(path, data)
            return
        self._remote(lambda fs, path: _pipe(fs, path, data), digest)

    def get(self, digest: str) -> bytes:
        """The content of that hash. Raises InputError where it is not there or not it."""
        if "://" not in self.url:
            path = Path(self.url) / _name(digest)
            try:
                with path.open("rb") as file:
                    data = file.read(LARGEST_PICTURE + 1)
            except OSError as error:
                message = f"cannot be read: {error.strerror}"
                raise InputError.of(message, file=path) from error
        else:
            data = self._remote(lambda fs, path: fs.cat_file(path, 0, LARGEST_PICTURE + 1), digest)
        if hashlib.sha256(data).hexdigest() != digest:
            raise InputError.of("its content is not of its hash", file=Path(_name(digest)))
        return data

    def _remote(self, work: Callable[[Any, str], Any], digest: str) -> Any:
        try:
            import fsspec
        except ImportError as error:
            message = f"a store at a URL needs fsspec: {INSTALL}"
            raise InputError.of(message, key="--store", value=self.url) from error
        try:
            fs, root = fsspec.core.url_to_fs(self.url)
            return work(fs, f"{root.rstrip('/')}/{_name(digest)}")
        except Exception as error:  # each file system has errors of its own
            reason = f"{type(error).__name__}: {error}".rstrip(": ")
            message = f"cannot be reached: {' '.join(reason.split())[:200]}"
            raise InputError.of(message, key="--store", value=self.url) from error


def store_at(where: str) -> Store | None:
    """The store in a folder or at a URL; none where nothing was named."""
    return Store(where) if where else None


def _name(digest: str) -> str:
    if len(digest) != 64 or set(digest) - set("0123456789abcdef"):
        raise InputError.of("not a SHA-256", value=digest[:80])
    return f"sha256/{digest[:2]}/{digest}.png"


def _pipe(fs: Any, path: str, data: bytes) -> None:
    """An upload that broke off leaves part of a file, which is no reason to keep it."""
    if fs.exists(path) and fs.cat_file(path) == data:
        return
    fs.makedirs(path.rpartition("/")[0], exist_ok=True)
    fs.pipe_file(path, data)
