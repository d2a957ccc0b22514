"""`snellcheck export`: a run in the formats of CI systems."""

from __future__ import annotations

from pathlib import Path

import click

from harness.cli.errors import reports_errors
from harness.cli.options import run_option


@click.command(name="export")
@click.argument("target", type=click.Choice(["junit", "markdown", "github"]))
@run_option
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="File.  [default: -]")
@reports_errors
def command(target: str, folder: Path, out: Path | None) -> None:
    """Write the run as JUnit XML, as a Markdown summary, or as GitHub's annotations.

    After `snellcheck check`, what is red is what differs from the baseline for the worse.
    """
    from harness.baseline.run_folder import read_run
    from harness.ci.github import workflow_commands
    from harness.ci.junit import junit
    from harness.ci.markdown import markdown
    from harness.record import write_text

    run = read_run(folder)
    if target == "junit":
        text = junit(run)
    elif target == "markdown":
        text = markdown(run)
    else:
        text = "".join(f"{line}\n" for line in workflow_commands(run))
    if out is None:
        click.echo(text, nl=False)
    else:
        write_text(out, text)
