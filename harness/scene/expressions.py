"""Numbers written as expressions: ``"=0.5 - cosd(38)"``.

Only arithmetic is understood: numbers, names, ``+ - * / **`` and the functions of `FUNCTIONS`.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeGuard

from harness.errors import nearest
from harness.scene import degrees
from harness.scene.findings import quoted

if TYPE_CHECKING:
    from simpleeval import SimpleEval

Value = float | int | str

LONGEST_EXPRESSION = 500  # characters

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
OPERATORS: dict[type[ast.operator | ast.unaryop], Callable[..., object]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}


class ExpressionError(Exception):
    """Why an expression has no value, with the known name that may have been meant.

    `depends` says that other values of the names may do better.
    """

    def __init__(
        self, message: str, suggestion: str | None = None, *, depends: bool = False
    ) -> None:
        super().__init__(message)
        self.suggestion = suggestion
        self.depends = depends


@dataclass(frozen=True)
class Expression:
    """A parsed expression; `text` is without its leading ``=``."""

    text: str
    tree: ast.expr
    names: frozenset[str]

    def check_names(self, known: Collection[str]) -> None:
        """Raises ExpressionError for a name that is not among the known ones."""
        for name in sorted(self.names.difference(known)):
            raise ExpressionError(f"unknown name {name}", nearest(name, [*known, *FUNCTIONS]))


def is_expression(value: object) -> TypeGuard[str]:
    return isinstance(value, str) and value.startswith("=")


def format_value(value: Value) -> str:
    """A value as ids show it: ten significant digits, nothing superfluous."""
    if isinstance(value, str):
        return value
    text = f"{value + 0:.10g}"  # + 0 turns -0.0 into 0
    return re.sub(r"e([+-])0*(\d)", lambda m: f"e{m[1].replace('+', '')}{m[2]}", text)


def parse(text: str) -> Expression:
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


def _names_in(node: ast.expr) -> Iterator[str]:
    """Names that an expression reads; raises ExpressionError at what is not arithmetic."""
    match node:
        case ast.Constant(value=value) if type(value) in (int, float):
            return
        case ast.Name(id=name) if name not in FUNCTIONS:
            yield name
        case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATORS:
            yield from _names_in(operand)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            yield from _names_in(left)
            yield from _names_in(right)
        case ast.Call(func=ast.Name(id=function), args=args, keywords=[]):
            if function not in FUNCTIONS:
                known = nearest(function, FUNCTIONS)
                raise ExpressionError(f"unknown function {function}", known)
            for arg in args:
                yield from _names_in(arg)
        case _:
            raise ExpressionError(
                "not plain arithmetic of numbers, names, + - * / ** and functions"
            )


def _real(value: object) -> float:
    # Everything is calculated in floating point: integers could grow without bound.
    if isinstance(value, int | float):
        return float(value)
    if isinstance(value, complex):
        raise ExpressionError("the result is not a real number", depends=True)
    raise ExpressionError(f"cannot calculate with the text {quoted(value)}")


def _on_reals(function: Callable[..., object]) -> Callable[..., float]:
    return lambda *args: _real(function(*map(_real, args)))


class Calculator:
    """Evaluates expressions, each of which it parses once."""

    def __init__(self) -> None:
        self._parsed: dict[str, Expression | ExpressionError] = {}
        self._evaluator: SimpleEval | None = None

    def parse(self, text: str) -> Expression:
        """The expression of a text that begins with ``=``. Raises ExpressionError."""
        found = self._parsed.get(text)
        if found is None:
            try:
                found = parse(text[1:])
            except ExpressionError as error:
                found = error
            self._parsed[text] = found
        if isinstance(found, ExpressionError):
            raise ExpressionError(str(found), found.suggestion)
        return found

    def value(self, expression: Expression, names: Mapping[str, Value]) -> Value:
        """Its value, an int where it is whole, or the text that a single name stands for.

        Raises ExpressionError.
        """
        expression.check_names(names)
        if isinstance(expression.tree, ast.Name):
            named = names[expression.tree.id]
            if isinstance(named, str):
                return named  # such as the name of a medium
        number = self._number(expression, names)
        if not math.isfinite(number):
            raise ExpressionError(f"the result is {number}, not a finite number", depends=True)
        whole = number.is_integer() and abs(number) < 2**53
        return int(number) if whole else number

    def _number(self, expression: Expression, names: Mapping[str, Value]) -> float:
        evaluator = self._prepared()
        evaluator.names = names
        try:
            return _real(evaluator.eval(expression.text, expression.tree))
        except ExpressionError:
            raise
        except ZeroDivisionError as error:
            raise ExpressionError("division by zero", depends=True) from error
        except OverflowError as error:
            raise ExpressionError("the result is too large", depends=True) from error
        except Exception as error:  # a wrong number of arguments, or outside a function's domain
            raise ExpressionError(f"cannot be evaluated: {error}", depends=True) from error

    def _prepared(self) -> SimpleEval:
        if self._evaluator is None:
            from simpleeval import SimpleEval

            self._evaluator = SimpleEval(
                operators={kind: _on_reals(function) for kind, function in OPERATORS.items()},
                functions={name: _on_reals(function) for name, function in FUNCTIONS.items()},
            )
        return self._evaluator
