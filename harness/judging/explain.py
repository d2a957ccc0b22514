"""Has renderers diagnosed: in one case from what its probes tell, in a run from all its cases."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from harness import plan
from harness.diagnosis.choose import diagnose
from harness.diagnosis.evidence import Evidence, Landings, Levels, Setting, landings, levels
from harness.diagnosis.whole_run import Witness, diagnose_run
from harness.errors import ImageNotFinite
from harness.judging.documented import is_documented, known_here, known_in_run
from harness.judging.results import FAILED_PREFLIGHT, Contender, NotAvailable, Results
from harness.measure.comparison import Unmeasurable
from harness.measure.images import Pixels
from harness.measure.observables import DIRECTION_OBSERVABLES, Observable
from harness.measure.precision import Precision
from harness.measure.probe_truth import ProbeTruth, probe_truth
from harness.measure.rays import RayMeasurement
from harness.plan import PreparedCase
from harness.record import Cause, Check, Diagnosis, SummaryCase, Verdict
from harness.renderers.base import Capability, Rays, Status
from harness.scene import model
from harness.scene.resolve import expand_thin_slabs
from harness.scene.resolved import ThinSlab

OFF = (Verdict.FAIL, Verdict.KNOWN, Verdict.ERROR)


class Explainer:
    """Diagnoses the renderers of one case. `truth_of` and `measured` are the judge's own."""

    def __init__(
        self,
        case: PreparedCase,
        results: Results,
        truth_of: Callable[[model.Probe], ProbeTruth],
        measured: Callable[[Contender, model.Probe], RayMeasurement],
    ) -> None:
        self._case, self._results = case, results
        self._truth_of, self._measured = truth_of, measured

    def explain(self, contender: Contender, checks: list[Check]) -> Diagnosis | None:
        """Why `contender` is off in this case; None where it is not, or where nothing tells."""
        mine = [c for c in checks if c.renderer == contender.name and c.against == "truth"]
        if contender.absent is not None or not any(c.status in OFF for c in mine):
            return None
        if (documented := known_here(contender.name, mine)) is not None:
            return documented
        evidence = list(self._evidence(contender))
        found = diagnose(contender.name, evidence) if evidence else None
        return found or unfitted(contender.name, mine)

    def _evidence(self, contender: Contender) -> Iterator[Evidence]:
        for probe in self._case.loaded.model.probes:
            try:
                piece = self._piece(contender, probe)
            except (NotAvailable, Unmeasurable, ValueError):
                continue  # the checks say so
            if piece is not None:
                yield piece

    def _piece(self, contender: Contender, probe: model.Probe) -> Evidence | None:
        if probe.measure == "all-light":
            return None  # many paths at once fit no single cause
        truth, preflight = self._truth_of(probe), contender.ready()
        precision = contender.precision(self._case.scene)
        thin = Capability.THIN_SLAB in contender.capabilities and any(
            isinstance(s.material, ThinSlab) for s in self._case.scene.surfaces
        )
        if probe.measure == "light":
            pixels = self._lit(contender, probe)
            n2 = Capability.RADIANCE_N2 in contender.capabilities
            return levels(truth, pixels, precision, preflight.quantum, preflight.samples, n2, thin)
        return landings(truth, self._measured(contender, probe), precision, thin)

    def _lit(self, contender: Contender, probe: model.Probe) -> Pixels:
        """The picture; where it was refused for pixels that are no numbers, truth but for these."""
        role = plan.light_role(probe)
        refused = self._results.by_role.get((contender.name, role))
        if not isinstance(refused, ImageNotFinite):
            return self._results.picture(contender, role)
        level = np.nan_to_num(self._truth_of(probe).level)
        level[list(refused.pixels)] = np.nan
        shape = (self._results.height, self._results.width, 3)
        return np.asarray(level.reshape(shape), np.float32)


def unfitted(renderer: str, checks: Sequence[Check]) -> Diagnosis | None:
    """What is said of checks that fail although no single ray shows why; None where none fails."""
    off = dict.fromkeys(c.observable for c in checks if c.status is Verdict.FAIL)
    if not off:
        return None
    sentence = (
        f"{renderer} is off in {', '.join(off)}, and no single rays show a deviation to which a "
        "cause could be fitted"
    )
    return Diagnosis(renderer=renderer, sentence=sentence)


# --- a run ----------------------------------------------------------------------------------------

# Of the cases in which a renderer is right, as many are asked what they say against a cause.
MOST_WITNESSES = 24
WITNESS_RAYS = 48
# Checks that compare all there is to see of each ray of their probe, and so speak for all of them.
# Others look at where light ends, at an extremum, at rays of one row or height, at one component,
# or at an angle whatever side it is on.
EVERY_RAY = frozenset({
    Observable.EXIT_POINT, Observable.EXIT_DIRECTION, Observable.FOLDED_DIRECTION,
    Observable.REFLECTANCE, Observable.TRANSMITTANCE,
})  # fmt: skip
# A renderer that passed deviates by less than its tolerances: as a rule by less than these, and
# by less than the errors of single precision, which grow near a critical angle.
POINT_TOLERANCE, DIRECTION_TOLERANCE, LEVEL_TOLERANCE = 1e-4, 1e-4, 1e-3
# A coarse renderer has coarser ones; those that its checks tell are of one ray each, others of the
# same probe may have several times as much.
SPREAD = 10
# Of a plane's size: so far aside may a ray be where all checks look at its direction.
UNSAID = 0.01
SINGLE = Precision(float(np.finfo(np.float32).eps), float(np.finfo(np.float32).eps))


def explain_run(
    cases: Sequence[PreparedCase], judged: Sequence[SummaryCase], renderers: Mapping[str, str]
) -> list[Diagnosis]:
    """Why each renderer is off in this run; nothing of those that are not.

    What no scene documents comes first, then what scenes do.
    `renderers` are named with the reason why they are out, which is "" where they are not.
    """
    found: list[Diagnosis] = []
    for renderer, reason in renderers.items():
        _, failed, findings = reason.partition(FAILED_PREFLIGHT)
        if failed:
            found.append(explain_preflight(renderer, findings))
        new = [
            (c, d)
            for c in judged
            for d in c.diagnoses
            if d.renderer == renderer and not is_documented(d)
        ]
        by_case = {c.id: d for c, d in new if d.fits}
        if by_case:
            witnesses = list(_witnesses(cases, judged, renderer))
            found += diagnose_run(renderer, by_case, witnesses)
        found += _unfitted_in_run(renderer, [c for c, d in new if not d.fits])
        found += known_in_run(renderer, judged)
    return found


def _unfitted_in_run(renderer: str, cases: Sequence[SummaryCase]) -> Iterator[Diagnosis]:
    checks = [
        check
        for case in cases
        for check in case.checks
        if check.renderer == renderer and check.against == "truth"
    ]
    if (diagnosis := unfitted(renderer, checks)) is not None:
        yield diagnosis.model_copy(update={"unexplained": [case.id for case in cases]})


def explain_preflight(name: str, findings: str) -> Diagnosis:
    """The diagnosis of a renderer that failed its calibration: its findings name the cause."""
    cause = next((c for words, c in NAMED.items() if words in findings), "preflight")
    return Diagnosis(
        renderer=name, sentence=f"{name} fails its preflight: {findings}",
        cause=Cause(id=cause, sentence=findings, residual=0.0, explains=1.0),
    )  # fmt: skip


# What the findings of a preflight say, and the hypotheses that say the same.
NAMED = {
    "mirrored in x": "mirrored-x",
    "mirrored in y": "mirrored-y",
    "rotated by 180": "rotated-180",
    "is shifted by": "pixel-shift",
    "field of view is off": "field-of-view",
    "field of view": "fov-axis",
    "encoded": "gamma",
    "scaled: radiance": "gain",
}


def _witnesses(
    cases: Sequence[PreparedCase], judged: Sequence[SummaryCase], renderer: str
) -> Iterator[Witness]:
    """Cases in which the renderer passed all checks against the truth, one for each scene file."""
    right = {
        case.id: mine
        for case in judged
        if (mine := [k for k in case.checks if k.renderer == renderer and k.against == "truth"])
        and all(check.status is Verdict.PASS for check in mine)
    }
    files: set[str] = set()
    for case in cases:
        if any(isinstance(surface.material, ThinSlab) for surface in case.scene.surfaces):
            continue  # what a renderer does there need not be what it does at solids
        if case.loaded.id in right and case.loaded.case not in files and case.loaded.model.probes:
            files.add(case.loaded.case)
            if len(files) > MOST_WITNESSES:
                return
            try:
                slack = Slack.of(right[case.loaded.id])
                evidence = tuple(
                    _truth_as_evidence(case, probe, slack) for probe in _measuring(case)
                )
            except ValueError:
                continue  # no closed form
            yield Witness(case.loaded.id, evidence)


def _measuring(case: PreparedCase) -> list[model.Probe]:
    """The probes of which every ray is checked."""
    used = {c.probe for c in case.loaded.model.checks if c.observable in EVERY_RAY}
    return [
        probe
        for probe in case.loaded.model.probes
        if probe.name in used and probe.measure != "all-light"
    ]


def _only_directions(case: PreparedCase, probe: model.Probe) -> bool:
    used = {c.observable for c in case.loaded.model.checks if c.probe == probe.name}
    return used & EVERY_RAY <= DIRECTION_OBSERVABLES


@dataclass(frozen=True)
class Slack:
    """By how much a renderer may be off in a case that it passed: units, radians, and light."""

    point: float
    turn: float
    level: float

    @classmethod
    def of(cls, checks: Sequence[Check]) -> Slack:
        def largest(unit: str, scale: float = 1.0) -> float:
            return scale * max((c.tolerance or 0.0 for c in checks if c.unit == unit), default=0.0)

        turn = max(largest("µrad", 1e-6), largest("deg", float(np.radians(1))))
        return cls(SPREAD * largest("units"), SPREAD * turn, SPREAD * largest(""))


def _truth_as_evidence(case: PreparedCase, probe: model.Probe, slack: Slack) -> Evidence:
    truth = probe_truth(expand_thin_slabs(case.scene), probe.path, case.planes(probe))
    lands = np.all([landing.status == Status.HIT for landing in truth.landings], axis=0)
    kept = np.flatnonzero(lands & ~truth.grazing)
    kept = kept[np.linspace(0, len(kept) - 1, min(WITNESS_RAYS, len(kept))).astype(int)]
    rays = Rays(truth.rays.origins[kept], truth.rays.directions[kept])
    setting = Setting(truth.scene, rays, kept, probe.path, truth.planes)
    if probe.measure == "light":
        level = truth.level[kept]
        least = max(LEVEL_TOLERANCE, slack.level)
        tolerance = np.maximum(truth.level_tolerance(SINGLE)[kept, None], least)
        return Levels(setting, level, np.broadcast_to(tolerance, level.shape))
    size = max(max(plane.size) for plane in truth.planes)
    unsaid = UNSAID * size if _only_directions(case, probe) else POINT_TOLERANCE
    point = max(unsaid, slack.point, slack.turn * size)
    turn = max(DIRECTION_TOLERANCE, slack.turn, slack.point)
    return Landings(
        setting, truth.landings[0].point[kept],
        truth.paths.direction[kept] if len(truth.planes) == 2 else None,
        np.ones(len(kept), bool),
        np.maximum(truth.point_tolerance(SINGLE)[kept], point),
        np.maximum(truth.direction_tolerance(SINGLE)[kept], turn),
    )  # fmt: skip
