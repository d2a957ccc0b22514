"""Two runs side by side: the later one's report, with the earlier as its baseline and beside it."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from harness import record as records
from harness.baseline.compare import compare
from harness.baseline.outcome import outcome, write_outcome
from harness.baseline.run_folder import inside, read_run, record_file
from harness.baseline.select import selector
from harness.baseline.source import open_baselines
from harness.errors import InputError
from harness.record import BaselineSummary

BEFORE = "before: "  # what the earlier run's pictures are called by
# What a run's report is made of; its pages are made anew.
PARTS = ("records", "images", "data", "scenes", "translated")


def two_runs(before: Path, after: Path, out: Path) -> BaselineSummary:
    """Makes `out` a run's folder that compares `after` with `before`, ready for its report.

    Nothing is rendered, and neither run is changed. Files are linked where the disk allows it.
    Raises InputError where either is no run, or `out` is one of them or something else.
    """
    earlier, later = read_run(before), read_run(after)
    _make_room(out, before, after)
    for part in PARTS:
        _link_all(after / part, out / part)
    shutil.copyfile(after / "summary.json", out / "summary.json")
    for case in later.records.keys() & earlier.records.keys():
        record = later.records[case][0]
        pack = earlier.records[case][0].pack
        if pack is not None and (source := inside(before, pack)).is_file():
            _link(source, out / "before" / pack)
            changed = record.model_copy(update={"other_packs": {BEFORE: f"before/{pack}"}})
            records.write(changed, record_file(out, case))
    run, baselines = read_run(out), open_baselines(str(before))
    comparison = compare(run, baselines, selector((), (), run, baselines))
    found = outcome(comparison, baselines.source, [])
    write_outcome(run, comparison, found)
    return found


def _make_room(out: Path, *runs: Path) -> None:
    """Clears what an earlier comparison left in `out`, and refuses to touch anything else."""
    if any(out.resolve() == run.resolve() for run in runs):
        raise InputError.of("a comparison needs a folder of its own", file=out, key="--out")
    if out.is_dir() and any(out.iterdir()):
        if not (out / "before").is_dir() or not (out / "summary.json").is_file():
            raise InputError.of(
                "not empty, and not an earlier comparison", file=out, key="--out",
                expected="a new folder",
            )  # fmt: skip
        shutil.rmtree(out)
    (out / "before").mkdir(parents=True)


def _link_all(source: Path, target: Path) -> None:
    for path in sorted(source.rglob("*")):
        if path.is_file() and not path.is_symlink():
            _link(path, target / path.relative_to(source))


def _link(source: Path, target: Path) -> None:
    """Records are always written anew under their names, never changed in place, so links do."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target)
    except OSError:  # another disk, or one that knows no links
        shutil.copyfile(source, target)
