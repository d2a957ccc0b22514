"""What works here, what does not, and the command that mends it: `snellcheck doctor`.

A renderer counts as usable when it has rendered something just now, in a process of its own;
that it can be found or imported proves nothing.
"""

from __future__ import annotations

import dataclasses
import json
import platform
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import harness
from harness.cores import core_count
from harness.data import cache_root, scenes_root
from harness.errors import SnellcheckError
from harness.renderers.base import Health, Renderer
from harness.renderers.confinement import described

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

DOCTOR_SCHEMA = "snellcheck-doctor/1"
SUPPORTED_PYTHON = ((3, 11), (3, 14))  # oldest and newest that the locked packages have wheels for

Factory = Callable[[], Renderer]


@dataclass(frozen=True)
class Finding:
    """One thing about this machine. `remedy` is the command that mends what is wrong."""

    name: str
    ok: bool
    detail: str
    remedy: str = ""


@dataclass(frozen=True)
class Diagnosis:
    """All that was found. `cores` are those that this process may use; memory is in MiB."""

    snellcheck: str
    python: str
    system: str
    cores: int
    memory_mb: int
    memory_available_mb: int
    cache: str
    findings: tuple[Finding, ...]
    renderers: tuple[Health, ...]

    @property
    def healthy(self) -> bool:
        """Whether nothing needs mending."""
        return all(f.ok for f in self.findings) and all(r.usable for r in self.renderers)

    def to_json(self) -> str:
        """The same as a JSON document; `schema` names its version."""
        document = {"schema": DOCTOR_SCHEMA, "healthy": self.healthy, **dataclasses.asdict(self)}
        return json.dumps(document, indent=1, ensure_ascii=False)


def diagnose(factories: Mapping[str, Factory] | None = None) -> Diagnosis:
    """Looks at this machine and lets every renderer make a tiny image, all at the same time.

    `factories` are the renderers to look at, by name; those that are registered unless given.
    """
    import psutil

    if factories is None:
        from harness.renderers import registry

        factories = registry.available()
    memory = psutil.virtual_memory()
    with ThreadPoolExecutor(max_workers=max(1, len(factories))) as pool:
        renderers = tuple(pool.map(_examine, factories.keys(), factories.values()))
    return Diagnosis(
        snellcheck=harness.__version__,
        python=platform.python_version(),
        system=f"{platform.system()} {platform.release()} {platform.machine()}",
        cores=core_count(),
        memory_mb=memory.total // 2**20,
        memory_available_mb=memory.available // 2**20,
        cache=str(cache_root()),
        findings=(_python(), _cache(cache_root()), _scenes(scenes_root()), _confinement()),
        renderers=renderers,
    )


def _examine(name: str, factory: Factory) -> Health:
    """The health of one renderer; one that does not even load is unusable, not our end."""
    try:
        return factory().health()
    except Exception as error:  # a third party's code can raise anything
        known = isinstance(error, SnellcheckError)
        return Health(
            name=name,
            usable=False,
            detail=str(error) if known else f"{type(error).__name__}: {error}",
            remedy=f"mend or uninstall the package that registers the renderer {name!r}",
        )


def _python() -> Finding:
    oldest, newest = SUPPORTED_PYTHON
    ok = oldest <= sys.version_info[:2] <= newest
    return Finding(
        name="Python",
        ok=ok,
        detail=f"{platform.python_version()} at {sys.executable}",
        remedy="" if ok else f"make clean setup PYTHON=python{newest[0]}.{newest[1]}",
    )


def _cache(folder: Path) -> Finding:
    """Whether the cache folder can be written, found out by writing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(b"\0")
    except OSError as error:
        return Finding(
            name="cache",
            ok=False,
            detail=f"{folder} cannot be written: {error.strerror}",
            remedy='export SNELLCHECK_CACHE="$HOME/.cache/snellcheck"  # or any folder of yours',
        )
    return Finding(name="cache", ok=True, detail=str(folder))


def _scenes(folder: Path) -> Finding:
    count = sum(1 for _ in folder.glob("*/*.toml"))
    return Finding(
        name="scenes",
        ok=count > 0,
        detail=f"{count} files in {folder}",
        remedy=""
        if count
        else f"{shlex.quote(sys.executable)} -m pip install --force-reinstall --no-deps snellcheck",
    )


def _confinement() -> Finding:
    """What renderers are held to. Where the system cannot, nothing is broken: it is only told."""
    return Finding(name="confinement", ok=True, detail=described())


# --- for people ---------------------------------------------------------------------------------


def show(diagnosis: Diagnosis, console: Console) -> None:
    """Prints the diagnosis: a line per thing, then for each ✗ the command that mends it."""
    console.print(f"[bold]snellcheck {diagnosis.snellcheck}[/] on {diagnosis.system}")
    console.print(
        f"{diagnosis.cores} cores, {diagnosis.memory_mb / 1024:.1f} GiB of memory, "
        f"{diagnosis.memory_available_mb / 1024:.1f} GiB free\n",
        highlight=False,
    )
    console.print(_table(diagnosis))
    for name, remedy in _remedies(diagnosis):
        # Not wrapped, so that it can be copied as it stands.
        console.print(f"\nTo mend {name}:\n  {remedy}", markup=False, soft_wrap=True)


def _table(diagnosis: Diagnosis) -> Table:
    from rich.table import Table
    from rich.text import Text

    table = Table.grid(padding=(0, 2))
    for _ in ("mark", "name", "version"):
        table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for ok, name, version, about in _lines(diagnosis):
        mark = Text("✓", style="green") if ok else Text("✗", style="bold red")
        table.add_row(mark, Text(name, style="bold"), Text(version), Text(about))
    return table


def _lines(diagnosis: Diagnosis) -> Iterator[tuple[bool, str, str, str]]:
    for finding in diagnosis.findings:
        yield finding.ok, finding.name, "", finding.detail
    for health in diagnosis.renderers:
        facts = [f"{name}: {value}" for name, value in health.facts.items()]
        about = "\n".join(filter(None, [health.path, health.detail, *facts]))
        yield health.usable, health.name, health.version, about


def _remedies(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    things: list[Finding | Health] = [*diagnosis.findings, *diagnosis.renderers]
    return [(thing.name, thing.remedy) for thing in things if thing.remedy]
