"""Which cause explains a case best, and whether it explains it at all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from harness.diagnosis.evidence import Evidence
from harness.diagnosis.fit import CURSORY, FULL, TRIMMED, Fit, fit, truth_fit
from harness.diagnosis.hypothesis import Fitted, Hypothesis
from harness.diagnosis.library import LIBRARY
from harness.record import Cause, CauseFit, Diagnosis

# A cause fits where it leaves no more than twice the tolerance, or a thousandth of the deviation.
WITHIN = 2.0
LEFT = 0.001
# What being further down in the library costs: no more than enough to decide between equals.
ORDER = 0.01
# Two causes explain a case equally well where their costs differ by less.
SAME = 2.0

T = TypeVar("T")


@dataclass(frozen=True)
class Ranked:
    """A hypothesis with its cost, complexity included."""

    fit: Fit
    cost: float


def complexity(hypothesis: Hypothesis, rays: int) -> float:
    """Half of k log n, as in Schwarz's criterion (1978), and the order of the library."""
    return hypothesis.size / 2 * float(np.log(max(rays, 2))) + ORDER * LIBRARY.index(hypothesis)


def rank(evidence: Sequence[Evidence], trimmed: float) -> list[Ranked]:
    """All hypotheses that say something about the evidence, the best first."""
    ranked, effort = [], FULL
    for hypothesis in LIBRARY:
        found = fit(hypothesis, evidence, trimmed, effort=effort)
        if found is not None:
            effort = CURSORY if max(found.squares) <= 1 else effort
            cost = found.score + complexity(hypothesis, sum(found.rays))
            cost += min(hypothesis.prior(piece.setting) for piece in evidence)
            ranked.append(Ranked(found, cost))
    ranked.sort(key=lambda r: r.cost)
    return first_of_kin(ranked, lambda r: r.cost, lambda r: r.fit.hypothesis)


def diagnose(renderer: str, evidence: Sequence[Evidence]) -> Diagnosis | None:
    """The diagnosis of one case; None where the evidence shows no deviation."""
    if not evidence:
        return None
    truth, trimmed = truth_fit(evidence), TRIMMED
    if max(truth.squares) <= 1:  # then only a few rays are off, if any
        truth, trimmed = truth_fit(evidence, 0.0), 0.0
    if max(truth.squares) <= 1:
        return None
    ranked = rank(evidence, trimmed)
    deviation = float(np.sqrt(np.average(truth.squares, weights=truth.rays)))
    iors = indices(evidence)
    best, second = (
        ranked[0],
        next(r for r in ranked if not akin(r.fit.hypothesis, ranked[0].fit.hypothesis)),
    )
    nearest, next_best = (cause_of(r.fit, deviation, iors) for r in (best, second))
    if truth.score - best.cost > SAME and fits(best.fit.squares, truth.squares):
        sentence, cause, runner_up = f"{renderer} {nearest.sentence}", nearest, next_best
        if second.cost - best.cost < SAME and fits(second.fit.squares, truth.squares):
            sentence += f"; or it {next_best.sentence}, which explains this case equally well"
    else:
        sentence, cause, runner_up = no_cause(renderer, nearest), None, nearest
    return Diagnosis(
        renderer=renderer, sentence=sentence, cause=cause, runner_up=runner_up,
        deviation=deviation, rays=sum(truth.rays), iors=list(iors),
        fits=[
            CauseFit(id="", values=[], score=truth.score, information=0.0, fits=False),
            *(
                CauseFit(
                    id=r.fit.hypothesis.id, values=list(r.fit.values), score=r.fit.score,
                    information=r.fit.information, fits=fits(r.fit.squares, truth.squares),
                )
                for r in ranked
            ),
        ],
    )  # fmt: skip


def first_of_kin(
    ranked: list[T], cost: Callable[[T], float], hypothesis: Callable[[T], Hypothesis]
) -> list[T]:
    """The same, led by the likeliest of the best one's kin that are as good."""
    best = ranked[0]
    equals = [
        r for r in ranked if akin(hypothesis(r), hypothesis(best)) and cost(r) - cost(best) < SAME
    ]
    leader = min(equals, key=lambda r: LIBRARY.index(hypothesis(r)))
    return [leader, *(r for r in ranked if r is not leader)]


def akin(a: Hypothesis, b: Hypothesis) -> bool:
    """Whether two hypotheses say the same of a single case."""
    return a is b or (a.kin != "" and a.kin == b.kin)


def no_cause(renderer: str, nearest: Cause) -> str:
    """The sentence of a diagnosis that found nothing."""
    return (
        f"none of the known causes fits what {renderer} does; the nearest is that it "
        f"{nearest.sentence}, which leaves {nearest.residual:.3g} tolerances"
    )


def fits(squares: Sequence[float], truth: Sequence[float]) -> bool:
    """Whether mean squares of misfits are within tolerance, or little of what truth leaves."""
    pairs = zip(squares, truth, strict=True)
    return all(q <= WITHIN**2 or q <= LEFT**2 * t for q, t in pairs)


def cause_of(found: Fit, deviation: float, iors: tuple[float, ...]) -> Cause:
    """The fit for the record."""
    hypothesis = found.hypothesis
    fitted = Fitted(found.values, found.errors, iors)
    has_value = bool(hypothesis.size)
    return Cause(
        id=hypothesis.id, sentence=hypothesis.says(fitted), parameter=hypothesis.parameter,
        value=found.values[0] if has_value else None,
        uncertainty=(found.errors[0] or None) if has_value and hypothesis.continuous else None,
        unit=hypothesis.unit, residual=found.residual,
        explains=max(0.0, 1 - found.residual / deviation) if deviation > 0 else 0.0,
    )  # fmt: skip


def indices(evidence: Sequence[Evidence]) -> tuple[float, ...]:
    """The indices that fill the solids of all scenes."""
    return tuple(
        sorted(
            {
                piece.setting.scene.media[solid.medium].ior
                for piece in evidence
                for solid in piece.setting.scene.solids
            }
        )
    )
