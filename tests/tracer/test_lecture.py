"""docs/lecture.md names functions that exist, and prints numbers that are right."""

from __future__ import annotations

import importlib
import math
import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "lecture.md").read_text(encoding="utf-8")
NAMES = sorted(set(re.findall(r"`([a-z]+)\.([A-Za-z_]\w+)`", PAGE)))


@pytest.mark.parametrize(("module", "name"), [n for n in NAMES if n[1] != "py"])
def test_every_function_it_names_exists(module: str, name: str) -> None:
    assert hasattr(importlib.import_module(f"tracer.{module}"), name)


def test_every_slide_is_there() -> None:
    assert len(NAMES) >= 20


def test_the_right_table_stands_beside_the_printed_one() -> None:
    table = re.findall(r"\| (\d+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|", PAGE)
    assert len(table) == 9
    for theta, printed, rounded, exact in table:
        sine = math.sin(math.radians(float(theta)))
        assert float(printed) == round(2 / 3 * float(theta), 2)
        assert rounded == f"{math.degrees(math.asin(0.67 * sine)):.6f}"
        assert exact == f"{math.degrees(math.asin(2 / 3 * sine)):.6f}"
