"""`snellcheck report`: HTML from records."""

from __future__ import annotations

from pathlib import Path

import click

from harness.cli.errors import reports_errors

FOLDER = click.Path(path_type=Path, file_okay=False)


@click.command(name="report")
@click.argument("folder", type=FOLDER)
@click.argument("later", type=FOLDER, required=False)
@click.option("--single-file", is_flag=True, help="One HTML file with everything in it, to attach.")
@click.option(
    "--out", type=click.Path(path_type=Path),
    help="Where to: a folder for a comparison, a file for --single-file.",
)  # fmt: skip
@click.option(
    "--pixels", default=25, show_default=True, type=click.IntRange(0), metavar="MB",
    help="Room for linear pixels in a single file; failures come first.",
)  # fmt: skip
@reports_errors
def command(
    folder: Path, later: Path | None, single_file: bool, out: Path | None, pixels: int
) -> None:
    """Rebuild the HTML of the run in FOLDER, or compare it with the LATER run.

    A comparison is written to reports/compare: the later run's report, with what changed since the
    earlier one, and both runs' pictures in the viewer. Nothing is rendered.
    """
    from harness.baseline.two_runs import two_runs
    from harness.errors import InputError
    from harness.report import write_report
    from harness.report.single import MEGABYTE, write_single

    if out is not None and later is None and not single_file:
        raise InputError.of("--out goes with two runs or with --single-file", key="--out")
    if later is not None:
        target = Path("reports/compare") if single_file or out is None else out
        two_runs(folder, later, target)
        folder = target
    if not single_file:
        click.echo(write_report(folder))
        return
    written = write_single(folder, out or folder / "report.html", pixels * MEGABYTE)
    click.echo(f"{written.path} ({written.size / MEGABYTE:.1f} MB)")
    if written.without_pixels:
        count = len(written.without_pixels)
        cases = "1 case has" if count == 1 else f"{count} cases have"
        click.echo(f"{cases} pictures only; --pixels makes more room", err=True)
