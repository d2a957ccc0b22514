"""pytest as a renderer's developers use it: scene files are items, and failures speak plainly."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from tests.fakes.student import SOURCE, with_faults
from tests.harness.tiny import SCENES

INVERTED = ("mu = ior_i / ior_t", "mu = ior_t / ior_i")
CONFIG = (SOURCE.parent / "student-worker.toml").read_text(encoding="utf-8")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A renderer's repository: itself, how to call it, and two scenes with three cases."""
    for family in ("slab", "snell"):
        shutil.copytree(SCENES / family, tmp_path / "scenes" / family)
    for name in ("student.py", "student_worker.py"):
        shutil.copy(SOURCE.parent / name, tmp_path)
    (tmp_path / "snellcheck-renderer.toml").write_text(CONFIG, encoding="utf-8")
    (tmp_path / "pytest.ini").write_text("[pytest]\nfilterwarnings = error\n")
    return tmp_path


def run(project: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", *options]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stdout + done.stderr
    return done


def judged(project: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return run(project, "--snellcheck-renderer-config=snellcheck-renderer.toml", *options)


def break_it(project: Path) -> None:
    file = project / "student.py"
    file.write_text(with_faults(file.read_text(encoding="utf-8"), INVERTED), encoding="utf-8")


@pytest.mark.slow
def test_cases_are_items(project: Path) -> None:
    done = judged(project, "scenes", "-v", "-p", "no:cacheprovider", "--junitxml=junit.xml")
    assert done.returncode == 0, done.stdout
    for name in ("slab-offset[thickness=0.25]", "slab-offset[thickness=1]", "snell-sweep"):
        assert re.search(rf"{re.escape(name)} PASSED", done.stdout)
    tests = ET.parse(project / "junit.xml").getroot().findall(".//testcase")
    assert len(tests) == 3
    assert list((project / "reports" / "pytest").glob("*/index.html"))


@pytest.mark.slow
def test_failures_say_what_is_wrong_and_where_to_look(project: Path) -> None:
    break_it(project)
    done = judged(project, "scenes", "-k", "snell", "-x")
    assert done.returncode == 1
    assert "1 failed, 2 deselected" in done.stdout
    assert re.search(r"student-worker: \w+: fail: off by", done.stdout)
    assert re.search(r"value .*, expected .* within", done.stdout)
    (page,) = set(re.findall(r"page: (\S+)", done.stdout))
    assert (project / page).is_file()
    # --lf runs just that one, and passes once it is mended.
    shutil.copy(SOURCE, project / "student.py")
    again = judged(project, "scenes", "--lf", "-v")
    assert again.returncode == 0
    assert "1 passed" in again.stdout
    assert "run-last-failure" in again.stdout


@pytest.mark.slow
def test_against_what_was_approved_only_changes_are_red(project: Path) -> None:
    """As `snellcheck check`: a failure that somebody approved with a reason is green."""
    break_it(project)
    only, against = ("scenes/snell", "-p", "no:cacheprovider"), "--snellcheck-baseline=references"
    assert judged(project, *only).returncode == 1
    (out,) = (project / "reports" / "pytest").iterdir()
    command = (
        "approve",
        "*",
        "--run",
        str(out),
        "--reason",
        "not mended yet",
        "--by",
        "Willebrord",
    )
    snellcheck = Path(sys.executable).with_name("snellcheck")
    approved = subprocess.run(
        [snellcheck, *command], cwd=project, capture_output=True, text=True, check=False
    )
    assert approved.returncode == 0, approved.stderr
    assert judged(project, *only).returncode == 1
    same = judged(project, *only, against)
    assert same.returncode == 0, same.stdout
    assert "1 passed" in same.stdout
    # A case that nobody approved is judged by its verdicts.
    assert "2 failed" in judged(project, "scenes/slab", against).stdout
    # It grows.
    worse_mu = (INVERTED[0], f"{INVERTED[1]} * 1.2")
    source = SOURCE.read_text(encoding="utf-8")
    (project / "student.py").write_text(with_faults(source, worse_mu), encoding="utf-8")
    worse = judged(project, *only, against)
    assert worse.returncode == 1
    assert "regressed" in worse.stdout


@pytest.mark.slow
def test_workers_share_the_cases(project: Path) -> None:
    done = judged(project, "scenes", "-n", "2")
    assert done.returncode == 0, done.stdout
    assert "3 passed" in done.stdout


def test_what_is_wrong_with_a_scene_is_told_with_its_line(project: Path) -> None:
    file = project / "scenes" / "snell" / "sweep.toml"
    file.write_text(file.read_text().replace("format = 1", "format = 1\nfromat = 2"))
    (project / "scenes" / "broken.toml").write_text("[checks")
    (project / "scenes" / "ruff.toml").write_text("line-length = 100\n")
    done = judged(project, "scenes", "--collect-only", "-q")
    assert done.returncode == 2
    assert re.search(r"sweep\.toml:2: fromat: ", done.stdout)
    assert "broken.toml:1: not valid TOML" in done.stdout
    assert "ruff.toml" not in done.stdout


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("--snellcheck-renderer=trecer", "did you mean tracer"),
        ("--snellcheck-renderer-config=none.toml", "cannot be read"),
        ("--snellcheck-renderer-command=x {what}", "what"),
        ("--snellcheck-renderer=tracer --snellcheck-baseline=scenes", "nothing was approved there"),
        ("--snellcheck-renderer=tracer --snellcheck-baseline=nowhere", "neither a folder nor a"),
    ],
)
def test_a_wrong_option_is_one_message(option: str, said: str, project: Path) -> None:
    renderer, *more = option.split(" --")
    done = run(project, "scenes", renderer, *(f"--{one}" for one in more))
    assert done.returncode == 4  # pytest's code for bad usage
    assert said in done.stderr + done.stdout


def test_nothing_happens_without_its_options(project: Path) -> None:
    """Other projects that have snellcheck installed see nothing of it, and load nothing of it."""
    (project / "test_it.py").write_text(
        "import sys\n\n\ndef test_it():\n"
        "    loaded = {m for m in sys.modules if m.split('.')[0] in ('harness', 'numpy')}\n"
        "    assert loaded == {'harness', 'harness.pytest_plugin'}, loaded\n"
    )
    done = run(project, "-p", "no:cacheprovider")
    assert done.returncode == 0, done.stdout
    assert "1 passed" in done.stdout
