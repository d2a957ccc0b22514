"""What a hypothesis is: a name, a world with one thing wrong, and a sentence for people."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from harness.diagnosis.evidence import Setting
from harness.diagnosis.worlds import World

Values = tuple[float, ...]
Change = Callable[[World, Values], World]


@dataclass(frozen=True)
class Fitted:
    """Parameters with their uncertainties, and the indices that the scenes ask for.

    `iors` are those of all media that fill a solid, each once.
    """

    values: Values
    errors: Values
    iors: tuple[float, ...] = ()

    def near(self, value: float, slack: float = 0.02) -> bool:
        """Whether the first parameter is `value` for all practical purposes."""
        return abs(self.values[0] - value) <= max(slack, self.errors[0])

    def __str__(self) -> str:
        return plus_minus(self.values[0], self.errors[0])


@dataclass(frozen=True)
class Hypothesis:
    """One known cause of wrong pictures.

    `world` exchanges one thing of a world, given the parameters. `starts` are parameters from which
    a fit begins; where they are not `continuous` they are all that can be, the most harmless first.
    A hypothesis without parameters has the one start (). `says` is the second half of the sentence
    "The renderer …". `parameter` and `unit` name the first parameter. `prior` lowers the cost where
    it is likelier.
    Hypotheses of one `kin` say the same of a single case and differ over several.
    """

    id: str
    world: Change
    says: Callable[[Fitted], str]
    starts: tuple[Values, ...] = ((),)
    parameter: str = ""
    unit: str = ""
    continuous: bool = True
    applies: Callable[[World], bool] = lambda _: True
    prior: Callable[[Setting], float] = lambda _: 0.0
    kin: str = ""

    @property
    def size(self) -> int:
        """The number of parameters."""
        return len(self.starts[0])


def plus_minus(value: float, error: float) -> str:
    """As many digits as the uncertainty leaves: 1.4873 ± 0.0002."""
    if not (np.isfinite(value) and np.isfinite(error)) or error <= 0:
        return f"{value:.6g}"
    digits = int(np.clip(-np.floor(np.log10(error)), 0, 15))
    if abs(value) < 1e-3 or digits == 0:
        return f"{value:.4g} ± {error:.1g}"
    return f"{value:.{digits}f} ± {error:.{digits}f}"


def percent(value: float, error: float) -> str:
    """A relative deviation, as in 0.85 ± 0.02 %."""
    return f"{plus_minus(100 * abs(value), 100 * error)} %"


def says(text: str) -> Callable[[Fitted], str]:
    """A sentence that needs no numbers."""
    return lambda _: text
