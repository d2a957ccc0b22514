"""What one part of a scene file says about another: names that must exist and be unique.

These checks read the document before it becomes a model, and pass over what the model will
refuse, so that both kinds of mistakes are reported together.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import cache

from harness.errors import nearest
from harness.measure.observables import (
    ALL_LIGHT_OBSERVABLES,
    IMAGE_OBSERVABLES,
    IMPLIED_OBSERVABLES,
    LIGHT_OBSERVABLES,
    TRUTH_OBSERVABLES,
    Observable,
)
from harness.scene.expressions import is_expression
from harness.scene.findings import Finding, KeyPath, quoted

WAYS = ("ior", "glass", "sellmeier", "cauchy", "abbe")  # in which a medium says its index
AIR = "air"  # what surrounds everything; a scene may define it otherwise
AGAINST = frozenset({"truth", "renderers"})
OBSERVABLES = frozenset(o.value for o in Observable if o not in IMPLIED_OBSERVABLES)
BUILT_IN = frozenset({"tracer", "povray", "povray-stock", "mitsuba", "mitsuba-exact"})

MOST_NAMES = 30  # that a message lists

Table = Mapping[str, object]


@cache
def registered_renderers() -> frozenset[str]:
    """Names of the renderers of the entry-point group; none of them is imported."""
    from importlib.metadata import entry_points

    return BUILT_IN | {entry.name for entry in entry_points(group="snellcheck.renderers")}


def cross_findings(document: Table, renderers: Collection[str] = ()) -> list[Finding]:
    """All broken references of a document; `renderers` are further names of renderers."""
    return [
        *_repeated_names(document),
        *_media(document),
        *_dispersion(document),
        *_environment(document),
        *_variants(document),
        *_checks(document, registered_renderers().union(renderers)),
    ]


def _rows(table: Table, key: str) -> Iterator[tuple[int, Table]]:
    rows = table.get(key)
    for index, row in enumerate(rows if isinstance(rows, tuple) else ()):
        if isinstance(row, dict):
            yield index, row


def _text(table: Table, key: str) -> str | None:
    value = table.get(key)
    return value if isinstance(value, str) and not is_expression(value) else None


def _table(table: Table, key: str) -> Table:
    value = table.get(key)
    return value if isinstance(value, dict) else {}


def _reference(path: KeyPath, name: str | None, known: Collection[str] | None) -> Iterator[Finding]:
    """A finding where `name` is given and not known; the last key of `path` says what it is."""
    if name is None or known is None or name in known:
        return
    key = next(part for part in reversed(path) if isinstance(part, str))
    what = "renderer" if key == "against" else key.removesuffix("s")
    names = sorted(known)
    listed = ", ".join(names[:MOST_NAMES]) + (", …" if len(names) > MOST_NAMES else "")
    expected = listed or f"a {what} that the scene defines"
    yield Finding(path, f"unknown {what}", quoted(name), expected, nearest(name, names))


def _repeated_names(document: Table) -> Iterator[Finding]:
    for group in ("solids", "surfaces", "probes", "variants"):
        seen: set[str] = set()
        for index, row in _rows(document, group):
            name = _text(row, "name")
            if name is not None and name in seen:
                yield Finding((group, index, "name"), "name used twice", quoted(name))
            seen.add(name or "")


def _media(document: Table) -> Iterator[Finding]:
    media = _table(document, "media")
    for name, medium in media.items():
        if isinstance(medium, dict):
            yield from _index(("media", name), medium)
    known = {AIR, *media}
    for index, solid in _rows(document, "solids"):
        yield from _reference(("solids", index, "medium"), _text(solid, "medium"), known)
    for index, surface in _rows(document, "surfaces"):
        material = _table(surface, "material")
        path = ("surfaces", index, "material", "medium")
        yield from _reference(path, _text(material, "medium"), known)
    camera = _table(document, "camera")
    yield from _reference(("camera", "medium"), _text(camera, "medium"), known)


def _index(path: KeyPath, medium: Table) -> Iterator[Finding]:
    """Whether a medium says its index, and in one way only."""
    said = [way for way in WAYS if way in medium]
    if not said:
        # Not where a key may be one of them, misspelt, which is reported.
        if not [key for key in medium if key != "absorption"]:
            expected = f"a number ≥ 0.001 and ≤ 1000, or one of {', '.join(WAYS[1:])} instead"
            yield Finding((*path, WAYS[0]), "missing", None, expected)
    elif len(said) > 1:
        expected = f"either {said[0]} or {said[1]}"
        yield Finding((*path, said[1]), "the index is said twice", None, expected)


def _dispersion(document: Table) -> Iterator[Finding]:
    """Whether there is a truth where renderers disperse by themselves: in a furnace alone."""
    if _table(document, "transport").get("dispersion") is not True:
        return
    for key in ("spectrum", "surfaces", "lights", "probes"):
        if document.get(key):
            message = "has no truth where renderers disperse by themselves"
            expected = "solids before a background, or no transport.dispersion"
            yield Finding((key,), message, None, expected)


def _environment(document: Table) -> Iterator[Finding]:
    """Whether what is behind everything is said once, and stays where it is."""
    if "environment" not in document:
        return
    if "background" in document:
        yield Finding(("background",), "there is an environment, too", None, "one of the two")
    for index, variant in _rows(document, "variants"):
        if variant.get("rotate"):
            message = "an environment cannot be turned"
            yield Finding(("variants", index, "rotate"), message, None, "no environment")


def _variants(document: Table) -> Iterator[Finding]:
    names = {_text(row, "name") for _, row in _rows(document, "solids")}
    known = None if None in names else {name for name in names if name}
    for index, variant in _rows(document, "variants"):
        for solid in _table(variant, "shapes"):
            yield from _reference(("variants", index, "solid"), solid, known)


def _checks(document: Table, renderers: frozenset[str]) -> Iterator[Finding]:
    # Where a probe's own name is missing, what refers to it is not to blame.
    rows = {_text(row, "name"): row for _, row in _rows(document, "probes")}
    probes = None if None in rows else {name: row for name, row in rows.items() if name}
    for index, check in _rows(document, "checks"):
        path: KeyPath = ("checks", index)
        observable = _text(check, "observable")
        yield from _reference((*path, "observable"), observable, OBSERVABLES)
        yield from _reference((*path, "against"), _text(check, "against"), AGAINST | renderers)
        yield from _reference((*path, "probe"), _text(check, "probe"), probes)
        if observable in OBSERVABLES:
            yield from _opponent(path, check, Observable(observable))
            yield from _probe(path, check, Observable(observable), probes)
        if "tolerance" in check and not check.get("derivation"):
            expected = "where the tolerance comes from"
            yield Finding((*path, "derivation"), "missing", None, expected)
        chosen = check.get("renderers")
        for place, renderer in enumerate(chosen if isinstance(chosen, tuple) else ()):
            if isinstance(renderer, str):
                yield from _reference((*path, "renderers", place), renderer, renderers)
        for place, deviation in _rows(check, "known"):
            yield from _known(deviation, (*path, "known", place), renderers)


def _opponent(path: KeyPath, check: Table, observable: Observable) -> Iterator[Finding]:
    """Whether the observable can be compared with what the check names."""
    against = check.get("against", "truth")
    if (against == "truth") == (observable in TRUTH_OBSERVABLES) or not isinstance(against, str):
        return
    expected = "truth" if observable in TRUTH_OBSERVABLES else "renderers or a renderer's name"
    message = f"{observable} cannot be compared with it"
    yield Finding((*path, "against"), message, quoted(against), expected)


def _probe(
    path: KeyPath, check: Table, observable: Observable, probes: Mapping[str, Table] | None
) -> Iterator[Finding]:
    """Whether the check names a probe where it needs one, and one of the right kind."""
    name = check.get("probe")
    where = (*path, "probe")
    if observable in IMAGE_OBSERVABLES:
        if name is not None:
            yield Finding(where, f"{observable} is measured without a probe", quoted(name))
        return
    if name is None:
        expected = ", ".join(sorted(probes or ())) or "a probe that the scene defines"
        yield Finding(where, "missing", None, expected)
        return
    measure = measure_of(observable)
    probe = probes.get(name) if probes is not None and isinstance(name, str) else None
    if probe is not None and probe.get("measure", "position") != measure:
        expected = f'a probe with measure = "{measure}"'
        yield Finding(where, f"{observable} needs another probe", quoted(name), expected)


def measure_of(observable: Observable) -> str:
    """What a probe must measure for `observable`."""
    if observable in ALL_LIGHT_OBSERVABLES:
        return "all-light"
    return "light" if observable in LIGHT_OBSERVABLES else "position"


def _known(deviation: Table, path: KeyPath, renderers: Collection[str]) -> Iterator[Finding]:
    yield from _reference((*path, "renderer"), _text(deviation, "renderer"), renderers)
    least, most = deviation.get("at_least"), deviation.get("at_most")
    if isinstance(least, int | float) and isinstance(most, int | float) and least > most:
        where = (*path, "at_most")
        yield Finding(where, "less than at_least", quoted(most), f"≥ {quoted(least)}")
