"""The whole report as one HTML file, to be attached or mailed: pages, pictures, pixels and all.

It is put together from the written pages: the index as it is, each case's page as a template that
the script takes out when it is asked for, pictures as data URLs. Its policy admits just the one
script and the one style that stand in it, by their hashes.
"""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from harness.record import write_text
from harness.report.build import write_report
from harness.report.digest import digest_of
from harness.report.links import page_name, url
from harness.summary_file import SummaryFile

MEGABYTE = 1_000_000
TYPES = {".webp": "image/webp", ".png": "image/png", ".jpg": "image/jpeg", ".svg": "image/svg+xml"}


@dataclass(frozen=True)
class SingleFile:
    """What was written: its size in bytes, and the cases whose pixels found no room."""

    path: Path
    size: int
    without_pixels: list[str]


def write_single(run_folder: Path, out: Path, room: int = 25 * MEGABYTE) -> SingleFile:
    """Writes the report of the run as one file; pixel packs of at most `room` bytes in all.

    Failures come first, so it is their pixels that are there. Raises InputError where the run's
    summary is missing or unreadable.
    """
    write_report(run_folder)
    order = digest_of(SummaryFile(run_folder / "summary.json")).order()
    blocks: list[str] = []
    without: list[str] = []
    for case in order:
        page = run_folder / "cases" / page_name(case.id)
        if not page.is_file():
            continue
        text = page.read_text("utf-8")
        blocks.append(_template(text, f"cases/{url(page.name)}", page.parent))
        pack = _pack(text, page.parent)
        if pack is None:
            continue
        if len(pack[1]) > room:
            without.append(case.id)
            continue
        room -= len(pack[1])
        blocks.append(f'<script type="application/json" data-pack="{pack[0]}">{pack[1]}</script>')
    index = _embedded((run_folder / "index.html").read_text("utf-8"), run_folder, "")
    text = _assembled(index, blocks, run_folder / "assets")
    write_text(out, text)
    return SingleFile(out, len(text.encode("utf-8")), without)


def _template(page: str, name: str, folder: Path) -> str:
    """A page's header and main part, inert until they are taken out."""
    parts = [re.search(rf"<{tag}\b.*</{tag}>", page, re.DOTALL) for tag in ("header", "main")]
    body = "\n".join(part[0] for part in parts if part)
    title = re.search(r"<title>(.*?)</title>", page, re.DOTALL)
    heading = title[1] if title else ""
    content = _embedded(body, folder, "../")
    return f'<template data-page="{name}" data-title="{heading}">{content}</template>'


def _pack(page: str, folder: Path) -> tuple[str, str] | None:
    """The address of a page's pack and the JSON in it, in which no "<" can stand."""
    found = re.search(r'"packs":\[\{"href":"([^"]+)"', page)
    if found is None:
        return None
    path = folder / unquote(found[1])
    if not path.is_file():
        return None
    text = path.read_text("ascii")
    content = text.removeprefix("snellcheckPack(").removesuffix(");\n")
    return (found[1], content) if "<" not in content and content != text else None


def _embedded(html: str, folder: Path, up: str) -> str:
    """`html` with its pictures in it; links to what is not in the file lead nowhere."""

    def picture(match: re.Match[str]) -> str:
        data = _data_url(folder / unquote(match[1]))
        return f'src="{data}"' if data else match[0]

    html = re.sub(r'\bsrc="([^":]+\.(?:webp|png|jpe?g))"', picture, html)
    return re.sub(r'(?<=<a )([^>]*?)href="([^"]*)"', lambda m: m[1] + _link(m[2], up), html)


def _link(target: str, up: str) -> str:
    """Pages and places in them can be followed; files of the run are not here."""
    plain = target.partition("#")[0]
    page = plain.endswith(".html") or not plain
    return f'href="{target}"' if page else f'data-left-out="{up}"'


def _data_url(path: Path) -> str | None:
    kind = TYPES.get(path.suffix)
    if kind is None or not path.is_file():
        return None
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode('ascii')}"


def _assembled(index: str, blocks: list[str], assets: Path) -> str:
    """The index with style, script and the blocks in it, and a policy that admits just these."""
    style = (assets / "report.css").read_text("utf-8")
    script = (assets / "report.js").read_text("utf-8").replace("</script", "<\\/script")
    policy = (
        f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; "
        f"script-src '{_hash(script)}'; base-uri 'none'; form-action 'none'"
    )
    index = re.sub(
        r'(http-equiv="Content-Security-Policy" content=")[^"]*', lambda m: m[1] + policy, index
    )
    index = re.sub(r'<link rel="stylesheet"[^>]*>', lambda _: f"<style>{style}</style>", index)
    index = re.sub(r"<script src=[^>]*></script>\n?", "", index)
    index = index.replace('<html lang="en">', '<html lang="en" data-single>')
    note = "<noscript><p>Pages of cases open with a script only in a single file.</p></noscript>"
    tail = "\n".join([note, *blocks, f"<script>{script}</script>"])
    return index.replace("</body>", f"{tail}\n</body>")


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode()
