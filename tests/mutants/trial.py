"""One wrong renderer through the whole of snellcheck: what was red, and what was said of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from harness.plan import PreparedCase, prepare
from harness.record import Summary, Verdict
from harness.renderers.base import Renderer
from harness.run import run
from harness.scene.load import find
from tests.fakes.student import student
from tests.mutants.mutants import Mutant, outside_renderer

SCENES = Path(__file__).parent / "scenes"
RED = (Verdict.FAIL, Verdict.ERROR)


@dataclass(frozen=True)
class Trial:
    """`red` are the checks that are not green, `cause` what the first diagnosis names."""

    mutant: Mutant
    red: tuple[str, ...]
    cause: str | None
    sentence: str
    value: float | None
    uncertainty: float | None

    @property
    def caught(self) -> bool:
        return bool(self.red)

    @property
    def right(self) -> bool:
        """Whether the first diagnosis is one that names the fault."""
        return self.caught and bool(self.mutant.causes) and self.cause in self.mutant.causes


def cases(*selection: str) -> list[PreparedCase]:
    """The selected cases that were made to tell faults apart, all by default."""
    return [prepare(case) for case in find(selection, SCENES)]


def run_alone(renderer: Renderer, chosen: Sequence[PreparedCase], folder: Path) -> Summary:
    """A run of one renderer; the student is the helper, so that the tracer has no part in it."""
    try:
        return run(chosen, [renderer], student(name="helper"), folder)
    finally:
        close = getattr(renderer, "close", None)
        if close is not None:
            close()


def trial(
    mutant: Mutant,
    chosen: Sequence[PreparedCase],
    folder: Path,
    *,
    shows: str = "float",
    float32: bool = False,
) -> Trial:
    """Runs `mutant` as an outside renderer. Raises what a user would see where it cannot."""
    folder.mkdir(parents=True, exist_ok=True)
    renderer = outside_renderer(mutant, folder, shows=shows, float32=float32)
    summary = run_alone(renderer, chosen, folder / "out")
    red = tuple(
        f"{case.id} {check.observable}"
        for case in summary.cases
        for check in case.checks
        if check.status in RED
    )
    if not summary.diagnoses:
        reason = summary.renderers[renderer.name].reason
        return Trial(mutant, red, "preflight" if reason else None, reason, None, None)
    first = summary.diagnoses[0]
    cause = first.cause
    return Trial(
        mutant, red, cause.id if cause else None, first.sentence,
        cause.value if cause else None, cause.uncertainty if cause else None,
    )  # fmt: skip
