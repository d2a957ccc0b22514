"""Bisection finds the commit that broke a check, and leaves the repository as it was."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner

from harness.cli import main
from harness.errors import InputError
from harness.history.bisect import Answer, Step, bisect, run_of
from harness.history.bisect_case import judged
from harness.record import Check, Verdict
from tests.harness.tiny import SCENES

STUDENT = Path(__file__).parents[2] / "docs" / "bring-your-own-renderer" / "student.py"
WRONG = ("mu = ior_i / ior_t", "mu = ior_t / ior_i")


class Repository:
    def __init__(self, root: Path) -> None:
        self.root = root
        root.mkdir()
        self.git("init", "-q", "-b", "main")

    def git(self, *arguments: str) -> str:
        identity = {"GIT_AUTHOR_NAME": "Ann", "GIT_AUTHOR_EMAIL": "ann@example.com"}
        identity |= {"GIT_COMMITTER_NAME": "Ann", "GIT_COMMITTER_EMAIL": "ann@example.com"}
        done = subprocess.run(
            ["git", "-C", str(self.root), *arguments], env={**os.environ, **identity},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        return done.stdout.strip()

    def commit(self, subject: str, **files: str) -> str:
        for name, text in files.items():
            (self.root / name).write_text(text)
        self.git("add", "-A")
        self.git("commit", "-q", "--allow-empty", "-m", subject)
        return self.git("rev-parse", "HEAD")


@pytest.fixture
def repository(tmp_path: Path) -> Repository:
    return Repository(tmp_path / "repository")


def history(repository: Repository, states: str) -> list[str]:
    """A commit per letter: g good, b bad, x cannot be built."""
    return [repository.commit(f"{k} {s}", state=s, count=str(k)) for k, s in enumerate(states)]


def attempt(tree: Path) -> tuple[Answer, str]:
    (tree / "count").write_text("as a build would leave it")
    return {"g": Answer.GOOD, "b": Answer.BAD, "x": Answer.SKIP}[(tree / "state").read_text()], "!"


@pytest.mark.parametrize("states", ["gb", "ggggb", "gbbbb", "gggggggbbbbbbbbb"])
def test_the_first_bad_commit_is_found(states: str, repository: Repository) -> None:
    commits = history(repository, states)
    steps: list[Step] = []
    found = bisect(repository.root, commits[0], "HEAD", attempt, steps.append)
    assert found.commits == (commits[states.index("b")],)
    assert f"{states.index('b')} b" in found.text
    assert len(steps) <= 3 + len(states).bit_length()


def test_commits_that_cannot_be_tried_are_skipped(repository: Repository) -> None:
    commits = history(repository, "ggxgxbb")
    found = bisect(repository.root, commits[0], commits[-1], attempt, lambda _: None)
    assert set(found.commits) >= {commits[5]}
    assert set(found.commits) <= {commits[4], commits[5]}


def test_the_users_files_and_branch_stay_as_they_are(repository: Repository) -> None:
    commits = history(repository, "gggbb")
    (repository.root / "state").write_text("unsaved work")
    before = (repository.git("status", "--porcelain"), repository.git("branch", "--show-current"))
    bisect(repository.root, commits[0], commits[-1], attempt, lambda _: None)
    assert (repository.root / "state").read_text() == "unsaved work"
    assert before == (
        repository.git("status", "--porcelain"), repository.git("branch", "--show-current")
    )  # fmt: skip
    assert repository.git("worktree", "list").count("\n") == 0
    assert repository.git("for-each-ref", "refs/bisect") == ""


@pytest.mark.parametrize("states", ["bb", "gg", "xb"])
def test_ends_that_are_not_what_they_are_said_to_be(states: str, repository: Repository) -> None:
    commits = history(repository, states)
    with pytest.raises(InputError, match="not what it is said to be"):
        bisect(repository.root, commits[0], commits[1], attempt, lambda _: None)
    assert repository.git("worktree", "list").count("\n") == 0


def test_what_a_bisection_that_was_killed_left_is_cleared_away(
    repository: Repository, tmp_path: Path
) -> None:
    commits = history(repository, "gbb")
    left = tmp_path / "left"
    repository.git("worktree", "add", "--quiet", "--detach", str(left))
    shutil.rmtree(left)
    bisect(repository.root, commits[0], commits[-1], attempt, lambda _: None)
    assert repository.git("worktree", "list").count("\n") == 0


def test_commits_that_nobody_knows(repository: Repository, tmp_path: Path) -> None:
    history(repository, "g")
    for name in ("v9.9", "--all", "HEAD~5"):
        with pytest.raises(InputError, match="knows no such commit"):
            bisect(repository.root, name, "HEAD", attempt, lambda _: None)
    (tmp_path / "plain").mkdir()
    with pytest.raises(InputError, match="not a git repository"):
        bisect(tmp_path / "plain", "a", "b", attempt, lambda _: None)


def test_builds(tmp_path: Path) -> None:
    def good(tree: Path) -> tuple[Answer, str]:
        return Answer.GOOD, "fine"

    assert run_of("", good)(tmp_path) == (Answer.GOOD, "fine")
    assert run_of("true", good)(tmp_path) == (Answer.GOOD, "fine")
    answer, why = run_of("ls no-such-file", good)(tmp_path)
    assert answer is Answer.SKIP
    assert "no-such-file" in why
    with pytest.raises(InputError, match="--build"):
        run_of("snellcheck-no-such-program", good)(tmp_path)


def check(name: str, status: Verdict) -> Check:
    return Check(
        id=name, renderer="r", against="truth", observable="tir", value=None, expected=None,
        tolerance=None, unit="", status=status, reason="because",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("statuses", "answer"),
    [
        ("pass", Answer.GOOD), ("known", Answer.GOOD), ("pass skip", Answer.GOOD),
        ("pass fail error", Answer.BAD), ("pass error", Answer.SKIP), ("skip", Answer.SKIP),
        ("", Answer.SKIP),
    ],
)  # fmt: skip
def test_what_verdicts_are_to_bisection(statuses: str, answer: Answer) -> None:
    checks = [check(f"a{k}", Verdict(s)) for k, s in enumerate(statuses.split())]
    assert judged(checks, None)[0] is answer
    assert judged([*checks, check("b", Verdict.FAIL)], "a*")[0] is answer
    assert judged(checks, "c*")[0] is Answer.SKIP


@pytest.mark.slow
def test_the_command_finds_the_commit_that_turned_an_index_around(
    repository: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = STUDENT.read_text()
    assert right.count(WRONG[0]) == 1
    first = repository.commit("Trace rays", **{"mine.py": right})
    repository.commit("Say what it is", README="a tracer")
    repository.commit("Tidy up", **{"mine.py": right.replace(*WRONG)})
    repository.commit("Say more", README="a fine tracer")
    monkeypatch.chdir(repository.root)
    command = "{python} mine.py {scene} {output.npy}"
    arguments = ["bisect", "snell-sweep", "--good", first, "--scenes", str(SCENES)]
    done = CliRunner().invoke(main, [*arguments, "-r", "tracer", "--renderer-command", command])
    assert done.exit_code == 0, done.output
    assert "first bad commit" in done.output
    assert done.output.rstrip().endswith("Tidy up")
