"""What the judge is given: the renderers of the run and what their jobs delivered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from harness.errors import RendererError, RendererFailed
from harness.measure.images import Pixels
from harness.measure.precision import Precision
from harness.preflight import FLOAT32, FLOAT64, Preflight
from harness.record import Check, Stored, Verdict
from harness.renderers.base import Capability, Image, RayPaths
from harness.scene.model import CheckSpec
from harness.scene.resolved import Mesh, ResolvedScene
from harness.verdict import check_id, unmeasured

# How the reason of a renderer begins that is out because of its calibration.
FAILED_PREFLIGHT = "failed its preflight: "

Result = Image | RayPaths | RendererError


class NotAvailable(Exception):
    """A result that a check needs is not there; the check becomes SKIP or ERROR."""

    def __init__(self, status: Verdict, reason: str) -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


@dataclass(frozen=True)
class Contender:
    """A renderer as the judge sees it. `absent` is SKIP or ERROR with `reason` where it is out.

    `stored` says that approved results, `stored_checks` by id, stand in for a missing one.
    """

    name: str
    version: str
    capabilities: frozenset[Capability]
    preflight: Preflight | None
    absent: Verdict | None = None
    reason: str = ""
    stored: Stored | None = None
    stored_checks: Mapping[str, Check] = field(default_factory=dict)

    def ready(self) -> Preflight:
        """Its calibration. Raises NotAvailable where it is out."""
        if self.absent is not None or self.preflight is None:
            raise NotAvailable(self.absent or Verdict.ERROR, self.reason or "no preflight")
        return self.preflight

    def remembered(self, spec: CheckSpec, against: str, stored: list[str]) -> Check:
        """A check of a missing renderer in which nothing is live: SKIP, with what was approved.

        `stored` names whose side it is. What was not measured now is no pass, whatever it was then.
        """
        check = self.stored_checks.get(check_id(spec, self.name, against))
        if check is None:
            reason = f"{self.reason}; nothing is stored for this check"
            return unmeasured(spec, self.name, against, Verdict.SKIP, reason)
        reason = f"{self.reason}; it was {check.status.value} then"
        return check.model_copy(update={"stored": stored, "status": Verdict.SKIP, "reason": reason})

    def precision(self, scene: ResolvedScene) -> Precision:
        """Of its numbers in this scene: stored in float32, vertices make a mesh no better."""
        double = Capability.DOUBLE_DATA in self.capabilities
        data = FLOAT64 if double else FLOAT32
        meshes = any(isinstance(solid.shape, Mesh) for solid in scene.solids)
        return Precision(max(self.ready().epsilon, data) if meshes else self.ready().epsilon, data)


@dataclass(frozen=True)
class Results:
    """Results of one case by (renderer, role), all pictures `width` x `height`."""

    by_role: Mapping[tuple[str, str], Result]
    width: int
    height: int

    def get(self, contender: Contender, role: str) -> Image | RayPaths:
        """Raises NotAvailable where the renderer is out or did not deliver."""
        contender.ready()
        return self.of(contender.name, role)

    def of(self, renderer: str, role: str) -> Image | RayPaths:
        """Raises NotAvailable where there is no such result."""
        result = self.by_role.get((renderer, role))
        if result is None:
            raise NotAvailable(Verdict.ERROR, f"'{role}' was not rendered by {renderer}")
        if isinstance(result, RendererError):
            failed = isinstance(result, RendererFailed)
            raise NotAvailable(Verdict.ERROR if failed else Verdict.SKIP, str(result))
        return result

    def picture(self, contender: Contender, role: str) -> Pixels:
        """The pixels of an image of the case's own size."""
        image = self.get(contender, role)
        if not isinstance(image, Image) or image.pixels.shape != (self.height, self.width, 3):
            raise NotAvailable(Verdict.ERROR, f"'{role}' is no image of the film's size")
        return image.pixels

    def auxiliary(self, helper: str, role: str) -> Pixels:
        """The pixels of a helper's image, of whatever size."""
        image = self.of(helper, role)
        if not isinstance(image, Image):
            raise NotAvailable(Verdict.ERROR, f"'{role}' is no image")
        return image.pixels
