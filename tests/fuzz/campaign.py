"""Reads mutated files in a child process, and notes what must not be.

``python -m tests.fuzz.campaign SEED FOLDER KIND=COUNT…`` does it and prints a line of JSON for each
kind. The file in work stays in FOLDER, so that a crash of the child leaves its cause behind.
"""

from __future__ import annotations

import json
import random
import resource
import signal
import subprocess
import sys
import time
import traceback
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import FrameType

from harness.errors import InputError, Problem
from tests.fuzz.mutation import mutate
from tests.fuzz.targets import ROOT, Kind, kinds, prepare_folder

HANG_S = 5.0  # of processor time, which does not depend on who else is at work
WAIT_S = 60.0  # of wall time, for what would wait for ever
MOST_MB = 1024
# Messages about a file as a whole, which has no line or key.
WHOLE = ("larger than", "nested too deeply", "more than", "cannot be read", "empty")


@dataclass
class Outcome:
    """Of one kind of file. `faults` are what must not be, with the file's content in hex."""

    kind: str
    read: int = 0
    accepted: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    most_mb: float = 0.0
    faults: list[str] = field(default_factory=list)


class Hang(BaseException):
    """Raised by the alarm."""


def campaign(kind: Kind, count: int, seed: int, folder: Path) -> Outcome:
    """Reads `count` mutated files."""
    prepare_folder(kind, folder)
    path, outcome = folder / kind.file, Outcome(kind.name)
    signal.signal(signal.SIGPROF, _alarm)
    signal.signal(signal.SIGALRM, _alarm)
    for example in kind.seeds[:3]:  # also so that imports do not count as a hang
        path.write_bytes(example)
        kind.read(path)
    for index in range(count):
        rng = random.Random(f"{kind.name} {seed} {index}")
        data = mutate(rng.choice(kind.seeds), rng)
        path.write_bytes(data)
        outcome.read += 1
        start = time.process_time()
        wrong = attempt(kind, path, outcome)
        outcome.slowest_s = max(outcome.slowest_s, time.process_time() - start)
        if wrong:
            outcome.faults.append(f"{wrong}\n{kind.name} {seed} {index}: {data[:4000].hex()}")
            if len(outcome.faults) >= 10:
                break
    outcome.most_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    if outcome.most_mb > MOST_MB:
        outcome.faults.append(f"{outcome.most_mb:.0f} MB")
    return outcome


def attempt(kind: Kind, path: Path, outcome: Outcome) -> str:
    """Reads the file; what is wrong with how that went, or nothing."""
    signal.setitimer(signal.ITIMER_PROF, HANG_S)
    signal.setitimer(signal.ITIMER_REAL, WAIT_S)
    try:
        return judged(kind, path, outcome)
    except Hang:
        return f"no answer within {HANG_S} s:\n{traceback.format_exc(limit=-6)}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)


def judged(kind: Kind, path: Path, outcome: Outcome) -> str:
    """As `attempt`, for as long as it takes."""
    try:
        kind.read(path)
    except InputError as error:
        outcome.refused += 1
        return next(filter(None, map(_unclear, error.problems)), "") or (
            "" if error.problems else "an error without a message"
        )
    except Exception:
        return traceback.format_exc(limit=-6)
    outcome.accepted += 1
    return ""


def _unclear(problem: Problem) -> str:
    """What a message lacks: the file, a place in it, or being one line."""
    said = str(problem)
    if problem.file is None:
        return f"no file: {said}"
    if not said.isprintable() or len(said) > 2000:
        return f"not one line that can be shown: {said!r}"
    if problem.line is None and not problem.key and not any(w in said for w in WHOLE):
        return f"no place: {said}"
    return ""


def _alarm(_: int, __: FrameType | None) -> None:
    raise Hang


def in_child(counts: dict[str, int], seed: int, folder: Path, timeout: float) -> list[Outcome]:
    """Campaigns in a process of their own, so that a crash or a hang in C is an outcome, too."""
    command = [sys.executable, "-m", "tests.fuzz.campaign", str(seed), str(folder)]
    command += [f"{name}={count}" for name, count in counts.items()]
    try:
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=timeout
        )
        said, ended = done.stdout, f"ended with {done.returncode}: {done.stderr[-2000:]}"
    except subprocess.TimeoutExpired as error:
        said, ended = (error.stdout or b"").decode(), "hangs"
    outcomes = [Outcome(**json.loads(line)) for line in said.splitlines()]
    missing = list(counts)[len(outcomes) :]
    return outcomes + [
        Outcome(name, faults=[f"{ended} (files are in {folder})"]) for name in missing
    ]


def main(arguments: list[str]) -> None:
    seed, root, *counts = arguments
    by_name = {kind.name: kind for kind in kinds()}
    for index, (name, _, count) in enumerate(word.partition("=") for word in counts):
        folder = Path(root) / str(index)
        folder.mkdir(parents=True, exist_ok=True)
        outcome = campaign(by_name[name], int(count), int(seed), folder)
        print(json.dumps(asdict(outcome)), flush=True)  # noqa: T201


if __name__ == "__main__":
    main(sys.argv[1:])
