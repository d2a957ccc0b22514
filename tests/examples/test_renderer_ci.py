"""The story of docs/examples/renderer-ci, told with the very commands of its CI files."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import yaml

from tests.fakes.student import with_faults

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "renderer-ci"
WORKFLOW = Path(".github") / "workflows" / "refraction.yml"

UPSIDE_DOWN = ("mu = ior_i / ior_t", "mu = ior_t / ior_i")
SCHLICK = (
    "    return np.where(cos_t > 0, (s**2 + p**2) / 2, 1.0)",
    "    base = ((ior_i - ior_t) / (ior_i + ior_t)) ** 2\n"
    "    cos = np.where(ior_i < ior_t, cos_i, cos_t)\n"
    "    return np.where(cos_t > 0, base + (1 - base) * (1 - cos) ** 5, 1.0)",
)


@dataclass
class Repository:
    """A copy of the example, under git, where the job can be run."""

    folder: Path
    environment: dict[str, str] = field(default_factory=dict)

    def shell(self, command: str) -> subprocess.CompletedProcess[str]:
        """As GitHub's runner runs a step."""
        return subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", command],
            cwd=self.folder, env=os.environ | self.environment, capture_output=True, text=True,
            check=False,
        )  # fmt: skip

    def job(self) -> tuple[bool, str]:
        """Runs the job's steps; whether it is green, and all that its steps said."""
        workflow = yaml.safe_load((self.folder / WORKFLOW).read_text(encoding="utf-8"))
        (self.folder / "summary.md").write_text("")
        green, said = True, ""
        for step in workflow["jobs"]["refraction"]["steps"]:
            command = step.get("run", "")
            if not command or command.startswith("pip ") or not (green or "if" in step):
                continue
            done = self.shell(command)
            green = green and done.returncode == 0
            said += done.stdout + done.stderr
        return green, said

    def summary(self) -> str:
        return (self.folder / "summary.md").read_text(encoding="utf-8")

    def change(self, fault: tuple[str, str]) -> None:
        file = self.folder / "panes.py"
        file.write_text(with_faults(file.read_text(encoding="utf-8"), fault), encoding="utf-8")

    def git(self, *arguments: str) -> str:
        done = subprocess.run(
            ["git", *arguments], cwd=self.folder, capture_output=True, text=True, check=True
        )
        return done.stdout


@pytest.fixture
def repository(tmp_path: Path) -> Repository:
    folder = tmp_path / "panes"
    shutil.copytree(EXAMPLE, folder, ignore=shutil.ignore_patterns("reports"))
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {
        "PATH": programs, "GITHUB_STEP_SUMMARY": str(folder / "summary.md"),
        "SNELLCHECK_CACHE": str(tmp_path / "cache"), "COLUMNS": "200",
    }  # fmt: skip
    made = Repository(folder, environment)
    made.git("init", "--quiet")
    made.git("config", "user.name", "A. Person")
    made.git("config", "user.email", "a@example.org")
    made.git("add", ".")
    made.git("commit", "--quiet", "--message", "panes")
    return made


@pytest.mark.slow
def test_green_red_approved_green(repository: Repository) -> None:
    green, said = repository.job()
    assert green, said
    assert "Refraction: nothing is off" in repository.summary()
    assert "::error" not in said

    # A bug turns it red, with the right diagnosis, at the lines of the scenes.
    repository.change(UPSIDE_DOWN)
    green, said = repository.job()
    assert not green
    assert "uses the ratio of indices upside down" in repository.summary()
    errors = re.findall(r"^::error file=(.*?),line=(\d+),", said, re.MULTILINE)
    assert errors
    for file, line in errors:
        lines = (repository.folder / file).read_text(encoding="utf-8").splitlines()
        assert lines[int(line) - 1] == "[[checks]]"
    root = ET.parse(repository.folder / "reports" / "junit.xml").getroot()
    assert int(root.get("failures", "0")) == len(root.findall(".//failure")) > 0
    repository.git("checkout", "--quiet", "panes.py")

    # So does a change on purpose, until it is approved with a reason.
    repository.change(SCHLICK)
    green, said = repository.job()
    assert not green
    assert "Schlick" in repository.summary()
    reason = "Schlick is enough for previews"
    silent = repository.shell("snellcheck approve pane-fresnel --renderer panes")
    assert silent.returncode == 2
    approved = repository.shell(
        f"snellcheck approve pane-fresnel --renderer panes --reason '{reason}'"
    )
    assert approved.returncode == 0, approved.stderr
    assert "regressed" in approved.stdout
    changed = repository.git("status", "--porcelain", "references").split()
    assert len(changed) == 2  # M and one file
    assert reason in repository.git("diff", "references")
    green, said = repository.job()
    assert green, said
    assert "::error" not in said

    # What was approved may stay, but not grow, and nothing else may hide behind it.
    repository.change(UPSIDE_DOWN)
    assert not repository.job()[0]


def test_both_ci_files_run_the_same_commands() -> None:
    github = (EXAMPLE / WORKFLOW).read_text(encoding="utf-8")
    gitlab = yaml.safe_load((EXAMPLE / ".gitlab-ci.yml").read_text(encoding="utf-8"))["refraction"]
    steps = yaml.safe_load(github)["jobs"]["refraction"]["steps"]
    commands = [step["run"].strip() for step in steps if "run" in step]
    for command in gitlab["script"]:
        assert command.strip() in commands
    for command in gitlab["after_script"]:
        assert command in commands[-1]


def test_the_workflow_may_only_read(tmp_path: Path) -> None:
    for file in (EXAMPLE / WORKFLOW, *(ROOT / ".github" / "workflows").glob("*.yml")):
        workflow = yaml.safe_load(file.read_text(encoding="utf-8"))
        assert workflow["permissions"] == {"contents": "read"}, file
        for job in workflow["jobs"].values():
            assert "permissions" not in job, file
            for step in job["steps"]:
                if step.get("uses", "").startswith("actions/checkout"):
                    assert step["with"]["persist-credentials"] is False, file


def test_the_renderer_knows_nothing_of_snellcheck() -> None:
    source = (EXAMPLE / "panes.py").read_text(encoding="utf-8")
    imported = set(re.findall(r"^(?:import|from) (\w+)", source, re.MULTILINE))
    assert imported - set(sys.stdlib_module_names) == {"numpy"}
