"""Stored results in place of a reference renderer that is not installed.

A live run always wins: only a renderer that is missing is stood in for, one that crashes is not.
What was stored for another scene or with other settings is refused, case by case.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

from harness import plan
from harness.baseline.document import Baseline, Kept
from harness.baseline.source import Baselines
from harness.errors import InputError
from harness.judging.results import Contender
from harness.plan import PreparedCase
from harness.preflight import Preflight
from harness.record import Verdict
from harness.renderers.base import Capability, Image, RenderSettings
from harness.scene.fingerprint import fingerprint

Stood = tuple[Contender, Mapping[str, Image]]  # images by role


class StandIns:
    """Looks a missing renderer's results up, in the first source that has the case.

    `sources` are hundreds of files, read once a renderer turns out to be missing and not before.
    """

    def __init__(self, sources: Callable[[], Sequence[Baselines]], quality: str) -> None:
        self._read, self._quality = sources, quality

    @cached_property
    def _sources(self) -> Sequence[Baselines]:
        return self._read()

    def stand_in(self, missing: Contender, case: PreparedCase, settings: RenderSettings) -> Stood:
        """`missing` with what is stored for `case`; itself, with the reason, where that is no use.

        Its own reason for being absent is kept, since whoever reads it may want to install it.
        """
        for source in self._sources:
            kept = source.kept.get((case.loaded.id, missing.name))
            if kept is None:
                continue
            if why := self._stale(kept.baseline, case, settings):
                return replace(
                    missing, reason=f"{missing.reason}; stored results refused: {why}"
                ), {}
            return _stood(missing, kept, source)
        return missing, {}

    def _stale(self, baseline: Baseline, case: PreparedCase, settings: RenderSettings) -> str:
        if baseline.quality != self._quality:
            return f"they are of {baseline.quality} quality, this run is of {self._quality}"
        if baseline.scene_fingerprint != fingerprint(case.scene):
            return "the scene has changed since they were approved"
        if baseline.noisy:
            for key, value in (("samples", settings.samples), ("seed", settings.seed)):
                if baseline.settings.get(key) != value:
                    return f"they have {key} = {baseline.settings.get(key)}, this run {value}"
        return ""


def _stood(missing: Contender, kept: Kept, source: Baselines) -> Stood:
    baseline = kept.baseline
    known = frozenset(map(str, Capability))
    images, coarsest = {}, 0.0
    for image in baseline.images:
        if image.role == plan.IMAGE and (image.file or image.store):
            try:
                images[image.role] = Image(source.picture(kept, image))
            except InputError as error:
                return replace(missing, reason=f"{missing.reason}; stored results: {error}"), {}
            coarsest = image.quantum
    approved = baseline.approval
    reason = f"not installed; stored results of {baseline.version}, approved {approved.at[:10]}"
    contender = Contender(
        name=missing.name,
        version=f"{baseline.version} (stored)",
        capabilities=frozenset(Capability(c) for c in baseline.capabilities if c in known),
        preflight=_preflight(baseline, coarsest),
        absent=None if images else Verdict.SKIP,
        reason=reason,
        stored=kept.stored(),
        stored_checks={check.id: check for check in baseline.checks},
    )
    return contender, images


def _preflight(baseline: Baseline, coarsest: float) -> Preflight:
    """What calibration found when the results were measured; storing has made pictures coarser."""

    def number(key: str) -> float:
        return float(baseline.facts.get(key, "nan"))

    return Preflight(
        quantum=number("quantum") + coarsest,
        cells=int(baseline.facts.get("code_cells", 1)),
        position_error=number("position_resolution"),
        epsilon=number("epsilon"),
        samples=int(baseline.settings.get("samples", 1)) if baseline.noisy else None,
    )
