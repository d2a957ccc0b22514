"""`snellcheck report`: HTML from records."""

from __future__ import annotations

from pathlib import Path

import click

from harness.cli.errors import reports_errors


@click.command(name="report")
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@reports_errors
def command(folder: Path) -> None:
    """Rebuild the HTML of the run in FOLDER from its records."""
    from harness.report import write_report

    click.echo(write_report(folder))
