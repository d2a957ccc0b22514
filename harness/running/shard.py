"""Shards: a suite split over machines that know nothing of each other.

Every machine divides the suite by itself, so all of them must come to the same division: from the
same cases and the same recorded times, and nothing else.
"""

from __future__ import annotations

import hashlib
import json
import re
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from harness.documents import Model, read, write_text
from harness.errors import InputError
from harness.plan import PreparedCase
from harness.record import CaseRecord

SCHEMA: Literal["snellcheck-shard/1"] = "snellcheck-shard/1"
NOTE = "shard.json"
TIMES = "times.json"  # in a run's folder, and beside scenes


@dataclass(frozen=True)
class Shard:
    """The `index`-th of `count` parts, counted from 1."""

    index: int
    count: int

    @classmethod
    def parse(cls, text: str) -> Shard:
        """From "2/3". Raises InputError."""
        found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text.strip())
        if found is None or not 1 <= int(found[1]) <= int(found[2]):
            expected = "i/n with 1 <= i <= n, such as 2/3"
            raise InputError.of("no shard", key="--shard", value=text, expected=expected)
        return cls(int(found[1]), int(found[2]))

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"


class ShardNote(Model):
    """`shard.json`: which part of which suite a run was. `suite` is the hash of all of it."""

    note_schema: Literal["snellcheck-shard/1"] = Field(default=SCHEMA, alias="schema")
    index: int = Field(ge=1)
    count: int = Field(ge=1)
    suite: str
    cases: list[str]  # of the whole suite, in its order
    mine: list[str]

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


def divide(cases: Sequence[str], seconds: Mapping[str, float], count: int) -> list[list[str]]:
    """The cases of each of `count` shards, in the suite's order.

    Longest first, each to the shard that has least to do (Graham's LPT rule: at most 4/3 of the
    best possible longest shard). A case without a recorded time counts as the median of those with
    one.
    """
    usual = statistics.median(seconds.values()) if seconds else 1.0
    cost = {case: max(seconds.get(case, usual), 0.0) for case in cases}
    loads = [0.0] * count
    shard_of = {}
    for case in sorted(cases, key=lambda case: (-cost[case], case)):
        least = loads.index(min(loads))
        loads[least] += cost[case]
        shard_of[case] = least
    return [[case for case in cases if shard_of[case] == k] for k in range(count)]


def suite_hash(
    cases: Sequence[PreparedCase],
    renderers: Sequence[str],
    settings: str,
    seconds: Mapping[str, float],
) -> str:
    """The hash of what shards have in common: scenes, checks, renderers, settings, times."""
    digest = hashlib.sha256(json.dumps([list(renderers), settings]).encode())
    for case in cases:
        parts = [
            case.loaded.id, case.loaded.model.model_dump_json(), case.scene.model_dump_json()
        ]  # fmt: skip
        digest.update(json.dumps([*parts, seconds.get(case.loaded.id)]).encode())
    return digest.hexdigest()


def read_times(path: Path) -> dict[str, float]:
    """Seconds by case. Raises InputError where the file is unreadable or something else."""
    try:
        kind = TypeAdapter(dict[str, float])
        found = kind.validate_json(path.read_bytes())
    except OSError as error:
        raise InputError.of(f"cannot be read: {error.strerror}", file=path) from error
    except ValidationError as error:
        expected = "a JSON object of seconds by case"
        raise InputError.of("no recorded times", file=path, expected=expected) from error
    return {case: seconds for case, seconds in found.items() if seconds >= 0}  # no NaN, either


def write_times(folder: Path, records: Sequence[CaseRecord]) -> None:
    """Writes how long the renders of each case took to `times.json` in a run's folder."""
    times = {r.id: round(sum(run.render_s for run in r.runs), 3) for r in records}
    write_text(folder / TIMES, json.dumps(times, indent=1, sort_keys=True) + "\n")


def read_note(folder: Path) -> ShardNote:
    """Raises InputError where `folder` holds no shard."""
    if not (folder / NOTE).is_file():
        expected = "the folder of a run with --shard"
        raise InputError.of("no shard", file=folder / NOTE, expected=expected)
    return read(folder / NOTE, ShardNote, "shard")


def write_note(folder: Path, note: ShardNote) -> None:
    """Writes `shard.json`."""
    write_text(folder / NOTE, note.model_dump_json(by_alias=True, indent=1) + "\n")
