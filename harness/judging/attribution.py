"""Who is off, where two renderers differ.

Where the case has a truth, whoever fails it is off. Without one, renderers that agree vouch for
each other. How far that goes is a matter of two assumptions: a renderer is wrong about a case with
a chance of `WRONG`, independently of the others, and two wrong ones are wrong alike with a chance
of `ALIKE`. From these Bayes' rule gives the probability of every way to part the renderers into
right and wrong ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from harness.record import Attribution, Check, Verdict

WRONG, ALIKE = 0.1, 0.05
# Below this probability nobody is named.
SURE = 0.9
DIFFERS = (Verdict.FAIL, Verdict.KNOWN)


def attributed(checks: Sequence[Check]) -> list[Check]:
    """All checks of one case; those that differ say who is off."""
    failing = _truth_verdicts(checks)
    return [
        check.model_copy(update={"attribution": _attribution(check, checks, failing)})
        if check.status in DIFFERS
        else check
        for check in checks
    ]


def _truth_verdicts(checks: Sequence[Check]) -> dict[str, str | None]:
    """By renderer that was held against the truth: the first observable that it fails, or None."""
    found: dict[str, str | None] = {}
    for check in checks:
        if check.against == "truth" and check.status in (Verdict.PASS, *DIFFERS):
            failed = check.observable if check.status in DIFFERS else None
            found[check.renderer] = found.get(check.renderer) or failed
    return found


def _attribution(
    check: Check, checks: Sequence[Check], failing: Mapping[str, str | None]
) -> Attribution:
    if check.against == "variant":
        said = f"{check.renderer} is off: it shows two forms of the same scene differently"
        return Attribution(off=[check.renderer], how="truth", confidence=1.0, sentence=said)
    if check.against == "truth":
        said = f"{check.renderer} is off: it differs from the closed form"
        return Attribution(off=[check.renderer], how="truth", confidence=1.0, sentence=said)
    pair = (check.renderer, check.against)
    off = [name for name in pair if failing.get(name)]
    right = [name for name in pair if name in failing and not failing[name]]
    if off and len(off) + len(right) == 2:
        who = " and ".join(off)
        said = f"{who} {_are(off)} off: {failing[off[0]]} differs from its closed form in this case"
        if right:
            said += f", and {right[0]} passes it"
        return Attribution(off=off, how="truth", confidence=1.0, sentence=said)
    return _by_agreement(pair, [c for c in checks if c.observable == check.observable])


def _by_agreement(pair: tuple[str, str], checks: Sequence[Check]) -> Attribution:
    groups = _groups(checks)
    right, probability = most_likely_right(groups)
    off = [name for name in pair if name not in right]
    if probability < SURE or not off:
        chance = f"{probability:.0%}" if right else "no"
        said = (
            f"cannot tell who is off: {_described(groups)}; that the likeliest are right has "
            f"{chance} probability"
        )
        return Attribution(off=[], how="undecided", confidence=probability, sentence=said)
    witnesses = " and ".join(sorted(right))
    said = (
        f"{' and '.join(off)} {_are(off)} off: {witnesses} agree with each other and not with "
        f"{'them' if len(off) > 1 else 'it'} (probability {probability:.1%})"
    )
    return Attribution(off=off, how="agreement", confidence=probability, sentence=said)


def _are(names: Sequence[str]) -> str:
    return "are" if len(names) > 1 else "is"


def _described(groups: Sequence[frozenset[str]]) -> str:
    return " against ".join(" with ".join(sorted(group)) for group in groups)


def _groups(checks: Sequence[Check]) -> list[frozenset[str]]:
    """Renderers that agree, directly or through others, the largest group first."""
    names = [n for c in checks for n in (c.renderer, c.against) if _compares(c)]
    group = {name: frozenset({name}) for name in names}
    for check in checks:
        if _compares(check) and check.status is Verdict.PASS:
            joined = group[check.renderer] | group[check.against]
            for name in joined:
                group[name] = joined
    return sorted(set(group.values()), key=lambda g: (-len(g), sorted(g)))


def _compares(check: Check) -> bool:
    return check.against not in ("truth", "variant") and check.status in (Verdict.PASS, *DIFFERS)


def most_likely_right(groups: Sequence[frozenset[str]]) -> tuple[frozenset[str], float]:
    """The group that is right with the highest probability, and that probability.

    Groups contradict each other, so at most one is right; an empty one says that none is.
    """
    chances = dict(_chances(groups))
    total = sum(chances.values())
    best = max(chances, key=lambda g: (chances[g], sorted(g)))
    return best, chances[best] / total


def _chances(groups: Sequence[frozenset[str]]) -> Iterator[tuple[frozenset[str], float]]:
    """Each group that may be right, the empty one for nobody, with its unnormalised chance."""
    for right in (*groups, frozenset[str]()):
        chance = 1.0
        for group in groups:
            if group == right:
                chance *= (1 - WRONG) ** len(group)
            else:
                chance *= WRONG ** len(group) * ALIKE ** (len(group) - 1)
        yield right, chance
