"""Where the files that come with snellcheck are, and where it keeps what it can make again.

The wheel carries its files in `harness/_data`; a checkout, and an editable installation of it,
has them beside the packages.
"""

from __future__ import annotations

import os
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


def cache_root() -> Path:
    """The folder of what can be made again; ``SNELLCHECK_CACHE`` moves it. It may not exist yet."""
    if chosen := os.environ.get("SNELLCHECK_CACHE"):
        return Path(chosen).expanduser()
    import platformdirs

    return platformdirs.user_cache_path("snellcheck")
