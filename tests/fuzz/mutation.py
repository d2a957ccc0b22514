"""Makes broken files out of whole ones; all chance is in the random generator that is given."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Callable
from typing import Any

Mutation = Callable[[bytes, random.Random], bytes]

ODD_TEXT = (
    "", "\0", "\n", "'\"", '"""', "../../etc/passwd", "/dev/zero", "C:\\x", "a" * 5000, "=1/0",
    "=2**9999999", "=ior", "=(" * 200, "=sqrt(-1)", "<script>", "\x1b[2J", "\u202e", "𝔘",
    "#declare X = 1;", "]]>", "&x;", "%s%n", "{scene}", "=[1]*99999999", "=exp(1e9)",
)  # fmt: skip
ODD_NUMBERS = (
    "nan", "inf", "-inf", "1e999", "-0.0", "0", "-1", "1e-320", "9" * 400, "0x7fffffff", "1_0",
    "99999999999", "true", "1979-05-27T07:32:00Z", '"1"', "[]", "{}", "[[[]]]", "[1, 'a']",
)  # fmt: skip
NUMBER = re.compile(rb"-?\d+(\.\d+)?")
TEXT = re.compile(rb'"[^"\n]*"')
LINE = re.compile(rb"[^\n]*\n")


def flip_bytes(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.randint(1, 8)):
        if changed:
            changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def truncate(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def cut(data: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start + rng.randint(1, 60) :]


def repeat(data: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(data) + 1)
    piece = data[start : start + rng.randint(1, 40)]
    return data[:start] + piece * rng.choice((2, 10, 1000)) + data[start:]


def insert(data: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(data) + 1)
    odd = rng.choice(ODD_TEXT + ODD_NUMBERS).encode("utf-8", "surrogatepass")
    return data[:start] + odd + data[start:]


def brackets(data: bytes, rng: random.Random) -> bytes:
    start = rng.randrange(len(data) + 1)
    deep = rng.choice((30, 300, 30_000))
    return data[:start] + rng.choice((b"[", b"{", b"[[", b"a.", b'{"a":')) * deep + data[start:]


def odd_number(data: bytes, rng: random.Random) -> bytes:
    return _replace(NUMBER, data, rng.choice(ODD_NUMBERS).encode(), rng)


def odd_text(data: bytes, rng: random.Random) -> bytes:
    odd = json.dumps(rng.choice(ODD_TEXT), ensure_ascii=rng.random() < 0.5)
    return _replace(TEXT, data, odd.encode("utf-8", "surrogatepass"), rng)


def swap_values(data: bytes, rng: random.Random) -> bytes:
    """A value of one key where another's belongs: right in form, wrong in kind."""
    values = NUMBER.findall(data) and [m[0] for m in NUMBER.finditer(data)]
    texts = TEXT.findall(data)
    if not values or not texts:
        return flip_bytes(data, rng)
    if rng.random() < 0.5:
        return _replace(TEXT, data, rng.choice(values), rng)
    return _replace(NUMBER, data, rng.choice(texts), rng)


def other_key(data: bytes, rng: random.Random) -> bytes:
    words = re.findall(rb"[A-Za-z_]{3,}", data)
    if not words:
        return flip_bytes(data, rng)
    return _replace(re.compile(re.escape(rng.choice(words))), data, rng.choice(words), rng)


def move_lines(data: bytes, rng: random.Random) -> bytes:
    lines = LINE.findall(data)
    if len(lines) < 3:
        return truncate(data, rng)
    for _ in range(rng.randint(1, 4)):
        line = lines.pop(rng.randrange(len(lines)))
        if rng.random() < 0.7 and lines:
            lines.insert(rng.randrange(len(lines)), line)
    return b"".join(lines)


def rewrite(data: bytes, rng: random.Random) -> bytes:
    """Valid JSON with one value exchanged, removed or added."""
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        return odd_number(data, rng)
    path = _random_path(document, rng)
    parent: Any = document
    for part in path[:-1]:
        parent = parent[part]
    odd: Any = rng.choice(
        (None, True, -1, 0, 1e308, float("nan"), 2**70, "", [], {}, [[]], {"a": 1}, *ODD_TEXT)
    )
    if not path:
        return json.dumps(odd).encode()
    if rng.random() < 0.2 and isinstance(parent, dict):
        del parent[path[-1]]
    elif rng.random() < 0.2 and isinstance(parent, dict):
        parent[rng.choice(ODD_TEXT)[:50]] = odd
    else:
        parent[path[-1]] = odd
    return json.dumps(document).encode("utf-8", "surrogatepass")


def _random_path(document: Any, rng: random.Random) -> list[Any]:
    path: list[Any] = []
    while isinstance(document, dict | list) and document:
        if path and rng.random() < 0.15:
            break
        key = rng.choice(list(document) if isinstance(document, dict) else range(len(document)))
        path.append(key)
        document = document[key]
    return path


def _replace(pattern: re.Pattern[bytes], data: bytes, new: bytes, rng: random.Random) -> bytes:
    found = list(pattern.finditer(data))
    if not found:
        return flip_bytes(data, rng)
    match = rng.choice(found)
    return data[: match.start()] + new + data[match.end() :]


MUTATIONS: tuple[Mutation, ...] = (
    flip_bytes, truncate, cut, repeat, insert, brackets, odd_number, odd_number, odd_text, odd_text,
    swap_values, other_key, move_lines, rewrite,
)  # fmt: skip


def mutate(data: bytes, rng: random.Random) -> bytes:
    """`data` after one to three mutations; most files have one thing wrong with them."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        data = rng.choice(MUTATIONS)(data, rng)[: 8 * 2**20]
    return data
