"""`snellcheck bisect`: which commit broke a check."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from harness.cli.errors import reports_errors
from harness.cli.options import quality_option, scenes_option


@click.command(name="bisect")
@click.argument("case")
@click.option("--good", required=True, metavar="REV", help="A commit at which the check passed.")
@click.option("--bad", default="HEAD", show_default=True, metavar="REV")
@click.option("--check", metavar="GLOB", help="Only checks like exit_point*.  [default: all]")
@click.option("--renderer", "-r", "renderers", multiple=True, metavar="NAME", help="Only these.")
@click.option(
    "--renderer-command", "commands", multiple=True, metavar="TEMPLATE",
    help="An executable of your own, run in the folder of each commit.",
)  # fmt: skip
@click.option(
    "--renderer-config",
    "configs",
    multiple=True,
    metavar="FILE",
    help="A snellcheck-renderer.toml, as a path within the repository.",
)
@click.option("--build", default="", metavar="COMMAND", help="Builds a commit; no shell runs it.")
@quality_option
@scenes_option
@reports_errors
def command(
    case: str,
    good: str,
    bad: str,
    check: str | None,
    renderers: tuple[str, ...],
    commands: tuple[str, ...],
    configs: tuple[str, ...],
    build: str,
    quality: str,
    scenes: Path | None,
) -> None:
    """Find the commit of this repository since which CASE fails.

    Every commit is tried in a folder of its own; your files stay as they are. Commits that cannot
    be built or run are skipped.
    """
    from harness.history.bisect import Step, bisect, run_of
    from harness.history.bisect_case import verdict_of_case

    def report(step: Step) -> None:
        click.echo(f"{step.commit[:10]} {step.answer}: {step.why}  ({step.subject})")

    options = ["--quality", quality]
    for name, values in (
        ("--renderer", renderers), ("--renderer-command", commands), ("--renderer-config", configs)
    ):  # fmt: skip
        options += [word for value in values for word in (name, value)]
    if scenes is not None:
        options += ["--scenes", str(scenes.resolve())]
    found = bisect(
        Path.cwd(), good, bad, run_of(build, verdict_of_case(case, check, options)), report
    )
    click.echo(f"first bad commit: {found.text}")
    sys.exit(0)
