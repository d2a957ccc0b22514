"""`snellcheck run`: render and judge."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import click

from harness.cli.errors import reports_errors
from harness.cli.options import (
    DEFAULT_OUT,
    add_to_history,
    cache_option,
    chosen_renderers,
    command_option,
    config_option,
    history_option,
    named_by,
    prepared_cases,
    quality_option,
    renderer_option,
    scenes_option,
    store_option,
    those_that_must_run,
)
from harness.cli.shards import divided


@click.command(name="run")
@click.argument("case", nargs=-1)
@renderer_option
@command_option
@config_option
@click.option("--out", type=click.Path(path_type=Path), default=DEFAULT_OUT, show_default=True)
@click.option("--jobs", type=click.IntRange(1, 256), help="Cores to use.  [default: all]")
@click.option(
    "--stored/--no-stored",
    default=True,
    show_default=True,
    help="Let approved results stand in for renderers that are missing.",
)
@store_option
@click.option(
    "--timeout",
    type=click.FloatRange(0.1),
    default=120.0,
    show_default=True,
    metavar="SECONDS",
    help="After which a render counts as hung.",
)
@click.option(
    "--memory",
    type=click.IntRange(64),
    default=4096,
    show_default=True,
    metavar="MB",
    help="That a renderer may use.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@quality_option
@scenes_option
@cache_option
@click.option("--no-cache", is_flag=True, help="Neither use nor keep results of other runs.")
@click.option("--fresh", is_flag=True, help="Begin anew where a run into OUT was interrupted.")
@click.option("--shard", metavar="I/N", help="Only the I-th of N parts; `merge` joins them.")
@click.option(
    "--times",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The times.json of an earlier run, to balance shards by.  [default: times.json in the "
    "folder of scenes]",
)
@click.option(
    "--cluster",
    "cluster_at",
    metavar="URL|local:N",
    help="Render on the workers of a Dask scheduler, tcp://HOST:PORT, or on N of our own.",
)
@history_option
@reports_errors
def command(
    case: tuple[str, ...],
    renderers: tuple[str, ...],
    commands: tuple[str, ...],
    configs: tuple[Path, ...],
    out: Path,
    jobs: int | None,
    stored: bool,
    store: str,
    timeout: float,
    memory: int,
    seed: int,
    quality: str,
    scenes: Path | None,
    cache_at: str,
    no_cache: bool,
    fresh: bool,
    shard: str | None,
    times: Path | None,
    cluster_at: str | None,
    history: bool,
) -> None:
    """Render CASEs (all of them, or those a glob like "slab-*" selects) and judge them.

    Writes OUT/records/*.json, OUT/summary.json and OUT/index.html. What has not changed since an
    earlier run is taken from the cache. After an interruption, even by kill -9, the same command
    goes on where it stood.
    """
    from harness import show
    from harness.cache.cache import open_cache
    from harness.cli.baselines import stand_ins
    from harness.cli.interrupts import terminable
    from harness.cli.places import places
    from harness.cores import core_count
    from harness.report import write_report
    from harness.run import UNFINISHED
    from harness.run import run as run_cases
    from harness.running.shard import NOTE, write_note

    cache, note = None if no_cache else open_cache(cache_at), None
    with show.progress() as progress, places(cluster_at) as place:
        chosen = chosen_renderers(renderers, commands, configs)
        cases = prepared_cases(case, quality, scenes, [r.name for r in chosen])
        if not renderers:
            chosen += named_by(cases)
        must_run = those_that_must_run(chosen, renderers)
        if shard is not None:
            settings = f"{quality}, seed {seed}, stored {stored}"
            cases, note = divided(shard, cases, [r.name for r in chosen], settings, times, scenes)
        if fresh:
            shutil.rmtree(out / UNFINISHED, ignore_errors=True)
        (out / NOTE).unlink(missing_ok=True)
        chosen, helper = place.put(chosen, commands, configs)
        with terminable():
            summary = run_cases(
                cases, chosen, helper, out, quality=quality, seed=seed,
                threads=place.threads(jobs or core_count()), timeout_s=timeout, memory_mb=memory,
                report=progress, cache=cache,
                command=" ".join(["snellcheck", *sys.argv[1:]]), must_run=must_run,
                stand_ins=stand_ins(store, quality) if stored else None,
            )  # fmt: skip
    if cache is not None and cache.trouble:
        click.secho(f"warning: {cache.trouble}; nothing is kept", fg="yellow", err=True)
    if note is not None:
        write_note(out, note)
    if history and not summary.interrupted:
        add_to_history(summary, out)
    index = write_report(out)
    show.verdicts(summary, index)
    sys.exit(summary.exit_code)
