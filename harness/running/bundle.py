"""A judged case, kept whole: its record and its files under the hash of all that determines them.

A run in which nothing changed takes its cases from here and renders, measures and draws nothing.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from harness.archive import Archive, belongs, folder_name
from harness.cache.cache import Cache
from harness.errors import InputError, RendererError, RendererFailed
from harness.fingerprint import code_digest, combined, versions
from harness.judging.results import Contender, Result
from harness.plan import PreparedCase
from harness.record import CaseRecord, read_case, write_bytes
from harness.renderers.base import Image, RenderSettings
from harness.running.memo import Memo
from harness.running.parcel import pack_contender

# What plans, judges and draws a case.
CODE = ("harness.plan", "harness.judging.judge", "harness.archive", "harness.baseline.stand_in")
COMPUTING = ("numpy", "scipy", "scikit-image", "colour-science", "imagecodecs", "OpenEXR")


def suite_key(
    contenders: Sequence[Contender],
    memos: Mapping[str, Memo],
    helper: str,
    settings: RenderSettings,
    quality: str,
) -> str | None:
    """The hash of all that a run's cases have in common.

    None where nothing can be kept from run to run, since the work of one of its renderers cannot.
    """
    parts = [code_digest(*CODE), versions(*COMPUTING), quality]
    parts += [str(settings.samples), str(settings.seed), f"{settings.timeout_s} {helper}"]
    for contender in contenders:
        memo = memos[contender.name]
        if contender.absent is None and not memo.lasting:
            return None
        parts += [memo.fingerprint, json.dumps(pack_contender(contender))]
    return combined(*parts, memos[helper].fingerprint) if memos[helper].lasting else None


def case_key(
    case: PreparedCase,
    suite: str,
    stored: Sequence[Contender],
    results: Mapping[tuple[str, str], Result],
) -> str:
    """The hash of all that determines the record of `case`.

    `stored` are the renderers for which approved results stand in; `results` has their pictures.
    """
    loaded = case.loaded
    named = f"{loaded.id} {loaded.file.parent.name}/{loaded.file.name}"
    parameters = json.dumps(dict(loaded.parameters))
    scene = case.scene.model_dump_json()
    parts = [named, parameters, loaded.model.model_dump_json(), scene]
    for contender in stored:
        checks = {name: c.model_dump_json() for name, c in contender.stored_checks.items()}
        parts += [json.dumps(pack_contender(contender)), repr(contender.stored), json.dumps(checks)]
    for (renderer, role), result in results.items():
        if isinstance(result, Image) and any(c.name == renderer for c in stored):
            parts += [renderer, role, hashlib.sha256(result.pixels.tobytes()).hexdigest()]
    return combined("case", suite, *parts)


def keep(
    cache: Cache, key: str, archive: Archive, case: PreparedCase, results: Sequence[Result]
) -> None:
    """Keeps the case as it was written; not where a renderer failed, which it may not do again."""
    if any(isinstance(result, RendererFailed) for result in results):
        return
    paths = archive.files(folder_name(case.loaded.id))
    count = sum(not isinstance(result, RendererError) for result in results)
    cache.put(key, {"results": count}, {p: (archive.root / p).read_bytes() for p in paths})


@dataclass(frozen=True)
class Restored:
    """A case as it was judged before, from `results` results."""

    record: CaseRecord
    results: int


def restore(cache: Cache, key: str, archive: Archive, case: PreparedCase) -> Restored | None:
    """Writes the files of a case as they were kept, its record last; None where they were not."""
    entry = cache.get(key)
    if entry is None:
        return None
    name = folder_name(case.loaded.id)
    wanted = {path: block for path, block in entry.blocks.items() if belongs(path, name)}
    stale = [path for path in archive.files(name) if path not in wanted]
    record_file = archive.root / "records" / f"{name}.json"
    if stale or not record_file.is_file():
        archive.discard(name)
    for path, block in wanted.items():
        file = archive.root / path
        if not (file.is_file() and file.read_bytes() == block):
            write_bytes(file, block)
    try:
        return Restored(read_case(record_file), int(entry.meta["results"]))
    except InputError:  # kept by a version whose records were others
        return None
