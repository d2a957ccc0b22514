"""docs/lecture.md names functions that exist, and prints numbers that are right."""

from __future__ import annotations

import ast
import importlib
import io
import math
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TRACER = ROOT / "tracer"
PAGE = (ROOT / "docs" / "lecture.md").read_text(encoding="utf-8")
BETWEEN = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    tokenize.ENDMARKER,
}
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


def lines_of_code(file: Path) -> int:
    """Those that are neither import nor documentation, comment or empty."""
    text = file.read_text("utf-8")
    code, other = set[int](), set[int]()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in BETWEEN:
            code |= set(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and ast.get_docstring(
            node
        ):
            node = node.body[0]
        elif not isinstance(node, ast.Import | ast.ImportFrom):
            continue
        other |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(code - other)


def test_it_says_how_long_the_tracer_is() -> None:
    """Lines of all files, counted once each, within a twentieth."""
    rows = re.findall(r"^\| ((?:`\w+\.py`(?:, )?)+) \| ([\d,]+) \| (\d+) \|", PAGE, re.MULTILINE)
    named, totals = list[str](), [0, 0]
    for files, lines, code in rows:
        here = [TRACER / name for name in re.findall(r"`(\w+\.py)`", files)]
        counts = (
            sum(len(file.read_text("utf-8").splitlines()) for file in here),
            sum(map(lines_of_code, here)),
        )
        assert (int(lines.replace(",", "")), int(code)) == pytest.approx(counts, rel=0.05)
        named += [file.name for file in here]
        totals = [total + count for total, count in zip(totals, counts, strict=True)]
    assert sorted(named) == sorted(p.name for p in TRACER.glob("*.py"))
    said = re.search(r"Some ([\d,]+) lines in (\d+) files, of which ([\d,]+) are code", PAGE)
    assert said is not None
    lines, files, code = (int(number.replace(",", "")) for number in said.groups())
    assert files == len(named)
    assert [lines, code] == pytest.approx(totals, rel=0.01)


def test_the_right_table_stands_beside_the_printed_one() -> None:
    table = re.findall(r"\| (\d+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|", PAGE)
    assert len(table) == 9
    for theta, printed, rounded, exact in table:
        sine = math.sin(math.radians(float(theta)))
        assert float(printed) == round(2 / 3 * float(theta), 2)
        assert rounded == f"{math.degrees(math.asin(0.67 * sine)):.6f}"
        assert exact == f"{math.degrees(math.asin(2 / 3 * sine)):.6f}"
