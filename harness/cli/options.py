"""Options that several commands share, and what they select."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.plan import PreparedCase
    from harness.record import Summary
    from harness.renderers.base import Renderer
    from harness.scene.load import LoadedCase

DEFAULT_OUT = Path("reports/latest")
BASELINES = Path("references")

scenes_option = click.option(
    "--scenes",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of scene files instead of the built-in suite.",
)
quality_option = click.option(
    "--quality", type=click.Choice(["draft", "normal", "high"]), default="normal",
    show_default=True, help="Image size and samples.",
)  # fmt: skip
renderer_option = click.option(
    "--renderer", "-r", "renderers", multiple=True, metavar="NAME", help="Only these."
)
command_option = click.option(
    "--renderer-command", "commands", multiple=True, metavar="TEMPLATE",
    help='An executable of your own: "mytracer {scene} {output}". May be given several times.',
)  # fmt: skip
config_option = click.option(
    "--renderer-config", "configs", multiple=True, type=click.Path(path_type=Path, dir_okay=False),
    help="A snellcheck-renderer.toml that describes a renderer of your own.",
)  # fmt: skip

cache_option = click.option(
    "--cache", "cache_at", metavar="DIR|URL", default="", envvar="SNELLCHECK_RESULTS",
    help="Where results are kept from run to run.  [default: the user's cache folder]",
)  # fmt: skip

store_option = click.option(
    "--store", metavar="DIR|URL", default="", envvar="SNELLCHECK_STORE",
    help="Where approved pictures are that are too large for git.",
)  # fmt: skip

history_option = click.option(
    "--history/--no-history", "history", default=True, show_default=True,
    help="Add the figures to the history of past runs.",
)  # fmt: skip

reason_option = click.option("--reason", default="", help="Why this is how it should be.")
run_option = click.option(
    "--run", "folder", type=click.Path(path_type=Path, file_okay=False),
    default=DEFAULT_OUT, show_default=True, help="Folder of the run.",
)  # fmt: skip


def add_to_history(summary: Summary, out: Path) -> None:
    """Adds a run to the user's history, or says why it could not."""
    from harness.history.revision import revision
    from harness.history.store import History, history_file

    trouble = History(history_file()).add(summary, revision(Path.cwd()), out)
    if trouble:
        click.secho(f"warning: {trouble}", fg="yellow", err=True)


def loaded_cases(
    selection: Sequence[str],
    quality: str,
    scenes: Path | None,
    renderers: Sequence[str] = (),
) -> list[LoadedCase]:
    """The cases that the selection names. Raises InputError where a scene is wrong."""
    from harness.data import scenes_root
    from harness.scene.load import find

    return find(selection, scenes or scenes_root(), quality, renderers)


def prepared_cases(
    selection: Sequence[str],
    quality: str,
    scenes: Path | None,
    renderers: Sequence[str] = (),
) -> list[PreparedCase]:
    """The cases that the selection names, with their resolved scenes."""
    from harness.plan import prepare

    return [prepare(case) for case in loaded_cases(selection, quality, scenes, renderers)]


def chosen_renderers(
    names: Sequence[str], commands: Sequence[str], configs: Sequence[Path]
) -> list[Renderer]:
    """Those named; without names the registered ones, and in any case the user's own.

    Renderers that only some scenes are about are left to `named_by`.
    """
    from harness.renderers import registry

    own = [registry.command_renderer(template) for template in commands]
    own += [registry.configured_renderer(path) for path in configs]
    chosen = list(names) or sorted(registry.available().keys() - registry.ONLY_WHERE_NAMED)
    return [*(registry.create(name) for name in chosen), *own]


def named_by(cases: Sequence[PreparedCase]) -> list[Renderer]:
    """The renderers that are asked only where a check names them, where one of `cases` does."""
    from harness.renderers import registry

    checks = (check for case in cases for check in case.loaded.model.checks)
    named = {name for check in checks for name in check.renderers}
    available = registry.ONLY_WHERE_NAMED & named & registry.available().keys()
    return [registry.create(name) for name in sorted(available)]


def those_that_must_run(chosen: Sequence[Renderer], named: Sequence[str]) -> list[str]:
    """Those of `chosen` that no stored result can excuse from running.

    For who brings a renderer of their own the registered ones are what it is held against, and
    what is stored of them will do, unless they are `named`. Without one they are asked for.
    """
    from harness.renderers import registry

    own = {renderer.name for renderer in chosen} - registry.available().keys()
    wanted = own | set(named) if own else {renderer.name for renderer in chosen}
    return [renderer.name for renderer in chosen if renderer.name in wanted]
