"""`snellcheck doctor`: what works here, and what mends what does not."""

from __future__ import annotations

import sys

import click

from harness.cli.errors import EXIT_COULD_NOT_RUN, reports_errors


@click.command(name="doctor")
@click.option("--json", "as_json", is_flag=True, help="Machine-readable.")
@reports_errors
def command(as_json: bool) -> None:
    """Check each renderer with a real tiny render, and say what mends what is broken."""
    from harness import doctor as doctors

    diagnosis = doctors.diagnose()
    if as_json:
        click.echo(diagnosis.to_json())
    else:
        from rich.console import Console

        doctors.show(diagnosis, Console())
    sys.exit(0 if diagnosis.healthy else EXIT_COULD_NOT_RUN)
