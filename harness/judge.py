"""From the results of a case's jobs to its checks.

Every check that the scene asks for yields at least one verdict for every renderer of the run: a
renderer that is absent, failed or cannot do it is named with its reason, never left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from harness import plan, spectral
from harness.attribution import attributed
from harness.explain import Explainer
from harness.measure import light_observables, radiance, ray_observables
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.observables import IMAGE_OBSERVABLES, Observable
from harness.measure.probe_truth import ProbeTruth, probe_truth
from harness.measure.raymap import ProbeRays
from harness.measure.rays import RayMeasurement, from_images, from_paths
from harness.pairs import PairJudge
from harness.plan import PreparedCase
from harness.probe.scenes import AXES
from harness.record import Check, Curve, Diagnosis, Verdict
from harness.renderers.base import Capability, RayPaths
from harness.results import Contender, NotAvailable, Results
from harness.scene import model
from harness.scene.resolve import expand_thin_slabs
from harness.verdict import check_id, judge, unmeasured

# The chance of a false alarm of one check of a sampled picture, over all of its means. A suite of
# a hundred such checks cries wolf once in a hundred runs.
FALSE_ALARM = 1e-4

RAYS = {
    Observable.EXIT_POINT: ray_observables.exit_point,
    Observable.EXIT_DIRECTION: ray_observables.exit_direction,
    Observable.INTERNAL_ANGLE: ray_observables.internal_angle,
    Observable.SLAB_OFFSET: ray_observables.slab_offset,
    Observable.DEVIATION: ray_observables.deviation,
    Observable.MINIMUM_DEVIATION: ray_observables.minimum_deviation,
    Observable.INVERSION: ray_observables.inversion,
    Observable.TESSELLATION_ERROR: ray_observables.tessellation_error,
    Observable.TIR: ray_observables.tir,
}
BOUNDARIES = {
    Observable.CRITICAL_ANGLE: light_observables.critical_angle,
    Observable.FIRST_TRANSMITTING_ANGLE: light_observables.first_transmitting_angle,
}


@dataclass
class Judgement:
    """All checks of a case in the order of its scene file, their curves, and why who is off.

    `rays` are those that were measured on the way, probe by probe.
    """

    checks: list[Check] = field(default_factory=list)
    curves: list[Curve] = field(default_factory=list)
    rays: list[ProbeRays] = field(default_factory=list)
    diagnoses: list[Diagnosis] = field(default_factory=list)


class CaseJudge:
    """Judges one case. Truth and measurements are each made once and shared by its checks.

    `helper` is the renderer without noise that made the auxiliary pictures.
    """

    def __init__(
        self, case: PreparedCase, contenders: list[Contender], results: Results, helper: str
    ) -> None:
        self._case, self._contenders, self._results = case, contenders, results
        gain = spectral.gain(case.wavelengths)
        self._pairs = PairJudge(case.scene, results, helper, gain)
        self._truths: dict[str, ProbeTruth] = {}
        self._rays: dict[tuple[str, str], RayMeasurement] = {}

    def judge(self) -> Judgement:
        """Judges all checks; what cannot be measured is SKIP or ERROR with its reason."""
        judgement = Judgement()
        for spec in self._case.loaded.model.checks:
            contenders = [
                c for c in self._contenders if not spec.renderers or c.name in spec.renderers
            ]
            if spec.against == "truth":
                for contender in contenders:
                    check, curve = self._against_truth(spec, contender)
                    judgement.checks.append(check)
                    if curve is not None:
                        _merge(judgement.curves, spec, curve, contender.name)
            else:
                judgement.checks += self._pairs.checks(spec, contenders, self._contenders)
        judgement.checks = attributed(judgement.checks)
        explainer = Explainer(self._case, self._results, self._truth, self._measured)
        found = (explainer.explain(c, judgement.checks) for c in self._contenders)
        judgement.diagnoses = [diagnosis for diagnosis in found if diagnosis is not None]
        judgement.rays = [ProbeRays(*item) for item in self._measured_probes()]
        return judgement

    def _measured_probes(self) -> Iterator[tuple[str, ProbeTruth, dict[str, RayMeasurement]]]:
        for probe, truth in self._truths.items():
            measured = {name: rays for (name, of), rays in self._rays.items() if of == probe}
            if measured:
                yield probe, truth, measured

    def _against_truth(
        self, spec: model.CheckSpec, contender: Contender
    ) -> tuple[Check, Curve | None]:
        if contender.stored is not None:
            return self._stored(spec, contender), None
        try:
            comparison = self._compare(spec, contender)
        except NotAvailable as gap:
            return unmeasured(spec, contender.name, "truth", gap.status, gap.reason), None
        except (Unmeasurable, ValueError) as error:
            return unmeasured(spec, contender.name, "truth", Verdict.ERROR, str(error)), None
        return judge(spec, contender.name, "truth", comparison), comparison.curve

    def _stored(self, spec: model.CheckSpec, contender: Contender) -> Check:
        """The approved result of a renderer that is not there, marked as such."""
        check = contender.stored_checks.get(check_id(spec, contender.name, "truth"))
        if check is None or contender.stored is None:
            reason = f"{contender.reason}; nothing is stored for this check"
            return unmeasured(spec, contender.name, "truth", Verdict.SKIP, reason)
        return check.model_copy(update={"stored": [contender.name]})

    def _compare(self, spec: model.CheckSpec, contender: Contender) -> Comparison:
        observable, preflight = Observable(spec.observable), contender.ready()
        precision = contender.precision(self._case.scene)
        if observable in IMAGE_OBSERVABLES:
            picture = self._results.picture(contender, plan.IMAGE)
            level = FALSE_ALARM if preflight.noisy else None
            return radiance.against_truth(
                self._case.scene, picture, preflight.quantum, precision, level
            )
        probe = self._case.probe(spec.probe)
        truth = self._truth(probe)
        if observable in RAYS:
            return RAYS[observable](truth, self._measured(contender, probe), precision)
        pixels = self._results.picture(contender, plan.light_role(probe))
        if observable in BOUNDARIES:
            return BOUNDARIES[observable](truth, pixels, preflight.quantum, preflight.noisy)
        n2 = Capability.RADIANCE_N2 in contender.capabilities
        if preflight.noisy:
            return light_observables.sampled_path_weight(truth, pixels, FALSE_ALARM, n2)
        return light_observables.path_weight(truth, pixels, precision, preflight.quantum, n2)

    def _truth(self, probe: model.Probe) -> ProbeTruth:
        if probe.name not in self._truths:
            scene = expand_thin_slabs(self._case.scene)
            self._truths[probe.name] = probe_truth(scene, probe.path, self._case.planes(probe))
        return self._truths[probe.name]

    def _measured(self, contender: Contender, probe: model.Probe) -> RayMeasurement:
        key = (contender.name, probe.name)
        if key not in self._rays:
            self._rays[key] = self._measure(contender, probe)
        return self._rays[key]

    def _measure(self, contender: Contender, probe: model.Probe) -> RayMeasurement:
        truth, preflight = self._truth(probe), contender.ready()
        if Capability.RAYS in contender.capabilities:
            paths = self._results.get(contender, plan.trace_role(probe))
            if not isinstance(paths, RayPaths):
                raise NotAvailable(Verdict.ERROR, "the trace delivered an image")
            if len(paths.status) != len(truth.grazing):
                reason = f"the trace delivered {len(paths.status)} of {len(truth.grazing)} rays"
                raise NotAvailable(Verdict.ERROR, reason)
            return from_paths(paths)
        images = {
            (index, axis): self._results.picture(contender, plan.code_role(probe, index, axis))
            for index in range(len(truth.planes))
            for axis in AXES
        }
        cells = min(preflight.cells, probe.cells)
        alone = Capability.LOBE_SWITCH in contender.capabilities
        mixed = np.zeros(len(truth.grazing), bool) if alone else truth.ambiguous
        return from_images(
            images,
            truth,
            cells,
            preflight.code_quantum,
            preflight.epsilon,
            mixed,
            preflight.samples,
        )


def _merge(curves: list[Curve], spec: model.CheckSpec, curve: Curve, renderer: str) -> None:
    """Adds one renderer's curve to the chart of its observable; the truth is drawn once."""
    chart_id = f"{spec.observable}-{spec.probe or 'probe'}"
    named = [s.model_copy(update={"renderer": s.renderer or renderer}) for s in curve.series]
    residuals = [s.model_copy(update={"renderer": renderer}) for s in curve.residuals]
    for index, chart in enumerate(curves):
        if chart.id == chart_id:
            mine = [s for s in named if s.renderer != "truth"]
            # The band drawn is the widest of the renderers', so that each has its own in its check.
            same = len(chart.tolerance) == len(curve.tolerance)
            band = (
                [max(p) for p in zip(chart.tolerance, curve.tolerance, strict=True)] if same else []
            )
            curves[index] = chart.model_copy(
                update={
                    "series": [*chart.series, *mine],
                    "residuals": [*chart.residuals, *residuals],
                    "tolerance": band or chart.tolerance,
                }
            )
            return
    curves.append(
        curve.model_copy(update={"id": chart_id, "series": named, "residuals": residuals})
    )
