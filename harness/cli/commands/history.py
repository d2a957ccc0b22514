"""`snellcheck history`: a case's figures over past runs."""

from __future__ import annotations

from pathlib import Path

import click

from harness.cli.errors import reports_errors


@click.command(name="history")
@click.argument("case", required=False)
@click.option("--renderer", "-r", "renderers", multiple=True, metavar="NAME", help="Only these.")
@click.option("--last", type=click.IntRange(1), default=30, show_default=True, help="Runs.")
@click.option("--json", "as_json", is_flag=True, help="Machine-readable.")
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("reports"), show_default=True,
    help="Folder for the page with the plots.",
)  # fmt: skip
@reports_errors
def command(
    case: str | None, renderers: tuple[str, ...], last: int, as_json: bool, out: Path
) -> None:
    """Show how the figures of CASE went over the last runs, with a page of plots.

    Without CASE, lists the runs themselves.
    """
    import dataclasses
    import json

    from harness.errors import InputError, nearest
    from harness.history import show as show_history
    from harness.history.store import History, history_file
    from harness.report.history import write_history

    history = History(history_file())
    if case is None:
        runs = history.runs(last)
        if as_json:
            click.echo(json.dumps([dataclasses.asdict(run) for run in runs], indent=1))
        else:
            show_history.runs(runs)
        return
    points = history.of_case(case, last)
    if not points:
        suggestion = nearest(case, history.cases())
        raise InputError.of("no run had this case", value=case, suggestion=suggestion)
    points = [p for p in points if not renderers or p.renderer in renderers]
    if as_json:
        click.echo(json.dumps([dataclasses.asdict(point) for point in points], indent=1))
        return
    show_history.case(points)
    click.echo(
        write_history(out, case, show_history.curves(case, points), show_history.rows(points))
    )
