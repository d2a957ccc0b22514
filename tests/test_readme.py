"""What the README shows works."""

from __future__ import annotations

import re
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from harness.cli import main
from harness.data import scenes_root
from harness.judging.judge import CaseJudge
from harness.judging.results import Contender, Results
from harness.plan import Form, PreparedCase, prepare
from harness.record import Verdict
from harness.renderers.base import Capability
from harness.scene.load import LoadedCase, load_cases, scene_files

README = (Path(__file__).resolve().parent.parent / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)


def test_the_scene_that_it_shows_is_a_scene(tmp_path: Path) -> None:
    (scene,) = blocks("toml")
    path = tmp_path / "slab" / "offset.toml"
    path.parent.mkdir()
    path.write_text(scene, encoding="utf-8")
    cases = load_cases(path, "draft")
    assert [c.id for c in cases] == [
        "slab-offset[thickness=0.25,ior=1.333]",
        "slab-offset[thickness=0.25,ior=1.5]",
        "slab-offset[thickness=1,ior=1.333]",
        "slab-offset[thickness=1,ior=1.5]",
    ]


CODE = "\n".join(blocks("") + re.findall(r"`([^`\n]+)`", README))
COMMANDS = sorted(set(re.findall(r"^(?:\.venv/bin/)?snellcheck ([a-z]+)", CODE, re.MULTILINE)))


@pytest.mark.parametrize("command", COMMANDS)
def test_the_commands_that_it_names_exist(command: str) -> None:
    assert CliRunner().invoke(main, [command, "--help"]).exit_code == 0


@pytest.mark.parametrize("option", sorted(set(re.findall(r"(?<=\s)--[a-z-]+", README))))
def test_the_options_that_it_names_exist(option: str) -> None:
    assert option in options_of(main)


def options_of(command: click.Command) -> set[str]:
    """The options of a command and of those below it."""
    own = {option for parameter in command.params for option in parameter.opts}
    if not isinstance(command, click.Group):
        return own
    context = click.Context(command)
    below = [command.get_command(context, name) for name in command.list_commands(context)]
    return own.union(*(options_of(sub) for sub in below if sub is not None))


def test_the_cases_that_it_names_exist() -> None:
    named = set(re.findall(r"'(slab-[^']+)'", README))
    assert named
    for case in named:
        listed = CliRunner().invoke(main, ["list", case])
        assert listed.exit_code == 0, listed.output


def test_the_catalogue_is_as_large_as_it_says() -> None:
    scenes = [load_cases(path) for path in scene_files(scenes_root())]
    core = [cases for cases in scenes if "core" in cases[0].model.tags]
    everything = [case for cases in scenes for case in cases]
    hundreds = checks_of(everything) // 100
    for said in (
        f"The core is {len(core)} scenes",
        f"all\n{len(scenes)} of them",
        f"{len(everything)} cases",
        f"{hundreds // 10},{hundreds % 10}00 checks",
    ):
        assert said in README


def checks_of(cases: list[LoadedCase]) -> int:
    """How many checks a run of all built-in renderers makes, told without rendering anything.

    All are judged as missing. Where a pair of pictures is a SKIP it is one for each side, which
    makes some ten checks more than there are in a run.
    """
    followers = ("tracer", "mitsuba-exact")
    contenders = [
        Contender(
            name, "1", frozenset({Capability.RAYS} if name in followers else ()), None,
            Verdict.SKIP, "missing",
        )
        for name in (*followers, "mitsuba", "povray", "povray-stock")
    ]  # fmt: skip
    any_scene, total = prepare(cases[0]).scene, 0
    for case in cases:
        variants = tuple(Form(v.name, any_scene, {}, v.scale) for v in case.model.variants)
        judge = CaseJudge(
            PreparedCase(case, any_scene, variants), contenders, Results({}, 8, 8), "tracer"
        )
        total += len(judge.judge().checks)
    return total


def test_every_page_of_the_documentation_can_be_reached_from_it() -> None:
    """By links, from page to page; what nothing leads to is read by nobody."""
    root = Path(__file__).resolve().parent.parent
    reached, waiting = set[Path](), [root / "README.md"]
    while waiting:
        page = waiting.pop()
        page = page / "README.md" if page.is_dir() else page
        if page in reached:
            continue
        assert page.is_file(), page
        reached.add(page)
        if page.suffix == ".md":
            links = re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8"))
            waiting += [(page.parent / link).resolve() for link in links if "://" not in link]
    pages = {p for pattern in ("*.md", "docs/**/*.md") for p in root.glob(pattern)}
    assert not {str(p.relative_to(root)) for p in pages - reached}
