"""File names and links: what a record says is never trusted to be either."""

from __future__ import annotations

import hashlib
import re
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

    def href(self, path: str | None) -> str | None:
        """A link to a file of the run; None where it is absent or lies outside the folder."""
        if not path or "\x00" in path:
            return None
        try:
            target = (self.root / path).resolve()
            if not target.is_file():
                return None
        except OSError:  # a name too long, a loop of symbolic links
            return None
        if not target.is_relative_to(self.root):
            return None
        return self.up + url(target.relative_to(self.root).as_posix())
