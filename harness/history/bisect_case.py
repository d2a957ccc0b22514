"""What a commit is to bisection: a run of one case with the renderer as it was then."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from harness.errors import InputError
from harness.history.bisect import Answer
from harness.record import Check, Verdict, read_summary
from harness.temporary import temporary_folder


def verdict_of_case(
    case: str, check: str | None, options: Sequence[str]
) -> Callable[[Path], tuple[Answer, str]]:
    """A function of a commit's folder: is `case` good there, in the checks like `check`?

    The run is a process of its own, started in that folder, so that whatever of the renderer is
    imported or executed is that commit's.
    """

    def verdict(tree: Path) -> tuple[Answer, str]:
        with temporary_folder() as name:
            out = Path(name) / "run"
            # snellcheck itself stays the one that runs now, even where it is what is bisected.
            code = f"import sys; sys.path[:0] = {sys.path!r}; from harness.cli import main; main()"
            arguments = ["run", case, "--out", str(out), "--no-history", *options]
            done = subprocess.run(
                [sys.executable, "-P", "-c", code, *arguments],
                cwd=tree, capture_output=True, text=True, check=False,
            )  # fmt: skip
            try:
                summary = read_summary(out / "summary.json")
            except InputError:
                last = (done.stderr or done.stdout).strip().splitlines()[-1:]
                return Answer.SKIP, " ".join(["it cannot be run:", *last])
            return judged([c for one in summary.cases for c in one.checks], check)

    return verdict


def judged(checks: Sequence[Check], wanted: str | None) -> tuple[Answer, str]:
    """Bad where one fails, good where all pass, to be skipped where nothing can be said."""
    mine = [c for c in checks if wanted is None or fnmatchcase(c.id, wanted)]
    for check in mine:
        if check.status is Verdict.FAIL:
            return Answer.BAD, f"{check.id}: {check.reason}"
    broken = next((c for c in mine if c.status is Verdict.ERROR), None)
    if broken is not None:
        return Answer.SKIP, f"{broken.id}: {broken.reason}"
    passed = [c for c in mine if c.status in (Verdict.PASS, Verdict.KNOWN)]
    if not passed:
        return Answer.SKIP, "none of the checks could be made" if mine else "no such check"
    return Answer.GOOD, f"{len(passed)} checks passed"
