"""The command line. Heavy modules are imported by the commands that need them.

Exit codes, everywhere the same: 0 all passed, 1 a check failed, 2 bad usage or bad input,
3 something asked for could not run.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from harness import __version__

if TYPE_CHECKING:
    from harness.plan import PreparedCase
    from harness.renderers.base import Renderer

EXIT_BAD_INPUT = 2
EXIT_COULD_NOT_RUN = 3
DEFAULT_OUT = Path("reports/latest")

Command = TypeVar("Command", bound=Callable[..., Any])


def reports_errors(command: Command) -> Command:
    """Turns our errors into a message and an exit code; a traceback is never a user's business."""

    @wraps(command)
    def wrapped(*args: object, **kwargs: object) -> object:
        from harness.errors import InputError, RendererError

        try:
            return command(*args, **kwargs)
        except InputError as error:
            click.secho(str(error), fg="red", err=True)
            sys.exit(EXIT_BAD_INPUT)
        except RendererError as error:
            click.secho(str(error), fg="red", err=True)
            sys.exit(EXIT_COULD_NOT_RUN)
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            click.secho(f"{where}{error.strerror or error}", fg="red", err=True)
            sys.exit(EXIT_BAD_INPUT)

    return wrapped  # type: ignore[return-value]


@click.group(
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 all passed, 1 a check failed, 2 bad usage or input, "
    "3 something asked for could not run.",
)
@click.version_option(__version__, prog_name="snellcheck")
def main() -> None:
    """Does a renderer refract light correctly, by how much is it off, and why?"""
    for stream in (sys.stdout, sys.stderr):  # an ASCII terminal has no check marks
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


scenes_option = click.option(
    "--scenes",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of scene files instead of the built-in suite.",
)
quality_option = click.option(
    "--quality", type=click.Choice(["draft", "normal", "high"]), default="normal",
    show_default=True, help="Image size and samples.",
)  # fmt: skip


@main.command()
@click.argument("case", nargs=-1)
@click.option("--renderer", "-r", "renderers", multiple=True, metavar="NAME", help="Only these.")
@click.option(
    "--renderer-command", "commands", multiple=True, metavar="TEMPLATE",
    help='An executable of your own: "mytracer {scene} {output}". May be given several times.',
)  # fmt: skip
@click.option(
    "--renderer-config", "configs", multiple=True, type=click.Path(path_type=Path, dir_okay=False),
    help="A snellcheck-renderer.toml that describes a renderer of your own.",
)  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path), default=DEFAULT_OUT, show_default=True)
@click.option("--jobs", type=click.IntRange(1, 256), help="Cores to use.  [default: all]")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@quality_option
@scenes_option
@reports_errors
def run(
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

    chosen = _renderers(renderers, commands, configs)
    cases = _cases(case, quality, scenes, [r.name for r in chosen])
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


@main.command(name="list")
@click.argument("case", nargs=-1)
@click.option("--json", "as_json", is_flag=True, help="Machine-readable.")
@scenes_option
@reports_errors
def list_cases(case: tuple[str, ...], as_json: bool, scenes: Path | None) -> None:
    """List the cases, a line each."""
    import json

    from harness import show

    loaded = _loaded(case, "normal", scenes)
    if as_json:
        rows = [
            {
                "id": c.id, "case": c.case, "family": c.model.family, "title": c.model.title,
                "parameters": c.parameters, "tags": list(c.model.tags), "file": str(c.file),
                "checks": [check.observable for check in c.model.checks],
            }
            for c in loaded
        ]  # fmt: skip
        click.echo(json.dumps(rows, indent=1))
    else:
        show.cases(loaded)


@main.command()
@click.argument("case")
@quality_option
@scenes_option
@reports_errors
def show(case: str, quality: str, scenes: Path | None) -> None:
    """Show the resolved scene, the truth and the checks of CASE."""
    from harness import show as shows

    for prepared in _cases((case,), quality, scenes):
        shows.case(prepared)


@main.command()
@click.argument("case")
@click.option("--to", "target", required=True, metavar="povray|mitsuba|json|…")
@click.option("--out", type=click.Path(path_type=Path), help="Folder.  [default: ./translated]")
@quality_option
@scenes_option
@reports_errors
def translate(case: str, target: str, out: Path | None, quality: str, scenes: Path | None) -> None:
    """Write what a renderer is given for CASE, ready for its own command line."""
    from harness.archive import folder_name, scene_text
    from harness.plan import scene_for
    from harness.record import write_text
    from harness.renderers import registry

    renderer = None if target == "json" else registry.create(target)
    root = out or Path("translated")
    for prepared in _cases((case,), quality, scenes):
        folder = root / folder_name(prepared.loaded.id)
        folder.mkdir(parents=True, exist_ok=True)
        if renderer is None:
            path = folder / "scene.json"
            write_text(path, scene_text(prepared))
        else:
            path = renderer.emit(scene_for(prepared.scene, renderer.capabilities), folder)
        click.echo(path)


@main.command()
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@reports_errors
def report(folder: Path) -> None:
    """Rebuild the HTML of the run in FOLDER from its records."""
    from harness.report import write_report

    click.echo(write_report(folder))


@main.command()
@click.option("--of", "what", type=click.Choice(["case", "scene"]), default="case")
@reports_errors
def schema(what: str) -> None:
    """Print the JSON Schema of scene files (case) or of scene.json (scene)."""
    import json

    from harness.scene.schema import case_schema, scene_schema

    click.echo(json.dumps(case_schema() if what == "case" else scene_schema(), indent=1))


@main.command()
@click.option("--json", "as_json", is_flag=True, help="Machine-readable.")
@reports_errors
def doctor(as_json: bool) -> None:
    """Check each renderer with a real tiny render, and say what mends what is broken."""
    from harness import doctor as doctors

    diagnosis = doctors.diagnose()
    if as_json:
        click.echo(diagnosis.to_json())
    else:
        from rich.console import Console

        doctors.show(diagnosis, Console())
    sys.exit(0 if diagnosis.healthy else EXIT_COULD_NOT_RUN)


# --- shared ---------------------------------------------------------------------------------------


def _loaded(
    selection: tuple[str, ...],
    quality: str,
    scenes: Path | None,
    renderers: list[str] | None = None,
) -> list[Any]:
    from harness.data import scenes_root
    from harness.scene.load import find

    return find(selection, scenes or scenes_root(), quality, renderers or ())


def _cases(
    selection: tuple[str, ...],
    quality: str,
    scenes: Path | None,
    renderers: list[str] | None = None,
) -> list[PreparedCase]:
    from harness.plan import prepare

    return [prepare(case) for case in _loaded(selection, quality, scenes, renderers)]


def _renderers(
    names: tuple[str, ...], commands: tuple[str, ...], configs: tuple[Path, ...]
) -> list[Renderer]:
    """Those named; without names the built-in ones, and in any case the user's own."""
    from harness.renderers import registry

    own = [registry.command_renderer(template) for template in commands]
    own += [registry.configured_renderer(path) for path in configs]
    chosen = list(names) or sorted(registry.available())
    return [*(registry.create(name) for name in chosen), *own]
