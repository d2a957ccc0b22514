"""The composite action's script, run as GitHub's runner would."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.examples.test_renderer_ci import EXAMPLE, ROOT

ACTION = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
INPUT = re.compile(r"\$\{\{\s*inputs\.([\w-]+)\s*\}\}")


def step(name: str) -> dict[str, Any]:
    return next(s for s in ACTION["runs"]["steps"] if s["name"] == name)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copytree(EXAMPLE, tmp_path / "panes", ignore=shutil.ignore_patterns("reports"))
    return tmp_path / "panes"


def act(folder: Path, **inputs: str) -> subprocess.CompletedProcess[str]:
    """The step that renders, with the action's defaults for what is not given."""
    values = {name: spec["default"] for name, spec in ACTION["inputs"].items()}
    values |= {name.replace("_", "-"): value for name, value in inputs.items()}
    script = step("Render, measure, compare")
    environment = os.environ | {
        name: INPUT.sub(lambda match: values[match[1]], text)
        for name, text in script["env"].items()
    }
    installed = folder.parent / "snellcheck" / "bin" / "snellcheck"
    if not installed.exists():
        installed.parent.mkdir(parents=True)
        installed.symlink_to(Path(sys.executable).with_name("snellcheck"))
    environment |= {
        "RUNNER_TEMP": str(folder.parent),
        "GITHUB_STEP_SUMMARY": str(folder / "summary.md"),
        "SNELLCHECK_CACHE": str(folder.parent / "cache"),
    }  # fmt: skip
    return subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script["run"]],
        cwd=folder, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.slow
def test_it_is_green_and_says_so(folder: Path) -> None:
    done = act(
        folder, scenes="scenes", renderer_config="snellcheck-renderer.toml", cases="pane-fresnel"
    )
    # Only panes was approved; the tracer's results are new.
    assert done.returncode == 0, done.stdout + done.stderr
    assert "nothing is off" in (folder / "summary.md").read_text(encoding="utf-8")
    assert (folder / "reports" / "latest" / "junit.xml").is_file()


@pytest.mark.parametrize(
    "inputs",
    [
        {"cases": "$(touch harm)"},
        {"cases": "'; touch harm; '"},
        {"renderers": "`touch harm`"},
        {"baseline": "$(touch harm)", "cases": "none"},
        {"scenes": "x; touch harm"},
    ],
)
def test_inputs_are_never_commands(inputs: dict[str, str], folder: Path) -> None:
    done = act(folder, **inputs)
    assert done.returncode != 0
    assert not list(folder.rglob("harm"))


def test_no_input_is_pasted_into_a_script() -> None:
    for one in ACTION["runs"]["steps"]:
        assert "${{" not in one.get("run", "")
