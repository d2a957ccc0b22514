"""Images survive their files to the bit, and a bad file is one clear error."""

from __future__ import annotations

import errno
import io
import os
import struct
import sys
import tempfile
import zlib
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from harness import imagefile
from harness.errors import InputError
from tests.fakes import misbehave


def pixels(height: int = 5, width: int = 7) -> np.ndarray:
    return np.random.default_rng(0).random((height, width, 3), dtype=np.float32)


def pfm(data: np.ndarray, header: str = "PF\n{w} {h}\n-1.0\n") -> bytes:
    height, width, _ = data.shape
    kind = "<f4" if "-1" in header else ">f4"
    return header.format(w=width, h=height).encode() + data[::-1].astype(kind).tobytes()


def png(data: np.ndarray, *chunks: tuple[bytes, bytes]) -> bytes:
    """A PNG written by hand from uint8 or uint16, with `chunks` after IHDR."""
    height, width, channels = data.shape
    bits = 8 * data.dtype.itemsize
    rows = b"".join(b"\0" + row.astype(f">u{bits // 8}").tobytes() for row in data)
    header = struct.pack(">IIBBBBB", width, height, bits, {3: 2, 4: 6, 1: 0}[channels], 0, 0, 0)
    everything = [(b"IHDR", header), *chunks, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in everything
    )


def problem(path: Path, **arguments: object) -> str:
    with pytest.raises(InputError) as caught:
        imagefile.read(path, **arguments)  # type: ignore[arg-type]
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


# --- what is written is read ----------------------------------------------------------------------


@given(
    hnp.arrays(
        np.float32,
        st.tuples(st.integers(1, 9), st.integers(1, 9), st.just(3)),
        elements=st.floats(width=32, allow_nan=False),
    )
)
def test_floating_point_formats_keep_every_bit(data: np.ndarray) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name, write in (("a.exr", imagefile.write_exr), ("a.npy", imagefile.write_npy)):
            write(Path(folder) / name, data)
            back, info = imagefile.read(Path(folder) / name)
            assert back.tobytes() == data.tobytes()
            assert (info.bits, info.encoding, info.encoding_from) == (32, "linear", "format")
            bad = ~np.isfinite(data).all(axis=2)
            assert info.nonfinite == bad.sum()


@pytest.mark.parametrize("header", ["PF\n{w} {h}\n-1.0\n", "PF\n{w} {h}\n1.0\n", "PF {w} {h} -1\n"])
def test_pfm_rows_run_from_the_bottom(header: str, tmp_path: Path) -> None:
    path = tmp_path / "a.pfm"
    path.write_bytes(pfm(pixels(), header))
    assert np.array_equal(imagefile.read(path)[0], pixels())


def test_pfm_whose_first_byte_looks_like_white_space(tmp_path: Path) -> None:
    data = pixels()
    data[-1, 0, 0] = np.frombuffer(b"\n\n \x3e", "<f4")[0]
    (tmp_path / "a.pfm").write_bytes(pfm(data))
    assert np.array_equal(imagefile.read(tmp_path / "a.pfm")[0], data)


def test_png_of_16_bits_really_has_16(tmp_path: Path) -> None:
    stored = np.arange(65536, dtype=np.uint16)[: 64 * 64 * 3 * 5].reshape(-1, 64, 1)
    stored = np.repeat(stored, 3, axis=2)
    (tmp_path / "a.png").write_bytes(png(stored))
    back, info = imagefile.read(tmp_path / "a.png", encoding="linear")
    assert info.bits == 16
    assert np.array_equal(back, (stored / 65535).astype(np.float32))


@pytest.mark.parametrize(("bits", "half_step"), [(8, 0.5 / 255), (16, 0.5 / 65535)])
def test_written_png_is_within_half_a_step(bits: int, half_step: float, tmp_path: Path) -> None:
    imagefile.write_png(tmp_path / "a.png", pixels(), bits=bits, encoding="linear")
    back, info = imagefile.read(tmp_path / "a.png")
    assert (info.bits, info.encoding, info.encoding_from) == (bits, "linear", "file")
    # float32 stores k / 65535 within 2^-25
    assert np.abs(back.astype(float) - pixels()).max() <= half_step + 2**-25


def test_preview_is_srgb_and_clipped(tmp_path: Path) -> None:
    data = np.array([[[0.5, 2.0, np.nan], [-1.0, 0.0, 1.0]]], dtype=np.float32)
    imagefile.write_png(tmp_path / "a.png", data)
    back, info = imagefile.read(tmp_path / "a.png")
    assert info.encoding_from == "file"
    assert info.encoding == "srgb"
    # IEC 61966-2-1: linear 0.5 is encoded 188 of 255
    assert back[0, 0, 0] == np.float32(((188 / 255 + 0.055) / 1.055) ** 2.4)
    assert back[0, 0, 1:].tolist() == [1.0, 0.0]
    assert back[0, 1].tolist() == [0.0, 0.0, 1.0]


def test_ppm_of_16_bits_is_big_endian(tmp_path: Path) -> None:
    stored = (pixels() * 65535).astype(">u2")
    (tmp_path / "a.ppm").write_bytes(b"P6\n# a date\n7 5\n65535\n" + stored.tobytes())
    back, info = imagefile.read(tmp_path / "a.ppm", encoding="linear")
    assert info.bits == 16
    assert np.array_equal(back, (stored / 65535).astype(np.float32))


def test_ppm_with_another_maximum(tmp_path: Path) -> None:
    (tmp_path / "a.ppm").write_bytes(b"P6 1 1 100\n" + bytes([0, 50, 100]))
    back, info = imagefile.read(tmp_path / "a.ppm", encoding="linear")
    assert back.tolist() == [[[0.0, 0.5, 1.0]]]
    assert info.bits == 7


def test_half_floats_say_so(tmp_path: Path) -> None:
    import OpenEXR

    half = pixels().astype(np.float16)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": half}).write(str(tmp_path / "a.exr"))
    back, info = imagefile.read(tmp_path / "a.exr")
    assert info.bits == 16
    assert np.array_equal(back, half.astype(np.float32))


def test_alpha_of_an_exr_is_left_out(tmp_path: Path) -> None:
    import OpenEXR

    data = np.concatenate([pixels(), np.zeros((5, 7, 1), np.float32)], axis=2)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGBA": data}).write(str(tmp_path / "a.exr"))
    assert np.array_equal(imagefile.read(tmp_path / "a.exr")[0], pixels())


# --- encodings ------------------------------------------------------------------------------------

GREY = np.full((1, 1, 3), 188, np.uint8)


@pytest.mark.parametrize(
    ("chunks", "declared", "encoding", "source"),
    [
        ([], None, "srgb", "assumed"),
        ([], "linear", "linear", "declared"),
        ([(b"sRGB", b"\0")], None, "srgb", "file"),
        ([(b"sRGB", b"\0")], "linear", "linear", "declared"),
        ([(b"gAMA", struct.pack(">I", 100000))], None, "linear", "file"),
        ([(b"gAMA", struct.pack(">I", 45455))], None, "srgb", "file"),
        ([(b"gAMA", struct.pack(">I", 55000))], None, "srgb", "assumed"),
        ([(b"cICP", bytes([1, 8, 0, 1])), (b"sRGB", b"\0")], None, "linear", "file"),
        ([(b"cICP", bytes([1, 13, 0, 1]))], None, "srgb", "file"),
    ],
)
def test_encoding_of_a_png(
    chunks: list, declared: imagefile.Encoding | None, encoding: str, source: str, tmp_path: Path
) -> None:
    (tmp_path / "a.png").write_bytes(png(GREY, *chunks))
    back, info = imagefile.read(tmp_path / "a.png", encoding=declared)
    assert (info.encoding, info.encoding_from) == (encoding, source)
    expected = ((188 / 255 + 0.055) / 1.055) ** 2.4 if encoding == "srgb" else 188 / 255
    assert back[0, 0, 0] == np.float32(expected)


@given(st.floats(0, 1))
def test_srgb_is_its_own_inverse(value: float) -> None:
    # Both pieces meet at 0.04045 within 3e-8 only: the standard's constants are rounded.
    there = imagefile.linear_to_srgb(np.array(value))
    assert abs(imagefile.srgb_to_linear(there) - value) < 3e-8


# --- bad files ------------------------------------------------------------------------------------


def test_missing_empty_and_foreign_files(tmp_path: Path) -> None:
    assert "No such file" in problem(tmp_path / "none.exr")
    assert "Is a directory" in problem(tmp_path)
    (tmp_path / "a.exr").write_bytes(b"")
    assert "empty" in problem(tmp_path / "a.exr")
    (tmp_path / "a.npy").write_bytes(b"an image, honestly")
    assert "EXR, NPY, PFM, PPM, PNG" in problem(tmp_path / "a.npy")
    (tmp_path / "a.exr").write_bytes(png(GREY))
    assert "holds a PNG image, but its name says EXR" in problem(tmp_path / "a.exr")


def files(folder: Path) -> list[Path]:
    """One good file of each format."""
    imagefile.write_exr(folder / "a.exr", pixels())
    imagefile.write_npy(folder / "a.npy", pixels())
    imagefile.write_png(folder / "a.png", pixels(), bits=16)
    (folder / "a.pfm").write_bytes(pfm(pixels()))
    (folder / "a.ppm").write_bytes(b"P6 7 5 255\n" + bytes(7 * 5 * 3))
    return [folder / f"a.{name}" for name in imagefile.FORMATS]


def test_truncated_anywhere(tmp_path: Path) -> None:
    for path in files(tmp_path):
        whole = path.read_bytes()
        # The last 12 bytes of a PNG are IEND, which its decoder does not insist on.
        end = len(whole) - 12 if path.suffix == ".png" else len(whole)
        for length in range(0, end, 1 if len(whole) < 1000 else 7):
            path.write_bytes(whole[:length])
            problem(path)


def test_wrong_size_names_both(tmp_path: Path) -> None:
    for path in files(tmp_path):
        assert "got 7 x 5; expected 8 x 5" in problem(path, size=(8, 5))
        assert imagefile.read(path, size=(7, 5))[0].shape == (5, 7, 3)


def test_more_than_pixels(tmp_path: Path) -> None:
    for name in ("a.npy", "a.pfm", "a.ppm"):
        path = next(p for p in files(tmp_path) if p.name == name)
        path.write_bytes(path.read_bytes() + b"\0" * 105)
        assert "followed by something else" in problem(path)


def huge_npy() -> bytes:
    file = io.BytesIO()
    header = {"descr": "<f4", "fortran_order": False, "shape": (1 << 20, 1 << 20, 3)}
    np.lib.format.write_array_header_1_0(file, header)
    return file.getvalue()


def huge_exr(folder: Path) -> bytes:
    imagefile.write_exr(folder / "small.exr", pixels())
    window = struct.pack("<4i", 0, 0, 6, 4)
    return (
        (folder / "small.exr")
        .read_bytes()
        .replace(window, struct.pack("<4i", 0, 0, 1 << 20, 1 << 20))
    )


def test_a_header_that_claims_too_much_costs_nothing(tmp_path: Path) -> None:
    bomb = bytearray(png(GREY))
    bomb[16:24] = struct.pack(">II", 1 << 20, 1 << 20)
    bomb[29:33] = struct.pack(">I", zlib.crc32(bomb[12:29]))
    claims = {
        "a.npy": huge_npy(),
        "a.pfm": b"PF\n1048576 1048576\n-1\n",
        "a.ppm": b"P6 1048576 1048576 255\n",
        "a.png": bytes(bomb),
        "a.exr": huge_exr(tmp_path),
    }
    for name, data in claims.items():
        (tmp_path / name).write_bytes(data)
        assert "too large" in problem(tmp_path / name)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((2, 2, 3), int), "wrong type of values; got int64"),
        (np.zeros((2, 2, 3), complex), "wrong type of values"),
        (np.zeros((2, 2, 4)), "wrong shape; got (2, 2, 4)"),
        (np.zeros((2, 2)), "wrong shape"),
        (np.zeros((0, 2, 3)), "without pixels"),
        (np.array([None]), "wrong type of values; got object"),
    ],
)
def test_npy_of_another_kind(array: np.ndarray, message: str, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    assert message in problem(tmp_path / "a.npy")


def test_a_pickle_is_never_loaded(tmp_path: Path) -> None:
    misbehave.wrong_type(tmp_path / "a.npy", 8, 8)
    assert "got object" in problem(tmp_path / "a.npy")
    assert [p.name for p in tmp_path.iterdir()] == ["a.npy"]
    np.load(tmp_path / "a.npy", allow_pickle=True)
    assert (tmp_path / "unpickled").exists()  # the trap would have worked


def test_png_of_another_kind(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(np.zeros((2, 2, 1), np.uint8)))
    assert "8 bits of grey" in problem(tmp_path / "a.png")
    (tmp_path / "a.png").write_bytes(png(np.zeros((2, 2, 4), np.uint8)))
    assert "transparent" in problem(tmp_path / "a.png")
    (tmp_path / "a.png").write_bytes(png(np.full((2, 2, 4), 255, np.uint8)))
    assert imagefile.read(tmp_path / "a.png")[0].tolist() == np.ones((2, 2, 3)).tolist()


def test_exr_without_colours(tmp_path: Path) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Z": pixels()[..., 0].copy()}).write(str(tmp_path / "a.exr"))
    assert "no channels R, G, B; got Z" in problem(tmp_path / "a.exr")
    whole = pixels()[..., 0].astype(np.uint32)
    OpenEXR.File(header, {"R": whole, "G": whole, "B": whole}).write(str(tmp_path / "a.exr"))
    assert "wrong type of channels; got uint32" in problem(tmp_path / "a.exr")


def test_overflow_to_float32_is_counted(tmp_path: Path) -> None:
    data = np.ones((2, 2, 3))
    data[0, 0, 0] = 1e300
    np.save(tmp_path / "a.npy", data)
    back, info = imagefile.read(tmp_path / "a.npy")
    assert info.nonfinite == 1
    assert np.isinf(back[0, 0, 0])
    assert info.bits == 64


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text there")
def test_an_exr_may_lie_at_a_name_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"caf\xe9.exr")
    imagefile.write_exr(path, pixels(4, 3))
    back, _ = imagefile.read(path)
    assert np.array_equal(back, pixels(4, 3))
    assert list(tmp_path.iterdir()) == [path]


def test_damaged_exr_prints_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    imagefile.write_exr(tmp_path / "a.exr", pixels(100, 100))
    whole = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(whole[: len(whole) // 2])
    assert "truncated or damaged" in problem(tmp_path / "a.exr")
    assert capsys.readouterr().out == ""


@given(st.data())
def test_damage_is_an_input_error_or_an_image(data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = data.draw(st.sampled_from(files(Path(folder))))
        content = bytearray(path.read_bytes())
        for _ in range(data.draw(st.integers(1, 4))):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
        path.write_bytes(content)
        try:
            back, _ = imagefile.read(path, max_pixels=10_000)
        except InputError:
            return
        assert back.dtype == np.float32
        assert back.ndim == 3


def disk_full(file: BinaryIO, *_: object, **__: object) -> None:
    file.write(b"half of")
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_failed_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    imagefile.write_npy(tmp_path / "a.npy", pixels())
    before = (tmp_path / "a.npy").read_bytes()
    with pytest.raises(ValueError, match="shape"):
        imagefile.write_npy(tmp_path / "a.npy", np.zeros((2, 2), np.float32))

    monkeypatch.setattr(np, "save", disk_full)
    with pytest.raises(OSError, match="No space left"):
        imagefile.write_npy(tmp_path / "a.npy", pixels())
    assert (tmp_path / "a.npy").read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.npy"]
