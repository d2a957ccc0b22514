"""`snellcheck translate`: what a renderer is given."""

from __future__ import annotations

from pathlib import Path

import click

from harness.cli.errors import reports_errors
from harness.cli.options import prepared_cases, quality_option, scenes_option


@click.command(name="translate")
@click.argument("case")
@click.option("--to", "target", required=True, metavar="povray|mitsuba|json|…")
@click.option("--out", type=click.Path(path_type=Path), help="Folder.  [default: ./translated]")
@quality_option
@scenes_option
@reports_errors
def command(case: str, target: str, out: Path | None, quality: str, scenes: Path | None) -> None:
    """Write what a renderer is given for CASE, ready for its own command line."""
    from harness.archive import folder_name, scene_text
    from harness.plan import scene_for
    from harness.record import write_text
    from harness.renderers import registry

    renderer = None if target == "json" else registry.create(target, "--to", ("json",))
    root = out or Path("translated")
    for prepared in prepared_cases((case,), quality, scenes):
        folder = root / folder_name(prepared.loaded.id)
        folder.mkdir(parents=True, exist_ok=True)
        if renderer is None:
            path = folder / "scene.json"
            write_text(path, scene_text(prepared))
        else:
            path = renderer.emit(scene_for(prepared.scene, renderer.capabilities), folder)
        click.echo(path)
