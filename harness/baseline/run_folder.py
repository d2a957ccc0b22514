"""A finished run on disk, as baselines see it: its summary, its records, their hashes."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from harness.archive import folder_name
from harness.baseline.document import MEASURED, Approval, Baseline, Kept, StoredImage
from harness.errors import InputError
from harness.record import CaseRecord, Check, RendererRun, Summary, Verdict, read_case, read_summary

SETTINGS = ("samples", "seed")  # those on which a result may depend


@dataclass(frozen=True)
class RunFolder:
    """`records` by case id, each with the SHA-256 of its file."""

    folder: Path
    summary: Summary
    records: dict[str, tuple[CaseRecord, str]]


def read_run(folder: Path) -> RunFolder:
    """Reads the run in `folder`. Raises InputError where any of its files is missing or broken."""
    if not folder.is_dir():
        raise InputError.of("there is no run", file=folder, expected="run `snellcheck run` first")
    summary = read_summary(folder / "summary.json")
    records = {}
    for case in summary.cases:
        file = record_file(folder, case.id)
        record = read_case(file)
        if record.id != case.id:
            raise InputError.of("the record of another case", file=file, value=record.id[:80])
        records[case.id] = (record, hashlib.sha256(file.read_bytes()).hexdigest())
    return RunFolder(folder, summary, records)


def record_file(folder: Path, case: str) -> Path:
    """Where the run in `folder` keeps the record of a case."""
    return folder / "records" / f"{folder_name(case)}.json"


def inside(folder: Path, name: str) -> Path:
    """The file `name` of a run. Raises InputError where it leads out of the run's folder."""
    path = folder / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise InputError.of("leads out of the run's folder", file=folder, value=name[:80])
    return path


def measured_of(record: CaseRecord, renderer: str) -> list[Check]:
    """The checks in which `renderer` takes part that were measured in this run, on both sides."""
    return [
        check
        for check in checks_of(record, renderer)
        if check.status in MEASURED and not check.stored
    ]


def checks_of(record: CaseRecord, renderer: str) -> list[Check]:
    """The checks in which `renderer` takes part, as the one judged or as the opponent."""
    return [check for check in record.checks if renderer in (check.renderer, check.against)]


def refusal(record: CaseRecord, run: RendererRun) -> str:
    """Why the results of `run` cannot be approved; empty where they can."""
    if run.stored is not None:
        return "its results are stored ones, not measured now"
    for check in checks_of(record, run.name):
        if check.status is Verdict.ERROR:
            return f"{check.id} is an error: {check.reason}"
    checks = measured_of(record, run.name)
    if not checks:
        return run.reason or "nothing was measured"
    for check in checks:
        numbers = (check.value, check.expected, check.tolerance)
        details = [x for x in check.detail.values() if isinstance(x, float)]
        if not all(x is not None and math.isfinite(x) for x in (*numbers, *details)):
            return f"{check.id} is not finite"
    if not record.scene_fingerprint:
        return "its record is of an older version without the scene's fingerprint; run it again"
    return ""


def baseline_of(
    record: CaseRecord,
    run: RendererRun,
    approval: Approval,
    images: list[StoredImage],
    earlier: list[Approval],
) -> Baseline:
    """The results of `run` as a baseline. Raises InputError for what must not be approved."""
    if why := refusal(record, run):
        raise InputError.of(f"{record.id} of {run.name} cannot be approved: {why}")
    settings = {key: value for key, value in run.settings.items() if key in SETTINGS}
    return Baseline(
        case=record.id,
        renderer=run.name,
        version=run.version,
        quality=record.quality,
        settings=settings,
        scene_file=record.scene_file,
        scene_fingerprint=record.scene_fingerprint,
        platform=record.platform,
        measured=record.started,
        capabilities=sorted(run.capabilities),
        facts=run.facts,
        checks=[
            check.model_copy(update={"derivation": "", "baseline": None})
            for check in measured_of(record, run.name)
        ],
        images=images,
        approval=approval,
        earlier=earlier,
    )


def baselines_of_run(folder: Path) -> Iterator[Kept]:
    """Every result of the run that could be approved, as if it had been."""
    run = read_run(folder)
    for record, digest in run.records.values():
        for renderer in run.summary.renderers:
            ran = next((r for r in record.runs if r.name == renderer), None)
            if ran is None or refusal(record, ran):
                continue
            approval = Approval(
                at=run.summary.started, by="", reason=f"the run in {folder}",
                version=ran.version, snellcheck_version=record.snellcheck_version,
                record_sha256=digest,
            )  # fmt: skip
            images = [
                StoredImage(
                    role=i.role, pixels_sha256=i.sha256, width=i.width, height=i.height,
                    scale=1.0, mean=i.mean, mean_error=i.mean_error,
                )
                for i in ran.images
            ]  # fmt: skip
            yield Kept(
                baseline_of(record, ran, approval, images, []), record_file(folder, record.id),
                digest,
            )  # fmt: skip
