"""`snellcheck findings`: what a run shows of renderers, for their developers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from harness.cli.errors import reports_errors
from harness.cli.options import DEFAULT_OUT, prepared_cases, scenes_option

if TYPE_CHECKING:
    from harness.report.findings import Finding, Sample

# How a renderer's own command line renders what `emit` writes.
COMMANDS = {
    "povray": ("pov", "`povray scene.ini` renders it."),
    "mitsuba": ("xml", "`mitsuba -m scalar_rgb scene.xml` renders it."),
}
# A longer scene, such as one with a mesh, is not shown but for the command that writes it.
MOST_LINES = 120


@click.command(name="findings")
@click.argument(
    "folder", type=click.Path(path_type=Path, file_okay=False), default=DEFAULT_OUT, required=False
)
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="File to write.")
@scenes_option
@reports_errors
def command(folder: Path, out: Path | None, scenes: Path | None) -> None:
    """Write what is KNOWN of renderers in the run in FOLDER, with scenes that show it."""
    from harness import record
    from harness.errors import InputError
    from harness.measure.observables import Observable
    from harness.report.findings import findings, markdown

    paths = sorted((folder / "records").glob("*.json"))
    if not paths:
        raise InputError.of("holds no records of a run", file=folder)
    found = findings([record.read_case(path) for path in paths])
    units = {observable.value: observable.unit for observable in Observable}
    text = markdown(found, units, lambda finding: _sample(finding, scenes))
    if out is None:
        click.echo(text, nl=False)
    else:
        record.write_text(out, text)
        click.echo(out)


def _sample(finding: Finding, scenes: Path | None) -> Sample | None:
    """The finding in its smallest scene, no variant, as the renderer is given it."""
    from harness.plan import shown_to
    from harness.renderers import registry
    from harness.report.findings import Sample
    from harness.temporary import temporary_folder

    language, how = COMMANDS[finding.renderer.partition("-")[0]]
    renderer = registry.create(finding.renderer)
    samples = []
    for shown, check in finding.shown:
        if "~" in check.id or check.against != "truth":
            continue
        (case,) = prepared_cases((shown.id,), "normal", scenes)
        with temporary_folder() as name:
            probe = check.id.partition("(")[2].partition(")")[0]
            scene = shown_to(case, probe or None, renderer.capabilities)
            text = renderer.emit(scene, Path(name)).read_text(encoding="utf-8")
        wrote = f"written by `snellcheck translate '{shown.id}' --to {finding.renderer}`"
        samples.append(Sample(shown.id, language, text, f"{wrote}, here with its probe. {how}"))
        if len(samples) == 6:
            break
    best = min(samples, key=lambda s: len(s.text), default=None)
    return best if best and best.text.count("\n") <= MOST_LINES else None
