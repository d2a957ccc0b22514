"""`snellcheck run`: render and judge."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from harness.cli.errors import reports_errors
from harness.cli.options import (
    DEFAULT_OUT,
    chosen_renderers,
    command_option,
    config_option,
    prepared_cases,
    quality_option,
    renderer_option,
    scenes_option,
)


@click.command(name="run")
@click.argument("case", nargs=-1)
@renderer_option
@command_option
@config_option
@click.option("--out", type=click.Path(path_type=Path), default=DEFAULT_OUT, show_default=True)
@click.option("--jobs", type=click.IntRange(1, 256), help="Cores to use.  [default: all]")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@quality_option
@scenes_option
@reports_errors
def command(
    case: tuple[str, ...],
    renderers: tuple[str, ...],
    commands: tuple[str, ...],
    configs: tuple[Path, ...],
    out: Path,
    jobs: int | None,
    seed: int,
    quality: str,
    scenes: Path | None,
) -> None:
    """Render CASEs (all of them, or those a glob like "slab-*" selects) and judge them.

    Writes OUT/records/*.json, OUT/summary.json and OUT/index.html.
    """
    from harness import show
    from harness.cores import core_count
    from harness.renderers import registry
    from harness.report import write_report
    from harness.run import HELPER
    from harness.run import run as run_cases

    chosen = chosen_renderers(renderers, commands, configs)
    cases = prepared_cases(case, quality, scenes, [r.name for r in chosen])
    helper = next((r for r in chosen if r.name == HELPER), None) or registry.create(HELPER)
    line = " ".join(["snellcheck", *sys.argv[1:]])
    with show.progress() as progress:
        summary = run_cases(
            cases, chosen, helper, out, quality=quality, threads=jobs or core_count(), seed=seed,
            command=line, report=progress,
        )  # fmt: skip
    index = write_report(out)
    show.verdicts(summary, index)
    sys.exit(summary.exit_code)
