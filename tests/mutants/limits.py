"""How small a fault may be and still be seen: per case and class of renderer, by bisection."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from tests.mutants.mutants import Mutant
from tests.mutants.trial import cases, trial

CLASSES = {
    "float64, 16 bits": {"shows": "16bit"},
    "float32, float images": {"float32": True},
    "float64, 8 bits sRGB": {"shows": "8bit"},
}


@dataclass(frozen=True)
class Question:
    """Which fault, in which case; the fault is right at `right`, and surely seen at `largest`."""

    what: str
    fault: str
    case: str
    unit: str
    right: float = 0.0
    largest: float = 0.5


QUESTIONS = (
    Question("index", "index-off", "snell-near[ior=1.5]", "relative"),
    Question("index", "index-off", "snell-immersed[ior=1.5]", "relative"),
    Question("index", "index-off", "ball-view[ior=1.5]", "relative"),
    Question("index", "index-off", "prism-analytic[ior=1.5]", "relative"),
    Question("angle", "turned", "snell-immersed[ior=1.5]", "rad"),
    Question("angle", "turned", "prism-analytic[ior=1.5]", "rad"),
    Question("pixel shift", "pixel-shift", "ball-view[ior=1.5]", "pixels"),
    Question("absorption", "absorption-scaled", "absorption-slab[ior=1.5,thickness=1]",
             "relative", 1.0),
    Question("Fresnel", "fresnel-off", "fresnel-outside[ior=1.5]", "of light"),
)  # fmt: skip

# Where the search begins and how fine it gets: a factor of 2.
SMALLEST, STEPS = 1e-10, 32


@dataclass(frozen=True)
class Limit:
    """The smallest fault that was seen; all smaller powers of two that were tried were not."""

    question: Question
    kind: str
    amount: float


def limit(question: Question, kind: str) -> Limit:
    """Bisects over powers of two, from `SMALLEST` to the largest."""
    with tempfile.TemporaryDirectory() as folder:
        return _bisected(question, kind, Path(folder))


def _bisected(question: Question, kind: str, folder: Path) -> Limit:
    chosen = cases(question.case)
    low, high = 0, STEPS

    def seen(step: int) -> bool:
        amount = question.right + SMALLEST * 2.0**step
        mutant = Mutant(question.fault, amount, ())
        return trial(mutant, chosen, folder, **CLASSES[kind]).caught  # type: ignore[arg-type]

    while high - low > 1:
        middle = (low + high) // 2
        if seen(middle):
            high = middle
        else:
            low = middle
    return Limit(question, kind, SMALLEST * 2.0**high)
