"""From the results of a case's jobs to its checks.

Every check that the scene asks for yields at least one verdict for every renderer of the run: a
renderer that is absent, failed or cannot do it is named with its reason, never left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from harness import plan
from harness.judging import spectral
from harness.judging.attribution import attributed
from harness.judging.explain import Explainer
from harness.judging.pairs import PairJudge
from harness.judging.probed import Probed
from harness.judging.results import Contender, NotAvailable, Results
from harness.measure import (
    flat_observables,
    focus_observables,
    furnace,
    light_observables,
    radiance,
    ray_observables,
    symmetry_observables,
    total_light,
)
from harness.measure.agreement import optical_length, ray_agreement, variant_agreement
from harness.measure.comparison import Comparison, Unmeasurable
from harness.measure.observables import (
    ALL_LIGHT_OBSERVABLES,
    IMAGE_OBSERVABLES,
    RAY_API_OBSERVABLES,
    Observable,
)
from harness.measure.raymap import ProbeRays
from harness.measure.statistics import Noise
from harness.plan import Form, PreparedCase
from harness.preflight import Preflight
from harness.record import Check, Curve, Diagnosis, Verdict
from harness.renderers.base import Capability
from harness.scene import model
from harness.scene.resolved import ResolvedScene
from harness.verdict import judge, unmeasured

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
    Observable.BREWSTER_ANGLE: flat_observables.brewster_angle,
    Observable.STACK_OFFSET: flat_observables.stack_offset,
    Observable.FOLDED_DIRECTION: flat_observables.folded_direction,
    Observable.RETURN_ERROR: symmetry_observables.return_error,
    Observable.SKEWNESS: symmetry_observables.skewness,
    Observable.REVERSIBILITY: flat_observables.reversibility,
    Observable.SAGITTAL_DEPTH: flat_observables.sagittal_depth,
    Observable.TANGENTIAL_DEPTH: flat_observables.tangential_depth,
    Observable.FOCUS: focus_observables.focus,
    Observable.FOCAL_LENGTH: focus_observables.focal_length,
    Observable.BACK_FOCAL_LENGTH: focus_observables.back_focal_length,
    Observable.SPHERICAL_ABERRATION: focus_observables.spherical_aberration,
    Observable.APLANATIC_IMAGE: focus_observables.aplanatic_image,
    Observable.CARTESIAN_FOCUS: focus_observables.cartesian_focus,
    Observable.RAINBOW_ANGLE: focus_observables.rainbow_angle,
    Observable.OPTICAL_LENGTH: optical_length,
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
        self._probed = Probed(case, results)

    def judge(self) -> Judgement:
        """Judges all checks; what cannot be measured is SKIP or ERROR with its reason."""
        judgement = Judgement()
        for spec in self._case.loaded.model.checks:
            contenders = list(self._asked(spec))
            if spec.against == "truth":
                for contender in contenders:
                    judgement.checks += self._in_all_forms(spec, contender, judgement.curves)
            else:
                judgement.checks += self._pairs.checks(spec, contenders, self._contenders)
        judgement.checks = attributed(judgement.checks)
        base, probed = self._probed.forms[0], self._probed
        explainer = Explainer(
            self._case,
            self._results,
            lambda probe: probed.truth(probe, base),
            lambda contender, probe: probed.rays(contender, probe, base),
        )
        found = (explainer.explain(c, judgement.checks) for c in self._contenders)
        judgement.diagnoses = [diagnosis for diagnosis in found if diagnosis is not None]
        judgement.rays = list(probed.measured())
        return judgement

    def _asked(self, spec: model.CheckSpec) -> Iterator[Contender]:
        """Those whom the check names, and who have what it is about."""
        api = Observable(spec.observable) in RAY_API_OBSERVABLES
        for contender in self._contenders:
            if plan.asks(spec, contender.name) and (
                not api or Capability.RAYS in contender.capabilities
            ):
                yield contender

    def _in_all_forms(
        self, spec: model.CheckSpec, contender: Contender, curves: list[Curve]
    ) -> Iterator[Check]:
        """The check of the case itself, of its variants, and of their agreement with it."""
        base, *variants = self._probed.forms
        check, curve = self._against_truth(spec, contender, base)
        if curve is not None:
            _merge(curves, spec, curve, contender.name)
        yield check
        observable = Observable(spec.observable)
        if observable in IMAGE_OBSERVABLES | {Observable.RAY_AGREEMENT}:
            return
        for form in variants:
            yield self._against_truth(spec, contender, form)[0]
        if observable is Observable.EXIT_POINT:
            for form in variants:
                yield self._against_base(spec, contender, form)

    def _against_truth(
        self, spec: model.CheckSpec, contender: Contender, form: Form
    ) -> tuple[Check, Curve | None]:
        spec = in_form(spec, form)
        if contender.stored is not None:
            return contender.remembered(spec, "truth", [contender.name]), None
        try:
            comparison = self._compare(spec, contender, form)
        except NotAvailable as gap:
            return unmeasured(spec, contender.name, "truth", gap.status, gap.reason), None
        except (Unmeasurable, ValueError) as error:
            return unmeasured(spec, contender.name, "truth", Verdict.ERROR, str(error)), None
        return judge(spec, contender.name, "truth", comparison), comparison.curve

    def _against_base(self, spec: model.CheckSpec, contender: Contender, form: Form) -> Check:
        """Whether the variant shows the same as the case itself, ray by ray."""
        probe, base = self._case.probe(spec.probe), self._probed.forms[0]
        spec = agreement(spec, form)
        if contender.stored is not None:
            return contender.remembered(spec, "variant", [contender.name])
        try:
            both = [
                (
                    self._probed.truth(probe, f),
                    self._probed.rays(contender, probe, f),
                    contender.precision(f.scene),
                )
                for f in (base, form)
            ]
            comparison = variant_agreement(form.scale, both[0], both[1])
        except NotAvailable as gap:
            return unmeasured(spec, contender.name, "variant", gap.status, gap.reason)
        except (Unmeasurable, ValueError) as error:
            return unmeasured(spec, contender.name, "variant", Verdict.ERROR, str(error))
        return judge(spec, contender.name, "variant", comparison)

    def _compare(self, spec: model.CheckSpec, contender: Contender, form: Form) -> Comparison:
        observable, preflight = Observable(spec.observable), contender.ready()
        precision = contender.precision(form.scene)
        n2 = Capability.RADIANCE_N2 in contender.capabilities
        if observable in IMAGE_OBSERVABLES:
            picture = self._results.picture(contender, plan.IMAGE)
            if furnace.is_furnace(self._case.scene):
                own = None if preflight.samples is None else Noise(preflight.samples)
                return furnace.energy(self._case.scene, picture, preflight.quantum, precision, own)
            noise = _noise(preflight, self._case.scene)
            return radiance.against_truth(
                self._case.scene, picture, preflight.quantum, precision, noise
            )
        probe = self._case.probe(spec.probe.partition("~")[0] if spec.probe else None)
        truth = self._probed.truth(probe, form)
        if observable is Observable.RAY_AGREEMENT:
            ways = (self._probed.traced, self._probed.coded)
            traced, coded = (way(contender, probe, form) for way in ways)
            return ray_agreement(truth, traced, coded, precision)
        if observable in RAYS:
            return RAYS[observable](truth, self._probed.rays(contender, probe, form), precision)
        pixels = self._probed.light(contender, probe, form)
        if observable in BOUNDARIES:
            return BOUNDARIES[observable](truth, pixels, preflight.quantum, preflight.noisy)
        quantum, noise = preflight.quantum, _noise(preflight, form.scene)
        if observable in ALL_LIGHT_OBSERVABLES:
            return total_light.all_light(truth, pixels, precision, quantum, noise, n2)
        if observable is Observable.BREWSTER_REFLECTANCE:
            return total_light.brewster_reflectance(truth, pixels, precision, quantum, noise)
        if noise is not None:
            return light_observables.sampled_path_weight(truth, pixels, noise, n2)
        return light_observables.path_weight(truth, pixels, precision, quantum, n2)


def _noise(preflight: Preflight, scene: ResolvedScene) -> Noise | None:
    """Of pictures that are held against the truth, which have as many samples as that takes."""
    if preflight.samples is None:
        return None
    return Noise(plan.light_samples(scene, preflight.samples))


def in_form(spec: model.CheckSpec, form: Form) -> model.CheckSpec:
    """The check as one of a variant: what is documented in units grows with it.

    A documented deviation need not show in every variant, so it has no least size there, unless it
    is documented for that variant.
    """
    own = [k for k in spec.known if form.name in k.variants]
    general = [k for k in spec.known if not k.variants]
    if not form.name:
        return spec.model_copy(update={"known": tuple(general)})
    grown = form.scale if Observable(spec.observable).unit == "units" else 1.0
    known = tuple(
        k.model_copy(update={"at_least": least * grown, "at_most": k.at_most * grown})
        for k, least in [*((k, k.at_least) for k in own), *((k, 0.0) for k in general)]
    )
    tolerance = None if spec.tolerance is None else spec.tolerance * grown
    probe = plan.probe_label(spec.probe or "", form.name)
    return spec.model_copy(update={"probe": probe, "known": known, "tolerance": tolerance})


def agreement(spec: model.CheckSpec, form: Form) -> model.CheckSpec:
    """The check that a variant shows what the case itself does, to the sum of their tolerances.

    Where both are documented to be off, they may differ by as much as both are.
    """
    both = sorted(spec.known, key=lambda k: form.name not in k.variants)
    known = tuple(
        k.model_copy(update={"at_least": 0.0, "at_most": 2 * k.at_most})
        for k in both
        if not k.variants or form.name in k.variants
    )
    probe = plan.probe_label(spec.probe or "", form.name)
    update = {"observable": Observable.VARIANT_AGREEMENT, "probe": probe, "known": known}
    return spec.model_copy(update=update | {"tolerance": None, "derivation": ""})


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
