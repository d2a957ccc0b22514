"""`snellcheck approve`: make results the baseline."""

from __future__ import annotations

from pathlib import Path

import click

from harness.cli.errors import reports_errors
from harness.cli.options import BASELINES, reason_option, run_option, store_option


@click.command(name="approve")
@click.argument("case", nargs=-1)
@run_option
@click.option("--renderer", "-r", "renderers", multiple=True, metavar="NAME", help="Only these.")
@reason_option
@click.option(
    "--from", "choices", type=click.Path(path_type=Path, dir_okay=False),
    help="A file of choices that the report's page wrote.",
)  # fmt: skip
@click.option(
    "--baseline", "target", type=click.Path(path_type=Path, file_okay=False), default=BASELINES,
    show_default=True, help="Folder to write to.",
)  # fmt: skip
@click.option("--by", default="", help="Who approves.  [default: as git knows you]")
@store_option
@click.option("--dry-run", is_flag=True, help="Only show what would change.")
@reports_errors
def command(
    case: tuple[str, ...],
    folder: Path,
    renderers: tuple[str, ...],
    reason: str,
    choices: Path | None,
    target: Path,
    by: str,
    store: str,
    dry_run: bool,
) -> None:
    """Make what the run measured for CASEs the baseline, per case and renderer.

    Shows what changes, and records who approved it, when, why and what. Results that are errors or
    not finite are refused, and then nothing is written.
    """
    from harness.baseline.approve import approve, approver, choose, plan_approvals, read_choices
    from harness.baseline.run_folder import read_run
    from harness.baseline.source import Baselines, open_baselines
    from harness.baseline.store import store_at
    from harness.cli.baselines import show_plans
    from harness.errors import InputError

    if bool(case) == bool(choices):
        message = "both cases and --from" if case else "nothing to approve"
        expected = "cases, or a file of choices with --from"
        raise InputError.of(message, key="CASE", expected=expected)
    run = read_run(folder)
    chosen = read_choices(choices) if choices else choose(run, case, renderers)
    present = open_baselines(str(target)) if target.is_dir() else Baselines(str(target))
    plans = plan_approvals(run, chosen, reason, present)
    show_plans(plans)
    if dry_run:
        return
    who = by or approver()
    for file in approve(plans, run, target, who, store_at(store)):
        click.echo(file)
