"""Fits the parameters of one hypothesis to the evidence of one case.

Every ray's misfit is in units of its tolerance, so 1 is as good as can be asked for. A piece of
evidence with n rays costs n / 2 log(1 + q), where q is the mean square of its misfits without the
worst rays: the likelihood of errors of unknown size, but for those within tolerance, which cost
nothing. So a hypothesis that explains everything beats by far one that explains most, and one that
is nearer than the tolerance gains nothing by it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from harness.diagnosis.evidence import Evidence
from harness.diagnosis.hypothesis import Hypothesis, Values
from harness.diagnosis.worlds import World, misfit
from harness.expected import Float

# Rays that a wrong renderer's own edges may have spoilt: those of the truth are left out already.
TRIMMED = 0.05
MOST_STEPS, MOST_HALVINGS, STARTS_TRIED = 16, 5, 2
# A step that gains less than this in cost, a factor of 1.6 in likelihood, is the last.
CRAWL = 0.5
FARTHEST = 1e4  # no parameter is larger
LARGEST = 1e15  # of a misfit, so that squares stay finite


@dataclass(frozen=True)
class Fit:
    """How well a hypothesis with its best `values` explains the evidence.

    `squares` has the mean square misfit of each piece of evidence, `rays` how many rays each has.
    `score` is their cost; around its minimum it grows by `information` / 2 times the square of the
    change of the first parameter. `errors` are two standard errors.
    """

    hypothesis: Hypothesis
    values: Values
    errors: Values
    score: float
    squares: tuple[float, ...]
    rays: tuple[int, ...]
    information: float

    @property
    def residual(self) -> float:
        """Root mean square misfit over everything, in tolerances."""
        weights = np.array(self.rays, float)
        return float(np.sqrt(np.average(self.squares, weights=weights)))


@dataclass(frozen=True)
class _Point:
    """Misfits (n_j, figures) of all pieces of evidence at one place, and their cost."""

    gaps: list[Float]
    squares: tuple[float, ...]
    rays: tuple[int, ...]
    score: float


At = Callable[[Values], _Point]


def _point(
    worlds: Sequence[World], evidence: Sequence[Evidence], trimmed: float = TRIMMED
) -> _Point:
    gaps, squares, rays = [], [], []
    for world, piece in zip(worlds, evidence, strict=True):
        gap = np.clip(np.nan_to_num(misfit(world, piece), nan=LARGEST), -LARGEST, LARGEST)
        each = np.sort((gap**2).mean(axis=1))
        kept = max(1, int(np.ceil(len(each) * (1 - trimmed))))
        gaps.append(gap)
        squares.append(float(each[:kept].mean()))
        rays.append(len(each))
    cost = sum(n / 2 * np.log1p(q) for n, q in zip(rays, squares, strict=True))
    return _Point(gaps, tuple(squares), tuple(rays), float(cost))


def cost_of(worlds: Sequence[World], evidence: Sequence[Evidence]) -> float:
    """What it costs to explain the evidence by these worlds, one for each piece."""
    return _point(worlds, evidence).score


def truth_fit(evidence: Sequence[Evidence], trimmed: float = TRIMMED) -> _Point:
    """How well the right world explains the evidence."""
    return _point([World.right(piece.setting) for piece in evidence], evidence, trimmed)


def fit(
    hypothesis: Hypothesis, evidence: Sequence[Evidence], trimmed: float = TRIMMED
) -> Fit | None:
    """The best parameters by Gauss and Newton from the most promising starts.

    `trimmed` is the share of rays that may be anything. None where the hypothesis says nothing
    about any of the evidence.
    """
    right = [World.right(piece.setting) for piece in evidence]
    concerned = [hypothesis.applies(world) for world in right]
    if not any(concerned):
        return None

    def at(values: Values) -> _Point:
        with np.errstate(all="ignore"):  # what is no number is no fit
            worlds = [
                hypothesis.world(world, values) if mine else world
                for world, mine in zip(right, concerned, strict=True)
            ]
        return _point(worlds, evidence, trimmed)

    tried = sorted(((at(start), start) for start in hypothesis.starts), key=lambda t: t[0].score)
    if not hypothesis.size or not hypothesis.continuous:
        point, values = tried[0]
        return _result(hypothesis, point, values, np.zeros((hypothesis.size, hypothesis.size)))
    found = []
    for point, start in tried[:STARTS_TRIED]:
        found.append(_descend(at, point, start))
        if max(found[-1][0].squares) <= 1:
            break  # within all tolerances: nothing is better
    point, values, curvature = min(found, key=lambda f: f[0].score)
    return _result(hypothesis, point, values, curvature)


def _descend(at: At, point: _Point, values: Values) -> tuple[_Point, Values, Float]:
    """Steps of Gauss and Newton, halved until they gain; the curvature (k, k) at the end."""
    curvature = np.zeros((len(values), len(values)))
    for _ in range(MOST_STEPS):
        gradient, curvature = _slopes(at, point, values)
        try:
            step = -np.linalg.solve(curvature, gradient)
        except np.linalg.LinAlgError:
            break
        if not np.isfinite(step).all():
            break
        better = None
        for halving in range(MOST_HALVINGS):
            there = tuple(float(v) for v in np.array(values) + step / 2**halving)
            if max(map(abs, there)) > FARTHEST:
                continue
            other = at(there)
            if other.score < point.score:
                better = (other, there)
                break
        if better is None:
            break
        gained = point.score - better[0].score
        point, values = better
        if gained < CRAWL:
            break
    return point, values, curvature


def _slopes(at: At, point: _Point, values: Values) -> tuple[Float, Float]:
    """Gradient (k,) and curvature (k, k) of the score, by differences of the misfits."""
    k = len(values)
    gradient, curvature = np.zeros(k), np.zeros((k, k))
    slopes = []
    for axis in range(k):
        h = 1e-6 * max(abs(values[axis]), 1e-2)
        moved = tuple(v + h * (i == axis) for i, v in enumerate(values))
        there = at(moved)
        slopes.append([(b - a) / h for a, b in zip(point.gaps, there.gaps, strict=True)])
    for j, gap in enumerate(point.gaps):
        each = (gap**2).mean(axis=1)
        # The trimmed rays, and those whose fate the small change decided, say nothing of slopes.
        kept = each <= np.quantile(each, 1 - TRIMMED)
        for axis in range(k):
            kept &= (np.abs(slopes[axis][j]) < LARGEST).all(axis=1)
        weight = 1 / (1 + point.squares[j]) / gap.shape[1]
        for a in range(k):
            gradient[a] += weight * float((slopes[a][j] * gap)[kept].sum())
            for b in range(k):
                curvature[a, b] += weight * float((slopes[a][j] * slopes[b][j])[kept].sum())
    return gradient, curvature


def _result(hypothesis: Hypothesis, point: _Point, values: Values, curvature: Float) -> Fit:
    try:
        spread = np.sqrt(np.diag(np.linalg.inv(curvature)))
    except np.linalg.LinAlgError:
        spread = np.full(len(values), np.nan)
    # The curvature is weighted by 1 / (1 + q) and so by the errors' own size; errors evenly spread
    # over the tolerance have a third of its square.
    own = np.sqrt(max(min(point.squares), 1 / 3) / (1 + min(point.squares)))
    errors = tuple(float(2 * own * s) if np.isfinite(s) else 0.0 for s in spread)
    information = float(curvature[0, 0]) if len(values) else 0.0
    return Fit(
        hypothesis, tuple(map(float, values)), errors, point.score, point.squares, point.rays,
        information,
    )  # fmt: skip
