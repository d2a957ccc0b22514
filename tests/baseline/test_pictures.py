"""Pictures of baselines come back as they were, to half a step of sixteen bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from harness import imagefile
from harness.baseline.pictures import keep, restore
from harness.errors import InputError
from harness.record import ImageFile
from tests.baseline.documents import stored_image


def source(size: int) -> ImageFile:
    return ImageFile(role="image", path="image.exr", sha256="0" * 64, width=size, height=size)


@pytest.mark.parametrize("darkest", [0.0, -0.25])
def test_a_picture_comes_back(tmp_path: Path, darkest: float) -> None:
    """Negative radiance too: a colour of the spectrum lies outside of linear sRGB."""
    pixels = np.random.default_rng(4).uniform(darkest, 3.0, (8, 8, 3)).astype(np.float32)
    imagefile.write_exr(tmp_path / "image.exr", pixels)
    kept = keep(source(8), tmp_path / "image.exr", tmp_path / "kept.png", None)
    data = (tmp_path / "kept.png").read_bytes()
    back = restore(kept, data, tmp_path / "kept.png")
    assert kept.darkest <= 0
    assert np.abs(back - pixels).max() <= kept.scale / 65535 / 2 * (1 + 2 / 256)


def test_what_is_not_finite_is_refused(tmp_path: Path) -> None:
    pixels = np.full((8, 8, 3), 0.5, np.float32)
    pixels[0, 0, 0] = np.nan
    imagefile.write_exr(tmp_path / "image.exr", pixels)
    with pytest.raises(InputError, match="not finite"):
        keep(source(8), tmp_path / "image.exr", tmp_path / "kept.png", None)
    assert not (tmp_path / "kept.png").exists()


def test_another_picture_is_no_baseline(tmp_path: Path) -> None:
    image = stored_image()
    with pytest.raises(InputError, match="hash"):
        restore(image, b"something else", tmp_path / "kept.png")
