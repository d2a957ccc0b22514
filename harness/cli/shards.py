"""Which part of the suite a run is to do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from harness.plan import PreparedCase
    from harness.running.shard import ShardNote


def divided(
    text: str,
    cases: Sequence[PreparedCase],
    renderers: Sequence[str],
    settings: str,
    times: Path | None,
    scenes: Path | None,
) -> tuple[list[PreparedCase], ShardNote]:
    """The cases of shard `text`, such as "2/3", and what `merge` will want to know of it.

    Raises InputError where that is no shard of this suite.
    """
    from harness.data import scenes_root
    from harness.errors import InputError
    from harness.running.shard import TIMES, Shard, ShardNote, divide, read_times, suite_hash

    shard = Shard.parse(text)
    if shard.count > len(cases):
        raise InputError.of(
            "more shards than cases", key="--shard", value=text, expected=f"at most {len(cases)}"
        )
    recorded = times or (scenes or scenes_root()) / TIMES
    seconds = read_times(recorded) if times or recorded.is_file() else {}
    ids = [case.loaded.id for case in cases]
    mine = divide(ids, seconds, shard.count)[shard.index - 1]
    note = ShardNote(
        index=shard.index, count=shard.count, cases=ids, mine=mine,
        suite=suite_hash(cases, renderers, settings, seconds),
    )  # fmt: skip
    return [case for case in cases if case.loaded.id in mine], note
