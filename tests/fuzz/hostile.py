"""Files that mean harm: bombs, nesting, names that are code elsewhere, paths that lead out."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from tests.fuzz.targets import MESH_SCENE, OBJ

# Each is something in SDL, XML, HTML, a shell, a path, or a terminal.
EVIL_NAMES = (
    'a" #write (x) "', "#fopen F \"{canary}\" write", "*/ #include \"{canary}\" /*",
    "<include filename='{canary}'/>", "]]><x>&e;", "<script>alert(1)</script>", "'; --",
    "$(touch {canary})", "`touch {canary}`", "; touch {canary}", "../../../{canary}", "{canary}",
    "a\nb\r\nc", "\x1b]0;x\x07", "\u202egnp", "con", ".", "..", "-rf", "--help", "%s%n", "{{7*7}}",
    "x" * 5000,
)  # fmt: skip

PICTURE_SCENE = (
    MESH_SCENE.replace(
        b'{ type = "mesh", file = "FILE" }', b'{ type = "sphere", center = [0, 0, 0], radius = 1 }'
    )
    .replace(
        b'{ type = "ramp", start = [0, 0, 0], end = [1, 1, 1] }',
        b'{ type = "picture", file = "FILE", encoding = "srgb" }',
    )
)  # fmt: skip


def png(width: int, height: int, body: bytes) -> bytes:
    """A PNG of 8-bit RGB that says that size, whatever its pixels are."""

    def chunk(name: bytes, data: bytes) -> bytes:
        checked = name + data
        return struct.pack(">I", len(data)) + checked + struct.pack(">I", zlib.crc32(checked))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    whole = chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + whole


def bombs() -> dict[str, bytes]:
    """By file name: small files that ask for very much."""
    zeros = zlib.compress(bytes(200 * 2**20), 9)  # 200 kB that become 200 MB
    header = b"ply\nformat %s 1.0\nelement vertex 4000000000\nproperty float x\n"
    header += b"property float y\nproperty float z\nelement face 4000000000\n"
    header += b"property list uint int vertex_indices\nend_header\n"
    return {
        "huge.png": png(100_000, 100_000, zeros),
        "lying.png": png(16, 16, zeros),
        "at-the-limit.png": png(2048, 2048, zeros),
        "no-pixels.png": png(2048, 2048, b""),
        "text.ply": header % b"ascii" + b"0 0 0\n",
        "binary.ply": header % b"binary_little_endian" + bytes(1000),
        "list.ply": header.replace(b"4000000000", b"1", 1) % b"binary_little_endian"
        + bytes(12) + struct.pack("<I", 2**32 - 1) + bytes(100),
        "many.stl": bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(500),
        "index.obj": OBJ.replace(b"f 1 3 2", b"f 1 3 4000000000"),
        "negative.obj": OBJ.replace(b"f 1 3 2", b"f -1 -3 -9999999999"),
        "fan.obj": OBJ + b"f " + b"1 2 3 " * 200_000 + b"\n",
        "numbers.obj": OBJ + b"v " + b"9" * 2_000_000 + b" 0 0\n",
        "many-lines.obj": OBJ * 60_000,
        "material.obj": b"mtllib ../../../canary\nusemtl x\n" + OBJ,
    }  # fmt: skip


def scenes() -> dict[str, bytes]:
    """By name: scene files that ask for very much."""
    start = MESH_SCENE.split(b"[camera]")[0]
    rest = PICTURE_SCENE[len(start) :].replace(
        b'{ type = "picture", file = "FILE", encoding = "srgb" }',
        b'{ type = "ramp", start = [0, 0, 0], end = [1, 1, 1] }',
    )
    axis = b", ".join(b"%d" % k for k in range(1000))
    solid = rest[rest.index(b"[[solids]]") : rest.index(b"[[surfaces]]")]
    return {
        "million": start + b"[axes]\na = [%s]\nb = [%s]\n" % (axis, axis) + rest,
        "range": start + b"[axes]\na = { start = 0, stop = 1, count = 1000000 }\n" + rest,
        "huge-range": start + b"[axes]\na = { start = 0, stop = 1, count = 99999999999 }\n" + rest,
        "nested": start + b"x = " + b"[" * 100_000 + b"]" * 100_000 + b"\n" + rest,
        "dotted": start + b"a." * 50_000 + b"b = 1\n" + rest,
        "tables": start + b"[" + b".".join([b"a"] * 20_000) + b"]\n" + rest,
        "inline": start + b"x = " + b"{a = " * 20_000 + b"1" + b"}" * 20_000 + b"\n" + rest,
        "power": start + rest.replace(b"radius = 1", b'radius = "=9**9**9"'),
        "brackets": start + rest.replace(b"radius = 1", b'radius = "=' + b"(" * 20_000 + b'"'),
        "sum": start + rest.replace(b"radius = 1", b'radius = "=' + b"1+" * 50_000 + b'1"'),
        "long-number": start + rest.replace(b"radius = 1", b"radius = " + b"9" * 100_000),
        "film": start + b"[film]\nwidth = 1000000\nheight = 1000000\n" + rest,
        "solids": start + rest + b"".join(
            solid.replace(b'"thing"', b'"t%d"' % k) for k in range(3000)
        ),
        "large": start + b"# " + b"x" * (5 * 2**20) + b"\n" + rest,
        "zeros": bytes(2**20),
    }  # fmt: skip


def names(canary: Path) -> dict[str, str]:
    """The evil names with the canary's path in them, by a harmless key."""
    return {
        f"n{index}": name.replace("{canary}", str(canary)) for index, name in enumerate(EVIL_NAMES)
    }
