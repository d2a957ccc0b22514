"""A comparison becomes a verdict: PASS, FAIL, KNOWN, and SKIP or ERROR where there is none."""

from __future__ import annotations

import math

from harness.measure.comparison import Comparison
from harness.measure.observables import Observable
from harness.record import Check, Verdict
from harness.scene.model import CheckSpec, Known


def judge(spec: CheckSpec, renderer: str, against: str, comparison: Comparison) -> Check:
    """The check that says what `comparison` shows of `renderer`.

    A tolerance that the scene states replaces the derived one and is held against the worst ray or
    pixel. A documented deviation is KNOWN only while its size stays within its stated bounds, and
    FAILs when it is gone: then the scene is out of date. What a comparison calls a fault is none
    that any tolerance excuses, and no document but one that says how many rays go astray.
    """
    tolerance, derivation = comparison.tolerance, comparison.derivation
    within = comparison.within and not comparison.fault
    error = abs(comparison.value - comparison.expected)
    largest = float(comparison.detail.get("max", error))
    if spec.tolerance is not None:
        tolerance, derivation = spec.tolerance, spec.derivation
        error = max(error, largest)
        within = error <= tolerance and not comparison.fault
    if not all(math.isfinite(x) for x in (error, largest, tolerance)):
        return unmeasured(spec, renderer, against, Verdict.ERROR, "the measurement is not finite")
    unit = Observable(spec.observable).unit
    known = next((k for k in spec.known if k.renderer in (renderer, against)), None)
    fault = comparison.fault
    if known and 0 < _astray(comparison) <= known.astray:
        within, fault = False, ""
    status, reason = _status(within, error, tolerance, unit, fault, known)
    return Check(
        id=check_id(spec, renderer, against), renderer=renderer, against=against,
        observable=spec.observable, value=comparison.value, expected=comparison.expected,
        cause=known.cause if known else "",
        tolerance=tolerance, unit=unit, status=status, reason=reason, derivation=derivation,
        detail=comparison.detail,
    )  # fmt: skip


def _astray(comparison: Comparison) -> int:
    """How many rays were lost, or came where none should."""
    return sum(int(comparison.detail.get(name, 0)) for name in ("lost", "ghosts"))


def _status(
    within: bool, error: float, tolerance: float, unit: str, fault: str, known: Known | None
) -> tuple[Verdict, str]:
    size = f"off by {error:.3g} {unit}".rstrip()
    if within and known is None:
        return Verdict.PASS, ""
    if known is None or fault:
        times = f", {error / tolerance:.3g} times the tolerance" if tolerance > 0 else ""
        said = f"{size}{times}" if error > tolerance else "within tolerance where measured"
        return Verdict.FAIL, f"{said}; {fault}" if fault else said
    bounds = f"{known.at_least:.3g} to {known.at_most:.3g} {unit}".rstrip()
    if within and known.at_least <= 0:
        return Verdict.PASS, ""
    if within:
        return Verdict.FAIL, f"the documented deviation of {bounds} is gone: {known.cause}"
    if known.at_least <= error <= known.at_most:
        return Verdict.KNOWN, f"{size}: {known.cause}"
    return Verdict.FAIL, f"{size}, outside the documented {bounds}: {known.cause}"


def unmeasured(spec: CheckSpec, renderer: str, against: str, status: Verdict, reason: str) -> Check:
    """A check without a value: SKIP or ERROR, never a pass."""
    return Check(
        id=check_id(spec, renderer, against), renderer=renderer, against=against,
        observable=spec.observable, value=None, expected=None, tolerance=None,
        unit=Observable(spec.observable).unit, status=status, reason=reason,
    )  # fmt: skip


def check_id(spec: CheckSpec, renderer: str, against: str) -> str:
    """Unique within a case, and the same in every run."""
    probe = f"({spec.probe})" if spec.probe else ""
    return f"{spec.observable}{probe}/{renderer}/{against}"
