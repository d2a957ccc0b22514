"""All hypotheses, the likelier first: of two that explain the same equally well, that one is named.

The classes are those of bugs that renderers really had; `tests/mutants` has one of each.
"""

from __future__ import annotations

from harness.diagnosis.absorption import ABSORPTION
from harness.diagnosis.brightness import BRIGHTNESS
from harness.diagnosis.hypothesis import Hypothesis
from harness.diagnosis.refraction import REFRACTION
from harness.diagnosis.seeing import SEEING

LIBRARY: tuple[Hypothesis, ...] = (*REFRACTION, *BRIGHTNESS, *ABSORPTION, *SEEING)
BY_ID = {hypothesis.id: hypothesis for hypothesis in LIBRARY}
