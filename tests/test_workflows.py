"""What runs in continuous integration may only read, and runs what it names, not what moves."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
WORKFLOWS = sorted(
    str(path.relative_to(ROOT))
    for place in (ROOT, ROOT / "docs" / "examples" / "renderer-ci")
    for path in (place / ".github" / "workflows").glob("*.yml")
)
PINNED = re.compile(r"uses: \S+@[0-9a-f]{40} # v\d+(\.\d+)*$")
OURS = re.compile(r"uses: snellcheck/snellcheck@")  # in documents: whoever reads knows which


EXAMPLE = "docs/examples/renderer-ci/.gitlab-ci.yml"
# Schemas that came with the checker: nothing is fetched.
SCHEMAS = {
    "action.yml": "vendor.github-actions",
    EXAMPLE: "vendor.gitlab-ci",
    **dict.fromkeys(WORKFLOWS, "vendor.github-workflows"),
}


def fits_its_schema(file: Path, schema: str) -> subprocess.CompletedProcess[str]:
    checker = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema]
    return subprocess.run([*checker, str(file)], capture_output=True, text=True, check=False)


def audited(*files: Path) -> subprocess.CompletedProcess[str]:
    """What zizmor finds wrong with workflows and actions, without asking anybody."""
    zizmor = Path(sys.executable).with_name("zizmor")
    options = ["--offline", "--no-config", "--strict-collection", "--no-progress"]
    return subprocess.run([zizmor, *options, *files], capture_output=True, text=True, check=False)


def workflow(file: str) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((ROOT / file).read_text(encoding="utf-8"))
    return found


def test_all_workflows_are_looked_at() -> None:
    assert len(WORKFLOWS) >= 2
    assert not set(ROOT.glob(".github/workflows/*")) - {ROOT / file for file in WORKFLOWS}


@pytest.mark.parametrize("file", WORKFLOWS)
def test_it_may_only_read(file: str) -> None:
    found = workflow(file)
    assert found["permissions"] == {"contents": "read"}
    for job in found["jobs"].values():
        assert job.get("permissions", {}) in ({}, {"contents": "read"})


@pytest.mark.parametrize("file", WORKFLOWS)
def test_nobody_elses_code_runs_with_our_rights(file: str) -> None:
    events = workflow(file)[True]  # YAML 1.1 reads the word `on` as a truth value
    assert not {"pull_request_target", "workflow_run"} & set(events)


@pytest.mark.parametrize("file", WORKFLOWS)
def test_no_credentials_are_left_in_the_checkout(file: str) -> None:
    steps = [step for job in workflow(file)["jobs"].values() for step in job["steps"]]
    checkouts = [step for step in steps if "/checkout@" in step.get("uses", "")]
    assert checkouts
    assert all(step["with"]["persist-credentials"] is False for step in checkouts)


@pytest.mark.parametrize("file", WORKFLOWS)
def test_nothing_from_outside_is_pasted_into_a_script(file: str) -> None:
    """A branch's or a title's name would be run as a command there."""
    steps = [step for job in workflow(file)["jobs"].values() for step in job["steps"]]
    assert not [step for step in steps if "${{" in step.get("run", "")]


@pytest.mark.parametrize("file", WORKFLOWS)
def test_jobs_end(file: str) -> None:
    assert all(job["timeout-minutes"] <= 60 for job in workflow(file)["jobs"].values())


@pytest.mark.parametrize("file", [*WORKFLOWS, "action.yml", "docs/ci.md"])
def test_actions_are_named_by_their_content(file: str) -> None:
    """A tag can be moved to something else, a hash cannot."""
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    used = [line.strip() for line in lines if "uses:" in line and not OURS.search(line)]
    assert [line for line in used if not PINNED.search(line)] == []


@pytest.mark.parametrize("file", WORKFLOWS)
def test_all_use_the_same_version_of_an_action(file: str) -> None:
    def uses(name: str) -> set[str]:
        return set(re.findall(r"uses: (\S+@\S+ # \S+)", (ROOT / name).read_text(encoding="utf-8")))

    everywhere = set().union(*map(uses, WORKFLOWS), uses("docs/ci.md"))
    actions = [used.partition("@")[0] for used in everywhere]
    assert uses(file)
    assert len(actions) == len(set(actions))


# --- as others see them -------------------------------------------------------------------------


@pytest.mark.parametrize("file", SCHEMAS)
def test_it_is_what_the_service_reads(file: str) -> None:
    done = fits_its_schema(ROOT / file, SCHEMAS[file])
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("file", "right", "wrong"),
    [
        (".github/workflows/ci.yml", "runs-on:", "run-on:"),
        ("action.yml", "using: composite", "using: composit"),
        (EXAMPLE, "script:", "scripts:"),
    ],
)
def test_a_misspelt_one_is_noticed(file: str, right: str, wrong: str, tmp_path: Path) -> None:
    text = (ROOT / file).read_text(encoding="utf-8")
    assert right in text
    broken = tmp_path / Path(file).name
    broken.write_text(text.replace(right, wrong), encoding="utf-8")
    done = fits_its_schema(broken, SCHEMAS[file])
    assert done.returncode == 1
    assert broken.name in done.stdout


def test_an_audit_finds_nothing_in_them() -> None:
    done = audited(*(ROOT / file for file in (*WORKFLOWS, "action.yml")))
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_audit_would_find_something(tmp_path: Path) -> None:
    """A branch's name that is run as a command, for one."""
    text = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    broken = tmp_path / ".github" / "workflows" / "ci.yml"
    broken.parent.mkdir(parents=True)
    given = "run: echo ${{ github.head_ref }} "
    broken.write_text(re.sub(r"run: (?=.ci)", given, text, count=1), encoding="utf-8")
    assert given in broken.read_text(encoding="utf-8")
    done = audited(broken)
    assert done.returncode > 10  # by severity; lower ones are failures of its own
    assert "template-injection" in done.stdout
