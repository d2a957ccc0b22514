"""The long form: ``python -m tests.fuzz [SEED]`` reads 27,000 files and writes what it found.

The figures go to docs/reliability.md, between the marks of its section.
"""

# ruff: noqa: T201 - a program

from __future__ import annotations

import os
import platform
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.campaign import HANG_S, MOST_MB, Outcome, in_child
from tests.fuzz.targets import ROOT

COUNTS = {
    "scene": 9000, "mesh (OBJ)": 2500, "mesh (PLY)": 2500, "mesh (STL)": 2000, "baseline": 3000,
    "record": 3000, "summary": 2000, "choices": 1000, "renderer config": 2000,
}  # fmt: skip
DOCUMENT = ROOT / "docs" / "reliability.md"
BEGIN, END = "<!-- malformed input: generated -->", "<!-- /malformed input -->"


def table(outcomes: list[Outcome], seed: int) -> str:
    """The figures as Markdown."""
    rows = [
        f"| {o.kind} | {o.read:,} | {o.refused:,} | {o.accepted:,} | {o.slowest_s:.2f} | "
        f"{o.most_mb:.0f} | {len(o.faults)} |"
        for o in outcomes
    ]
    total = sum(o.read for o in outcomes)
    return "\n".join(
        (
            BEGIN,
            f"{total:,} files, seed {seed}, {platform.system()} {platform.machine()}, Python "
            f"{platform.python_version()}. A fault is a traceback, a crash, more than {HANG_S:.0f} "
            f"s of processor time, more than {MOST_MB} MB, or a message without file or place.",
            "",
            "| kind of file | read | refused | still valid | slowest, s | memory, MB | faults |",
            "|--|--:|--:|--:|--:|--:|--:|",
            *rows,
            END,
        )
    )


def write_section(text: str, document: Path = DOCUMENT) -> None:
    """Puts the figures between the marks of the document."""
    whole = document.read_text(encoding="utf-8")
    before, _, rest = whole.partition(BEGIN)
    _, _, after = rest.partition(END)
    document.write_text(before + text + after, encoding="utf-8")


def main(seed: int) -> int:
    """The exit code: 1 where there is a fault."""
    with TemporaryDirectory() as folder, ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        futures = [
            pool.submit(in_child, {name: count}, seed, Path(folder) / str(index), 3600.0)
            for index, (name, count) in enumerate(COUNTS.items())
        ]
        outcomes = [outcome for future in futures for outcome in future.result()]
    for outcome in outcomes:
        for fault in outcome.faults:
            print(f"{outcome.kind}: {fault}", file=sys.stderr)
    text = table(outcomes, seed)
    print(text)
    if DOCUMENT.is_file():
        write_section(text)
    return int(any(outcome.faults for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 1))
