"""kill -9 of a run at any moment: nothing lost, nothing rendered twice, nothing half-written."""

from __future__ import annotations

import json
import math
import os
import random
import signal
import statistics
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from harness import record
from harness.cache.cache import open_cache
from harness.record import CaseRecord
from harness.run import UNFINISHED
from tests.stress.figures import count, note

ROOT = Path(__file__).parents[2]
KILLABLE = "from tests.stress.killable import main; import sys; main(*sys.argv[1:])"
CASES = ["snell", "slab", "ball", "tir"]


@dataclass(frozen=True)
class Place:
    """Where a run writes."""

    root: Path

    @property
    def out(self) -> Path:
        return self.root / "out"

    @property
    def log(self) -> Path:
        return self.root / "log"

    def start(self) -> subprocess.Popen[str]:
        self.root.mkdir(exist_ok=True)
        places = (self.out, self.root / "cache", self.log)
        return subprocess.Popen(
            [sys.executable, "-c", KILLABLE, *map(str, places), *CASES],
            cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def finish(self) -> dict[str, object]:
        out, err = self.start().communicate()
        assert out, err
        return dict(json.loads(out))

    def is_over(self) -> bool:
        """Whether the run has ended: the same command again is another run, not the rest of it."""
        return (self.out / "summary.json").exists()

    def verdicts(self) -> dict[str, object]:
        summary = record.read_summary(self.out / "summary.json")
        return {
            case.id: [[c.id, str(c.status), c.value] for c in case.checks] for case in summary.cases
        }

    def images(self) -> list[tuple[str, float]]:
        """Finished images in order: the renderer's name and the scene's hash, and when (s)."""
        lines = self.log.read_text().splitlines() if self.log.exists() else []
        return [(what, float(when)) for what, when in (line.rsplit(" ", 1) for line in lines)]

    def rendered(self) -> Counter[str]:
        return Counter(what for what, _ in self.images())

    def records(self) -> list[CaseRecord]:
        return [record.read_case(path) for path in sorted((self.out / "records").glob("*.json"))]


def check_what_is_there(place: Place) -> None:
    """Every file that has its final name is whole, and every record has all of its files."""
    for written in place.records():
        named = [i.path for run in written.runs for i in run.images]
        named += [i.picture for run in written.runs for i in run.images if i.picture]
        named += [d.path for d in written.differences] + list(written.files.values())
        for path in named:
            assert (place.out / path).stat().st_size > 0
    if (place.out / "summary.json").exists():
        record.read_summary(place.out / "summary.json")
    assert open_cache(str(place.root / "cache")).verify().removed == {}


@dataclass
class Ledger:
    """Which images may be rendered again: those that were finished but perhaps not yet kept.

    A renderer does one image at a time, and keeps it before it begins the next. So of each renderer
    that is the last one that it finished before a kill, and nothing else.
    """

    seen: int = 0  # lines of the log
    finished: dict[str, float] = field(default_factory=dict)  # when
    owed: dict[str, float] = field(default_factory=dict)  # for how long it was finished, s
    again: list[float] = field(default_factory=list)  # the same, of those that were made again

    def check(self, place: Place, killed_at: float) -> None:
        """Takes in what was rendered since; the last of each renderer may be made once more."""
        lines = place.images()
        new, self.seen = lines[self.seen :], len(lines)
        for what, when in new:
            if what in self.finished:
                assert what in self.owed, f"{what} was kept and is rendered again: {new}"
                self.again.append(self.owed.pop(what))
            self.finished[what] = when
        last = {what.split()[0]: (what, when) for what, when in new}
        self.owed |= {what: killed_at - when for what, when in last.values()}


def timeless(written: CaseRecord) -> CaseRecord:
    runs = [run.model_copy(update={"render_s": 0.0}) for run in written.runs]
    return written.model_copy(update={"started": "", "wall_s": 0.0, "runs": runs})


def kill_after(place: Place, images: int, delay_s: float) -> float | None:
    """Starts a run, kills it `delay_s` after it has rendered so many more images.

    Returns when, by the monotonic clock; None where the run had ended.

    Images rather than seconds, since a run takes longer to start than to work.
    """
    goal = place.rendered().total() + images
    process = place.start()
    while process.poll() is None and place.rendered().total() < goal:
        time.sleep(0.002)
    time.sleep(delay_s)
    if process.poll() is not None:
        process.communicate()
        return None
    os.kill(process.pid, signal.SIGKILL)
    killed_at = time.monotonic()
    process.communicate()
    return None if place.is_over() else killed_at


@pytest.mark.slow
def test_killed_again_and_again_a_run_ends_as_if_nothing_had_happened(tmp_path: Path) -> None:
    whole = Place(tmp_path / "whole")
    verdicts = whole.finish()
    expected = whole.rendered()
    assert set(expected.values()) == {1}
    wanted, dice = count(4, 100), random.Random(6)
    kills, rounds, again = 0, 0, list[float]()
    while kills < wanted:
        place = Place(tmp_path / f"round-{rounds}")
        rounds += 1
        ledger = Ledger()
        while kills < wanted:
            images = dice.randint(0, max(2, expected.total() // 3))
            killed_at = kill_after(place, images, dice.random() * 0.03)
            ledger.check(place, killed_at or math.inf)
            if killed_at is None:
                break
            kills += 1
            check_what_is_there(place)
        if place.is_over():
            assert place.verdicts() == verdicts
        else:
            assert place.finish() == verdicts
            assert not (place.out / UNFINISHED).exists()
            ledger.check(place, math.inf)
        assert ledger.finished.keys() == expected.keys()
        again += ledger.again
        assert list(map(timeless, place.records())) == list(map(timeless, whole.records()))
    note(
        "kill -9 of a run", "at a random moment, then the same command again", kills,
        f"{rounds} runs, all ended with the verdicts and records of a run that was not killed; "
        f"{told_again(again, rounds * expected.total())}",
    )  # fmt: skip


def told_again(ages: list[float], images: int) -> str:
    """What is told of the images that were made twice, finished for so many seconds."""
    if not ages:
        return f"none of {images} images was made again once it was finished"
    return (
        f"of {images} images, {len(ages)} were made again: their renderer had handed them over "
        f"{statistics.median(ages) * 1e3:.0f} ms before the kill (median; at most "
        f"{max(ages) * 1e3:.0f} ms), and they were still in memory"
    )
