"""The cache of results: what is read is what was written, or nothing."""

from __future__ import annotations

import errno
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from harness.cache import stores
from harness.cache.cache import FORGIVEN, Cache, open_cache
from harness.cache.entry import Damaged, Entry, decode
from harness.cache.stores import FolderStore, RemoteStore
from harness.errors import InputError

KEY = "ab" + 62 * "0"
OTHER = "cd" + 62 * "0"
ENTRY = Entry(KEY, {"kind": "image", "log": "grüß"}, {"pixels": b"\x00\x01\x02", "empty": b""})


@pytest.fixture(params=["folder", "remote"])
def cache(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Cache]:
    if request.param == "folder":
        yield open_cache(str(tmp_path / "cache"))
    else:
        pytest.importorskip("fsspec")
        remote = open_cache(f"memory://{tmp_path.name}")
        yield remote
        remote.clear()


def overwrite(cache: Cache, key: str, data: bytes) -> None:
    cache.store.write(key, data)


# --- entries --------------------------------------------------------------------------------------


def test_an_entry_is_read_as_it_was_written() -> None:
    assert decode(ENTRY.encode(), KEY) == ENTRY


@pytest.mark.parametrize("at", range(len(ENTRY.encode())))
def test_a_change_of_any_byte_is_noticed(at: int) -> None:
    data = bytearray(ENTRY.encode())
    for flip in (1, 128, 255):
        damaged = bytearray(data)
        damaged[at] ^= flip
        with pytest.raises(Damaged):
            decode(bytes(damaged), KEY)


@pytest.mark.parametrize("length", range(len(ENTRY.encode())))
def test_an_entry_that_is_cut_anywhere_is_noticed(length: int) -> None:
    with pytest.raises(Damaged):
        decode(ENTRY.encode()[:length], KEY)


def test_bytes_behind_an_entry_are_noticed() -> None:
    with pytest.raises(Damaged):
        decode(ENTRY.encode() + b"\0", KEY)


def test_an_entry_of_another_key_is_not_taken_for_ones_own() -> None:
    with pytest.raises(Damaged, match="another key"):
        decode(ENTRY.encode(), OTHER)


# --- the cache ------------------------------------------------------------------------------------


def test_what_is_put_is_got(cache: Cache) -> None:
    assert cache.get(KEY) is None
    cache.put(KEY, ENTRY.meta, ENTRY.blocks)
    assert cache.get(KEY) == ENTRY
    assert cache.get(OTHER) is None
    (stored,) = cache.store.entries()
    assert (stored.key, stored.size) == (KEY, len(ENTRY.encode()))
    assert cache.trouble == ""


def test_a_damaged_entry_counts_as_missing_and_is_removed(cache: Cache) -> None:
    overwrite(cache, KEY, ENTRY.encode()[:-1])
    assert cache.get(KEY) is None
    assert cache.damaged == 1
    assert list(cache.store.entries()) == []
    cache.put(KEY, {}, {})
    assert cache.get(KEY) == Entry(KEY)


def test_verify_removes_what_is_damaged_and_keeps_the_rest(cache: Cache) -> None:
    cache.put(KEY, ENTRY.meta, ENTRY.blocks)
    overwrite(cache, OTHER, b"nonsense")
    found = cache.verify()
    assert found.whole == 1
    assert list(found.removed) == [OTHER]
    assert [stored.key for stored in cache.store.entries()] == [KEY]


def test_clear_removes_entries_and_nothing_else(tmp_path: Path) -> None:
    cache = open_cache(str(tmp_path))
    (tmp_path / "ab").mkdir()
    mine = tmp_path / "ab" / "thesis.txt"
    mine.write_text("years of work")
    cache.put(KEY, {}, {})
    assert cache.clear() == 1
    assert cache.get(KEY) is None
    assert mine.exists()


def test_the_size_is_bounded_and_what_was_used_last_stays(tmp_path: Path) -> None:
    cache = Cache(FolderStore(tmp_path), limit=100_000)
    keys = [f"{k:02x}" + 62 * "0" for k in range(12)]
    for age, key in enumerate(keys):
        cache.put(key, {}, {"block": bytes(10_000)})
        path = tmp_path / key[:2] / f"{key}.entry"
        if path.exists():
            os.utime(path, (1e9 + age, 1e9 + age))
        cache.get(keys[0])  # in use all the time
    left = {stored.key for stored in cache.store.entries()}
    assert sum(stored.size for stored in cache.store.entries()) <= cache.limit
    assert {keys[0], keys[-1]} <= left
    assert keys[1] not in left


def test_files_of_writers_that_were_killed_are_swept_away(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    store.write(KEY, ENTRY.encode())
    old, new = (tmp_path / "ab" / f".{KEY}.entry.{name}" for name in ("aaaaaaaa", "bbbbbbbb"))
    for path in (old, new):
        path.write_bytes(b"half")
    past = time.time() - 2 * stores.STALE_S
    os.utime(old, (past, past))
    store.trim(10**9, 10**9)
    assert not old.exists()
    assert new.exists()  # its writer may be alive
    assert [stored.key for stored in store.entries()] == [KEY]


def test_a_cache_that_cannot_be_written_says_so_and_nothing_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = open_cache(str(tmp_path))

    def full(path: Path, data: bytes) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(stores, "write_bytes", full)
    cache.put(KEY, {}, {})
    assert "No space left" in cache.trouble
    monkeypatch.undo()
    cache.put(KEY, {}, {})
    assert cache.get(KEY) is None


def test_many_writers_and_readers_share_a_folder(tmp_path: Path) -> None:
    """Small enough that entries are removed all the time."""
    keys = [f"{k:02x}" + 62 * "0" for k in range(20)]
    wrong: list[str] = []

    def work(seed: int) -> None:
        cache = Cache(FolderStore(tmp_path), limit=30_000)
        for step in range(60):
            key = keys[(7 * step + seed) % len(keys)]
            cache.put(key, {"key": key}, {"block": key.encode() * 50})
            found = cache.get(keys[(3 * step + seed) % len(keys)])
            if found is not None and found.blocks["block"] != found.key.encode() * 50:
                wrong.append(found.key)
        wrong.extend(["damaged"] * cache.damaged + [cache.trouble] * bool(cache.trouble))

    workers = [threading.Thread(target=work, args=(seed,)) for seed in range(8)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert wrong == []
    assert Cache(FolderStore(tmp_path)).verify().removed == {}


def test_a_cache_that_is_a_file_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="no folder"):
        open_cache(str(tmp_path / "file"))


def test_the_default_place_is_the_users_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SNELLCHECK_CACHE", str(tmp_path))
    assert open_cache().store.where == str(tmp_path / "results")


def test_a_url_without_fsspec_names_the_command_that_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(InputError, match=r"pip install 'snellcheck\[store\]'"):
        open_cache("s3://bucket/folder")


def test_a_url_that_nobody_knows_is_bad_input() -> None:
    pytest.importorskip("fsspec")
    with pytest.raises(InputError, match="nonsense"):
        RemoteStore("nonsense://somewhere")


# --- places that fail now and then ----------------------------------------------------------------


class Refused(Exception):
    """What a library for some cloud raises: no OSError."""


@pytest.fixture
def flaky() -> list[str]:
    """`flaky://` is memory that refuses as many operations as are in the list."""
    memory = pytest.importorskip("fsspec.implementations.memory").MemoryFileSystem
    fsspec = pytest.importorskip("fsspec")
    refusals: list[str] = []

    def refusing(name: str) -> Callable[..., object]:
        method = getattr(memory, name)

        def work(self: object, *args: object, **kwargs: object) -> object:
            if refusals:
                raise Refused(refusals.pop())
            return method(self, *args, **kwargs)

        return work

    names = ("cat_file", "pipe_file", "mv", "rm_file", "find", "makedirs")
    methods = {name: refusing(name) for name in names}
    kind = type("Flaky", (memory,), {"protocol": "flaky", "store": {}, **methods})
    fsspec.register_implementation("flaky", kind, clobber=True)
    return refusals


def test_a_place_that_fails_now_and_then_is_used_all_the_same(flaky: list[str]) -> None:
    cache = open_cache("flaky://bucket/folder")
    for _ in range(FORGIVEN):
        flaky.append("503")
        assert cache.get(KEY) is None
    cache.put(KEY, ENTRY.meta, ENTRY.blocks)
    assert cache.get(KEY) == ENTRY
    assert cache.trouble == ""
    assert cache.verify().whole == 1


@pytest.mark.parametrize("work", ["get", "put"])
def test_a_place_that_keeps_failing_is_told_and_asked_no_more(flaky: list[str], work: str) -> None:
    cache = open_cache("flaky://bucket/folder")
    cache.put(KEY, ENTRY.meta, ENTRY.blocks)
    flaky += ["503 Service Unavailable"] * 100
    for _ in range(20):
        if work == "get":
            cache.get(OTHER)
        else:
            cache.put(OTHER, {}, {})
    assert "flaky://bucket/folder: Refused: 503 Service Unavailable" in cache.trouble
    assert 100 - len(flaky) == FORGIVEN + 1
    flaky.clear()
    assert cache.get(KEY) is None  # slow to notice each time, as far as we know


def test_a_folder_that_may_only_be_read_still_serves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = open_cache(str(tmp_path))
    cache.put(KEY, ENTRY.meta, ENTRY.blocks)

    def refused(path: Path, data: bytes) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(stores, "write_bytes", refused)
    for _ in range(2 * FORGIVEN):
        cache.put(OTHER, {}, {})
    assert "Read-only" in cache.trouble
    assert cache.get(KEY) == ENTRY
