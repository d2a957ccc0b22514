"""How a run stands to approved results: check by check, in one of eight states.

What is compared is the deviation d = value - expected of each check in units of its tolerance, not
the value: the worst ray may be another one without anything being worse.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from harness.baseline.document import Baseline, Kept, identity
from harness.baseline.means import mean_shift
from harness.baseline.run_folder import RunFolder, checks_of
from harness.baseline.source import Baselines
from harness.baseline.trend import in_tolerances
from harness.record import (
    AgainstBaseline,
    BaselineState,
    CaseRecord,
    Check,
    LostCheck,
    RendererRun,
    Verdict,
)

# A step of less than this part of the tolerance is called the same: an exact renderer repeats
# itself to the last bit on one machine, and its roundings move on another. What hides there is the
# trend test's to find, and the size follows from that. At its level a suite of 2,300 checks takes
# ten runs in a row (2 / 10! < 1 - 0.99^(1/2300) < 2 / 9!). So that a slide which nobody was told of
# is named before it leaves its tolerance from anywhere in the inner half, ten steps must not pass
# the outer half: a twentieth each.
STEP = 0.05
GREEN = (Verdict.PASS, Verdict.KNOWN)
FAILING = frozenset({BaselineState.REGRESSED, BaselineState.MISSING, BaselineState.STALE})

WORST_FIRST = (
    BaselineState.REGRESSED, BaselineState.MISSING, BaselineState.STALE, BaselineState.DRIFTED,
    BaselineState.RENDERER_CHANGED, BaselineState.IMPROVED, BaselineState.NEW, BaselineState.SAME,
)  # fmt: skip

Wanted = Callable[[str, str], bool]  # of a case's id and a renderer's name


@dataclass
class Comparison:
    """States of the run's checks by (case, check id), and what was approved and is lost."""

    states: dict[tuple[str, str], AgainstBaseline] = field(default_factory=dict)
    lost: list[LostCheck] = field(default_factory=list)

    def counts(self) -> Counter[BaselineState]:
        states = [s.state for s in self.states.values()] + [lost.state for lost in self.lost]
        return Counter(states)


def compare(run: RunFolder, baselines: Baselines, wanted: Wanted) -> Comparison:
    """Compares all checks of the cases and renderers that are `wanted`, on either side."""
    result = Comparison()
    for case, (record, _) in run.records.items():
        for renderer in record.runs:
            if wanted(case, renderer.name):
                kept = baselines.kept.get((case, renderer.name))
                _compare_one(record, renderer, kept, result)
    for (case, name), kept in baselines.kept.items():
        if wanted(case, name) and name not in _renderers(run, case):
            part = f"the renderer {name}" if case in run.records else "the case"
            result.lost.append(_lost(kept.baseline, "", f"{part} is not in the run"))
    for problem in baselines.unreadable:
        result.lost.append(
            LostCheck(case=str(problem.file), renderer="", state=BaselineState.MISSING,
                      reason=problem.said)
        )  # fmt: skip
    return result


def _renderers(run: RunFolder, case: str) -> set[str]:
    return {r.name for r in run.records[case][0].runs} if case in run.records else set()


def _compare_one(
    record: CaseRecord, run: RendererRun, kept: Kept | None, result: Comparison
) -> None:
    approved = kept.baseline.by_identity if kept else {}
    mine = {identity(check): check for check in checks_of(record, run.name)}
    for name, check in mine.items():
        state = against(check, approved.get(name), record, run, kept)
        if state is not None:
            key = (record.id, check.id)
            result.states[key] = _weightier(state, result.states.get(key))
    if kept is not None:
        for name, check in approved.items():
            if name not in mine:
                reason = f"approved {_when(kept.baseline)}, and not in the run"
                result.lost.append(_lost(kept.baseline, check.id, reason))


def _weightier(a: AgainstBaseline, b: AgainstBaseline | None) -> AgainstBaseline:
    """Of the states of a comparison of two renderers, each with its own baseline, the one to tell.

    What was approved for one is not new because nothing was for the other; else the worse counts.
    """
    if b is None:
        return a
    return min(a, b, key=lambda s: (s.status is None, WORST_FIRST.index(s.state)))


def against(
    check: Check, approved: Check | None, record: CaseRecord, run: RendererRun, kept: Kept | None
) -> AgainstBaseline | None:
    """The state of one check; None where there is nothing to say: skipped, and never approved."""
    if kept is None or approved is None:
        if check.status is Verdict.SKIP or check.stored:
            return None
        state, reason = _new(check)
        return AgainstBaseline(state=state, reason=reason)
    baseline = kept.baseline
    shift = None
    if stale := why_stale(baseline, record, run):
        state, reason = BaselineState.STALE, stale
    elif check.stored or check.status is Verdict.SKIP:
        state, reason = BaselineState.MISSING, f"not measured now: {check.reason}"
    elif check.status is Verdict.ERROR:
        state, reason = BaselineState.REGRESSED, check.reason
    else:
        shift = _deviation(check) - _deviation(approved)
        state, reason = _moved(check, approved, shift)
        changed = run.version != baseline.version
        if changed and state is BaselineState.SAME:
            state = BaselineState.RENDERER_CHANGED
        reason = "; ".join(filter(None, (reason, _cause(baseline, run, state))))
    return AgainstBaseline(
        state=state, reason=reason, value=approved.value, expected=approved.expected,
        tolerance=approved.tolerance, status=approved.status, shift=shift,
        version=baseline.version, approved=_when(baseline),
    )  # fmt: skip


def why_stale(baseline: Baseline, record: CaseRecord, run: RendererRun) -> str:
    """Why the baseline is not of what was run: another scene, or other settings; or empty."""
    if baseline.scene_fingerprint != record.scene_fingerprint:
        if baseline.quality != record.quality:
            return f"approved at {baseline.quality} quality, run at {record.quality}"
        return f"the scene has changed since it was approved {_when(baseline)}"
    if baseline.noisy:
        for key, value in baseline.settings.items():
            if run.settings.get(key) != value:
                return f"approved with {key} = {value}, run with {run.settings.get(key)}"
    return ""


def _new(check: Check) -> tuple[BaselineState, str]:
    if check.status in GREEN:
        return BaselineState.NEW, ""
    return BaselineState.REGRESSED, f"not approved before, and does not pass: {check.reason}"


def _deviation(check: Check) -> float:
    """The check's deviation in tolerances. Raises ValueError where it was not measured."""
    if check.value is None or check.expected is None or check.tolerance is None:
        raise ValueError(f"{check.id} was not measured")
    return in_tolerances(check.value, check.expected, check.tolerance)


def _moved(check: Check, approved: Check, shift: float) -> tuple[BaselineState, str]:
    now, then = check.status in GREEN, approved.status in GREEN
    before, after = abs(_deviation(approved)), abs(_deviation(check))
    if now != then:
        if now:
            return BaselineState.IMPROVED, f"passes; approved as a failure: {approved.reason}"
        return BaselineState.REGRESSED, check.reason
    sizes = f"off by {after:.3g} tolerances, approved with {before:.3g}"
    # What fails, or is a documented deviation, is beyond its tolerance: there steps are relative.
    step = STEP * max(1.0, before)
    if abs(shift) <= step:
        return BaselineState.SAME, ""
    if after < before - step:
        return BaselineState.IMPROVED, sizes
    if not now and after > before + step:
        return BaselineState.REGRESSED, f"fails by more than before: {sizes}"
    return BaselineState.DRIFTED, sizes


def _cause(baseline: Baseline, run: RendererRun, state: BaselineState) -> str:
    """Tells a changed renderer from noise: by its version, by pixels, by the shift of means."""
    if run.version != baseline.version:
        return f"{run.name} was {baseline.version} and is {run.version}"
    if state is BaselineState.SAME:
        return ""
    return "; ".join(
        said
        for image in run.images
        for stored in baseline.images
        if stored.role == image.role and (said := mean_shift(stored, image))
    )


def _lost(baseline: Baseline, check: str, reason: str) -> LostCheck:
    return LostCheck(
        case=baseline.case, renderer=baseline.renderer, check=check,
        state=BaselineState.MISSING, reason=reason,
    )  # fmt: skip


def _when(baseline: Baseline) -> str:
    approval = baseline.approval
    by = f" by {approval.by}" if approval.by else ""
    return f"{approval.at[:10]}{by}: {approval.reason}"
