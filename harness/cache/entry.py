"""An entry of the cache: named blocks of bytes under a key, with a checksum over all of it.

Nothing that was written outside this process is trusted: an entry that is short, long, changed in
any byte, or stored under another key is `Damaged` and counts as not there.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

MAGIC = b"snellcheck-entry/1\n"
_DIGEST = hashlib.sha256().digest_size
_LENGTH = 8


class Damaged(Exception):
    """The bytes are not the entry that they should be; the message says why."""


@dataclass(frozen=True)
class Entry:
    """`meta` is JSON; `blocks` are bytes by name, in order."""

    key: str
    meta: Mapping[str, Any] = field(default_factory=dict)
    blocks: Mapping[str, bytes] = field(default_factory=dict)

    def encode(self) -> bytes:
        """Magic, SHA-256 of what follows, length of the header, header, blocks."""
        sizes = [[name, len(block)] for name, block in self.blocks.items()]
        header = json.dumps({"key": self.key, "meta": self.meta, "blocks": sizes}).encode()
        body = b"".join([len(header).to_bytes(_LENGTH, "little"), header, *self.blocks.values()])
        return MAGIC + hashlib.sha256(body).digest() + body


def decode(data: bytes, key: str) -> Entry:
    """The entry in `data`. Raises Damaged where it is not whole or not that of `key`."""
    if not data.startswith(MAGIC):
        raise Damaged("it is no entry of this version")
    digest, body = data[len(MAGIC) :][:_DIGEST], data[len(MAGIC) + _DIGEST :]
    if hashlib.sha256(body).digest() != digest:
        raise Damaged("its checksum does not match")
    header_end = _LENGTH + int.from_bytes(body[:_LENGTH], "little")
    header = json.loads(body[_LENGTH:header_end])
    if header["key"] != key:
        raise Damaged("it belongs to another key")
    blocks, start = {}, header_end
    for name, size in header["blocks"]:
        blocks[name] = body[start : start + size]
        start += size
    return Entry(key, header["meta"], blocks)
