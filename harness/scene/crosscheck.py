"""What one part of a scene file says about another: names that must exist and be unique.

These checks read the document before it becomes a model, and pass over what the model will
refuse, so that both kinds of mistakes are reported together.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import cache

from harness.errors import nearest
from harness.measure.observables import Observable
from harness.scene.expressions import is_expression
from harness.scene.findings import Finding, KeyPath, quoted

AIR = "air"  # what surrounds everything; a scene may define it otherwise
AGAINST = ("truth", "renderers")
BUILT_IN = frozenset({"tracer", "povray", "mitsuba", "mitsuba-exact"})

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
        *_checks(document, registered_renderers() | set(renderers)),
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
    for group in ("solids", "surfaces", "probes"):
        seen: set[str] = set()
        for index, row in _rows(document, group):
            name = _text(row, "name")
            if name is not None and name in seen:
                yield Finding((group, index, "name"), "name used twice", quoted(name))
            seen.add(name or "")


def _media(document: Table) -> Iterator[Finding]:
    known = {AIR, *_table(document, "media")}
    for index, solid in _rows(document, "solids"):
        yield from _reference(("solids", index, "medium"), _text(solid, "medium"), known)
    for index, surface in _rows(document, "surfaces"):
        material = _table(surface, "material")
        path = ("surfaces", index, "material", "medium")
        yield from _reference(path, _text(material, "medium"), known)
    camera = _table(document, "camera")
    yield from _reference(("camera", "medium"), _text(camera, "medium"), known)


def _checks(document: Table, renderers: Collection[str]) -> Iterator[Finding]:
    names = [_text(row, "name") for _, row in _rows(document, "probes")]
    # Where a probe's own name is missing, what refers to it is not to blame.
    probes = None if None in names else {name for name in names if name}
    observables = [observable.value for observable in Observable]
    for index, check in _rows(document, "checks"):
        path: KeyPath = ("checks", index)
        for key, known in (
            ("observable", observables),
            ("against", {*AGAINST, *renderers}),
            ("probe", probes),
        ):
            yield from _reference((*path, key), _text(check, key), known)
        chosen = check.get("renderers")
        for place, renderer in enumerate(chosen if isinstance(chosen, tuple) else ()):
            if isinstance(renderer, str):
                yield from _reference((*path, "renderers", place), renderer, renderers)
        for place, deviation in _rows(check, "known"):
            yield from _known(deviation, (*path, "known", place), renderers)


def _known(deviation: Table, path: KeyPath, renderers: Collection[str]) -> Iterator[Finding]:
    yield from _reference((*path, "renderer"), _text(deviation, "renderer"), renderers)
    least, most = deviation.get("at_least"), deviation.get("at_most")
    if isinstance(least, int | float) and isinstance(most, int | float) and least > most:
        where = (*path, "at_most")
        yield Finding(where, "less than at_least", quoted(most), f"≥ {quoted(least)}")
