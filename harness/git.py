"""What git says: in English, changing nothing that it is not told to, and asking nobody."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

TIMEOUT_S = 60
_ENVIRONMENT = {"LC_ALL": "C", "GIT_TERMINAL_PROMPT": "0", "GIT_OPTIONAL_LOCKS": "0"}


class GitFailed(Exception):
    """There is no git, or it refuses; the message is its own."""


def git(folder: Path, *arguments: str, expected: int = 0) -> bytes:
    """What a git command prints in `folder`. Raises GitFailed.

    The exit code `expected` is no failure; what goes to stderr with it is part of the answer.
    """
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments],
            stdin=subprocess.DEVNULL, capture_output=True, check=False, timeout=TIMEOUT_S,
            env={**os.environ, **_ENVIRONMENT},
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise GitFailed(f"git {arguments[0]} took more than {TIMEOUT_S} s") from error
    except (OSError, ValueError) as error:  # ValueError: a NUL among the arguments
        raise GitFailed(f"git cannot be run: {getattr(error, 'strerror', error)}") from error
    if done.returncode not in (0, expected):
        words = " ".join(done.stderr.decode("utf-8", "replace").split())
        raise GitFailed(words.removeprefix("fatal: ") or f"exit code {done.returncode}")
    return done.stdout + done.stderr if done.returncode else done.stdout


def said(folder: Path, *arguments: str) -> str | None:
    """What a git command prints as a text, None where it fails."""
    try:
        return git(folder, *arguments).decode("utf-8", "replace").strip()
    except GitFailed:
        return None


def commit_of(folder: Path, name: str) -> str:
    """The hash of the commit that `name` is. Raises GitFailed, which says why there is none."""
    words = ("rev-parse", "--verify", "--end-of-options", f"{name}^{{commit}}")
    try:
        return git(folder, *words).decode().split()[-1]
    except GitFailed as error:
        if "Needed a single revision" not in str(error):
            raise
    if said(folder, "rev-parse", "--is-shallow-repository") == "true":
        raise GitFailed("this clone is shallow; `git fetch --unshallow` gets the rest")
    raise GitFailed("git knows no such commit")
