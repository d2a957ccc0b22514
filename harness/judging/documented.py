"""What a scene documents of a renderer, told apart from what is new.

A check that is KNOWN has the cause that its scene names, found and proven when it was written
down. Fitting the library of causes to it again would at best repeat that, and at worst blame
something else that happens to look alike; so only what no scene documents is diagnosed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from harness.record import Cause, Check, Diagnosis, SummaryCase, Verdict

DOCUMENTED = "documented"


def is_documented(diagnosis: Diagnosis) -> bool:
    """Whether the cause is a scene's own and not one that was fitted."""
    return diagnosis.cause is not None and diagnosis.cause.id == DOCUMENTED


def known_here(renderer: str, checks: Iterable[Check]) -> Diagnosis | None:
    """The diagnosis of a case in which all that is off is KNOWN; None of any other."""
    off = [check for check in checks if _is_off(check, renderer)]
    if not off or any(check.status is not Verdict.KNOWN for check in off):
        return None
    causes = "; ".join(dict.fromkeys(check.cause for check in off))
    return _diagnosis(
        renderer, f"{renderer} deviates as the scene documents: {causes}", causes, off
    )


def known_in_run(renderer: str, judged: Sequence[SummaryCase]) -> Iterator[Diagnosis]:
    """One diagnosis for each documented cause, that of most cases first."""
    by_cause: dict[str, dict[str, list[Check]]] = {}
    for case in judged:
        for check in case.checks:
            if _is_off(check, renderer) and check.status is Verdict.KNOWN:
                by_cause.setdefault(check.cause, {}).setdefault(case.id, []).append(check)
    for cause, cases in sorted(by_cause.items(), key=lambda item: (-len(item[1]), item[0])):
        many = f"{len(cases)} cases" if len(cases) > 1 else "1 case"
        sentence = f"{renderer} deviates in {many} as documented: {cause}"
        off = [check for checks in cases.values() for check in checks]
        yield _diagnosis(renderer, sentence, cause, off).model_copy(update={"cases": list(cases)})


def _is_off(check: Check, renderer: str) -> bool:
    off = (Verdict.FAIL, Verdict.KNOWN, Verdict.ERROR)
    return check.renderer == renderer and check.against == "truth" and check.status in off


def _diagnosis(renderer: str, sentence: str, cause: str, off: Sequence[Check]) -> Diagnosis:
    return Diagnosis(
        renderer=renderer, sentence=sentence, deviation=_in_tolerances(off),
        cause=Cause(id=DOCUMENTED, sentence=cause, residual=0.0, explains=1.0),
    )  # fmt: skip


def _in_tolerances(off: Sequence[Check]) -> float:
    """Root mean square of the checks' deviations; those without a tolerance do not count."""
    ratios = [
        (check.value - check.expected) / check.tolerance
        for check in off
        if check.value is not None and check.expected is not None and check.tolerance
    ]
    return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else 0.0
