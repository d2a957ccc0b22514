"""What a case's probes measured, and what they should have: each made once, for all its checks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from harness import plan
from harness.judging.results import Contender, NotAvailable, Results
from harness.measure.images import Pixels
from harness.measure.pixel_areas import over_areas
from harness.measure.probe_truth import ProbeTruth, probe_truth
from harness.measure.raymap import ProbeRays
from harness.measure.rays import RayMeasurement, from_images, from_paths
from harness.plan import Form, PreparedCase
from harness.probe.scenes import AXES
from harness.record import Verdict
from harness.renderers.base import Capability, RayPaths
from harness.scene import model
from harness.scene.resolve import expand_thin_slabs


class Probed:
    """Truths and measurements of one case, by probe and by the case's form."""

    def __init__(self, case: PreparedCase, results: Results) -> None:
        self._results = results
        self._truths: dict[tuple[str, str], ProbeTruth] = {}
        self._rays: dict[tuple[str, str, str], RayMeasurement] = {}
        self.forms = case.forms

    def truth(self, probe: model.Probe, form: Form) -> ProbeTruth:
        """Raises ValueError where the form has no closed form."""
        key = (probe.name, form.name)
        if key not in self._truths:
            scene, planes = expand_thin_slabs(form.scene), form.planes[probe.name]
            self._truths[key] = probe_truth(scene, probe.path, planes)
        return self._truths[key]

    def rays(self, contender: Contender, probe: model.Probe, form: Form) -> RayMeasurement:
        """By the renderer's ray API where it has one, by its images otherwise."""
        key = (contender.name, probe.name, form.name)
        if key not in self._rays:
            traces = Capability.RAYS in contender.capabilities
            measure = self.traced if traces else self.coded
            self._rays[key] = measure(contender, probe, form)
        return self._rays[key]

    def traced(self, contender: Contender, probe: model.Probe, form: Form) -> RayMeasurement:
        """By the renderer's ray API."""
        paths = self._results.get(contender, plan.trace_role(probe, form.name))
        if not isinstance(paths, RayPaths):
            raise NotAvailable(Verdict.ERROR, "the trace delivered an image")
        got, wanted = len(paths.status), len(self.truth(probe, form).grazing)
        if got != wanted:
            reason = f"the trace delivered {got} of {wanted} rays"
            raise NotAvailable(Verdict.ERROR, reason)
        return from_paths(paths)

    def coded(self, contender: Contender, probe: model.Probe, form: Form) -> RayMeasurement:
        """By position codes in the renderer's images."""
        truth, preflight = self.truth(probe, form), contender.ready()
        images = {
            (index, axis): self._results.picture(
                contender, plan.code_role(probe, index, axis, form.name)
            )
            for index in range(len(truth.planes))
            for axis in AXES
        }
        cells = min(preflight.cells, probe.cells)
        total = probe.total_reflection or "R" not in probe.path
        switched = Capability.LOBE_SWITCH in contender.capabilities
        if switched and total:
            mixed = truth.ambiguous_when_total
        elif switched and "T" not in probe.path:
            mixed = np.zeros(len(truth.grazing), bool)  # opaque: each ray has one path
        else:
            mixed = truth.ambiguous
        measured = from_images(
            images, truth, cells, preflight.code_quantum, preflight.epsilon, mixed,
            preflight.samples,
        )  # fmt: skip
        if preflight.averages:
            measured = over_areas(measured, truth)
        if switched and probe.total_reflection:
            # Where a reflection of the path is partial after all, it was switched off.
            return replace(measured, faint=measured.faint | ~truth.total)
        return measured

    def light(self, contender: Contender, probe: model.Probe, form: Form) -> Pixels:
        """The picture of a probe of light."""
        return self._results.picture(contender, plan.light_role(probe, form.name))

    def measured(self) -> Iterator[ProbeRays]:
        """All rays that were measured so far in the case as its file has it."""
        for (probe, form), truth in self._truths.items():
            measured = {
                name: rays for (name, *of), rays in self._rays.items() if of == [probe, form]
            }
            if measured and not form:
                yield ProbeRays(probe, truth, measured)
