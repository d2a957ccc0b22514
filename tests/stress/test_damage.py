"""Any byte of a kept result or of a baseline may change: it is noticed, wherever it is."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from harness.baseline.document import baseline_text, parse_baseline
from harness.baseline.pictures import restore
from harness.cache.cache import Cache
from harness.cache.entry import Damaged, Entry, decode
from harness.cache.stores import FolderStore
from harness.errors import InputError
from tests.baseline.documents import approval, baseline, check, stored_image
from tests.stress.figures import note

KEY, OTHER = "ab" * 32, "cd" * 32
ENTRY = Entry(KEY, {"results": 1, "wall_s": 0.25}, {"image": bytes(range(64)), "none": b""})
APPROVED = baseline([check(), check(observable="exit_direction")], earlier=[approval()])
BASELINE = baseline_text(APPROVED).encode()
PICTURE = bytes(range(256))
IMAGE = stored_image().model_copy(update={"sha256": hashlib.sha256(PICTURE).hexdigest()})


def read_entry(data: bytes) -> object:
    return decode(data, KEY)


def read_baseline(data: bytes) -> object:
    return parse_baseline(data, Path("b.json"))


def read_picture(data: bytes) -> object:
    return restore(IMAGE, data, Path("b.png"))


def flipped(data: bytes) -> Iterator[bytes]:
    """Each bit of each byte, changed alone."""
    for place in range(len(data)):
        for bit in range(8):
            yield data[:place] + bytes([data[place] ^ 1 << bit]) + data[place + 1 :]


def cut(data: bytes) -> Iterator[bytes]:
    """Cut off before each byte."""
    yield from (data[:length] for length in range(len(data)))


def grown(data: bytes) -> Iterator[bytes]:
    """With a byte more at each place."""
    yield from (data[:place] + b"0" + data[place:] for place in range(len(data) + 1))


@pytest.mark.parametrize("harm", [flipped, cut, grown])
@pytest.mark.parametrize(
    ("what", "data", "read", "refusal"),
    [
        ("an entry of the cache", ENTRY.encode(), read_entry, Damaged),
        ("a baseline", BASELINE, read_baseline, InputError),
        ("a baseline's picture", PICTURE, read_picture, InputError),
    ],
)
def test_no_change_passes(
    what: str,
    data: bytes,
    read: Callable[[bytes], object],
    refusal: type[Exception],
    harm: Callable[[bytes], Iterator[bytes]],
) -> None:
    made = 0
    for damaged in harm(data):
        with pytest.raises(refusal):
            read(damaged)
        made += 1
    how = {flipped: "every bit of", cut: "cut off at every byte,", grown: "a byte more anywhere in"}
    outcome = "all refused" if refusal is InputError else "none used"
    note("Damaged files", f"{how[harm]} {what} of {len(data)} bytes", made, outcome)


def test_what_is_whole_is_read() -> None:
    """Or everything above would pass with readers that refuse all."""
    assert read_entry(ENTRY.encode()) == ENTRY
    kept = parse_baseline(BASELINE, Path("b.json"))
    assert kept.baseline.checks == APPROVED.checks
    assert parse_baseline(BASELINE.replace(b"\n", b"\r\n"), Path("b.json"))  # as git may have it
    with pytest.raises(InputError, match="not an image"):  # past its hash
        read_picture(PICTURE)


def test_a_damaged_entry_is_removed_and_counted(tmp_path: Path) -> None:
    made = 0
    for place in range(0, len(ENTRY.encode()), 5):
        cache = Cache(FolderStore(tmp_path))
        cache.put(KEY, ENTRY.meta, ENTRY.blocks)
        (file,) = tmp_path.rglob("*.entry")
        data = bytearray(file.read_bytes())
        data[place] ^= 1
        file.write_bytes(data)
        assert cache.get(KEY) is None
        assert cache.damaged == 1
        assert not file.exists()
        made += 1
    note("Damaged files", "an entry of the cache in its folder", made, "all removed and counted")


def test_what_belongs_elsewhere_is_stale() -> None:
    """An entry under another key, a baseline of another approval with this one's hash."""
    with pytest.raises(Damaged, match="another key"):
        decode(ENTRY.encode(), OTHER)
    later = baseline_text(APPROVED.model_copy(update={"version": "2.0"}))
    mixed = later.replace(later.split("\n")[2], BASELINE.decode().split("\n")[2])
    with pytest.raises(InputError, match="has changed since it was approved"):
        read_baseline(mixed.encode())
    note("Damaged files", "what belongs to another key or approval", 2, "all refused")
