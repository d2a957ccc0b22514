"""`snellcheck show`: what a case asks and what is true of it."""

from __future__ import annotations

from pathlib import Path

import click

from harness.cli.errors import reports_errors
from harness.cli.options import prepared_cases, quality_option, scenes_option


@click.command(name="show")
@click.argument("case")
@quality_option
@scenes_option
@reports_errors
def command(case: str, quality: str, scenes: Path | None) -> None:
    """Show the resolved scene, the truth and the checks of CASE."""
    from harness import show as shows

    for prepared in prepared_cases((case,), quality, scenes):
        shows.case(prepared)
