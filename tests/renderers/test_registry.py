"""Renderers are found by name, and a broken package is named, not ours to crash over."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from harness.errors import InputError, RendererFailed
from harness.renderers import registry
from harness.renderers.base import Renderer

GROUP = registry.GROUP


def entry(name: str, value: str) -> EntryPoint:
    return EntryPoint(name, value, GROUP)


@pytest.fixture
def entries(monkeypatch: pytest.MonkeyPatch) -> list[EntryPoint]:
    found: list[EntryPoint] = []
    monkeypatch.setattr(registry, "entry_points", lambda group: found)
    return found


def test_built_in_renderers_are_registered() -> None:
    assert {"tracer", "povray", "mitsuba", "mitsuba-exact"} <= registry.available().keys()


@pytest.mark.parametrize("name", ["tracer", "povray"])
def test_built_in_renderers_bear_their_names(name: str) -> None:
    assert registry.create(name).name == name


def test_asking_what_there_is_imports_no_engine() -> None:
    code = (
        "import sys; from harness.renderers import registry;"
        "[registry.create(n) for n in registry.available() if n != 'mitsuba'];"
        "print([m for m in ('numba', 'mitsuba', 'drjit', 'tracer') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_third_partys_renderer(entries: list[EntryPoint]) -> None:
    entries.append(entry("mine", "tests.fakes:FakeRenderer"))
    assert list(registry.available()) == ["mine"]
    renderer = registry.create("mine")
    assert isinstance(renderer, Renderer)
    assert renderer.version() == "1.0"


def test_unknown_name_has_a_suggestion(entries: list[EntryPoint]) -> None:
    entries.append(entry("mitsuba", "x:y"))
    with pytest.raises(
        InputError, match="got mitsubba; expected one of mitsuba; did you mean mits"
    ):
        registry.create("mitsubba")


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ("snellcheck_no_such_module:make", "ModuleNotFoundError: No module named"),
        ("tests.fakes:no_such_name", "AttributeError"),
        ("tests.fakes:MISBEHAVE", "TypeError"),
        ("tests.fakes:Picture", "TypeError"),
        ("builtins:dict", "it is a dict without version, render, health, emit"),
    ],
)
def test_a_broken_package_is_named(value: str, reason: str, entries: list[EntryPoint]) -> None:
    entries += [entry("broken", value), entry("good", "tests.fakes:FakeRenderer")]
    factories = registry.available()
    with pytest.raises(RendererFailed) as caught:
        factories["broken"]()
    assert "'broken'" in str(caught.value)
    assert value in str(caught.value)
    assert reason in str(caught.value)
    assert factories["good"]().version() == "1.0"


def test_two_packages_with_one_name(entries: list[EntryPoint]) -> None:
    entries += [entry("mine", "tests.fakes:FakeRenderer"), entry("mine", "builtins:dict")]
    with pytest.raises(RendererFailed, match="two packages claim the renderer 'mine'"):
        registry.create("mine")
    entries[1:] = entries[:1]  # the same twice, as an editable installation can leave behind
    assert registry.create("mine").version() == "1.0"


def test_command_lines_and_files(tmp_path: Path) -> None:
    assert registry.command_renderer("./mytracer {scene} {output}").name == "mytracer"
    file = tmp_path / "snellcheck-renderer.toml"
    file.write_text('[renderer]\nname = "mine"\ncommand = "a {scene} {output}"\n')
    assert registry.configured_renderer(file).name == "mine"
