"""File names and links: what a record says is never trusted to be either."""

from __future__ import annotations

import hashlib
import os
import posixpath
import re
import stat
from pathlib import Path
from urllib.parse import quote

from markupsafe import Markup, escape

CONTROL = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)")
UNPRINTABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\u202a-\u202e\u2066-\u2069]")


def clean(text: str) -> str:
    """`text` without terminal escapes, and with other control characters made visible.

    Characters that reverse the direction of writing count as control characters: a log or a name
    must not look like what it is not.
    """
    text = CONTROL.sub("", text).replace("\r\n", "\n")
    return UNPRINTABLE.sub("\ufffd", text)


def breakable(name: str) -> Markup:
    """A name whose words are joined by "_", which may go on in the next line after each."""
    return escape(name).replace("_", Markup("_<wbr>"))


def page_name(case_id: str) -> str:
    """The file name of a case's page: different for different ids, also where case is ignored."""
    plain = re.sub(r"[^A-Za-z0-9._=,+\[\]-]", "_", case_id)[:120]
    if plain and plain == case_id.lower() and not plain.startswith((".", "-")):
        return f"{plain}.html"
    digest = hashlib.sha256(case_id.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return f"{plain.lstrip('.-') or 'case'}~{digest}.html"


def url(path: str) -> str:
    """A relative URL of a relative POSIX path: every character that could mean something quoted."""
    return quote(path, safe="/~=,+")


class RunFolder:
    """The run's folder, as seen from pages at its top (`up` = "") or one level down ("../")."""

    def __init__(self, root: Path, up: str = "") -> None:
        self.root = root.resolve()
        self.up = up
        self._inside: dict[str, str | None] = {}  # folders of paths, as they lie in the root

    def href(self, path: str | None) -> str | None:
        """A link to a file of the run; None where it is absent or lies outside the folder."""
        if not path or "\x00" in path:
            return None
        parent, _, name = path.rpartition("/")
        if parent not in self._inside:
            self._inside[parent] = self._place(self.root / parent)
        folder = self._inside[parent]
        plain = folder is not None and name not in ("", ".", "..")
        if plain and stat.S_ISREG(_mode(f"{self.root}/{folder}/{name}")):
            place: str | None = posixpath.normpath(f"{folder}/{name}")
        else:  # it is not there, or leads somewhere else
            place = self._place(self.root / path, is_file=True)
        return None if place is None else self.up + url(place)

    def _place(self, path: Path, *, is_file: bool = False) -> str | None:
        """Where `path` leads, from the root; None where that is outside or not there."""
        try:
            target = path.resolve()
            there = target.is_file() if is_file else target.is_dir()
        except (OSError, ValueError):  # too long, a loop of symbolic links, no name at all
            return None
        if not there or not target.is_relative_to(self.root):
            return None
        return target.relative_to(self.root).as_posix()


def _mode(path: str) -> int:
    """What lies there, links not followed; 0 where nothing does."""
    try:
        return os.lstat(path).st_mode
    except (OSError, ValueError):
        return 0
