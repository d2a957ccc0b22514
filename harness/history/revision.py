"""What git says of the code that is being tested: the commit of the current folder's repository."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

TIMEOUT_S = 10


@dataclass(frozen=True)
class Revision:
    """A commit, and whether there was more than it in the folder; both empty outside of git."""

    commit: str = ""
    dirty: bool = False


def revision(folder: Path) -> Revision:
    """That of the repository that `folder` is in. Never raises."""
    commit = git(folder, "rev-parse", "HEAD")
    if commit is None:
        return Revision()
    return Revision(commit, bool(git(folder, "status", "--porcelain", "--untracked-files=no")))


def git(folder: Path, *arguments: str) -> str | None:
    """What a git command prints, None where it fails or there is no git."""
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True, text=True, errors="replace", timeout=TIMEOUT_S, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
