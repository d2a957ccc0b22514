"""The axes of a scene file: lists and ranges of values to sweep.

An axis is a list of numbers or words, or a range: ``{start, stop, count}`` or
``{start, stop, step}``, both ends included.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction

from harness.errors import nearest
from harness.scene.expressions import (
    CONSTANTS,
    FUNCTIONS,
    Calculator,
    ExpressionError,
    Value,
    format_value,
    is_expression,
)
from harness.scene.findings import Finding, KeyPath, SceneInvalid, quoted

MOST_COMBINATIONS = 10_000
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")  # becomes a part of ids and file names
RANGE_KEYS = ("start", "stop", "count", "step")


@dataclass
class Axes:
    """Values by name; a name whose axis is wrong is `broken`, and why is in `findings`."""

    values: dict[str, list[Value]] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)
    findings: list[Finding] = field(default_factory=list)

    def refuse(self, finding: Finding) -> None:
        """Gives up on all axes."""
        self.findings.append(finding)
        self.broken |= self.values.keys()
        self.values = {}


def read_axes(document: dict[str, object], calculator: Calculator) -> Axes:
    """The ``[axes]`` of a document. More than MOST_COMBINATIONS combinations are refused."""
    axes = Axes()
    for name, axis in table(document, "axes", axes.findings).items():
        path = ("axes", name)
        try:
            check_name(path, name)
            axes.values[name] = _values(axis, path, calculator)
        except SceneInvalid as error:
            axes.findings += error.findings
            axes.broken.add(name)
    total = math.prod(len(values) for values in axes.values.values())
    if total > MOST_COMBINATIONS:
        sizes = " × ".join(f"{name} ({len(values)})" for name, values in axes.values.items())
        message = f"{sizes} are {total} combinations"
        axes.refuse(Finding(("axes",), message, None, f"≤ {MOST_COMBINATIONS}"))
    return axes


def table(document: dict[str, object], key: str, findings: list[Finding]) -> dict[str, object]:
    """The table under `key`, empty where it is absent or, as a finding says, no table."""
    found = document.get(key, {})
    if isinstance(found, dict):
        return found
    findings.append(Finding((key,), "wrong type", quoted(found), "a table"))
    return {}


def check_name(path: KeyPath, name: str) -> None:
    """Raises SceneInvalid for a name that expressions could not use."""
    if name in FUNCTIONS or name in CONSTANTS:
        raise SceneInvalid(Finding(path, f"{name} is built in and cannot be a name"))
    if not NAME.fullmatch(name):
        expected = "a letter, then letters, digits or _"
        raise SceneInvalid(Finding(path, "not a valid name", quoted(name), expected))


def check_number(path: KeyPath, value: object) -> int | float:
    """The value where it is a finite number; raises SceneInvalid."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            if math.isfinite(float(value)):
                return value
        except OverflowError:
            raise SceneInvalid(Finding(path, "too large", quoted(value))) from None
    raise SceneInvalid(Finding(path, "wrong type", quoted(value), "a finite number"))


def _values(axis: object, path: KeyPath, calculator: Calculator) -> list[Value]:
    if isinstance(axis, dict):
        return _range(axis, path, calculator)
    if not isinstance(axis, list) or not axis:
        expected = "a list of values, {start, stop, count} or {start, stop, step}"
        raise SceneInvalid(Finding(path, "not an axis", quoted(axis), expected))
    if len(axis) > MOST_COMBINATIONS:
        raise SceneInvalid(Finding(path, f"{len(axis)} values", None, f"≤ {MOST_COMBINATIONS}"))
    findings: list[Finding] = []
    values: list[Value] = []
    seen: set[str] = set()
    for index, item in enumerate(axis):
        try:
            value = _value(item, (*path, index), calculator)
        except SceneInvalid as error:
            findings += error.findings
            continue
        if format_value(value) in seen:
            message = "value repeated, to the digits that ids show"
            findings.append(Finding((*path, index), message, quoted(item)))
        seen.add(format_value(value))
        values.append(value)
    if findings:
        raise SceneInvalid(*findings)
    return values


def _value(item: object, path: KeyPath, calculator: Calculator) -> Value:
    if not isinstance(item, str) or is_expression(item):
        return _number(item, path, calculator)
    if not WORD.fullmatch(item):
        expected = "letters, digits, '_', '.' and '-'"
        raise SceneInvalid(Finding(path, "not a word", quoted(item), expected))
    return item


def _number(item: object, path: KeyPath, calculator: Calculator) -> int | float:
    """A number of an axis, which may be an expression over functions and pi alone."""
    value = item
    if is_expression(item):
        try:
            value = calculator.value(calculator.parse(item), CONSTANTS)
        except ExpressionError as error:
            message = f"{error} (axes know no other names than pi)"
            raise SceneInvalid(Finding(path, message, quoted(item))) from error
    return check_number(path, value)


def _range(axis: dict[str, object], path: KeyPath, calculator: Calculator) -> list[Value]:
    findings = [
        Finding((*path, key), "unknown key", None, ", ".join(RANGE_KEYS), nearest(key, RANGE_KEYS))
        for key in axis
        if key not in RANGE_KEYS
    ]
    if not {"start", "stop"} <= axis.keys() or ("count" in axis) == ("step" in axis):
        expected = "start, stop, and either count or step"
        findings.append(Finding(path, "not a range", quoted(axis), expected))
    exact: dict[str, Fraction] = {}
    for key in axis.keys() & set(RANGE_KEYS):
        try:
            # Decimals are meant as they are written: three steps of 0.1 are 0.3.
            exact[key] = Fraction(Decimal(repr(_number(axis[key], (*path, key), calculator))))
        except SceneInvalid as error:
            findings += error.findings
    if findings:
        raise SceneInvalid(*findings)
    start, step, count = _steps(exact, path)
    return [_plain(start + k * step) for k in range(count)]


def _steps(exact: dict[str, Fraction], path: KeyPath) -> tuple[Fraction, Fraction, int]:
    """Start, step and number of values of a range; raises SceneInvalid."""
    start, stop = exact["start"], exact["stop"]
    if start == stop:
        raise SceneInvalid(Finding(path, "start and stop are the same"))
    if "count" in exact:
        count = exact["count"]
        if count.denominator != 1 or count < 2:
            where = (*path, "count")
            raise SceneInvalid(Finding(where, "not a count", f"{float(count):g}", "an integer ≥ 2"))
        step = (stop - start) / (count - 1)
    else:
        step = exact["step"]
        if step == 0 or (stop - start) / step < 0:
            where = (*path, "step")
            raise SceneInvalid(
                Finding(where, "does not lead from start to stop", f"{float(step):g}")
            )
        count = Fraction((stop - start) // step + 1)
    if count > MOST_COMBINATIONS:
        raise SceneInvalid(Finding(path, f"more than {MOST_COMBINATIONS} values"))
    return start, step, int(count)


def _plain(number: Fraction) -> Value:
    return int(number) if number.denominator == 1 else float(number)
