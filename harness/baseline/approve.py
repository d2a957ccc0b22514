"""Approving: the only way in which a baseline comes to be or changes.

One case of one renderer at a time, so that accepting a change here never hides one there. Nothing
is written before all that was asked for is known to be acceptable.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from harness import __version__, plan
from harness.archive import folder_name
from harness.baseline.compare import against
from harness.baseline.document import MOST_EARLIER, Approval, Kept, identity, write_baseline
from harness.baseline.pictures import keep
from harness.baseline.run_folder import RunFolder, baseline_of, inside, measured_of, refusal
from harness.baseline.source import Baselines
from harness.documents import Model, read, write_bytes
from harness.errors import InputError, Problem, nearest
from harness.git import said
from harness.record import BaselineState, CaseRecord, Check, ImageFile, RendererRun, Verdict
from harness.scene.load import pattern
from harness.temporary import temporary_folder

if TYPE_CHECKING:
    from harness.baseline.store import Store

APPROVALS_SCHEMA: Literal["snellcheck-approvals/1"] = "snellcheck-approvals/1"
LONGEST_REASON = 1000


class Choice(Model):
    """One result to approve; without a `reason` of its own, that of the command counts."""

    case: str
    renderer: str
    reason: str = ""


class Choices(Model):
    """What a person marked on the report's page, as a file for `snellcheck approve --from`."""

    choices_schema: Literal["snellcheck-approvals/1"] = Field(
        default=APPROVALS_SCHEMA, alias="schema"
    )
    approve: list[Choice] = Field(min_length=1)


@dataclass(frozen=True)
class Change:
    """What approving would change of one check: its state against the present baseline."""

    check: str
    state: BaselineState
    before: str
    after: str


@dataclass(frozen=True)
class Plan:
    """One result that is to be approved, and what that changes. No changes: nothing to do."""

    record: CaseRecord
    record_sha256: str
    run: RendererRun
    reason: str
    changes: tuple[Change, ...]
    kept: Kept | None

    @property
    def needed(self) -> bool:
        """Whether the baseline is not just what was measured."""
        return self.kept is None or bool(self.changes)


def read_choices(file: Path) -> list[Choice]:
    """The choices in `file`. Raises InputError where it is no such file."""
    return list(read(file, Choices, "list of approvals").approve)


def choose(run: RunFolder, globs: Sequence[str], renderers: Sequence[str]) -> list[Choice]:
    """All results of the run that the globs over ids, cases or families and the names select.

    Renderers that were not there are left out where none is named. Raises InputError where a glob
    or a name selects nothing.
    """
    chosen: list[Choice] = []
    problems = []
    names = {n for r, _ in run.records.values() for n in (r.id, r.case, r.family)}
    for glob in globs:
        matching = [
            record
            for record, _ in run.records.values()
            if any(map(pattern(glob).fullmatch, (record.id, record.case, record.family)))
        ]
        if not matching:
            problems.append(
                Problem(f"no case of the run matches {glob!r}", file=run.folder,
                        suggestion=nearest(glob, names))
            )  # fmt: skip
        chosen += [
            Choice(case=record.id, renderer=ran.name)
            for record in matching
            for ran in record.runs
            if (ran.name in renderers if renderers else _took_part(record, ran))
        ]
    problems += [
        Problem("not a renderer of the run", key="--renderer", value=name,
                suggestion=nearest(name, run.summary.renderers))
        for name in renderers
        if name not in run.summary.renderers
    ]  # fmt: skip
    if problems:
        raise InputError(problems)
    return list(dict.fromkeys(chosen))


def _took_part(record: CaseRecord, run: RendererRun) -> bool:
    """Whether there is anything to approve or to refuse; else the renderer was not there."""
    return bool(measured_of(record, run.name)) or run.status is Verdict.ERROR


def plan_approvals(
    run: RunFolder, choices: Sequence[Choice], reason: str, baselines: Baselines
) -> list[Plan]:
    """What approving `choices` would change.

    Raises InputError with every reason why not: a result that is an error, not finite, not in the
    run, or a choice without a reason.
    """
    plans, problems = [], []
    for choice in choices:
        why = (choice.reason or reason).strip()
        found = run.records.get(choice.case)
        ran = next((r for r in found[0].runs if r.name == choice.renderer), None) if found else None
        said = f"{choice.case} of {choice.renderer}"
        if found is None or ran is None:
            problems.append(Problem(f"{said} is not in the run", file=run.folder))
        elif not why or len(why) > LONGEST_REASON or not why.isprintable():
            problems.append(
                Problem("say why in a line", key="--reason", value=why[:80] or "nothing")
            )
        elif refused := refusal(found[0], ran):
            problems.append(Problem(f"{said} cannot be approved: {refused}", file=run.folder))
        else:
            kept = baselines.kept.get((choice.case, choice.renderer))
            changes = tuple(_changes(found[0], ran, kept))
            plans.append(Plan(found[0], found[1], ran, why, changes, kept))
    if problems:
        raise InputError(problems)
    return plans


def _changes(record: CaseRecord, run: RendererRun, kept: Kept | None) -> Iterator[Change]:
    approved = kept.baseline.by_identity if kept else {}
    checks = {identity(check): check for check in measured_of(record, run.name)}
    for name, check in checks.items():
        before = approved.get(name)
        state = against(check, before, record, run, kept)
        if state is not None and state.state is not BaselineState.SAME:
            yield Change(check.id, state.state, _figures(before), _figures(check))
    for name, before in approved.items():
        if name not in checks:
            yield Change(before.id, BaselineState.MISSING, _figures(before), "not in the run")


def _figures(check: Check | None) -> str:
    if check is None or check.value is None or check.expected is None:
        return "nothing"
    off = check.value - check.expected
    sizes = f"off by {off:.3g} of {check.tolerance:.3g} {check.unit}"
    return f"{check.status.value}, {sizes}".rstrip()


def approve(
    plans: Sequence[Plan], run: RunFolder, folder: Path, by: str, store: Store | None = None
) -> list[Path]:
    """Writes the baselines of `plans` below `folder`; returns the files written."""
    needed = [one for one in plans if one.needed]
    with temporary_folder() as staging:
        # All pictures are read and encoded before anything is written: one may be refused.
        pictures = [
            [
                keep(image, inside(run.folder, image.path), _staged(staging, folder, one), store)
                for image in one.run.images
                if _worth_keeping(image, one.record, one.run)
            ]
            for one in needed
        ]
        for file in sorted(Path(staging).rglob("*.png")):
            write_bytes(folder / file.relative_to(staging), file.read_bytes())
    written = []
    for one, images in zip(needed, pictures, strict=True):
        file = baseline_file(folder, one.record.id, one.run.name)
        approval = Approval(
            at=datetime.now(UTC).replace(microsecond=0).isoformat(), by=by, reason=one.reason,
            commit=said(Path(), "rev-parse", "HEAD") or "", version=one.run.version,
            snellcheck_version=__version__, record_sha256=one.record_sha256,
        )  # fmt: skip
        write_baseline(baseline_of(one.record, one.run, approval, images, _earlier(one.kept)), file)
        written.append(file)
    return written


def _staged(staging: str, folder: Path, one: Plan) -> Path:
    """Where the picture of a plan waits until all of them are there."""
    file = baseline_file(folder, one.record.id, one.run.name).with_suffix(".png")
    return Path(staging) / file.relative_to(folder)


def baseline_file(folder: Path, case: str, renderer: str) -> Path:
    """Where the baseline of a case and renderer is kept below `folder`. Raises InputError."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,63}", renderer):
        raise InputError.of("no name for a folder of baselines", value=repr(renderer[:80]))
    return folder / renderer / f"{folder_name(case)}.json"


def _worth_keeping(image: ImageFile, record: CaseRecord, run: RendererRun) -> bool:
    """Pictures that other renderers are compared with: the scene's own, without noise."""
    compared = any(check.against not in ("truth", "baseline") for check in record.checks)
    return image.role == plan.IMAGE and compared and "pixel-centres" in run.capabilities


def _earlier(kept: Kept | None) -> list[Approval]:
    if kept is None:
        return []
    return [kept.baseline.approval, *kept.baseline.earlier][:MOST_EARLIER]


def approver() -> str:
    """Who is at work, by git. Raises InputError where git does not know."""
    name, mail = (said(Path(), "config", f"user.{key}") for key in ("name", "email"))
    if not name:
        raise InputError.of(
            "git does not know who you are", key="--by",
            expected='`git config user.name "…"`, or --by "name <address>"',
        )  # fmt: skip
    return f"{name} <{mail}>" if mail else name
