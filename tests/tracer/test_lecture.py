"""docs/lecture.md names functions that exist, and prints numbers that are right."""

from __future__ import annotations

import importlib
import math
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TRACER = ROOT / "tracer"
PAGE = (ROOT / "docs" / "lecture.md").read_text(encoding="utf-8")
NAMES = sorted(set(re.findall(r"`([a-z]+)\.([A-Za-z_]\w+)`", PAGE)))


@pytest.mark.parametrize(("module", "name"), [n for n in NAMES if n[1] != "py"])
def test_every_function_it_names_exists(module: str, name: str) -> None:
    assert hasattr(importlib.import_module(f"tracer.{module}"), name)


SLIDES = (
    "Translucence",
    "Refraction - With Trigonometry",
    "Practical Refraction: Solids",
    "More Recursion",
    "Practical Refraction: Surfaces",
    "Refraction - No Trigonometry",
    "A Wonderful Real Example",
    "Refraction and Polygons",
    "Special Case: Thin Faces",
    "The Complete Package",
)


@pytest.mark.parametrize("slide", SLIDES)
def test_every_slide_is_there_with_what_implements_it(slide: str) -> None:
    (row,) = (line for line in PAGE.splitlines() if line.startswith(f"| {slide} |"))
    where = row.split("|")[3]
    assert set(re.findall(r"`([a-z]+)\.([A-Za-z_]\w+)`", where)) & set(NAMES)


def test_all_errata_are_there() -> None:
    """Table, indices, sides, roots, parallel faces, images, and the number of rays."""
    assert re.findall(r"^(\d)\. \*\*", PAGE, re.MULTILINE) == list("1234567")


def test_it_says_how_long_the_tracer_is() -> None:
    """Lines of all files, counted once each, within a twentieth."""
    rows = re.findall(r"^\| ((?:`\w+\.py`(?:, )?)+) \| ([\d,]+) \|", PAGE, re.MULTILINE)
    said = [
        (re.findall(r"`(\w+\.py)`", files), int(lines.replace(",", ""))) for files, lines in rows
    ]
    own = (["optics.py", "surface.py", "light.py", "scene.py", "spectrum.py"], 780)
    for files, lines in [own, *said]:
        counted = sum(len((TRACER / file).read_text("utf-8").splitlines()) for file in files)
        assert lines == pytest.approx(counted, rel=0.05)
    named = [file for files, _ in [own, *said] for file in files]
    assert sorted([*named, "__init__.py", "errors.py"]) == sorted(
        p.name for p in TRACER.glob("*.py")
    )


def test_the_right_table_stands_beside_the_printed_one() -> None:
    table = re.findall(r"\| (\d+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|", PAGE)
    assert len(table) == 9
    for theta, printed, rounded, exact in table:
        sine = math.sin(math.radians(float(theta)))
        assert float(printed) == round(2 / 3 * float(theta), 2)
        assert rounded == f"{math.degrees(math.asin(0.67 * sine)):.6f}"
        assert exact == f"{math.degrees(math.asin(2 / 3 * sine)):.6f}"
