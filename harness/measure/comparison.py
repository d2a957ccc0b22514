"""What a measurement says: a value, what physics expects, how far apart they may be and why."""

from __future__ import annotations

from dataclasses import dataclass, field

from harness.record import Curve


@dataclass(frozen=True)
class Comparison:
    """One observable of one renderer. `within` is the verdict on all rays or pixels.

    `value`, `expected` and `tolerance`, in the observable's unit, are those of the ray or pixel
    that comes closest to its limit or oversteps it most, so |value - expected| <= tolerance says
    the same as `within`, unless `fault` names what else is wrong (rays that did not arrive, light
    where there should be none).
    """

    value: float
    expected: float
    tolerance: float
    within: bool
    derivation: str
    fault: str = ""
    detail: dict[str, float | int | str] = field(default_factory=dict)
    curve: Curve | None = None


# Detail of what no index of refraction changes: its condition number.
FREE_OF_INDEX: dict[str, float | int | str] = {"condition_level": 0.0}


class Unmeasurable(Exception):
    """Nothing could be measured; the message says why. The check becomes an ERROR."""
