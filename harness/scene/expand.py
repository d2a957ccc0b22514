"""From one scene file to its permutations: parameters, axes and expressions.

``[parameters]`` are named numbers. ``[axes]`` are lists to sweep, and every combination of their
values is one permutation of the case. A string that starts with ``=`` is an expression over
both, and is replaced by its value wherever it stands, but not in prose such as a description.
"""

from __future__ import annotations

import ast
import itertools
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from typing import TYPE_CHECKING

from harness.errors import nearest
from harness.scene import degrees
from harness.scene.findings import Finding, KeyPath, SceneInvalid, quoted

if TYPE_CHECKING:
    from simpleeval import SimpleEval

Value = float | int | str

MOST_COMBINATIONS = 10_000
LONGEST_EXPRESSION = 500  # characters
# Keys whose text is meant for people; a "=" at their start is only a character.
PROSE = frozenset(
    "title description lecture sources formula tags tables note cause derivation".split()
)
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")  # a text value of an axis: part of an id

FUNCTIONS: dict[str, Callable[..., float]] = {
    "sind": degrees.sind,
    "cosd": degrees.cosd,
    "tand": degrees.tand,
    "asind": degrees.asind,
    "acosd": degrees.acosd,
    "atand": degrees.atand,
    "sqrt": math.sqrt,
    "abs": abs,
    "min": min,
    "max": max,
}
CONSTANTS: dict[str, Value] = {"pi": math.pi}


class ExpressionError(Exception):
    """Why an expression has no value, with the known name that may have been meant."""

    def __init__(self, message: str, suggestion: str | None = None) -> None:
        super().__init__(message)
        self.suggestion = suggestion


@dataclass(frozen=True)
class Expression:
    """A parsed expression; `text` is without its leading ``=``."""

    text: str
    tree: ast.expr
    names: frozenset[str]


@dataclass(frozen=True)
class Permutation:
    """One combination of axis values, and the document with its expressions evaluated.

    `data` holds tuples where TOML has arrays. An expression without a value is left in place.
    """

    axes: dict[str, Value]
    parameters: dict[str, Value]
    data: dict[str, object]

    @property
    def suffix(self) -> str:
        """The part of the case's id that tells its permutations apart."""
        if not self.axes:
            return ""
        return "[" + ",".join(f"{k}={format_value(v)}" for k, v in self.axes.items()) + "]"


@dataclass
class Expansion:
    permutations: list[Permutation] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)


def is_expression(value: object) -> bool:
    return isinstance(value, str) and value.startswith("=")


def format_value(value: Value) -> str:
    """A parameter's value as ids show it: ten significant digits, nothing superfluous."""
    if isinstance(value, str):
        return value
    text = f"{value + 0:.10g}"  # + 0 turns -0.0 into 0
    return re.sub(r"e([+-])0*(\d)", lambda m: f"e{m[1].replace('+', '')}{m[2]}", text)


# --- expressions ----------------------------------------------------------------------------------


def parse_expression(text: str) -> Expression:
    """Parses what follows the ``=``; raises ExpressionError for all but plain arithmetic."""
    text = text.strip()
    if len(text) > LONGEST_EXPRESSION:
        raise ExpressionError(f"expression of more than {LONGEST_EXPRESSION} characters")
    if not text:
        raise ExpressionError("expression is empty")
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ExpressionError("not an expression") from error
    return Expression(text, tree, frozenset(_names_in(tree)))


OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow)


def _names_in(node: ast.expr) -> Iterator[str]:
    """Names that an expression reads; raises ExpressionError at what is not arithmetic."""
    match node:
        case ast.Constant(value=bool() | complex()):
            raise ExpressionError(f"{ast.unparse(node)} is not a real number")
        case ast.Constant(value=int() | float()):
            return
        case ast.Name(id=name):
            yield name
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            yield from _names_in(operand)
        case ast.BinOp(left=left, op=op, right=right) if isinstance(op, OPERATORS):
            yield from _names_in(left)
            yield from _names_in(right)
        case ast.Call(func=ast.Name(id=function), args=args, keywords=[]):
            if function not in FUNCTIONS:
                raise ExpressionError(
                    f"unknown function {function}", nearest(function, FUNCTIONS)
                )
            for arg in args:
                yield from _names_in(arg)
        case _:
            raise ExpressionError(
                "only numbers, names, + - * / ** and functions may stand in an expression"
            )


def _real(value: object) -> float:
    # Everything is calculated in floating point: integers could grow without bound.
    if isinstance(value, str):
        raise ExpressionError(f"cannot calculate with the text {quoted(value)}")
    if isinstance(value, complex):
        raise ExpressionError("the result is not a real number")
    return float(value)  # type: ignore[arg-type]


def _evaluator() -> SimpleEval:
    import operator

    from simpleeval import SimpleEval

    def real(function: Callable[..., object]) -> Callable[..., float]:
        return lambda *args: _real(function(*(_real(arg) for arg in args)))

    return SimpleEval(
        operators={
            ast.Add: real(operator.add),
            ast.Sub: real(operator.sub),
            ast.Mult: real(operator.mul),
            ast.Div: real(operator.truediv),
            ast.Pow: real(operator.pow),
            ast.USub: real(operator.neg),
            ast.UAdd: real(operator.pos),
        },
        functions={name: real(function) for name, function in FUNCTIONS.items()},
    )


class Calculator:
    """Evaluates expressions; parses and prepares each text once."""

    def __init__(self) -> None:
        self._parsed: dict[str, Expression | ExpressionError] = {}
        self._evaluator: SimpleEval | None = None

    def parse(self, text: str) -> Expression:
        """`text` begins with ``=``. Raises ExpressionError."""
        if text not in self._parsed:
            try:
                self._parsed[text] = parse_expression(text[1:])
            except ExpressionError as error:
                self._parsed[text] = error
        found = self._parsed[text]
        if isinstance(found, ExpressionError):
            raise ExpressionError(str(found), found.suggestion)
        return found

    def value(self, expression: Expression, names: dict[str, Value]) -> Value:
        """The value, an int where it is whole. Raises ExpressionError."""
        for name in sorted(expression.names - names.keys()):
            raise ExpressionError(f"unknown name {name}", nearest(name, [*names, *FUNCTIONS]))
        if isinstance(expression.tree, ast.Name):
            result = names[expression.tree.id]
            if isinstance(result, str):
                return result  # a text axis, such as the names of media
        if self._evaluator is None:
            self._evaluator = _evaluator()
        self._evaluator.names = names
        try:
            number = _real(self._evaluator.eval(expression.text, expression.tree))
        except ExpressionError:
            raise
        except ZeroDivisionError as error:
            raise ExpressionError("division by zero") from error
        except OverflowError as error:
            raise ExpressionError("the result is too large") from error
        except Exception as error:  # wrong number of arguments, domain errors of a function
            raise ExpressionError(f"cannot be evaluated: {error}") from error
        if not math.isfinite(number):
            raise ExpressionError(f"the result is {number}, not a finite number")
        whole = number.is_integer() and abs(number) < 2**53
        return int(number) if whole else number


# --- parameters and axes --------------------------------------------------------------------------


@dataclass
class _Declared:
    """Names with values; a name whose declaration is wrong is `broken`, and reported once."""

    values: dict[str, list[Value]] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)
    findings: list[Finding] = field(default_factory=list)


def _table(data: dict[str, object], key: str, findings: list[Finding]) -> dict[str, object]:
    table = data.get(key, {})
    if isinstance(table, dict):
        return table
    findings.append(Finding((key,), "not a table", quoted(table), f"a table [{key}]"))
    return {}


def _name_finding(path: KeyPath, name: str) -> Finding | None:
    if name in FUNCTIONS or name in CONSTANTS:
        return Finding(path, f"{name} is built in and cannot be a name")
    if not NAME.fullmatch(name):
        return Finding(
            path, "not a valid name", quoted(name), "a letter, then letters, digits or _"
        )
    return None


def _number_problem(value: object) -> str | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "not a number"
    try:
        return None if math.isfinite(float(value)) else "not a finite number"
    except OverflowError:
        return "too large"


def _axis_values(axis: object, path: KeyPath, calculator: Calculator) -> list[Value]:
    """The values of one axis; raises SceneInvalid."""
    if isinstance(axis, dict):
        return _range_values(axis, path, calculator)
    if not isinstance(axis, list) or not axis:
        raise SceneInvalid(
            Finding(
                path, "not an axis", quoted(axis), "a list, or {start, stop, count} or {…, step}"
            )
        )
    if len(axis) > MOST_COMBINATIONS:
        raise SceneInvalid(Finding(path, f"{len(axis)} values", None, f"≤ {MOST_COMBINATIONS}"))
    findings: list[Finding] = []
    values: list[Value] = []
    for index, item in enumerate(axis):
        try:
            values.append(_axis_value(item, (*path, index), calculator))
        except SceneInvalid as error:
            findings += error.findings
    if findings:
        raise SceneInvalid(*findings)
    seen: set[str] = set()
    for index, value in enumerate(values):
        if format_value(value) in seen:
            raise SceneInvalid(Finding((*path, index), "value repeated", quoted(value)))
        seen.add(format_value(value))
    return values


def _axis_value(item: object, path: KeyPath, calculator: Calculator) -> Value:
    if isinstance(item, str) and not is_expression(item):
        if not WORD.fullmatch(item):
            raise SceneInvalid(
                Finding(path, "not a word", quoted(item), "letters, digits, '_', '.' and '-'")
            )
        return item
    return _number(item, path, calculator)


def _number(item: object, path: KeyPath, calculator: Calculator) -> float | int:
    """A number of an axis, which may be an expression over functions and pi alone."""
    if isinstance(item, str) and is_expression(item):
        try:
            item = calculator.value(calculator.parse(item), CONSTANTS)
        except ExpressionError as error:
            message = f"{error} (axes are evaluated before parameters)"
            raise SceneInvalid(Finding(path, message, quoted(item))) from error
    if (problem := _number_problem(item)) or not isinstance(item, int | float):
        raise SceneInvalid(Finding(path, problem or "not a number", quoted(item), "a number"))
    return item


def _range_values(
    axis: dict[str, object], path: KeyPath, calculator: Calculator
) -> list[Value]:
    keys = ("start", "stop", "count", "step")
    findings = [
        Finding((*path, key), "unknown key", None, ", ".join(keys), nearest(key, keys))
        for key in axis
        if key not in keys
    ]
    if not {"start", "stop"} <= axis.keys() or ("count" in axis) == ("step" in axis):
        findings.append(Finding(path, "incomplete range", None, "start, stop and count or step"))
    exact: dict[str, Fraction] = {}
    for key in keys:
        if key in axis:
            try:
                number = _number(axis[key], (*path, key), calculator)
            except SceneInvalid as error:
                findings += error.findings
            else:
                # What was written in decimals is meant: 3 steps of 0.1 are 0.3.
                exact[key] = Fraction(Decimal(repr(number)))
    if findings:
        raise SceneInvalid(*findings)
    start, stop = exact["start"], exact["stop"]
    if "count" in exact:
        count = exact["count"]
        if count.denominator != 1 or count < 2:
            raise SceneInvalid(
                Finding((*path, "count"), "not a count", quoted(axis["count"]), "an integer ≥ 2")
            )
        step = (stop - start) / (count - 1)
    else:
        step = exact["step"]
        if step == 0 or (stop - start) / step < 0:
            raise SceneInvalid(
                Finding((*path, "step"), "does not lead from start to stop", quoted(axis["step"]))
            )
        count = Fraction((stop - start) // step + 1)
    if count > MOST_COMBINATIONS:
        raise SceneInvalid(
            Finding(path, f"a range of {float(count):.6g} values", None, f"≤ {MOST_COMBINATIONS}")
        )
    if step == 0:
        raise SceneInvalid(Finding(path, "start and stop are equal, so all values are"))
    return [_plain(start + k * step) for k in range(int(count))]


def _plain(number: Fraction) -> Value:
    return int(number) if number.denominator == 1 else float(number)


def _declared_axes(data: dict[str, object], calculator: Calculator) -> _Declared:
    declared = _Declared()
    for name, axis in _table(data, "axes", declared.findings).items():
        if finding := _name_finding(("axes", name), name):
            declared.findings.append(finding)
            declared.broken.add(name)
            continue
        try:
            declared.values[name] = _axis_values(axis, ("axes", name), calculator)
        except SceneInvalid as error:
            declared.findings += error.findings
            declared.broken.add(name)
    sizes = {name: len(values) for name, values in declared.values.items()}
    total = math.prod(sizes.values())
    if total > MOST_COMBINATIONS:
        product = " × ".join(f"{name} ({size})" for name, size in sizes.items())
        declared.findings.append(
            Finding(("axes",), f"{product} = {total} permutations", None, f"≤ {MOST_COMBINATIONS}")
        )
        declared.broken |= sizes.keys()
        declared.values.clear()
    return declared


def _declared_parameters(
    data: dict[str, object], axes: _Declared, calculator: Calculator
) -> tuple[dict[str, object], set[str], list[Finding]]:
    """Parameters as written, names of the broken ones, and what is wrong with them."""
    findings: list[Finding] = []
    broken: set[str] = set()
    written = _table(data, "parameters", findings)
    for name, value in written.items():
        path = ("parameters", name)
        finding = _name_finding(path, name)
        if finding is None and (name in axes.values or name in axes.broken):
            finding = Finding(path, "an axis has this name already")
        if finding is None and not is_expression(value) and (problem := _number_problem(value)):
            finding = Finding(path, problem, quoted(value), "a number or an expression")
        if finding is not None:
            findings.append(finding)
            broken.add(name)
    return written, broken, findings


# --- documents ------------------------------------------------------------------------------------


class _Evaluation:
    """Replaces the expressions of a document for one permutation after another."""

    def __init__(self, calculator: Calculator) -> None:
        self.calculator = calculator
        self.findings: dict[tuple[KeyPath, str], Finding] = {}
        self.names: dict[str, Value] = {}
        self.broken: set[str] = set()
        self.where = ""

    def value(self, text: str, path: KeyPath) -> Value | None:
        """None where the expression has no value; that is then among the findings."""
        try:
            expression = self.calculator.parse(text)
            if expression.names & self.broken:
                return None  # the name's own declaration was reported
            return self.calculator.value(expression, self.names)
        except ExpressionError as error:
            message = str(error)
            at = self.where if expression_depends(error) else ""
            self.findings.setdefault(
                (path, ""), Finding(path, message + at, quoted(text), None, error.suggestion)
            )
            return None

    def tree(self, node: object, path: KeyPath) -> object:
        if isinstance(node, dict):
            return {
                key: _frozen(value) if key in PROSE else self.tree(value, (*path, key))
                for key, value in node.items()
            }
        if isinstance(node, list):
            return tuple(self.tree(value, (*path, index)) for index, value in enumerate(node))
        if isinstance(node, str) and is_expression(node):
            value = self.value(node, path)
            return node if value is None else value
        return node


def _frozen(node: object) -> object:
    """The same data with tuples for arrays, as the models want them."""
    if isinstance(node, dict):
        return {key: _frozen(value) for key, value in node.items()}
    return tuple(map(_frozen, node)) if isinstance(node, list) else node


def expression_depends(error: ExpressionError) -> bool:
    """Whether the error may differ between permutations, so that a message must say which."""
    return error.__cause__ is not None or "result" in str(error)


def expand(document: dict[str, object]) -> Expansion:
    """All permutations of a scene file's TOML data.

    Whatever is wrong is among `findings`, once, and not once per permutation. There is always
    at least one permutation, so that the rest of a file can be validated too.
    """
    calculator = Calculator()
    axes = _declared_axes(document, calculator)
    written, broken, findings = _declared_parameters(document, axes, calculator)
    body = {key: value for key, value in document.items() if key not in ("axes", "parameters")}
    evaluation = _Evaluation(calculator)
    expansion = Expansion(findings=[*axes.findings, *findings])
    for combination in itertools.product(*axes.values.values()):
        chosen = dict(zip(axes.values, combination, strict=True))
        evaluation.names = {**CONSTANTS, **chosen}
        evaluation.broken = axes.broken | broken
        evaluation.where = f" (at {_words(chosen)})" if chosen else ""
        parameters = _parameters(written, evaluation)
        data = evaluation.tree(body, ())
        assert isinstance(data, dict)
        expansion.permutations.append(Permutation(chosen, parameters, data))
    expansion.findings += evaluation.findings.values()
    return expansion


def _parameters(written: dict[str, object], evaluation: _Evaluation) -> dict[str, Value]:
    """Parameters in the order of the file; each may use axes and the ones before it."""
    parameters: dict[str, Value] = {}
    for name, item in written.items():
        if name in evaluation.broken:
            continue
        value = evaluation.value(item, ("parameters", name)) if is_expression(item) else item
        if value is None:
            evaluation.broken = evaluation.broken | {name}
        else:
            parameters[name] = evaluation.names[name] = value
    return parameters


def _words(values: dict[str, Value]) -> str:
    return ", ".join(f"{name} = {format_value(value)}" for name, value in values.items())
