"""Settings for all tests."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from hypothesis import settings

# No test depends on how fast the machine is.
settings.register_profile("snellcheck", deadline=None)
settings.load_profile("snellcheck")

# What tests run is no part of the user's history.
_HISTORY = tempfile.TemporaryDirectory(prefix="snellcheck-history-")
os.environ["SNELLCHECK_HISTORY"] = str(Path(_HISTORY.name) / "history.sqlite")
