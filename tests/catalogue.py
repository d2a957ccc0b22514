"""The catalogue of closed forms in tests/data, and tolerances for numbers that rounding touched."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

DATA = Path(__file__).parent / "data" / "catalogue.json"
EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Row:
    """`p` and `v` as they stand in the catalogue: numbers, or decimal numbers in strings."""

    p: list[Any]
    v: Any

    def __str__(self) -> str:
        return ",".join(map(str, self.p))


@cache
def rows(name: str) -> list[Row]:
    """The rows of one entry."""
    document = json.loads(DATA.read_text(encoding="utf-8"))
    return [Row(row["p"], row["v"]) for row in document[name]["rows"]]


def numbers(values: list[Any]) -> list[float]:
    return [float(value) for value in values]


def rounding_bound(formula: Callable[..., float], *arguments: float) -> float:
    """8 eps times the condition number of `formula` at `arguments`, in absolute terms.

    Each argument is a decimal number rounded to binary, and each operation on the way rounds once
    more. To first order a relative error eps of argument x moves the value by eps |x df/dx|, and
    an error on the way acts like one of an argument or of the value itself. The derivatives are
    central differences; they need no more than their order of magnitude.
    """
    step = 1e-6
    value = formula(*arguments)
    condition = abs(value)
    for k, x in enumerate(arguments):
        h = step * (abs(x) or 1.0)
        at = [
            formula(*(a + sign * h if i == k else a for i, a in enumerate(arguments)))
            for sign in (-1, 1)
        ]
        slope = abs(at[1] - at[0]) / (2 * h)
        condition += abs(x) * (slope if np.isfinite(slope) else 0.0)
    return 8 * EPS * condition
