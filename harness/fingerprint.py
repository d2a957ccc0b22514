"""Hashes of code: what a result depends on besides its inputs.

A renderer's fingerprint changes whenever its images might. For our own adapters that is the text
of every module they reach, however deep, and the versions of the packages that compute.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import importlib.util
import platform
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

PACKAGES = ("harness", "tracer")

# Imports at load time, inside functions and for types alike; a name in an example that looks like
# one makes a fingerprint wider, never narrower.
_IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+(?P<source>[\w.]+)[ \t]+import[ \t]+(?P<names>\([^)]*\)|[^\n#]+)"
    r"|import[ \t]+(?P<module>[\w.]+))",
    re.MULTILINE,
)


def code_digest(*modules: str) -> str:
    """SHA-256 over the sources of `modules` and of all that they import from our packages."""
    digest = hashlib.sha256()
    for module in sorted(reached(modules)):
        path = _path(module)
        assert path is not None
        digest.update(f"{module}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()


def reached(modules: Iterable[str]) -> set[str]:
    """`modules` and every module of our packages that they import, directly or not."""
    found: set[str] = set()
    waiting = list(modules)
    for module in waiting:
        assert _path(module) is not None, f"no module {module}"
    while waiting:
        module = waiting.pop()
        if module not in found:
            found.add(module)
            waiting += _imported(module)
    return found


def versions(*distributions: str) -> str:
    """The Python and the installed distributions, such as "python 3.12.1; numpy 2.1.0"."""
    told = [f"python {platform.python_version()}"]
    for name in distributions:
        try:
            told.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            told.append(f"{name} absent")
    return "; ".join(told)


def file_digest(path: Path) -> str:
    """SHA-256 of a file's content. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def combined(*parts: str) -> str:
    """One hash of several texts, in their order."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(f"{len(part.encode())}:".encode() + part.encode())
    return digest.hexdigest()


@functools.cache
def _imported(module: str) -> tuple[str, ...]:
    path = _path(module)
    assert path is not None
    found = []
    for match in _IMPORT.finditer(path.read_text(encoding="utf-8")):
        source = match["source"] or match["module"]
        if source.partition(".")[0] not in PACKAGES:
            continue
        names = re.findall(r"\w+", match["names"] or "")
        found += list(_with_parents(source))
        found += [f"{source}.{name}" for name in names if _path(f"{source}.{name}") is not None]
    return tuple(found)


def _with_parents(module: str) -> Iterator[str]:
    """`module` and the packages it is in: importing it runs them, too."""
    words = module.split(".")
    for count in range(1, len(words) + 1):
        name = ".".join(words[:count])
        if _path(name) is not None:
            yield name


@functools.cache
def _path(module: str) -> Path | None:
    """The file of a module of ours, found without importing it."""
    package, *rest = module.split(".")
    root = _root(package)
    if root is None:
        return None
    plain = root.joinpath(*rest).with_suffix(".py") if rest else None
    candidates = [root.joinpath(*rest, "__init__.py"), *([plain] if plain else [])]
    return next((path for path in candidates if path.is_file()), None)


@functools.cache
def _root(package: str) -> Path | None:
    spec = importlib.util.find_spec(package) if package in PACKAGES else None
    return Path(spec.origin).parent if spec is not None and spec.origin else None
