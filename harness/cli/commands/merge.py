"""`snellcheck merge`: shards become one run."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from harness.cli.errors import reports_errors
from harness.cli.options import (
    DEFAULT_OUT,
    add_to_history,
    history_option,
    prepared_cases,
    scenes_option,
)


@click.command(name="merge")
@click.argument("folder", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), default=DEFAULT_OUT, show_default=True)
@scenes_option
@history_option
@reports_errors
def command(folder: tuple[Path, ...], out: Path, scenes: Path | None, history: bool) -> None:
    """Put the runs in FOLDERs, made with --shard, together; the exit code is that of the whole.

    Refuses shards that are missing, given twice, interrupted, or not of the same suite.
    """
    from harness import show
    from harness.errors import InputError
    from harness.report import write_report
    from harness.running.merge import merge

    line = " ".join(["snellcheck", *sys.argv[1:]])
    try:
        cases = prepared_cases((), "normal", scenes)
    except InputError:  # scenes that are not here can still be merged
        cases = []
    summary = merge(folder, out, cases, line)
    if history:
        add_to_history(summary, out)
    index = write_report(out)
    show.verdicts(summary, index)
    sys.exit(summary.exit_code)
