"""From one scene file to its permutations: parameters, axes and expressions.

``[parameters]`` are named numbers. ``[axes]`` are lists to sweep, and every combination of their
values is one permutation of the case. A string that starts with ``=`` is an expression over
both, and is replaced by its value wherever it stands, but not in prose such as a description.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

from harness.scene.axes import Axes, check_name, check_number, read_axes, table
from harness.scene.document import count_values
from harness.scene.expressions import (
    CONSTANTS,
    Calculator,
    ExpressionError,
    Value,
    format_value,
    is_expression,
)
from harness.scene.findings import Finding, KeyPath, SceneInvalid, quoted

MOST_WORK = 5_000_000  # permutations x values of a document

# Keys whose text is meant for people; a "=" at their start is only a character.
PROSE = frozenset(
    {
        "title",
        "description",
        "lecture",
        "sources",
        "formula",
        "tags",
        "tables",
        "cause",
        "derivation",
    }
)


@dataclass(frozen=True)
class Permutation:
    """One combination of axis values, and the document with its expressions evaluated.

    `data` has tuples for TOML's arrays. An expression without a value is left in place.
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

    @property
    def where(self) -> str:
        """The permutation as a message names it."""
        if not self.axes:
            return ""
        return " (at " + ", ".join(f"{k} = {format_value(v)}" for k, v in self.axes.items()) + ")"


@dataclass
class Expansion:
    permutations: list[Permutation] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)


def expand(document: dict[str, object]) -> Expansion:
    """All permutations of a scene file's TOML data.

    Whatever is wrong is among `findings`, once, and not once per permutation. There is always
    at least one permutation, so that the rest of a file can be validated too.
    """
    calculator = Calculator()
    axes = read_axes(document, calculator)
    _limit_work(document, axes)
    findings = dict.fromkeys(axes.findings)
    body = {
        key: _frozen(value) for key, value in document.items() if key not in ("axes", "parameters")
    }
    expansion = Expansion()
    for combination in itertools.product(*axes.values.values()):
        chosen = dict(zip(axes.values, combination, strict=True))
        evaluation = _Evaluation(calculator, chosen, set(axes.broken))
        parameters = evaluation.parameters(document)
        permutation = Permutation(chosen, parameters, evaluation.table(body, ()))
        expansion.permutations.append(permutation)
        known = {finding.path for finding in findings}
        for finding, depends in evaluation.findings.items():
            if finding.path not in known:
                where = permutation.where if depends else ""
                findings[_appended(finding, where)] = None
    expansion.findings = list(findings)
    return expansion


def _limit_work(document: dict[str, object], axes: Axes) -> None:
    """Gives up on axes whose permutations of a large document would take minutes."""
    permutations = math.prod(len(values) for values in axes.values.values())
    values = count_values(document)
    if permutations * values > MOST_WORK:
        message = f"{permutations} permutations of a scene of {values} values"
        axes.refuse(Finding(("axes",), message, None, f"a product ≤ {MOST_WORK:.0e}"))


def _appended(finding: Finding, where: str) -> Finding:
    message = finding.message + where
    return Finding(finding.path, message, finding.value, finding.expected, finding.suggestion)


class _Evaluation:
    """Replaces the expressions of a document for one permutation."""

    def __init__(self, calculator: Calculator, axes: dict[str, Value], broken: set[str]) -> None:
        self.calculator = calculator
        self.names: dict[str, Value] = {**CONSTANTS, **axes}
        self.broken = broken  # names that are declared, but wrongly, which is reported there
        self.findings: dict[Finding, bool] = {}  # and whether they depend on the permutation

    def parameters(self, document: dict[str, object]) -> dict[str, Value]:
        """Parameters in the order of the file; each may use axes and the ones before it."""
        found: list[Finding] = []
        parameters: dict[str, Value] = {}
        for name, item in table(document, "parameters", found).items():
            value = self._parameter(name, item)
            if value is None:
                self.broken.add(name)
            else:
                parameters[name] = self.names[name] = value
        self.findings.update(dict.fromkeys(found, False))
        return parameters

    def _parameter(self, name: str, item: object) -> Value | None:
        path = ("parameters", name)
        try:
            check_name(path, name)
            if name in self.names or name in self.broken:
                raise SceneInvalid(Finding(path, "an axis has this name already"))
            return self.value(item, path) if is_expression(item) else check_number(path, item)
        except SceneInvalid as error:
            self.findings.update(dict.fromkeys(error.findings, False))
            return None

    def value(self, text: str, path: KeyPath) -> Value | None:
        """None where the expression has no value; why is then among the findings."""
        try:
            expression = self.calculator.parse(text)
            expression.check_names(self.names.keys() | self.broken)
            if expression.names & self.broken:
                return None
            return self.calculator.value(expression, self.names)
        except ExpressionError as error:
            finding = Finding(path, str(error), quoted(text), None, error.suggestion)
            self.findings[finding] = error.depends
            return None

    def table(self, node: dict[str, object], path: KeyPath) -> dict[str, object]:
        return {
            key: value if key in PROSE else self._tree(value, (*path, key))
            for key, value in node.items()
        }

    def _tree(self, node: object, path: KeyPath) -> object:
        if isinstance(node, dict):
            return self.table(node, path)
        if isinstance(node, tuple):
            return tuple(self._tree(item, (*path, index)) for index, item in enumerate(node))
        if is_expression(node):
            value = self.value(node, path)
            return node if value is None else value
        return node


def _frozen(node: object) -> object:
    """The same data with tuples for arrays, as the models want them."""
    if isinstance(node, dict):
        return {key: _frozen(value) for key, value in node.items()}
    return tuple(map(_frozen, node)) if isinstance(node, list) else node
