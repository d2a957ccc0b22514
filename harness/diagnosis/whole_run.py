"""One cause for all that a renderer does wrong in a run, from the diagnoses of its cases.

Each case has told how well every hypothesis fits it, with which parameter and how sharply. Those
costs add up, with one parameter for all cases. A hypothesis also has to leave alone the cases in
which nothing is wrong: `Witness` is such a case, and whoever predicts a deviation that it does not
show is no cause. What the best cause does not explain is diagnosed again, since a renderer may have
two faults.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.diagnosis.choose import SAME, akin, complexity, first_of_kin, no_cause
from harness.diagnosis.evidence import Evidence
from harness.diagnosis.fit import cost_of
from harness.diagnosis.hypothesis import Fitted, Hypothesis, Values
from harness.diagnosis.library import BY_ID, LIBRARY
from harness.record import Cause, CauseFit, Diagnosis

# Of a case's gain by its own best parameter, so much may be lost by the common one.
LOST = 0.1
# Hypotheses that are held against witnesses: the others are out of the question.
CANDIDATES = 8
MOST_CAUSES = 3
# A cause that explains fewer of the cases that are off is taken for a coincidence.
CONVINCING = 1 / 3


@dataclass(frozen=True)
class Witness:
    """A case in which the renderer is right, with the truth in the place of measurements."""

    case: str
    evidence: tuple[Evidence, ...]


@dataclass(frozen=True)
class _Common:
    """A hypothesis with one parameter for several cases, and what each of them costs with it.

    `belied_by` is the witness that shows nothing of what it predicts, "" where none does.
    """

    hypothesis: Hypothesis
    values: Values
    error: float
    costs: Mapping[str, float]
    explained: tuple[str, ...]
    total: float
    belied_by: str = ""


def diagnose_run(
    renderer: str, by_case: Mapping[str, Diagnosis], witnesses: Sequence[Witness]
) -> list[Diagnosis]:
    """The causes of what is wrong with `renderer`, the one that explains most cases first."""
    left = dict(by_case)
    found: list[Diagnosis] = []
    tempting: _Common | None = None
    while left and len(found) < MOST_CAUSES:
        ranked = _ranked(left, witnesses)
        best = next((c for c in ranked if not c.belied_by), None)
        if best is None or not _convinces(best, left):
            tempting = next((c for c in ranked if c.belied_by and _convinces(c, left)), None)
            break
        varied = [
            case
            for case, d in left.items()
            if case not in best.explained and _shows(best.hypothesis, d)
        ]
        found.append(_as_diagnosis(renderer, left, best, _next(best, ranked), varied))
        left = {case: d for case, d in left.items() if case in found[-1].unexplained}
    if left:
        found.append(_nothing(renderer, left, found, tempting))
    return found


def _ranked(left: Mapping[str, Diagnosis], witnesses: Sequence[Witness]) -> list[_Common]:
    """The best hypotheses, the best first; those that a witness belies keep their place."""
    common = sorted((_common(h, left) for h in LIBRARY), key=lambda c: c.total)
    held = [replace(c, belied_by=_belying(c, witnesses)) for c in common[:CANDIDATES]]
    honest, belied = ([c for c in held if bool(c.belied_by) is b] for b in (False, True))
    if honest:
        honest = first_of_kin(honest, lambda c: c.total, lambda c: c.hypothesis)
    return honest + belied


def _convinces(common: _Common, left: Mapping[str, Diagnosis]) -> bool:
    return len(common.explained) >= CONVINCING * len(left)


def _shows(hypothesis: Hypothesis, diagnosis: Diagnosis) -> bool:
    """Whether the case, taken alone, is best explained by the hypothesis or one of its kin."""
    named = [(fit, BY_ID[fit.id]) for fit in diagnosis.fits if fit.id]
    cost = {h.id: fit.score + complexity(h, diagnosis.rays) for fit, h in named}
    least = min(cost.values())
    return any(fit.fits and akin(h, hypothesis) and cost[h.id] <= least + SAME for fit, h in named)


def _fit_of(diagnosis: Diagnosis, name: str) -> CauseFit:
    """What the case says of a hypothesis: as much as of truth where it does not concern it."""
    by_id = {fit.id: fit for fit in diagnosis.fits}
    return by_id.get(name, by_id[""])


def _common(hypothesis: Hypothesis, left: Mapping[str, Diagnosis]) -> _Common:
    fits = {case: _fit_of(d, hypothesis.id) for case, d in left.items()}
    values, error = _joint(hypothesis, left, fits)
    costs, explained = {}, []
    for case, fit in fits.items():
        truth = _fit_of(left[case], "").score
        lost = _lost(hypothesis, fit, values, left[case].rays, truth)
        costs[case] = min(fit.score + lost, truth)
        if _explains(fit, lost, truth):
            explained.append(case)
    rays = sum(d.rays for d in left.values())
    total = sum(costs.values()) + complexity(hypothesis, rays)
    return _Common(hypothesis, values, error, costs, tuple(explained), float(total))


def _lost(hypothesis: Hypothesis, fit: CauseFit, values: Values, rays: int, truth: float) -> float:
    """What a case's cost grows by where `values` take the place of its own."""
    if not fit.values or not values:
        return 0.0
    if not hypothesis.continuous:
        steps = [start[0] for start in hypothesis.starts]
        return 0.0 if steps.index(fit.values[0]) <= steps.index(values[0]) else truth
    moved = fit.values[0] - values[0]
    return float(rays / 2 * np.log1p(fit.information * moved**2 / rays))


def _explains(fit: CauseFit, lost: float, truth: float) -> bool:
    return bool(fit.id) and fit.fits and lost <= SAME + LOST * (truth - fit.score)


def _joint(
    hypothesis: Hypothesis, left: Mapping[str, Diagnosis], fits: Mapping[str, CauseFit]
) -> tuple[Values, float]:
    """One parameter for the cases, and its error.

    Of parameters that come in steps the most harmful: each case has the most harmless one that
    explains it. Of others that of the case by which all cases together cost least, since a case
    with a second fault knows its own wrong one sharply; and then the mean over all cases that this
    explains, weighted by how sharply each knows its own. The error is two standard errors, or the
    cases' own scatter where that is larger; 0 where no case knows it (where no ray arrives, say).
    """
    concerned = {case: fit for case, fit in fits.items() if fit.id and fit.fits}
    if not hypothesis.size or not concerned:
        return hypothesis.starts[0], 0.0
    if not hypothesis.continuous:
        steps = [start[0] for start in hypothesis.starts]
        return (max((fit.values[0] for fit in concerned.values()), key=steps.index),), 0.0
    truth = {case: _fit_of(left[case], "").score for case in concerned}

    def lost(case: str, values: Values) -> float:
        return _lost(hypothesis, concerned[case], values, left[case].rays, truth[case])

    def cost(leader: CauseFit) -> float:
        return sum(
            min(fit.score + lost(case, tuple(leader.values)), truth[case])
            for case, fit in concerned.items()
        )

    best = tuple(min(concerned.values(), key=cost).values)
    agreed = [
        fit for case, fit in concerned.items() if _explains(fit, lost(case, best), truth[case])
    ]
    weights = np.array([max(fit.information, 1e-300) for fit in agreed])
    first = np.array([fit.values[0] for fit in agreed])
    rest = max(agreed, key=lambda f: f.information).values[1:]
    mean = float(np.average(first, weights=weights))
    spread = np.sqrt(np.average((first - mean) ** 2, weights=weights) / len(agreed))
    known = any(fit.information > 0 for fit in agreed)
    return (mean, *rest), 2 * float(max(weights.sum() ** -0.5, spread)) if known else 0.0


def _belying(common: _Common, witnesses: Sequence[Witness]) -> str:
    """The first witness that shows nothing where the hypothesis predicts a deviation, or ""."""
    for witness in witnesses:
        cost = cost_of(common.hypothesis, common.values, witness.evidence)
        rays = sum(len(piece.setting.pixel) for piece in witness.evidence)
        if cost is not None and cost > SAME + rays / 2:
            return witness.case
    return ""


def _as_diagnosis(
    renderer: str,
    left: Mapping[str, Diagnosis],
    best: _Common,
    second: _Common | None,
    varied: Sequence[str],
) -> Diagnosis:
    """`varied` are cases that show the same with a size of their own."""
    mine = {case: left[case] for case in best.explained}
    iors = tuple(sorted({n for d in mine.values() for n in d.iors}))
    cause = _cause(best, mine, iors)
    other = [case for case in left if case not in best.explained and case not in varied]
    sentence = f"{renderer} {cause.sentence}"
    if len(left) > 1:
        sentence += f": this explains {len(mine)} of {len(left)} cases that are off"
    if varied:
        sentence += f", and with a size of their own {len(varied)} more"
    return Diagnosis(
        renderer=renderer, sentence=sentence, cause=cause,
        runner_up=None if second is None else _cause(second, mine, iors),
        deviation=_deviation(mine), rays=sum(d.rays for d in mine.values()),
        iors=list(iors), cases=[*mine, *varied], unexplained=other,
    )  # fmt: skip


def _next(best: _Common, ranked: Sequence[_Common]) -> _Common | None:
    """The runner-up: the next one that says something else."""
    return next((c for c in ranked if not akin(c.hypothesis, best.hypothesis)), None)


def _deviation(cases: Mapping[str, Diagnosis]) -> float:
    rays = [d.rays for d in cases.values()]
    return float(np.sqrt(np.average([d.deviation**2 for d in cases.values()], weights=rays)))


def _cause(common: _Common, cases: Mapping[str, Diagnosis], iors: tuple[float, ...]) -> Cause:
    hypothesis = common.hypothesis
    errors = (common.error, *(0.0 for _ in common.values[1:]))
    truth = sum(_fit_of(d, "").score for d in cases.values())
    cost = sum(common.costs[case] for case in cases)
    rays = sum(d.rays for d in cases.values())
    return Cause(
        id=hypothesis.id, sentence=hypothesis.says(Fitted(common.values, errors, iors)),
        parameter=hypothesis.parameter, value=common.values[0] if hypothesis.size else None,
        uncertainty=common.error or None if hypothesis.continuous else None,
        unit=hypothesis.unit,
        # The cost is n / 2 log(1 + q): the mean square that it stands for.
        residual=float(np.sqrt(np.expm1(min(2 * cost / max(rays, 1), 600)))),
        explains=max(0.0, 1 - float(np.exp(min(0.0, (cost - truth) / max(rays, 1))))),
    )  # fmt: skip


def _nothing(
    renderer: str,
    left: Mapping[str, Diagnosis],
    found: Sequence[Diagnosis],
    tempting: _Common | None,
) -> Diagnosis:
    """`tempting` would explain much, but for a witness that belies it."""
    nearest = [d.cause or d.runner_up for d in left.values()]
    named = next((cause for cause in nearest if cause is not None), None)
    cases = len(left)
    where = f" in {cases} other case{'s' * (cases > 1)}" if found else ""
    if tempting is not None:
        mine = {case: left[case] for case in tempting.explained}
        named = _cause(tempting, mine, tuple(sorted({n for d in mine.values() for n in d.iors})))
        sentence = (
            f"none of the known causes fits what {renderer} does{where}; that it {named.sentence} "
            f"would explain {len(mine)} of {cases}, but {tempting.belied_by}, where it would "
            "show, is right"
        )
    else:
        sentence = (
            no_cause(renderer, named) if named else f"none of the known causes fits {renderer}"
        )
        sentence = sentence.replace(" does;", f" does{where};")
    return Diagnosis(
        renderer=renderer, sentence=sentence, runner_up=named,
        deviation=_deviation(left), rays=sum(d.rays for d in left.values()),
        unexplained=list(left),
    )  # fmt: skip
