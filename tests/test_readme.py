"""What the README shows works."""

from __future__ import annotations

import re
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from harness.cli import main
from harness.scene.load import load_cases

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
