"""`snellcheck check`: a run against approved results."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from harness.cli.errors import reports_errors
from harness.cli.options import run_option, store_option


@click.command(name="check")
@click.argument("case", nargs=-1)
@run_option
@click.option(
    "--baseline", "where", metavar="DIR|GIT-REV|RUN",
    help="Folder of baselines, a revision that has one, or an earlier run.  [default: references]",
)  # fmt: skip
@click.option("--renderer", "-r", "renderers", multiple=True, metavar="NAME", help="Only these.")
@click.option(
    "--partial", is_flag=True,
    help="Only the cases of the run: for a run of a part of what was approved.",
)  # fmt: skip
@click.option(
    "--history", type=click.Path(path_type=Path, file_okay=False, exists=True),
    help="Folder of earlier runs, to find slow drift in.  [default: the history of past runs]",
)  # fmt: skip
@store_option
@reports_errors
def command(
    case: tuple[str, ...],
    folder: Path,
    where: str | None,
    renderers: tuple[str, ...],
    partial: bool,
    history: Path | None,
    store: str,
) -> None:
    """Compare a run with what was approved: all CASEs, or those a glob like "slab-*" selects.

    Fails with 1 where a check has regressed, is missing, or was approved for another scene. The
    states are written into the run's records and shown in its report. Checks that slide slowly over
    the last runs into the same folder are named, and fail nothing.
    """
    from harness.baseline.compare import compare
    from harness.baseline.outcome import outcome, write_outcome
    from harness.baseline.run_folder import read_run
    from harness.baseline.select import of_run, selector
    from harness.baseline.shown import show_pictures
    from harness.baseline.source import open_baselines
    from harness.baseline.store import store_at
    from harness.baseline.trend import deviations, read_history, trends
    from harness.cli.baselines import default_baseline, past_runs, show_states
    from harness.report import write_report

    run = read_run(folder)
    baselines = open_baselines(where or default_baseline(), store_at(store))
    wanted = selector(case, renderers, run, baselines)
    comparison = compare(run, baselines, of_run(run, wanted) if partial else wanted)
    past = read_history(history, run.summary) if history else past_runs(run)
    runs = [*past, deviations(run.summary)]
    found = outcome(comparison, baselines.source, trends(runs), len(runs))
    summary = write_outcome(show_pictures(run, baselines), comparison, found)
    index = write_report(folder)
    show_states(summary)
    click.echo(f"Report: {index}")
    sys.exit(1 if found.failed else 0)
