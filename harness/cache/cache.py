"""The cache: entries by key in a store, verified on every read.

A cache can be missing, full, slow or broken and never costs more than the work it would have saved:
what cannot be read is made again, and where nothing can be written, nothing is kept.
"""

from __future__ import annotations

import errno
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from harness.cache.entry import Damaged, Entry, decode
from harness.cache.stores import FolderStore, RemoteStore, Store
from harness.data import cache_root
from harness.errors import InputError

LIMIT = 4 * 2**30  # bytes; the suite at normal quality takes about a hundredth of it
# It is trimmed to this part of the limit, so that not every write has to look at all entries.
TRIMMED = 0.9
# A place that is far away fails now and then. After so many failures it is asked no more, or each
# might cost the time that it takes to notice.
FORGIVEN = 3
LASTING = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM})


@dataclass(frozen=True)
class Verified:
    """What `Cache.verify` found: how many entries are whole, and why the others were removed."""

    whole: int
    removed: dict[str, str]


class Cache:
    """Entries in `store`, at most `limit` bytes of them. Threads may share one.

    `trouble` is why nothing is written any more, "" where all is well: the place is full, may only
    be read, or has failed too often. `damaged` counts entries that did not pass their checksum;
    they were removed.
    """

    def __init__(self, store: Store, limit: int = LIMIT) -> None:
        self.store, self.limit = store, limit
        self.trouble = ""
        self.damaged = 0
        self._failures = 0
        self._unweighed = 0  # bytes written since the folder was last weighed
        self._lock = threading.Lock()

    def get(self, key: str) -> Entry | None:
        """The entry of `key`, None where there is none that is whole."""
        if self._failures > FORGIVEN:
            return None
        try:
            data = self.store.read(key)
        except OSError as error:
            self._failed("read", error)
            return None
        if data is None:
            return None
        try:
            return decode(data, key)
        except Damaged:
            self.damaged += 1
            self._remove(key)
            return None

    def put(self, key: str, meta: Mapping[str, Any], blocks: Mapping[str, bytes]) -> None:
        """Keeps an entry, or notes in `trouble` why it cannot."""
        if self.trouble:
            return
        data = Entry(key, meta, blocks).encode()
        try:
            self.store.write(key, data)
        except OSError as error:
            self._failed("write", error, lasting=error.errno in LASTING)
            return
        with self._lock:
            self._unweighed += len(data)
            weigh = self._unweighed > self.limit * (1 - TRIMMED)
        if weigh:
            self.trim()

    def trim(self) -> int:
        """Removes what was used longest ago where the limit is passed; returns how many."""
        with self._lock:
            self._unweighed = 0
        try:
            return self.store.trim(self.limit, int(self.limit * TRIMMED))
        except OSError as error:
            self._failed("trim", error)
            return 0

    def verify(self) -> Verified:
        """Reads every entry and removes those that are not whole."""
        whole, removed = 0, {}
        for stored in list(self.store.entries()):
            data = self.store.read(stored.key)
            if data is None:  # another run has just removed it
                continue
            try:
                decode(data, stored.key)
                whole += 1
            except Damaged as why:
                removed[stored.key] = str(why)
                self._remove(stored.key)
        return Verified(whole, removed)

    def clear(self) -> int:
        """Removes every entry, and nothing else; returns how many."""
        known = list(self.store.entries())
        for entry in known:
            self.store.remove(entry.key)
        return len(known)

    def _remove(self, key: str) -> None:
        try:
            self.store.remove(key)
        except OSError as error:
            self._failed("remove from", error)

    def _failed(self, verb: str, error: OSError, *, lasting: bool = False) -> None:
        with self._lock:
            self._failures += not lasting
            if lasting or self._failures > FORGIVEN:
                self.trouble = f"cannot {verb} {self.store.where}: {error.strerror or error}"


def open_cache(where: str = "", limit: int = LIMIT) -> Cache:
    """The cache at a folder or URL, by default the user's own.

    Raises InputError where the URL cannot be understood or the folder is a file.
    """
    if "://" in where:
        return Cache(RemoteStore(where), limit)
    folder = Path(where).expanduser() if where else cache_root() / "results"
    if folder.exists() and not folder.is_dir():
        raise InputError.of("no folder", key="--cache", value=str(folder))
    return Cache(FolderStore(folder), limit)
