"""What one part of a scene file says about another: names that must exist and be unique."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import cache

from harness.errors import nearest
from harness.measure.observables import Observable
from harness.scene import model
from harness.scene.findings import Finding, KeyPath, quoted

AIR = "air"  # what surrounds everything; a scene may define it otherwise
AGAINST = ("truth", "renderers")
BUILT_IN = ("tracer", "povray", "mitsuba", "mitsuba-exact")


@cache
def registered_renderers() -> frozenset[str]:
    """Names of the renderers of the entry-point group, which need not be importable."""
    from importlib.metadata import entry_points

    return frozenset(BUILT_IN) | {e.name for e in entry_points(group="snellcheck.renderers")}


def cross_findings(case: model.Case, renderers: Collection[str] = ()) -> list[Finding]:
    """All broken references of a case; `renderers` are further names of renderers."""
    return [
        *_repeated(case),
        *_media(case),
        *_checks(case, registered_renderers() | set(renderers)),
    ]


def _unknown(path: KeyPath, what: str, name: str, known: Collection[str]) -> Finding:
    names = sorted(known)
    expected = ", ".join(names) if names else f"a scene that defines a {what}"
    return Finding(path, f"unknown {what}", quoted(name), expected, nearest(name, names))


def _repeated(case: model.Case) -> Iterator[Finding]:
    groups: dict[str, Sequence[model.Solid | model.Surface | model.Probe]] = {
        "solids": case.solids,
        "surfaces": case.surfaces,
        "probes": case.probes,
    }
    for group, members in groups.items():
        seen: set[str] = set()
        for index, member in enumerate(members):
            if member.name in seen:
                yield Finding((group, index, "name"), "name used twice", quoted(member.name))
            seen.add(member.name)


def _media(case: model.Case) -> Iterator[Finding]:
    known = {AIR, *case.media}
    uses: list[tuple[KeyPath, str | None]] = [
        (("solids", index, "medium"), solid.medium) for index, solid in enumerate(case.solids)
    ]
    for index, surface in enumerate(case.surfaces):
        if isinstance(surface.material, model.ThinSlab):
            uses.append((("surfaces", index, "material", "medium"), surface.material.medium))
    uses.append((("camera", "medium"), case.camera.medium))
    for path, name in uses:
        if name is not None and name not in known:
            yield _unknown(path, "medium", name, known)


def _checks(case: model.Case, renderers: Collection[str]) -> Iterator[Finding]:
    probes = [probe.name for probe in case.probes]
    observables = [observable.value for observable in Observable]
    for index, check in enumerate(case.checks):
        path: KeyPath = ("checks", index)
        if check.observable not in observables:
            yield _unknown((*path, "observable"), "observable", check.observable, observables)
        if check.against not in AGAINST and check.against not in renderers:
            known = {*AGAINST, *renderers}
            yield _unknown((*path, "against"), "opponent", check.against, known)
        if check.probe is not None and check.probe not in probes:
            yield _unknown((*path, "probe"), "probe", check.probe, probes)
        for place, name in enumerate(check.renderers):
            if name not in renderers:
                yield _unknown((*path, "renderers", place), "renderer", name, renderers)
        for place, known_deviation in enumerate(check.known):
            if known_deviation.renderer not in renderers:
                where = (*path, "known", place, "renderer")
                yield _unknown(where, "renderer", known_deviation.renderer, renderers)
            if known_deviation.at_least > known_deviation.at_most:
                yield Finding(
                    (*path, "known", place, "at_most"),
                    "less than at_least",
                    f"{known_deviation.at_most:g}",
                    f"≥ {known_deviation.at_least:g}",
                )
