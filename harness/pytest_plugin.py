"""Scene files as tests: ``pytest scenes/ --snellcheck-renderer=NAME``.

pytest loads this in every project of an environment that has snellcheck, so it imports nothing but
pytest, and does nothing until one of its options names a renderer.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from harness.ci.pytest_items import SceneFile

RENDERERS = "--snellcheck-renderer"
COMMANDS = "--snellcheck-renderer-command"
CONFIGS = "--snellcheck-renderer-config"
BASELINE = "--snellcheck-baseline"


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options, in a group of their own."""
    group = parser.getgroup("snellcheck", "scene files as tests of renderers")
    group.addoption(
        RENDERERS, action="append", default=[], metavar="NAME",
        help="collect scene files (*.toml) and judge this renderer; may be given several times",
    )  # fmt: skip
    group.addoption(
        COMMANDS, action="append", default=[], metavar="TEMPLATE",
        help='the same for an executable: "./mytracer {scene} {output}"',
    )  # fmt: skip
    group.addoption(
        CONFIGS, action="append", default=[], metavar="FILE",
        help="the same for a renderer that a snellcheck-renderer.toml describes",
    )  # fmt: skip
    group.addoption(
        "--snellcheck-quality", default="normal", choices=["draft", "normal", "high"],
        help="image size and samples (default: normal)",
    )  # fmt: skip
    group.addoption(
        "--snellcheck-out", default="reports/pytest", metavar="DIR",
        help="where records and pages go, from the root folder (default: reports/pytest)",
    )  # fmt: skip
    group.addoption(
        BASELINE, metavar="DIR|GIT-REV|RUN",
        help="judge against what was approved, as `snellcheck check` does; renderers that were "
        "never approved for a case, by their verdicts",
    )  # fmt: skip


def is_active(config: pytest.Config) -> bool:
    """Whether any renderer was named."""
    return any(config.getoption(option) for option in (RENDERERS, COMMANDS, CONFIGS))


def pytest_configure(config: pytest.Config) -> None:
    """Refuses what is wrong with the options before anything is collected."""
    if is_active(config):
        from harness.ci.pytest_items import make_bench

        make_bench(config)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> SceneFile | None:
    """Scene files become collectors of their cases."""
    if file_path.suffix != ".toml" or not is_active(parent.config):
        return None
    from harness.ci.pytest_items import SceneFile, is_scene

    if not is_scene(file_path) and not parent.session.isinitpath(file_path):
        return None
    return SceneFile.from_parent(parent, path=file_path)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Ends the renderers' processes."""
    if is_active(session.config):
        from harness.ci.pytest_items import close

        close(session.config)
