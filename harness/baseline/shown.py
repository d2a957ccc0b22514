"""Approved pictures for the report's viewer: packs of them, beside those of the run."""

from __future__ import annotations

from dataclasses import replace

from harness import record as records
from harness.archive import folder_name
from harness.baseline.run_folder import RunFolder, record_file
from harness.baseline.source import Baselines
from harness.errors import InputError
from harness.record import CaseRecord
from harness.report import pack
from harness.report.pagedata import BASELINE


def show_pictures(run: RunFolder, baselines: Baselines) -> RunFolder:
    """Writes a pack of the approved pictures of each case, and its record where that is new to it.

    A picture that was not kept, or cannot be had, is left out. Returns the run as it is now.
    """
    shown = dict(run.records)
    for case, (record, digest) in run.records.items():
        path = f"data/{folder_name(case)}.baseline.js"
        others = {name: p for name, p in record.other_packs.items() if name != BASELINE}
        if images := _pictures(record, baselines):
            pack.write(run.folder / path, case, images)
            others[BASELINE] = path
        if others != record.other_packs:
            changed = record.model_copy(update={"other_packs": others})
            records.write(changed, record_file(run.folder, case))
            shown[case] = changed, digest
    return replace(run, records=shown)


def _pictures(record: CaseRecord, baselines: Baselines) -> list[pack.Image]:
    images: list[pack.Image] = []
    for ran in record.runs:
        kept = baselines.kept.get((record.id, ran.name))
        for image in kept.baseline.images if kept else ():
            if kept is None or not (image.file or image.store):
                continue
            try:
                pixels = baselines.picture(kept, image)
            except InputError:  # its figures are compared all the same
                continue
            first = images[0] if images else None
            images.append(pack.image(ran.name, image.role, pixels, first))
    return images
