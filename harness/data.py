"""Where the files that come with snellcheck are: in a checkout, or inside an installed wheel.

The wheel carries them in `harness/_data`; a checkout, and an editable installation of it, has
them beside the packages.
"""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def _root(name: str) -> Path:
    shipped = _PACKAGE / "_data" / name
    return shipped if shipped.is_dir() else _PACKAGE.parent / name


def scenes_root() -> Path:
    """The folder of scene families: ``scenes_root() / "slab" / "offset.toml"``."""
    return _root("scenes")


def references_root() -> Path:
    """The folder of the approved baselines that come with snellcheck."""
    return _root("references")
