"""Messages stay on one line and can be shown, whatever they quote."""

from __future__ import annotations

import pytest

from harness.errors import LONGEST_TEXT, Problem


@pytest.mark.parametrize("field", ["key", "value", "expected", "suggestion"])
def test_what_is_quoted_is_short_and_printable(field: str) -> None:
    parts = {"key": "command", field: "a\n\u202e\x1b[31m" + "[" * 100_000}
    said = str(Problem("wrong", **parts))  # type: ignore[arg-type]
    assert said.isprintable()
    assert "\\u202e" in said
    assert len(said) < LONGEST_TEXT + 100
