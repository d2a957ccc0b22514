"""Image files in and out. Inside, an image is (H, W, 3) float32, linear Rec. 709, row 0 on top.

Everything is checked against the header before memory is taken for pixels, so a file that lies
about its size costs nothing. What cannot be read is an InputError that says why. Pixels that are
not finite are handed on as they are and counted in `Info.nonfinite`: whether they matter is the
caller's question.
"""

from __future__ import annotations

import contextlib
import io
import re
import struct
import threading
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray

from harness.documents import write_bytes
from harness.errors import InputError

Encoding = Literal["linear", "srgb"]
Pixels = NDArray[np.float32]

MAX_PIXELS = 1 << 26  # 8192 x 8192
MAX_BYTES = 1 << 31
MAX_CHANNELS = 32

_OPENEXR = threading.Lock()


@dataclass(frozen=True)
class Info:
    """What a file said about itself.

    `bits` per channel as stored (8 … 64). `encoding` is what the stored values meant;
    `encoding_from` says how we know: "format" (always linear), "declared" by the caller, "file"
    (a chunk in it) or "assumed". `nonfinite` counts pixels with NaN or infinity in any channel.
    """

    format: str
    bits: int
    encoding: Encoding
    encoding_from: Literal["format", "declared", "file", "assumed"]
    nonfinite: int = 0


@dataclass(frozen=True)
class _Wanted:
    """What the caller allows; `size` is (width, height)."""

    path: Path
    size: tuple[int, int] | None
    max_pixels: int

    def refuse(self, message: str, **more: object) -> NoReturn:
        raise InputError.of(message, file=self.path, **more)

    def check_size(self, width: int, height: int) -> None:
        if width < 1 or height < 1:
            self.refuse("an image without pixels", value=f"{width} x {height}")
        if self.size is not None and (width, height) != self.size:
            expected = f"{self.size[0]} x {self.size[1]}"
            self.refuse("wrong image size", value=f"{width} x {height}", expected=expected)
        if width * height > self.max_pixels:
            limit = f"at most {self.max_pixels} pixels"
            self.refuse("image too large", value=f"{width} x {height}", expected=limit)


# Stored values as they are, bits per channel, and the encoding as far as the file tells.
_Stored = tuple[NDArray[Any], int, Encoding | None]


def read(
    path: Path,
    *,
    encoding: Encoding | None = None,
    size: tuple[int, int] | None = None,
    max_pixels: int = MAX_PIXELS,
) -> tuple[Pixels, Info]:
    """Reads EXR, PFM, PPM (P6), NPY or PNG of 8 or 16 bits, told apart by content.

    `encoding` declares what integer values mean. Without it a PNG's own chunks decide, and a
    file that says nothing is taken as sRGB, as viewers do. Floating-point formats are linear.
    `size` is the (width, height) that the image must have.

    Raises InputError where the file is missing, unreadable, truncated, of another kind than its
    name says, of a wrong size, or not RGB.
    """
    wanted = _Wanted(path, size, max_pixels)
    kind = _kind(wanted)
    try:
        stored, bits, found = _READERS[kind](wanted)
    except (OSError, ValueError, RuntimeError, MemoryError, EOFError) as error:
        wanted.refuse(f"not a readable {kind.upper()} image: {_one_line(error)}")
    used, source = _encoding(kind, encoding, found)
    with np.errstate(over="ignore", invalid="ignore"):
        pixels = _linear(stored, used)
    return pixels, Info(kind, bits, used, source, _count_nonfinite(pixels))


def _count_nonfinite(pixels: Pixels) -> int:
    """Pixels with NaN or infinity in any channel; to see that there is none is 30 times quicker."""
    finite = np.isfinite(pixels)
    return 0 if finite.all() else int(np.count_nonzero(~finite.all(axis=2)))


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _kind(wanted: _Wanted) -> str:
    """The format by its first bytes; it must agree with the file's name."""
    try:
        with wanted.path.open("rb") as file:
            start = file.read(8)
        length = wanted.path.stat().st_size
    except OSError as error:
        wanted.refuse(f"cannot be read: {error.strerror}")
    if length > MAX_BYTES:
        wanted.refuse("file too large", value=f"{length} bytes", expected=f"at most {MAX_BYTES}")
    if not start:
        wanted.refuse("the file is empty")
    kind = next((kind for kind, magic in _MAGIC.items() if start.startswith(magic)), None)
    named = wanted.path.suffix.lower().removeprefix(".")
    if kind is None:
        known = ", ".join(name.upper() for name in _MAGIC)
        wanted.refuse("not an image", value=f"a file that starts with {start!r}", expected=known)
    if named in _MAGIC and named != kind:
        wanted.refuse(f"holds a {kind.upper()} image, but its name says {named.upper()}")
    return kind


def _encoding(
    kind: str, declared: Encoding | None, found: Encoding | None
) -> tuple[Encoding, Literal["format", "declared", "file", "assumed"]]:
    if kind in {"exr", "pfm", "npy"}:
        return "linear", "format"
    if declared is not None:
        return declared, "declared"
    if found is not None:
        return found, "file"
    return "srgb", "assumed"


def _linear(stored: NDArray[Any], encoding: Encoding) -> Pixels:
    if stored.dtype.kind == "u":
        values = np.arange(256 if stored.dtype.itemsize == 1 else 65536, dtype=np.float64)
        values /= values[-1]
        table = srgb_to_linear(values) if encoding == "srgb" else values
        return np.ascontiguousarray(table.astype(np.float32)[stored])
    if encoding == "srgb":
        stored = srgb_to_linear(stored)
    return np.ascontiguousarray(stored, dtype=np.float32)


# --- readers ------------------------------------------------------------------------------------


def _read_exr(wanted: _Wanted) -> _Stored:
    import OpenEXR

    # OpenEXR prints to sys.stdout what it also shows as a missing part. The lock keeps two
    # threads from restoring each other's redirection. It takes names of files to be UTF-8, which
    # they need not be, so it is given the open file.
    with (
        _OPENEXR,
        contextlib.redirect_stdout(io.StringIO()),
        wanted.path.open("rb") as stream,
    ):
        header = OpenEXR.File(stream, header_only=True).header()
        (left, top), (right, bottom) = (
            (int(x), int(y)) for x, y in header.get("dataWindow", ((0, 0), (-1, -1)))
        )
        wanted.check_size(right - left + 1, bottom - top + 1)
        if len(header["channels"]) > MAX_CHANNELS:
            wanted.refuse("too many channels", value=str(len(header["channels"])))
        stream.seek(0)
        file = OpenEXR.File(stream, separate_channels=True)
    if not file.parts:
        wanted.refuse("the image is truncated or damaged")
    if any(map(any, np.subtract(header["dataWindow"], header["displayWindow"]))):
        wanted.refuse("the image is cropped: its data window is not its display window")
    channels = file.channels()
    if not {"R", "G", "B"} <= channels.keys():
        wanted.refuse("no channels R, G, B", value=", ".join(sorted(channels)))
    planes = [channels[name].pixels for name in "RGB"]
    if any(plane.dtype.kind != "f" for plane in planes):
        wanted.refuse("wrong type of channels", value=str(planes[0].dtype), expected="float")
    bits = 8 * min(plane.dtype.itemsize for plane in planes)
    return np.stack(planes, axis=2), bits, None


def _read_npy(wanted: _Wanted) -> _Stored:
    with wanted.path.open("rb") as file:
        shape, dtype = _npy_header(file)
        if dtype.kind != "f":
            wanted.refuse("wrong type of values", value=str(dtype), expected="float32")
        if len(shape) != 3 or shape[2] != 3:
            wanted.refuse("wrong shape", value=str(shape), expected="(height, width, 3)")
        wanted.check_size(shape[1], shape[0])
        _check_body(wanted, file.tell(), shape[0] * shape[1] * 3 * dtype.itemsize)
    return np.load(wanted.path, allow_pickle=False), 8 * dtype.itemsize, None


def _npy_header(file: BinaryIO) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type. The header is Python source, so a damaged one fails in any way Python can."""
    try:
        major, _ = np.lib.format.read_magic(file)
        if major == 1:
            shape, _, dtype = np.lib.format.read_array_header_1_0(file)
        else:
            shape, _, dtype = np.lib.format.read_array_header_2_0(file)
    except Exception as error:
        raise ValueError("its header is damaged") from error
    return shape, dtype


def _read_pfm(wanted: _Wanted) -> _Stored:
    """PFM by hand: netpbmfile 2026.1 leaves rows bottom first, and where the first pixel's first
    byte is that of a white space, takes it for a part of the header.
    """
    data = wanted.path.read_bytes()
    header = re.match(rb"PF\s+(\d{1,9})\s+(\d{1,9})\s+([-+.eE\d]{1,32})(?:\r\n|\s)", data)
    if header is None:
        wanted.refuse("not a colour PFM: the header must read PF, width height, scale")
    width, height, scale = int(header[1]), int(header[2]), float(header[3])
    wanted.check_size(width, height)
    _check_body(wanted, header.end(), width * height * 12)
    if scale == 0:
        wanted.refuse("the scale of a PFM cannot be 0")
    values = np.frombuffer(data, "<f4" if scale < 0 else ">f4", offset=header.end())
    return values.reshape(height, width, 3)[::-1], 32, None


def _read_ppm(wanted: _Wanted) -> _Stored:
    import netpbmfile

    with netpbmfile.NetpbmFile(wanted.path) as file:
        wanted.check_size(file.width, file.height)
        if not 1 <= file.maxval <= 65535:
            wanted.refuse("wrong maximal value", value=str(file.maxval), expected="1 to 65535")
        item = 1 if file.maxval < 256 else 2
        _check_body(wanted, file.dataoffset, file.width * file.height * 3 * item)
        stored = file.asarray()
        if file.maxval in (255, 65535):
            return stored.astype(f"u{item}"), 8 * item, None
        return stored / file.maxval, file.maxval.bit_length(), None


def _read_png(wanted: _Wanted) -> _Stored:
    import imagecodecs

    data = wanted.path.read_bytes()
    if len(data) < 33 or data[12:16] != b"IHDR":
        wanted.refuse("the image is truncated or damaged")
    width, height, bits, colour = struct.unpack(">IIBB", data[16:26])
    wanted.check_size(width, height)
    if colour not in (2, 6) or bits not in (8, 16):
        kinds = {0: "grey", 2: "RGB", 3: "a palette", 4: "grey with alpha", 6: "RGBA"}
        got = f"{bits} bits of {kinds.get(colour, 'unknown kind')}"
        wanted.refuse("wrong kind of PNG", value=got, expected="8 or 16 bits of RGB")
    stored = imagecodecs.png_decode(data)
    # Many decoders give 8 bits for 16 without a word.
    if stored.dtype != np.dtype(f"u{bits // 8}") or stored.shape[:2] != (height, width):
        wanted.refuse(f"decoded as {stored.dtype} {stored.shape}, stored with {bits} bits")
    if stored.shape[2] == 4:
        if (stored[..., 3] != (1 << bits) - 1).any():
            wanted.refuse("the image is partly transparent", expected="RGB, or RGBA with alpha 1")
        stored = stored[..., :3]
    return stored, bits, _png_encoding(data)


def _png_encoding(data: bytes) -> Encoding | None:
    """What a PNG says about its values: cICP before sRGB before gAMA, as its specification has it.

    None where it says nothing, or something that is neither linear nor sRGB.
    """
    chunks = dict(_png_chunks(data))
    if len(cicp := chunks.get(b"cICP", b"")) == 4:
        transfer: dict[int, Encoding] = {8: "linear", 13: "srgb"}
        return transfer.get(cicp[1])
    if b"sRGB" in chunks:
        return "srgb"
    if len(gama := chunks.get(b"gAMA", b"")) == 4:
        gamma: dict[int, Encoding] = {100000: "linear", 45455: "srgb"}
        return gamma.get(int.from_bytes(gama, "big"))
    return None


def _png_chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Names and contents of the chunks before the pixels."""
    at = 8
    while at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        name = data[at + 4 : at + 8]
        if name == b"IDAT":
            return
        yield name, data[at + 8 : at + 8 + length]
        at += 12 + length


def _check_body(wanted: _Wanted, offset: int, length: int) -> None:
    """The pixels must fill the rest of the file exactly."""
    there = wanted.path.stat().st_size - offset
    if there != length:
        what = "truncated" if there < length else "followed by something else"
        got, expected = f"{there} bytes of pixels", str(length)
        wanted.refuse(f"the image is {what}", value=got, expected=expected)


_READERS: dict[str, Callable[[_Wanted], _Stored]] = {
    "exr": _read_exr,
    "npy": _read_npy,
    "pfm": _read_pfm,
    "ppm": _read_ppm,
    "png": _read_png,
}
_MAGIC: dict[str, bytes] = {
    "exr": b"\x76\x2f\x31\x01",
    "npy": b"\x93NUMPY",
    "pfm": b"PF",
    "ppm": b"P6",
    "png": b"\x89PNG\r\n\x1a\n",
}

FORMATS = tuple(_MAGIC)


# --- writers: all or nothing ----------------------------------------------------------------------


def write_exr(path: Path, pixels: Pixels) -> None:
    """Writes `pixels` (H, W, 3) as 32-bit linear RGB, losslessly compressed."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    rgb = np.ascontiguousarray(_checked(pixels), dtype=np.float32)
    stream = io.BytesIO()
    OpenEXR.File(header, {"RGB": rgb}).write(stream)
    write_bytes(path, stream.getvalue())


def write_npy(path: Path, pixels: Pixels) -> None:
    """Writes `pixels` (H, W, 3) as float32."""
    values = np.ascontiguousarray(_checked(pixels), dtype="<f4")
    stream = io.BytesIO()
    np.save(stream, values, allow_pickle=False)
    write_bytes(path, stream.getbuffer())


def write_png(
    path: Path, pixels: Pixels, *, bits: Literal[8, 16] = 8, encoding: Encoding = "srgb"
) -> None:
    """Writes a PNG that says how it is encoded. Values are clipped to [0, 1]; NaN becomes 0."""
    import imagecodecs

    values = np.nan_to_num(_checked(pixels).astype(np.float64), nan=0.0).clip(0.0, 1.0)
    if encoding == "srgb":
        values = linear_to_srgb(values)
    data = imagecodecs.png_encode(np.rint(values * ((1 << bits) - 1)).astype(f"u{bits // 8}"))
    name, content = (b"sRGB", b"\0") if encoding == "srgb" else (b"gAMA", struct.pack(">I", 100000))
    chunk = struct.pack(">I", len(content)) + name + content
    chunk += struct.pack(">I", zlib.crc32(name + content))
    write_bytes(path, b"".join([data[:33], chunk, data[33:]]))  # after the signature and IHDR


def _checked(pixels: Pixels) -> Pixels:
    if pixels.ndim != 3 or pixels.shape[2] != 3 or 0 in pixels.shape:
        raise ValueError(f"an image has the shape (H, W, 3), not {pixels.shape}")
    return pixels


# --- the sRGB transfer function, IEC 61966-2-1 ----------------------------------------------------


def srgb_to_linear(values: NDArray[Any]) -> NDArray[np.float64]:
    """Encoded to linear, both in [0, 1]."""
    values = np.asarray(values, dtype=np.float64)
    bent = ((np.maximum(values, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(values <= 0.04045, values / 12.92, bent)


def linear_to_srgb(values: NDArray[Any]) -> NDArray[np.float64]:
    """Linear to encoded, both in [0, 1]."""
    values = np.asarray(values, dtype=np.float64)
    bent = 1.055 * np.maximum(values, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(values <= 0.0031308, values * 12.92, bent)
