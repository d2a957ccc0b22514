"""The cases of scene files as pytest's items. Imported only once a renderer is named."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from harness.archive import folder_name
from harness.baseline.compare import compare
from harness.baseline.outcome import outcome, write_outcome
from harness.baseline.run_folder import read_run
from harness.baseline.select import of_run
from harness.baseline.shown import show_pictures
from harness.baseline.source import Baselines, open_baselines
from harness.baseline.store import store_at
from harness.ci.findings import findings, lost
from harness.ci.reuse import Reused, reused
from harness.cores import core_count
from harness.errors import InputError, Problem, SnellcheckError
from harness.plan import prepare
from harness.record import Verdict
from harness.renderers import registry
from harness.report import write_report
from harness.run import HELPER, run
from harness.scene.load import LoadedCase, load_cases

# Settings of tools that may lie beside scenes.
OTHERS = {"pyproject.toml", "snellcheck-renderer.toml"}


@dataclass
class Bench:
    """The renderers of a session, which stay alive from item to item."""

    renderers: list[Reused]
    helper: Reused
    baselines: Baselines | None

    @classmethod
    def of(cls, config: pytest.Config) -> Bench:
        """Those that the options name. Raises InputError or RendererError."""
        root = config.rootpath
        names = config.getoption("--snellcheck-renderer")
        own = [
            registry.command_renderer(template, root)
            for template in config.getoption("--snellcheck-renderer-command")
        ]
        own += [
            registry.configured_renderer(root / path)
            for path in config.getoption("--snellcheck-renderer-config")
        ]
        renderers = [reused(one) for one in (*map(registry.create, names), *own)]
        helper = next((r for r in renderers if r.name == HELPER), None)
        return cls(renderers, helper or reused(registry.create(HELPER)), approved(config))


def approved(config: pytest.Config) -> Baselines | None:
    """What the session is to be held against; none where it was not asked for.

    Raises InputError where there is nothing in it: every case would be new, and pass or fail as if
    nobody had asked.
    """
    where = config.getoption("--snellcheck-baseline")
    if where is None:
        return None
    folder = config.rootpath / where
    store = store_at(os.environ.get("SNELLCHECK_STORE", ""))
    found = open_baselines(str(folder) if folder.exists() else where, store)
    if not found.kept:
        problem = Problem("nothing was approved there", key="--snellcheck-baseline", value=where)
        raise InputError([problem, *found.unreadable])
    return found


BENCH = pytest.StashKey[Bench]()


def make_bench(config: pytest.Config) -> None:
    """Makes the session's renderers; none of their processes is started yet."""
    try:
        config.stash[BENCH] = Bench.of(config)
    except SnellcheckError as error:
        raise pytest.UsageError(str(error)) from error


def close(config: pytest.Config) -> None:
    """Ends the renderers' processes."""
    found = config.stash.get(BENCH, None)
    for renderer in (*found.renderers, found.helper) if found else ():
        renderer.close_for_good()


def is_scene(path: Path) -> bool:
    """Whether a TOML file looks like a scene, or is too broken to tell: that must be reported."""
    if path.name in OTHERS:
        return False
    try:
        with path.open("rb") as file:
            keys = tomllib.load(file).keys()
    except (OSError, ValueError, RecursionError):
        return True
    return not keys.isdisjoint({"family", "checks", "solids"})


class SceneFile(pytest.File):
    """Collects a case per permutation of a scene file."""

    def collect(self) -> Iterator[CaseItem]:
        """The items; what is wrong with the file is the message of a collection error."""
        config = self.config
        names = [renderer.name for renderer in config.stash[BENCH].renderers]
        try:
            cases = load_cases(self.path, config.getoption("--snellcheck-quality"), names)
        except InputError as error:
            raise self.CollectError(str(error)) from error
        for case in cases:
            yield CaseItem.from_parent(self, name=case.id, case=case)


def against(baselines: Baselines, out: Path) -> None:
    """Writes into the run in `out` how it stands to what was approved of its cases and renderers.

    Renderers that were approved and do not take part in the session are not missed.
    """
    run = read_run(out)
    names = set(run.summary.renderers)
    compared = compare(run, baselines, of_run(run, lambda _, renderer: renderer in names))
    found = outcome(compared, baselines.source, [])
    write_outcome(show_pictures(run, baselines), compared, found)


class CaseFailed(Exception):
    """What is red, ready to be shown."""


class CaseItem(pytest.Item):
    """Renders one case with all renderers and judges it."""

    def __init__(self, *, case: LoadedCase, **more: Any) -> None:
        super().__init__(**more)
        self.case = case

    def runtest(self) -> None:
        """Fails with what is red; skips where every check is skipped."""
        config = self.config
        found, prepared = config.stash[BENCH], prepare(self.case)
        # Only cases that compare pictures have auxiliary ones to make.
        helper = found.helper if prepared.compares_images else found.renderers[0]
        out = config.rootpath / config.getoption("--snellcheck-out") / folder_name(self.case.id)
        workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
        threads = max(1, core_count() // workers)
        summary = run(
            [prepared], found.renderers, helper, out,
            quality=config.getoption("--snellcheck-quality"), threads=threads, command="pytest",
        )  # fmt: skip
        if found.baselines is not None:
            against(found.baselines, out)
        write_report(out)
        read = read_run(out)
        red = [finding.text for finding in findings(read)]
        red += [f"{what}: {reason}" for _, what, reason in lost(read.summary)]
        if red:
            raise CaseFailed("\n\n".join(red))
        checks = [check for case in summary.cases for check in case.checks]
        if not checks:
            raise CaseFailed("no check was made")
        if all(check.status is Verdict.SKIP for check in checks):
            pytest.skip(checks[0].reason)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Diagnosis, figures and the page's path: whoever reads it has no use for our stack."""
        if isinstance(excinfo.value, CaseFailed | SnellcheckError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """The scene file, from its first line."""
        return self.path, 0, self.name
