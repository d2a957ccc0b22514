"""What git says of the code that is being tested: the commit of the current folder's repository."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from harness.git import said


@dataclass(frozen=True)
class Revision:
    """A commit, and whether there was more than it in the folder; both empty outside of git."""

    commit: str = ""
    dirty: bool = False


def revision(folder: Path) -> Revision:
    """That of the repository that `folder` is in. Never raises."""
    commit = said(folder, "rev-parse", "HEAD")
    if commit is None:
        return Revision()
    return Revision(commit, bool(said(folder, "status", "--porcelain", "--untracked-files=no")))
