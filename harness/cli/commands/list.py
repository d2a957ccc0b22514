"""`snellcheck list`: the cases there are."""

from __future__ import annotations

from pathlib import Path

import click

from harness.cli.errors import reports_errors
from harness.cli.options import loaded_cases, scenes_option


@click.command(name="list")
@click.argument("case", nargs=-1)
@click.option("--json", "as_json", is_flag=True, help="Machine-readable.")
@scenes_option
@reports_errors
def command(case: tuple[str, ...], as_json: bool, scenes: Path | None) -> None:
    """List the cases, a line each."""
    import json

    from harness import show

    loaded = loaded_cases(case, "normal", scenes)
    if as_json:
        rows = [
            {
                "id": c.id, "case": c.case, "family": c.model.family, "title": c.model.title,
                "parameters": c.parameters, "tags": list(c.model.tags), "file": str(c.file),
                "checks": [check.observable for check in c.model.checks],
            }
            for c in loaded
        ]  # fmt: skip
        click.echo(json.dumps(rows, indent=1))
    else:
        show.cases(loaded)
