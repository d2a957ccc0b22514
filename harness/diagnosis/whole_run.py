"""One cause for all that a renderer does wrong in a run, from the diagnoses of its cases.

Each case has told how well every hypothesis fits it, with which parameter and how sharply. Those
costs add up, with one parameter for all cases. A hypothesis also has to leave alone the cases in
which nothing is wrong: `Witness` is such a case. What the best cause does not explain is diagnosed
again, since a renderer may have two faults.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from harness.diagnosis.choose import SAME, akin, complexity, first_of_kin, no_cause
from harness.diagnosis.evidence import Evidence
from harness.diagnosis.fit import cost_of
from harness.diagnosis.hypothesis import Fitted, Hypothesis, Values
from harness.diagnosis.library import LIBRARY
from harness.diagnosis.worlds import World
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
    """A hypothesis with one parameter for several cases, and what each of them costs with it."""

    hypothesis: Hypothesis
    values: Values
    error: float
    costs: Mapping[str, float]
    explained: tuple[str, ...]
    total: float
    broken: tuple[str, ...] = field(default=())


def diagnose_run(
    renderer: str, by_case: Mapping[str, Diagnosis], witnesses: Sequence[Witness]
) -> list[Diagnosis]:
    """The causes of what is wrong with `renderer`, the one that explains most cases first."""
    left = dict(by_case)
    found: list[Diagnosis] = []
    while left and len(found) < MOST_CAUSES:
        ranked = _ranked(left, witnesses)
        best = ranked[0]
        if len(best.explained) < CONVINCING * len(left):
            break
        found.append(_as_diagnosis(renderer, left, ranked))
        left = {case: d for case, d in left.items() if case not in best.explained}
    if left:
        found.append(_nothing(renderer, left, found))
    return found


def _ranked(left: Mapping[str, Diagnosis], witnesses: Sequence[Witness]) -> list[_Common]:
    common = sorted((_common(h, left) for h in LIBRARY), key=lambda c: c.total)
    held = [_held_against(c, witnesses) for c in common[:CANDIDATES]]
    held.sort(key=lambda c: c.total)
    return first_of_kin(held, lambda c: c.total, lambda c: c.hypothesis)


def _fit_of(diagnosis: Diagnosis, name: str) -> CauseFit:
    """What the case says of a hypothesis: as much as of truth where it does not concern it."""
    by_id = {fit.id: fit for fit in diagnosis.fits}
    return by_id.get(name, by_id[""])


def _common(hypothesis: Hypothesis, left: Mapping[str, Diagnosis]) -> _Common:
    fits = {case: _fit_of(d, hypothesis.id) for case, d in left.items()}
    concerned = [f for f in fits.values() if f.id and f.fits]
    values, error = _joint(hypothesis, concerned)
    costs, explained = {}, []
    for case, fit in fits.items():
        n, truth = left[case].rays, _fit_of(left[case], "").score
        moved = fit.values[0] - values[0] if fit.values and values else 0.0
        lost = n / 2 * np.log1p(fit.information * moved**2 / n)
        if fit.values and not hypothesis.continuous:
            steps = [start[0] for start in hypothesis.starts]
            lost = 0.0 if steps.index(fit.values[0]) <= steps.index(values[0]) else truth
        costs[case] = min(fit.score + lost, truth)
        if fit.id and fit.fits and lost <= SAME + LOST * (truth - fit.score):
            explained.append(case)
    rays = sum(d.rays for d in left.values())
    total = sum(costs.values()) + complexity(hypothesis, rays)
    return _Common(hypothesis, values, error, costs, tuple(explained), float(total))


def _joint(hypothesis: Hypothesis, fits: Sequence[CauseFit]) -> tuple[Values, float]:
    """The mean of the cases' parameters, weighted by how sharply each knows its own.

    Of parameters that come in steps the most harmful: each case has the most harmless one that
    explains it. The error is two standard errors,
    or the cases' own scatter where that is larger.
    """
    if not hypothesis.size or not fits:
        return hypothesis.starts[0], 0.0
    first = [fit.values[0] for fit in fits]
    if not hypothesis.continuous:
        steps = [start[0] for start in hypothesis.starts]
        return (max(first, key=steps.index),), 0.0
    weights = np.array([max(fit.information, 1e-300) for fit in fits])
    rest = max(fits, key=lambda f: f.information).values[1:]
    mean = float(np.average(first, weights=weights))
    spread = np.sqrt(np.average((np.array(first) - mean) ** 2, weights=weights) / len(fits))
    return (mean, *rest), 2 * float(max(weights.sum() ** -0.5, spread))


def _held_against(common: _Common, witnesses: Sequence[Witness]) -> _Common:
    """Adds what it costs where a hypothesis predicts a deviation that is not there."""
    hypothesis, extra, broken = common.hypothesis, 0.0, []
    for witness in witnesses:
        right = [World.right(piece.setting) for piece in witness.evidence]
        if not any(hypothesis.applies(world) for world in right):
            continue
        worlds = [hypothesis.world(w, common.values) if hypothesis.applies(w) else w for w in right]
        cost = cost_of(worlds, witness.evidence)
        if cost > SAME + sum(len(piece.setting.pixel) for piece in witness.evidence) / 2:
            broken.append(witness.case)
            extra += cost
    return _Common(
        hypothesis, common.values, common.error, common.costs, common.explained,
        common.total + extra, tuple(broken),
    )  # fmt: skip


def _as_diagnosis(
    renderer: str, left: Mapping[str, Diagnosis], ranked: Sequence[_Common]
) -> Diagnosis:
    best = ranked[0]
    mine = {case: left[case] for case in best.explained}
    iors = tuple(sorted({n for d in mine.values() for n in d.iors}))
    cause, second = _cause(best, mine, iors), _next(ranked)
    other = [case for case in left if case not in best.explained]
    sentence = f"{renderer} {cause.sentence}"
    if len(left) > 1:
        sentence += f": this explains {len(mine)} of {len(left)} cases that are off"
    if best.broken:
        sentence += f", but it should show in {best.broken[0]}, too, where nothing is off"
    return Diagnosis(
        renderer=renderer, sentence=sentence, cause=cause, runner_up=_cause(second, mine, iors),
        deviation=_deviation(mine), rays=sum(d.rays for d in mine.values()),
        iors=list(iors), cases=list(mine), unexplained=other,
    )  # fmt: skip


def _next(ranked: Sequence[_Common]) -> _Common:
    """The runner-up: the next one that says something else."""
    best = ranked[0].hypothesis
    return next((c for c in ranked[1:] if not akin(c.hypothesis, best)), ranked[1])


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
        uncertainty=common.error if hypothesis.size and hypothesis.continuous else None,
        unit=hypothesis.unit,
        # The cost is n / 2 log(1 + q): the mean square that it stands for.
        residual=float(np.sqrt(np.expm1(min(2 * cost / max(rays, 1), 600)))),
        explains=max(0.0, 1 - float(np.exp(min(0.0, (cost - truth) / max(rays, 1))))),
    )  # fmt: skip


def _nothing(renderer: str, left: Mapping[str, Diagnosis], found: Sequence[Diagnosis]) -> Diagnosis:
    nearest = [d.cause or d.runner_up for d in left.values()]
    named = next((cause for cause in nearest if cause is not None), None)
    sentence = no_cause(renderer, named) if named else f"none of the known causes fits {renderer}"
    cases = len(left)
    where = f" in {cases} other case{'s' * (cases > 1)}" if found else ""
    return Diagnosis(
        renderer=renderer, sentence=sentence.replace(" does;", f" does{where};"), runner_up=named,
        deviation=_deviation(left), rays=sum(d.rays for d in left.values()),
        unexplained=list(left),
    )  # fmt: skip
