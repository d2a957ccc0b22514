"""What people install: the wheel and the sdist, built and used away from the checkout."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
UV = Path(sys.executable).with_name("uv")

pytestmark = pytest.mark.slow

# Where the wheel puts what the checkout keeps beside the packages.
MOVED = {"scenes": "harness/_data/scenes", "references": "harness/_data/references"}
# What the page's script is built from; the wheel carries what is built, in harness/report/assets.
BUILT_FROM = "harness/report/ui/"


def run(
    *command: str | Path, cwd: Path, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def build(kind: str, source: Path, out: Path) -> Path:
    """Builds "wheel" or "sdist" from `source` with what is installed, without a network."""
    run(
        *(UV, "build", "--offline", "--no-build-isolation", "--python", sys.executable),
        *(f"--{kind}", "--out-dir", out, source),
        cwd=out,
    )
    (built,) = out.glob("*.whl" if kind == "wheel" else "*.tar.gz")
    return built


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("sdist", ROOT, tmp_path_factory.mktemp("sdist"))


@dataclass(frozen=True)
class Installed:
    """An environment that holds the wheel alone, and a folder to work in."""

    python: Path
    folder: Path

    def __call__(self, *command: str) -> str:
        """What a command of the environment prints, run away from the checkout."""
        program = self.python.with_name(command[0])
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        environment["SNELLCHECK_CACHE"] = str(self.folder / "cache")
        return run(program, *command[1:], cwd=self.folder, environment=environment).stdout


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """The wheel in an environment of its own.

    Its dependencies are those of this environment, lent through a path file: lent paths come last,
    and path files in them do not count, so our checkout cannot be found through them.
    """
    folder = tmp_path_factory.mktemp("installed")
    venv.create(folder / "venv", with_pip=False, symlinks=True)
    python = folder / "venv" / "bin" / "python"
    (site,) = (folder / "venv" / "lib").glob("python*/site-packages")
    (site / "lent.pth").write_text(sysconfig.get_path("purelib") + "\n")
    run(
        *(UV, "pip", "install", "--offline", "--no-index", "--no-deps", "--python", python, wheel),
        cwd=folder,
    )
    return Installed(python, folder)


def tracked(*folders: str) -> set[str]:
    """The files that git tracks, or would once they are added, of what ought to be shipped."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", *folders],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if listed.returncode:
        pytest.skip("not a git checkout: " + listed.stderr.strip())
    return {name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()}


def test_the_wheel_holds_every_module_scene_and_reference(wheel: Path) -> None:
    wanted = set()
    for name in tracked("harness", "tracer", "scenes", "references"):
        if name.startswith(BUILT_FROM):
            continue
        top, _, rest = name.partition("/")
        wanted.add(f"{MOVED.get(top, top)}/{rest}")
    held = set(zipfile.ZipFile(wheel).namelist())
    assert wanted
    assert not wanted - held
    strangers = {n for n in held if ".dist-info/" not in n and "/assets/" not in n}
    assert not strangers - wanted


def test_the_sdist_holds_what_is_needed_to_build_and_test(sdist: Path, tmp_path: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert not tracked("harness", "tracer", "scenes", "references", "tests", "requirements") - names
    assert {"LICENSE", "README.md", "Makefile", "scripts/setup"} <= names
    rebuilt = build("wheel", sdist, tmp_path)
    assert "harness/_data/scenes/slab/offset.toml" in zipfile.ZipFile(rebuilt).namelist()


def test_the_installed_command_says_its_version(installed: Installed) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert installed("snellcheck", "--version").split()[-1] == project["version"]


def test_the_installed_package_is_the_wheel_and_not_the_checkout(installed: Installed) -> None:
    where = installed("python", "-c", "import harness, tracer; print(harness.__file__)")
    assert Path(where.strip()).is_relative_to(installed.folder)


def test_the_installed_command_finds_its_scenes(installed: Installed) -> None:
    listed = installed("snellcheck", "list", "--json")
    assert json.loads(listed)
    assert "slab-offset[thickness=0.25,ior=1.5]" in listed


def test_the_installed_renderers_register_themselves(installed: Installed) -> None:
    code = "from harness.renderers.registry import available; print(*available())"
    names = set(installed("python", "-c", code).split())
    assert {"tracer", "povray", "mitsuba", "mitsuba-exact"} <= names


def test_the_installed_suite_runs(installed: Installed) -> None:
    installed(
        *("snellcheck", "run", "slab-offset[thickness=0.25,ior=1.5]"),
        *("--renderer", "tracer", "--quality", "draft", "--out", "report"),
    )
    report = installed.folder / "report"
    summary = json.loads((report / "summary.json").read_text(encoding="utf-8"))
    assert summary["counts"]["pass"] > 0
    assert summary["counts"]["fail"] == summary["counts"]["error"] == 0
    assert "slab-offset" in (report / "index.html").read_text(encoding="utf-8")
