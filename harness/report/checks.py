"""Checks as pages show them: figures as text, what to look at first, and who is off.

Nothing is judged here. Verdicts come from the records; the ratio of error to tolerance only orders
failures and draws the bars.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from harness.measure.observables import Observable
from harness.record import Check, Diagnosis, Verdict
from harness.report.links import clean
from harness.report.quantity import NARROW_SPACE, number, share, with_unit

T = TypeVar("T")

# What to look at first: a wrong number tells more than one that is missing.
FIRST_TO_LOOK_AT = (Verdict.FAIL, Verdict.ERROR, Verdict.SKIP, Verdict.KNOWN, Verdict.PASS)
BAD = (Verdict.FAIL, Verdict.ERROR)
# How a reason begins that repeats the figures: "off by 4.45 units, 2.21e+10 times the tolerance; "
REPEATED = re.compile(r"off by [^\s,;:]+( [^\s,;:]+)?(, \S+ times the tolerance)?([;:,] |$)")


@dataclass(frozen=True)
class CheckView:
    """A check with its figures as text. `ratio` is the error over the tolerance, None if unknown.

    `main` and `limit` are for places where there is no room for value, expectation and tolerance;
    `said` is the reason for where they stand: without them.
    """

    check: Check
    label: str  # the check's id without what stands beside it anyway, or ""
    ratio: float | None
    value: str
    expected: str
    tolerance: str
    error: str
    main: str
    limit: str
    used: str
    said: str
    bar: float  # 0 … 1, for drawing
    largest: str  # anywhere, where `value` is of the ray that uses most of its own tolerance
    pixel: tuple[int, int] | None  # where that one is

    @property
    def over(self) -> bool:
        return self.ratio is not None and not self.ratio <= 1

    @property
    def rank(self) -> tuple[int, float]:
        """Sorts worst first."""
        ratio = -1.0 if self.ratio is None else self.ratio
        # What may not happen at all counts by how often it did, or it would outrank everything.
        if math.isinf(ratio) and self.check.value is not None:
            ratio = abs(self.check.value)
        worst = -(math.inf if math.isnan(ratio) else ratio)
        return FIRST_TO_LOOK_AT.index(self.check.status), worst


def check_view(check: Check) -> CheckView:
    value, expected, tolerance = check.value, check.expected, check.tolerance
    unit = clean(check.unit)
    error = None if value is None or expected is None else value - expected
    ratio = None if error is None or tolerance is None else _ratio(abs(error), tolerance)
    # Where an expectation is known to very many digits, the error says more than the value does.
    fine = bool(expected and tolerance and abs(expected) > 1e6 * tolerance)
    resolution = tolerance if expected and not fine else None
    digits = 6 if fine else 4

    def text(figure: float | None) -> str:
        return number(figure, resolution, digits)

    tolerance_text = with_unit(number(tolerance, digits=3), unit)
    value_text = with_unit(text(value), unit)
    off = with_unit(number(error, digits=3), unit)
    exact = tolerance == 0 and not expected
    limit = (
        "none allowed" if exact
        else f"≤{NARROW_SPACE}{tolerance_text}" if fine or not expected
        else f"{text(expected)} ± {tolerance_text}"
    )  # fmt: skip
    return CheckView(
        check=check,
        label=_label(check),
        ratio=ratio,
        value=value_text,
        expected=with_unit(text(expected), unit),
        tolerance=tolerance_text,
        error=off if expected and error is not None else "",
        main=f"off by {off}" if fine and error is not None else value_text,
        limit="" if tolerance is None else limit,
        used="" if exact else share(ratio),
        said=clean(check.reason if value is None else REPEATED.sub("", check.reason, count=1)),
        bar=0.0 if ratio is None else 1.0 if math.isnan(ratio) else min(1.0, ratio),
        largest=_largest(check),
        pixel=_worst_pixel(check),
    )


def _label(check: Check) -> str:
    own = check.id.removesuffix(f"/{check.renderer}/{check.against}").removeprefix(check.observable)
    return clean(f"probe {own[1:-1]}" if own.startswith("(") and own.endswith(")") else own)


def _largest(check: Check) -> str:
    most = check.detail.get("max")
    if check.value is None or not isinstance(most, float) or not most > 1.25 * abs(check.value):
        return ""
    return with_unit(number(most, digits=3), clean(check.unit))


def _worst_pixel(check: Check) -> tuple[int, int] | None:
    x, y = (check.detail.get(f"worst_pixel_{axis}") for axis in "xy")
    return (int(x), int(y)) if isinstance(x, int | float) and isinstance(y, int | float) else None


def _ratio(error: float, tolerance: float) -> float:
    if tolerance > 0:
        return error / tolerance
    return 0.0 if error == 0 else math.nan if math.isnan(error) else math.inf


def grouped(views: Iterable[CheckView]) -> list[tuple[CheckView, list[CheckView]]]:
    """Each check with those that lack a value for the very reason for which it lacks its own."""
    groups: dict[object, tuple[CheckView, list[CheckView]]] = {}
    for k, view in enumerate(views):
        check = view.check
        told = check.attribution or check.derivation or check.baseline
        plain = check.value is None and not told
        alike = (check.renderer, check.against, check.status, check.reason)
        first, others = groups.setdefault(alike if plain else k, (view, []))
        if first is not view:
            others.append(view)
    return list(groups.values())


def told(renderer: str, sentence: str) -> str:
    """A sentence about a renderer whose name stands before it anyway."""
    return clean(sentence).removeprefix(f"{clean(renderer)} ")


def meaning(observable: str) -> str:
    """What an observable measures, in a line; "" for one that we do not know."""
    return Observable(observable).meaning if observable in set(Observable) else ""


def sorted_views(checks: Iterable[Check]) -> list[CheckView]:
    """Worst first; the order of the record among equals."""
    return sorted((check_view(check) for check in checks), key=lambda view: view.rank)


def elsewhere(renderer: str, checks: Iterable[Check]) -> str:
    """Who is off where a renderer fails only in comparison with others that are; else ""."""
    bad = [c for c in checks if c.renderer == renderer and c.status in BAD]
    off = [check.attribution.off if check.attribution else [] for check in bad]
    if not bad or not all(off) or any(renderer in names for names in off):
        return ""
    return ", ".join(dict.fromkeys(clean(name) for names in off for name in names))


def who_is_off(check: Check) -> str:
    """Who is off where a check fails: of two that differ perhaps the other one."""
    off = check.attribution.off if check.attribution else []
    return check.renderer if check.renderer in off or not off else off[0]


def kind_of(check: Check) -> tuple[str, str]:
    """Who is off and in what, or why without figures: failures that agree in both are alike."""
    return who_is_off(check), check.observable if check.status is Verdict.FAIL else check.reason


def in_turns(items: Iterable[tuple[str, T]]) -> list[T]:
    """Every name's first item before any name's second, lest one name's many hide all others."""
    turns: Counter[str] = Counter()
    numbered = []
    for name, item in items:
        numbered.append((turns[name], item))
        turns[name] += 1
    return [item for _, item in sorted(numbered, key=lambda pair: pair[0])]


def failing(checks: Iterable[Check]) -> set[str]:
    """The renderers that are off where a check is bad."""
    return {who_is_off(check) for check in checks if check.status in BAD}


def ranked(diagnoses: Sequence[Diagnosis], failing: Container[str]) -> list[tuple[str, Diagnosis]]:
    """Diagnoses with the verdict whose colour they bear: of renderers that fail before the rest."""
    toned = [
        ("fail" if d.renderer in failing and not _documented(d) else "known", d) for d in diagnoses
    ]
    return sorted(toned, key=lambda item: item[0] != "fail")


def _documented(diagnosis: Diagnosis) -> bool:
    """Whether it is of a deviation that the scenes state."""
    return diagnosis.cause is not None and diagnosis.cause.id == "documented"
