"""Where entries lie: a local folder of bounded size, or any place that fsspec can reach.

Both write an entry whole or not at all, so that any number of runs may share one: they never wait
for each other, and where two write the same entry they write the same bytes.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from harness.documents import write_bytes
from harness.errors import InputError

ENDING = ".entry"
STALE_S = 3600.0  # a temporary file this old belongs to nobody any more


@dataclass(frozen=True)
class Stored:
    """An entry as a file: its key, its size, and when it was last used (seconds since 1970)."""

    key: str
    size: int
    used: float


class Store(Protocol):
    """Bytes by key. A key is a hexadecimal hash."""

    where: str

    def read(self, key: str) -> bytes | None:
        """None where there is no such entry. Raises OSError where it cannot be read."""
        ...

    def write(self, key: str, data: bytes) -> None:
        """Raises OSError."""
        ...

    def remove(self, key: str) -> None:
        """Harmless where it is gone already."""
        ...

    def entries(self) -> Iterator[Stored]: ...

    def trim(self, limit: int, target: int) -> int:
        """Once `limit` bytes are passed, leaves `target` of those used last; returns how many went.

        Raises OSError.
        """
        ...


class FolderStore:
    """A local folder: ``ab/abcdef….entry``. Reading an entry marks it as used."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.where = str(root)

    def read(self, key: str) -> bytes | None:
        path = self._path(key)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return None
        with contextlib.suppress(OSError):  # a cache that may only be read serves as well
            os.utime(path)
        return data

    def write(self, key: str, data: bytes) -> None:
        # Not flushed to the disk: what a power cut leaves behind does not pass its checksum.
        write_bytes(self._path(key), data)

    def remove(self, key: str) -> None:
        self._path(key).unlink(missing_ok=True)

    def entries(self) -> Iterator[Stored]:
        for path in self.root.glob(f"??/*{ENDING}"):
            with contextlib.suppress(FileNotFoundError):  # another run has just removed it
                about = path.stat()
                yield Stored(path.name.removesuffix(ENDING), about.st_size, about.st_mtime)

    def trim(self, limit: int, target: int) -> int:
        self._sweep()
        known = sorted(self.entries(), key=lambda entry: entry.used)
        total, removed = sum(entry.size for entry in known), 0
        if total <= limit:
            return 0
        for entry in known:
            if total <= target:
                break
            self.remove(entry.key)
            total -= entry.size
            removed += 1
        return removed

    def _sweep(self) -> None:
        """Removes temporary files of writers that were killed."""
        for path in self.root.glob(f"??/.*{ENDING}.*"):
            with contextlib.suppress(FileNotFoundError):
                if time.time() - path.stat().st_mtime > STALE_S:
                    path.unlink()

    def _path(self, key: str) -> Path:
        return self.root / key[:2] / f"{key}{ENDING}"


class RemoteStore:
    """A URL that fsspec understands, such as ``s3://bucket/folder``; it grows without bound.

    Raises InputError where fsspec, or what it needs for the URL's scheme, is not installed.
    """

    def __init__(self, url: str) -> None:
        try:
            import fsspec
        except ModuleNotFoundError:
            raise InputError.of(
                "a cache at a URL needs fsspec", key="--cache", value=url,
                expected="pip install 'snellcheck[store]'",
            ) from None  # fmt: skip
        try:
            self._files, self._root = fsspec.core.url_to_fs(url)
        except (ImportError, ValueError) as error:
            raise InputError.of(str(error), key="--cache", value=url) from error
        self.where = url

    def read(self, key: str) -> bytes | None:
        with _as_os_error(), contextlib.suppress(FileNotFoundError):
            return bytes(self._files.cat_file(self._path(key)))
        return None

    def write(self, key: str, data: bytes) -> None:
        # Some file systems show a file while it is written, so it gets its name at the end.
        path = self._path(key)
        part = f"{path}.{secrets.token_hex(4)}.part"
        with _as_os_error():
            self._files.makedirs(path.rpartition("/")[0], exist_ok=True)
            self._files.pipe_file(part, data)
            self._files.mv(part, path)

    def remove(self, key: str) -> None:
        with _as_os_error(), contextlib.suppress(FileNotFoundError):
            self._files.rm_file(self._path(key))

    def entries(self) -> Iterator[Stored]:
        found: dict[str, dict[str, Any]] = {}
        with _as_os_error(), contextlib.suppress(FileNotFoundError):
            found = self._files.find(self._root, detail=True)
        for path, about in found.items():
            if path.endswith(ENDING):
                key = path.rpartition("/")[2].removesuffix(ENDING)
                yield Stored(key, int(about["size"] or 0), 0.0)

    def trim(self, limit: int, target: int) -> int:  # noqa: ARG002
        """Nothing: a shared place has its own rules for how long it keeps files."""
        return 0

    def _path(self, key: str) -> str:
        return f"{self._root.rstrip('/')}/{key[:2]}/{key}{ENDING}"


@contextlib.contextmanager
def _as_os_error() -> Iterator[None]:
    """Raises OSError for whatever goes wrong: each file system has errors of its own."""
    try:
        yield
    except OSError:
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}".rstrip(": ")
        raise OSError(errno.EIO, " ".join(reason.split())[:200]) from error
