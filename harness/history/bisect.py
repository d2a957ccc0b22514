"""Which commit broke a check: git's bisection, with a run of one case at each step.

It works in a worktree of its own, so that the user's files, index and branch stay as they are.
"""

from __future__ import annotations

import contextlib
import shlex
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from harness.errors import InputError
from harness.git import GitFailed, commit_of, git
from harness.temporary import temporary_folder


class Answer(StrEnum):
    """What a step is to git: `SKIP` where the commit cannot be tried."""

    GOOD = "good"
    BAD = "bad"
    SKIP = "skip"


@dataclass(frozen=True)
class Step:
    """A commit that was tried."""

    commit: str
    subject: str
    answer: Answer
    why: str


@dataclass(frozen=True)
class Culprit:
    """The first bad commit; several where the commits between could not be tried."""

    commits: tuple[str, ...]
    text: str


ONLY_SKIPPED = 2  # git's exit code where no commit is left that can be tried

Try = Callable[[Path], tuple[Answer, str]]


def bisect(
    repository: Path, good: str, bad: str, attempt: Try, report: Callable[[Step], None]
) -> Culprit:
    """The first commit between `good` and `bad` at which `attempt`, given its files, says BAD.

    Both ends are tried first: where `good` is not good or `bad` not bad there is nothing to find,
    which is an InputError, as are revisions that git does not know.
    """
    root = Path(_git(repository, "rev-parse", "--show-toplevel"))
    named = {"--good": good, "--bad": bad}
    ends = {key: _commit(root, key, name) for key, name in named.items()}
    with _worktree(root, ends["--bad"]) as tree:
        for key, wanted in (("--bad", Answer.BAD), ("--good", Answer.GOOD)):
            step = _step(tree, ends[key], attempt)
            report(step)
            if step.answer is not wanted:
                told = f"{step.answer}: {step.why}"
                raise InputError.of("this end is not what it is said to be", key=key, value=told)
        said = _git(tree, "bisect", "start", ends["--bad"], ends["--good"])
        while (found := _culprit(tree, said)) is None:
            step = _step(tree, "", attempt)
            report(step)
            said = _git(tree, "bisect", str(step.answer), expected=ONLY_SKIPPED)
    return found


def run_of(command: str, verdict: Callable[[Path], tuple[Answer, str]]) -> Try:
    """Tries a commit by `command`, run without a shell in its folder, and then by `verdict`.

    A commit that cannot be built is skipped.
    """
    words = shlex.split(command)

    def attempt(tree: Path) -> tuple[Answer, str]:
        if words:
            try:
                done = subprocess.run(words, cwd=tree, capture_output=True, text=True, check=False)
            except OSError as error:
                raise InputError.of(str(error.strerror), key="--build", value=command) from error
            if done.returncode != 0:
                last = (done.stderr or done.stdout).strip().splitlines()[-1:]
                return Answer.SKIP, " ".join(["it cannot be built:", *last])
        return verdict(tree)

    return attempt


def _step(tree: Path, commit: str, attempt: Try) -> Step:
    if commit:
        _git(tree, "checkout", "--quiet", "--detach", commit)
    name = _git(tree, "rev-parse", "HEAD")
    subject = _git(tree, "log", "-1", "--format=%s")
    answer, why = attempt(tree)
    # What a build has changed would keep git from checking out the next commit.
    _git(tree, "reset", "--quiet", "--hard")
    return Step(name, subject, answer, why)


def _culprit(tree: Path, said: str) -> Culprit | None:
    """The end of the search, as git says it."""
    if "is the first bad commit" in said:
        commit = said.split()[0]
        shown = _git(tree, "log", "-1", "--format=%h %an, %as: %s", commit)
        return Culprit((commit,), shown)
    if "first bad commit could be any of" in said:
        lines = said.splitlines()
        commits = tuple(line for line in lines if len(line) == 40 and line.isalnum())
        return Culprit(commits, "one of: " + ", ".join(commit[:10] for commit in commits))
    return None


@contextlib.contextmanager
def _worktree(root: Path, commit: str) -> Iterator[Path]:
    with temporary_folder() as folder:
        tree = Path(folder) / "tree"
        _git(root, "worktree", "prune")  # what a bisection that was killed has left
        _git(root, "worktree", "add", "--quiet", "--detach", str(tree), commit)
        try:
            yield tree
        finally:
            with contextlib.suppress(InputError):
                _git(root, "worktree", "remove", "--force", str(tree))


def _commit(root: Path, key: str, name: str) -> str:
    try:
        return commit_of(root, name)
    except GitFailed as error:
        raise InputError.of(str(error), key=key, value=name) from error


def _git(folder: Path, *arguments: str, expected: int = 0) -> str:
    """What git prints. Raises InputError with what it says where it fails."""
    try:
        return git(folder, *arguments, expected=expected).decode("utf-8", "replace").strip()
    except GitFailed as error:
        raise InputError.of(f"git {arguments[0]}: {error}", value=str(folder)) from error
