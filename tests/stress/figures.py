"""How many times a fault is made, and where the figures go that come of it.

A few of each in every test run. With SNELLCHECK_STRESS naming a folder (`make stress`) there are
many, and what was seen is noted there; `scripts/reliability` makes docs/reliability.md of it.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

FOLDER = os.environ.get("SNELLCHECK_STRESS", "")


def count(few: int, many: int) -> int:
    """How many faults to make."""
    return many if FOLDER else few


def note(section: str, fault: str, made: int, outcome: str) -> None:
    """Notes one line of a table: `made` faults of a kind, and what came of all of them."""
    if not FOLDER:
        return
    folder = Path(FOLDER)
    folder.mkdir(parents=True, exist_ok=True)
    name = "".join(c if c.isalnum() else "-" for c in f"{section} {fault}")
    line = {"section": section, "fault": fault, "made": made, "outcome": outcome}
    (folder / f"{name}.json").write_text(json.dumps(line))
