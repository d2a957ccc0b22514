"""What snellcheck is known to see: figures measured on renderers that are wrong on purpose.

`make detection` measures them and writes `detection.json` beside this module; they are of the
version that they name, not of the run that the report is about.
"""

from __future__ import annotations

import functools
import importlib.resources
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from harness.report.links import clean
from harness.report.quantity import number

SCHEMA = "snellcheck-detection/1"
FILE = "detection.json"


@dataclass(frozen=True)
class Rule:
    """A rule by which pictures are compared, and how many of the wrong renderers it sees."""

    name: str
    seen: int
    share: float


@dataclass(frozen=True)
class WrongRenderer:
    """`seen` has, in the order of the rules, whether each sees it; None where that is not known."""

    fault: str
    source: str
    checks: int
    sentence: str
    named: bool
    seen: tuple[bool | None, ...]


@dataclass(frozen=True)
class LimitRow:
    """The smallest fault that is seen in a case, by class of renderer."""

    what: str
    case: str
    unit: str
    amounts: tuple[str, ...]


@dataclass(frozen=True)
class Detection:
    version: str
    machine: str
    total: int
    caught: int
    named: int
    right: int
    alarms: int
    rules: tuple[Rule, ...]
    classes: tuple[str, ...]
    limits: tuple[LimitRow, ...]
    wrong: tuple[WrongRenderer, ...]


@functools.cache
def detection() -> Detection | None:
    """The figures that came with this version; None where there are none."""
    file = importlib.resources.files("harness.report").joinpath(FILE)
    if not file.is_file():
        return None
    return read(json.loads(file.read_text("utf-8")))


def read(data: Mapping[str, Any]) -> Detection:
    """Raises ValueError where the data are of another schema."""
    if data.get("schema") != SCHEMA:
        raise ValueError(f"schema {data.get('schema')!r} instead of {SCHEMA!r}")
    mutants, rivals = data["mutants"], data["rivals"]
    total = len(mutants)
    names = list(dict.fromkeys(name for seen in rivals.values() for name in seen))
    # A rule that could not be asked about every fault would seem to be blind to some.
    names = [name for name in names if all(seen[name] is not None for seen in rivals.values())]
    counts = [("snellcheck", sum(m["caught"] for m in mutants))]
    counts += [(name, sum(bool(seen[name]) for seen in rivals.values())) for name in names]
    classes = list(dict.fromkeys(limit["class"] for limit in data["limits"]))
    return Detection(
        version=clean(data["snellcheck_version"]), machine=clean(data["machine"]), total=total,
        caught=counts[0][1], named=sum(m["right"] for m in mutants),
        right=len(data["alarms"]), alarms=sum(len(a["red"]) for a in data["alarms"]),
        rules=tuple(Rule(clean(name), n, n / max(total, 1)) for name, n in counts),
        classes=tuple(map(clean, classes)), limits=tuple(_limits(data["limits"], classes)),
        wrong=tuple(
            WrongRenderer(
                clean(m["name"]), clean(m["source"]), m["red"], clean(said(m["sentence"])),
                m["right"], tuple(rivals[m["name"]][name] for name in names),
            )
            for m in mutants
        ),
    )  # fmt: skip


def said(sentence: str) -> str:
    """A diagnosis without the renderer's name and without what depends on the number of cases."""
    return sentence.partition(": this explains")[0].replace("mutant ", "it ", 1)


def _limits(limits: Sequence[Mapping[str, Any]], classes: Sequence[str]) -> list[LimitRow]:
    rows: dict[tuple[str, str, str], dict[str, float]] = {}
    for found in limits:
        key = (found["what"], found["case"], found["unit"])
        rows.setdefault(key, {})[found["class"]] = found["amount"]
    return [
        LimitRow(
            clean(what), clean(case), clean(unit),
            tuple(number(row[k], digits=2) if k in row else "–" for k in classes),
        )
        for (what, case, unit), row in rows.items()
    ]  # fmt: skip
