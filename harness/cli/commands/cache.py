"""`snellcheck cache`: what is kept from run to run."""

from __future__ import annotations

import sys

import click

from harness.cli.errors import reports_errors
from harness.cli.options import cache_option


@click.group(name="cache")
def command() -> None:
    """Look after the results that are kept from run to run."""


@command.command()
@cache_option
@reports_errors
def info(cache_at: str) -> None:
    """Say where the cache is and how much is in it."""
    from harness import show
    from harness.cache.cache import open_cache

    cache = open_cache(cache_at)
    entries = list(cache.store.entries())
    size = show.size(sum(entry.size for entry in entries))
    click.echo(f"{cache.store.where}: {len(entries)} entries, {size} of {show.size(cache.limit)}")


@command.command()
@cache_option
@reports_errors
def verify(cache_at: str) -> None:
    """Read every entry, and remove those that are damaged. Exit code 1 where there are any."""
    from harness.cache.cache import open_cache

    found = open_cache(cache_at).verify()
    for key, why in found.removed.items():
        click.echo(f"{key}: {why}; removed")
    click.echo(f"{found.whole} entries are whole, {len(found.removed)} were not")
    sys.exit(1 if found.removed else 0)


@command.command()
@cache_option
@reports_errors
def clear(cache_at: str) -> None:
    """Remove every entry."""
    from harness.cache.cache import open_cache

    cache = open_cache(cache_at)
    click.echo(f"{cache.store.where}: {cache.clear()} entries removed")
