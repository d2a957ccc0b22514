"""`snellcheck schema`: the formats of files, for editors."""

from __future__ import annotations

import click

from harness.cli.errors import reports_errors


@click.command(name="schema")
@click.option("--of", "what", type=click.Choice(["case", "scene"]), default="case")
@reports_errors
def command(what: str) -> None:
    """Print the JSON Schema of scene files (case) or of scene.json (scene)."""
    import json

    from harness.scene.schema import case_schema, scene_schema

    click.echo(json.dumps(case_schema() if what == "case" else scene_schema(), indent=1))
