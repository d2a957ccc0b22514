"""How often a right renderer that samples is accused: a short suite, judged again and again.

With fresh seeds each time, and by the code that judges the suite. `make rates` does it 200 times
and writes docs/rates.md; the tests do it 50 times.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from harness.measure.light_observables import sampled_path_weight
from harness.measure.probe_truth import ProbeTruth, probe_truth
from harness.measure.statistics import Noise, per_test, samples_needed
from harness.probe.scenes import light_scene
from harness.renderers.base import Renderer, RenderSettings
from harness.scene.resolved import ResolvedScene
from tests.harness.tiny import prepared
from tests.mutants.trial import SCENES

# What one face transmits and reflects, from outside and from inside.
CASES = ("fresnel-outside[ior=1.5]", "fresnel-inside[ior=1.5]")


@dataclass(frozen=True)
class Question:
    """A picture of light, and what it must show."""

    scene: ResolvedScene
    truth: ProbeTruth


def short_suite() -> list[Question]:
    """Four checks of light that is sampled."""
    found = []
    for case in prepared(*CASES, root=SCENES):
        for probe in case.loaded.model.probes:
            planes = case.planes(probe)
            found.append(
                Question(
                    light_scene(case.scene, planes[0], probe.path),
                    probe_truth(case.scene, probe.path, planes),
                )
            )
    return found


def rounds(renderer: Renderer, runs: int, levels: tuple[float, ...]) -> Iterator[tuple[int, ...]]:
    """How many of the suite's checks raise an alarm, run by run, at each of its `levels`."""
    suite, samples = short_suite(), samples_needed()
    noises = [Noise(samples, per_test(level, len(suite))) for level in levels]
    for seed in range(runs):
        settings = RenderSettings(samples=samples, seed=3 * seed)
        pictures = [renderer.render(question.scene, settings).pixels for question in suite]
        yield tuple(
            sum(
                not sampled_path_weight(question.truth, pixels, noise, n2=True).within
                for question, pixels in zip(suite, pictures, strict=True)
            )
            for noise in noises
        )
