"""Rules for the whole repository: what is locked, what must not be in it, what must be said."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).resolve().parent.parent
LOCKS = ("bootstrap", "runtime", "mitsuba", "dev", "audit", "rivals")
TEXT = {
    *("", ".cfg", ".css", ".html", ".in", ".ini", ".ipynb", ".j2", ".js", ".json", ".md", ".pov"),
    *(".py", ".sh", ".svg", ".toml", ".ts", ".txt", ".yaml", ".yml"),
}


@cache
def files() -> tuple[Path, ...]:
    """What git tracks, or would track once it is added."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if listed.returncode:
        pytest.skip("not a git checkout: " + listed.stderr.strip())
    return tuple(p for name in listed.stdout.split("\0") if name and (p := ROOT / name).is_file())


def lines_matching(pattern: str) -> list[str]:
    """Where `pattern` occurs in any text but this one, which has to name what it looks for."""
    found = []
    for path in files():
        if path.suffix in TEXT and path != Path(__file__).resolve():
            text = path.read_text(encoding="utf-8", errors="replace")
            for number, line in enumerate(text.splitlines(), 1):
                if re.search(pattern, line):
                    found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()[:80]}")
    return found


def locked(name: str) -> list[tuple[Requirement, int]]:
    """The requirements of a lock file and how many hashes each has."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    entries = re.sub(r"\\\n\s*", "", text).splitlines()
    return [
        (Requirement(entry.partition("--hash=")[0].strip()), entry.count("--hash=sha256:"))
        for entry in entries
        if not entry.startswith("#")
    ]


def project() -> dict[str, object]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


# --- what is locked -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", LOCKS)
def test_locks_hold_exact_versions_with_hashes_and_nothing_else(name: str) -> None:
    entries = locked(name)
    assert entries
    for requirement, hashes in entries:
        (specifier,) = requirement.specifier
        assert specifier.operator == "==", requirement
        assert requirement.url is None, requirement
        assert hashes > 0, requirement


@pytest.mark.parametrize("name", ["bootstrap", "runtime", "mitsuba"])
def test_locks_agree_with_the_widest(name: str) -> None:
    everything = {str(requirement) for requirement, _ in locked("dev")}
    assert {str(requirement) for requirement, _ in locked(name)} <= everything


def test_locks_hold_what_the_project_asks_for() -> None:
    """Whoever changes pyproject.toml and forgets `make lock` learns it here."""
    data = project()
    asked = {
        "runtime": data["project"]["dependencies"],
        "mitsuba": data["project"]["optional-dependencies"]["mitsuba"],
        "dev": [r for name in ("dev", "oracles") for r in data["dependency-groups"][name]],
        "rivals": data["dependency-groups"]["rivals"],
    }
    for name, wanted in asked.items():
        versions: dict[str, list[Version]] = {}
        for requirement, _ in locked(name):
            (specifier,) = requirement.specifier
            versions.setdefault(canonical(requirement.name), []).append(Version(specifier.version))
        for requirement in map(Requirement, wanted):
            held = versions.get(canonical(requirement.name))
            assert held, f"{requirement.name} is not in {name}.txt: run `make lock`"
            assert all(requirement.specifier.contains(v) for v in held), requirement


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


# Imported under a name that is not the distribution's, or brought along by one that pins it.
DISTRIBUTIONS = {
    "colour": "colour-science",
    "drjit": "mitsuba",
    "pydantic_core": "pydantic",
    "skimage": "scikit-image",
}


def test_what_is_imported_is_asked_for_and_what_is_asked_for_is_imported() -> None:
    own = {"harness", "tracer", *sys.stdlib_module_names}
    imported = {
        canonical(DISTRIBUTIONS.get(module, module))
        for package in ("harness", "tracer")
        for path in (ROOT / package).rglob("*.py")
        for module in imported_modules(path.read_text(encoding="utf-8"))
        if module not in own
    }
    data = project()["project"]
    wanted = data["dependencies"] + [r for e in data["optional-dependencies"].values() for r in e]
    assert imported == {canonical(Requirement(text).name) for text in wanted}


def imported_modules(source: str) -> set[str]:
    """Top-level names of all modules that a source imports, wherever in it."""
    modules = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            modules |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            modules.add(node.module.partition(".")[0])
    return modules


def test_the_entry_points_are_those_that_third_parties_use() -> None:
    registered = project()["project"]["entry-points"]["snellcheck.renderers"]
    assert set(registered) == {"tracer", "povray", "povray-stock", "mitsuba", "mitsuba-exact"}


# --- what must never be in it ---------------------------------------------------------------------


def test_no_package_registry_is_named() -> None:
    """Whoever installs from a mirror must not be led around it by us."""
    assert not lines_matching(
        r"\b(pypi\.org|pythonhosted\.org|npmjs\.(org|com)|deb\.debian\.org)\b"
    )
    assert not lines_matching(r"^\s*--((extra-)?index-url|find-links)\b")


def test_no_path_of_anybodys_machine_is_named() -> None:
    assert not lines_matching(r"(?<![\w.])(/home/[a-z]|/Users/[A-Za-z]|/root/|/work/|C:\\Users)")


def test_nothing_is_left_open() -> None:
    assert not lines_matching(r"\b(TODO|FIXME|XXX|HACK)\b")


def test_files_are_small_enough_for_git() -> None:
    assert not [str(p) for p in files() if p.stat().st_size > 2_000_000]


# --- what must be said ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("README.md", ["make suite", "make test", "snellcheck doctor"]),
        ("CHANGELOG.md", ["## [Unreleased]"]),
        (".ci/run", ["make test", "snellcheck run"]),
        (".github/workflows/ci.yml", ["permissions:\n  contents: read\n"]),
    ],
)
def test_documents_say_what_people_rely_on(file: str, words: list[str]) -> None:
    text = (ROOT / file).read_text(encoding="utf-8")
    assert not [word for word in words if word not in text]


@pytest.mark.parametrize("script", ["scripts/setup", "scripts/lock", ".ci/run"])
def test_scripts_can_be_run_and_parsed(script: str) -> None:
    path = ROOT / script
    assert os.access(path, os.X_OK)
    subprocess.run(["sh", "-n", path], check=True)


def test_decisions_are_numbered_without_gaps_and_name_what_was_rejected() -> None:
    records = sorted((ROOT / "docs" / "decisions").glob("[0-9]*.md"))
    assert [int(p.name[:4]) for p in records] == list(range(1, len(records) + 1))
    index = (ROOT / "docs" / "decisions" / "README.md").read_text(encoding="utf-8")
    for record in records:
        text = record.read_text(encoding="utf-8")
        assert "## Rejected" in text, record.name
        assert f"]({record.name})" in index, record.name


def test_links_between_documents_lead_somewhere() -> None:
    links = [
        (page, target)
        for page in files()
        if page.suffix == ".md"
        for target in local_links(page.read_text(encoding="utf-8"))
    ]
    assert links
    assert not [
        f"{page}: {target}" for page, target in links if not (page.parent / target).exists()
    ]


def local_links(markdown: str) -> list[str]:
    prose = re.sub(r"```.*?```", "", markdown, flags=re.DOTALL)
    targets = re.findall(r"\]\(([^)\s#]+)(?:#[^)]*)?\)", prose)
    return [target for target in targets if "://" not in target]
