"""Checks of renderers against each other: the same picture, twice."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from harness import plan
from harness.errors import SnellcheckError
from harness.expected import Float
from harness.judging.results import Contender, NotAvailable, Results
from harness.measure.comparison import Unmeasurable
from harness.measure.images import Pixels, box_downsample
from harness.measure.observables import Observable
from harness.measure.pictures import (
    GRAZING,
    PicturePair,
    SampledPicture,
    contrast,
    geometric_error,
    sensitivity,
)
from harness.measure.probe_truth import ROUNDINGS
from harness.preflight import FLOAT32
from harness.record import Check, Verdict
from harness.renderers.base import Capability, Image
from harness.scene import model
from harness.scene.resolved import ResolvedScene
from harness.verdict import judge, unmeasured

# float32 renderers start a ray this far from the surface that it leaves, lest they hit it again
# (Mitsuba 8.9e-5, and we 1e-4 for it): of a ray through a corner of glass they lose shorter ways.
STEP_OFF = 2e-4


def camera_shift(scene: ResolvedScene) -> float:
    """How far a float32 renderer's ray may stray in `scene`, units: two interfaces, then a face."""
    points = [np.abs(scene.camera.origin).max()]
    for surface in scene.surfaces:
        shape = surface.shape
        frame = getattr(shape, "frame", None)
        points.append(np.abs(frame.origin if frame else getattr(shape, "center", (1.0,))).max())
    return geometric_error(float(max(points)), 2, FLOAT32)


class PairJudge:
    """Compares pictures of one case; what every pair shares is computed once."""

    def __init__(
        self, scene: ResolvedScene, results: Results, helper: str, gain: float = 1.0
    ) -> None:
        """`gain` is by how much the error of a renderer's image shows in the picture."""
        self._scene, self._results, self._helper, self._gain = scene, results, helper, gain
        self._made: dict[tuple[str, str], PicturePair] = {}

    def checks(
        self, spec: model.CheckSpec, contenders: list[Contender], everyone: list[Contender]
    ) -> Iterator[Check]:
        """All pairs without noise, and each sampling renderer against the helper's area means.

        With a named opponent, each of the contenders against that one of `everyone`.
        """
        ready = []
        for contender in contenders:
            if (
                contender.stored is not None
                and Capability.PIXEL_CENTRES not in contender.capabilities
            ):
                # Its second seed is not stored, so that its noise cannot be told again.
                yield contender.remembered(spec, self._helper, [contender.name, self._helper])
                continue
            try:
                self._results.picture(contender, plan.IMAGE)
                ready.append(contender)
            except NotAvailable as gap:
                yield unmeasured(spec, contender.name, spec.against, gap.status, gap.reason)
        exact = [c for c in ready if not c.ready().noisy]
        if spec.against == "renderers":
            yield from self._all_pairs(spec, exact)
        else:
            opponent = next((c for c in everyone if c.name == spec.against), None)
            for contender in exact:
                if contender is not opponent:
                    yield self._against(spec, contender, opponent)
        for contender in ready:
            if contender.ready().noisy:
                yield from self._sampled(spec, contender)

    def _all_pairs(self, spec: model.CheckSpec, exact: list[Contender]) -> Iterator[Check]:
        if len(exact) == 1:
            reason = "no other renderer without noise shows this picture"
            yield unmeasured(spec, exact[0].name, spec.against, Verdict.SKIP, reason)
        for a, b in combinations(exact, 2):
            yield self._exact(spec, a, b)

    def _against(
        self, spec: model.CheckSpec, contender: Contender, opponent: Contender | None
    ) -> Check:
        try:
            if opponent is None:
                raise NotAvailable(Verdict.SKIP, "it is not part of this run")
            self._results.picture(opponent, plan.IMAGE)
            if opponent.ready().noisy:
                raise NotAvailable(Verdict.SKIP, "its pictures are noisy")
        except NotAvailable as gap:
            reason = f"{spec.against} shows no picture to compare with: {gap.reason}"
            return unmeasured(spec, contender.name, spec.against, Verdict.SKIP, reason)
        return self._exact(spec, contender, opponent)

    def _exact(self, spec: model.CheckSpec, a: Contender, b: Contender) -> Check:
        stored = [c.name for c in (a, b) if c.stored is not None]
        if len(stored) == 2:
            return a.remembered(spec, b.name, stored)
        try:
            comparison = self._pair(a, b).compare(Observable(spec.observable))
        except (NotAvailable, Unmeasurable, SnellcheckError) as error:
            return unmeasured(spec, a.name, b.name, Verdict.ERROR, str(error))
        check = judge(spec, a.name, b.name, comparison)
        return check.model_copy(update={"stored": stored})

    def _sampled(self, spec: model.CheckSpec, contender: Contender) -> Iterator[Check]:
        try:
            comparison = SampledPicture(
                self._results.picture(contender, plan.IMAGE),
                self._results.picture(contender, plan.SECOND_IMAGE),
                self._area, self._base, plan.AREA_FACTOR,
                contender.ready().samples or 1,
            ).compare(Observable(spec.observable))  # fmt: skip
        except NotAvailable as gap:
            yield unmeasured(spec, contender.name, self._helper, gap.status, gap.reason)
        except Unmeasurable as error:
            yield unmeasured(spec, contender.name, self._helper, Verdict.ERROR, str(error))
        else:
            if comparison is not None:
                yield judge(spec, contender.name, self._helper, comparison)

    def _pair(self, a: Contender, b: Contender) -> PicturePair:
        key = (a.name, b.name)
        if key not in self._made:
            change = self._sensitivity
            transport = self._scene.transport
            # Rays whose weight is the least to be followed may be followed by one and not the
            # other, once a generation; and each generation rounds the weight.
            cut = 2 * transport.min_weight * transport.max_depth
            epsilon = max(a.ready().epsilon, b.ready().epsilon)
            rounding = ROUNDINGS * epsilon / 2 * transport.max_depth
            floor = self._gain * (a.ready().quantum + b.ready().quantum + cut + rounding)
            grazing = change > GRAZING
            if not all(Capability.DOUBLE in c.capabilities for c in (a, b)):
                grazing = grazing | (self._closest < STEP_OFF)
            self._made[key] = PicturePair(
                self._results.picture(a, plan.IMAGE),
                self._results.picture(b, plan.IMAGE),
                floor + change,
                grazing,
                self._gain * self._contrast,
            )
        return self._made[key]

    @cached_property
    def _closest(self) -> NDArray[np.float32]:
        """(H, W) the shortest way between surfaces that the pixel's rays go."""
        image = self._results.of(self._helper, plan.BASE_IMAGE)
        if not isinstance(image, Image) or image.closest is None:
            raise NotAvailable(
                Verdict.ERROR, f"{self._helper} does not tell how close surfaces are"
            )
        return image.closest

    @cached_property
    def _base(self) -> Pixels:
        return self._results.auxiliary(self._helper, plan.BASE_IMAGE)

    @cached_property
    def _area(self) -> Pixels:
        fine = self._results.auxiliary(self._helper, plan.AREA_IMAGE)
        return box_downsample(fine, plan.AREA_FACTOR)

    @cached_property
    def _shifted(self) -> list[Pixels]:
        return [self._results.auxiliary(self._helper, role) for role in plan.SHIFTED]

    @cached_property
    def _sensitivity(self) -> Float:
        return sensitivity(self._base, self._shifted)

    @cached_property
    def _contrast(self) -> Float:
        return np.asarray(contrast([self._base, *self._shifted]).max(axis=-1))
