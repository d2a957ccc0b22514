"""Settings for all tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import settings

# No test depends on how fast the machine is.
settings.register_profile("snellcheck", deadline=None)
settings.load_profile("snellcheck")


@pytest.fixture(scope="session", autouse=True)
def _no_history_of_tests(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What tests run is no part of the user's history."""
    with pytest.MonkeyPatch.context() as patch:
        history = tmp_path_factory.mktemp("history") / "history.sqlite"
        patch.setenv("SNELLCHECK_HISTORY", str(history))
        yield
