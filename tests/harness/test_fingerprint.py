"""Fingerprints of code: nothing that a result depends on is left out, and little else is in."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from harness import fingerprint
from harness.errors import RendererMissing
from harness.fingerprint import code_digest, combined, reached, versions
from harness.renderers import registry
from harness.renderers.command import CommandRenderer, Template
from harness.running import bundle
from tests.test_layering import ROOT, imports_of, longest_known, module_name, sources

MODULES = {module_name(file): file for file in sources("harness", "tracer")}


def by_syntax(module: str) -> set[str]:
    """The modules that `module` reaches, according to Python's own parser."""
    found: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found.add(name)
        for one in imports_of(MODULES[name]):
            known = one.name if one.name in MODULES else longest_known(one.name, MODULES)
            if known in MODULES:
                waiting.append(known)
            package = one.name.partition(".")[0]
            if package in MODULES:
                waiting.append(package)
    return found


@pytest.mark.parametrize(
    "module",
    [
        "harness.renderers.povray", "harness.renderers.tracer", "harness.renderers.mitsuba",
        "harness.renderers.worker", "harness.preflight", *bundle.CODE,
    ],
)  # fmt: skip
def test_all_that_a_module_imports_is_found(module: str) -> None:
    assert by_syntax(module) <= reached([module])


def test_all_that_python_loads_is_found() -> None:
    script = (
        "import sys, harness.judging.judge, harness.archive\n"
        "mine = {n: m for n, m in sys.modules.items() if n.startswith(('harness', 'tracer'))}\n"
        "print(*[n for n, m in mine.items() if m.__file__])"  # a folder has no code of its own
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert len(loaded) > 20
    assert loaded <= reached(["harness.judging.judge", "harness.archive"])


def test_what_renders_does_not_depend_on_what_judges() -> None:
    for adapter in ("povray", "tracer", "mitsuba"):
        found = reached([f"harness.renderers.{adapter}", *registry.HOSTING])
        judging = {m for m in found if m.startswith(("harness.measure", "harness.judging.judge"))}
        assert not judging
    assert "harness.translate.mitsuba" not in reached(["harness.renderers.povray"])


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package in place of the tracer."""
    root = tmp_path / "tracer"
    root.mkdir()
    (root / "__init__.py").write_text("")
    (root / "path.py").write_text("def f():\n    from tracer import (\n        optics,\n    )\n")
    (root / "optics.py").write_text("import tracer.vector as v\n")
    (root / "vector.py").write_text("N = 1\n")
    (root / "other.py").write_text("")
    monkeypatch.setattr(fingerprint, "_root", lambda name: root if name == "tracer" else None)
    fingerprint._path.cache_clear()
    fingerprint._imported.cache_clear()
    yield root
    fingerprint._path.cache_clear()
    fingerprint._imported.cache_clear()


@pytest.mark.parametrize("name", ["__init__", "path", "optics", "vector"])
def test_a_change_in_anything_reached_changes_the_digest(name: str, package: Path) -> None:
    before = code_digest("tracer.path")
    (package / f"{name}.py").write_text((package / f"{name}.py").read_text() + "# changed\n")
    assert code_digest("tracer.path") != before


def test_a_change_elsewhere_does_not(package: Path) -> None:
    before = code_digest("tracer.path")
    (package / "other.py").write_text("# changed\n")
    assert code_digest("tracer.path") == before


def test_parts_do_not_run_into_each_other() -> None:
    assert combined("ab", "c") != combined("a", "bc")
    assert combined("", "a") != combined("a", "")


def test_versions_name_what_is_not_there() -> None:
    assert versions("no-such-package-here").endswith("no-such-package-here absent")


# --- fingerprints of renderers --------------------------------------------------------------------


def command(folder: Path, *depends: str) -> CommandRenderer:
    return CommandRenderer(
        "mine", Template.parse("{python} mine.py {scene} {output}"), folder, depends=depends
    )


def test_a_command_that_does_not_say_what_it_depends_on_has_none(tmp_path: Path) -> None:
    assert command(tmp_path).fingerprint() is None


def test_a_command_depends_on_its_program_and_on_what_it_says(tmp_path: Path) -> None:
    for name in ("mine.py", "lib/shade.py", "README.md"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    seen = {command(tmp_path, "lib/*.py").fingerprint()}
    (tmp_path / "README.md").write_text("changed")
    assert command(tmp_path, "lib/*.py").fingerprint() in seen
    for name in ("mine.py", "lib/shade.py", "lib/new.py"):
        (tmp_path / name).write_text("changed")
        found = command(tmp_path, "lib/*.py").fingerprint()
        assert found not in seen
        seen.add(found)


def test_a_renderer_that_is_not_there_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    from harness.renderers import mitsuba_variants
    from harness.renderers.povray import PovRayRenderer

    assert PovRayRenderer("no-such-povray").fingerprint() is None

    def missing() -> None:
        raise RendererMissing("gone")

    monkeypatch.setattr(mitsuba_variants, "choose", missing)
    assert registry.mitsuba().fingerprint() is None  # type: ignore[attr-defined]


def test_a_povray_of_other_content_is_another(tmp_path: Path) -> None:
    from harness.renderers.povray import PovRayRenderer

    prints = set()
    for content in ("one", "two"):
        program = tmp_path / "povray"
        program.write_text(f"#!/bin/sh\n# {content}\n")
        program.chmod(0o755)
        prints.add(PovRayRenderer(str(program)).fingerprint())
    assert len(prints) == 2
    assert None not in prints
