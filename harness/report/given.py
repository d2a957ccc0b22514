"""What a renderer was given, as its page shows it: links to all files, and the text of scenes."""

from __future__ import annotations

from dataclasses import dataclass

from harness.record import RendererRun
from harness.report.links import RunFolder, clean

TEXTS = (".pov", ".inc", ".ini", ".xml", ".json", ".txt", ".toml", ".py")
SHOWN = 12_000  # characters of one file; large meshes are megabytes


@dataclass(frozen=True)
class GivenFile:
    """A file that a renderer was given. `text` is None where it is none, or cannot be read.

    `cut` says that `text` is only its beginning.
    """

    name: str
    href: str
    size: int
    text: str | None
    cut: bool


def given_files(run: RendererRun, folder: RunFolder) -> list[GivenFile]:
    """The files of a renderer that are there, scenes before what they refer to."""
    found = []
    for name, path in run.files.items():
        href = folder.href(path)
        if href is None:
            continue
        file = folder.root / path
        text = None
        try:
            if path.lower().endswith(TEXTS):
                with file.open(encoding="utf-8", errors="replace") as opened:
                    text = opened.read(SHOWN + 1)
            size = file.stat().st_size
        except OSError:  # it has gone meanwhile
            continue
        shown = None if text is None else clean(text[:SHOWN])
        found.append(GivenFile(clean(name), href, size, shown, len(text or "") > SHOWN))
    return sorted(found, key=lambda file: file.text is None)
