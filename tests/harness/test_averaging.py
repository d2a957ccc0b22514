"""Renderers whose pixels are means over their areas: judged more loosely, accused of nothing."""

from __future__ import annotations

from pathlib import Path

from harness.record import Verdict
from harness.renderers.base import Capability
from tests.fakes.student import CAPABILITIES, averaging
from tests.harness.tiny import checks_of, run_tiny
from tests.mutants.test_outside_mutants import off_by

CLAIMS = CAPABILITIES - {Capability.PIXEL_CENTRES}


def test_a_right_one_is_not_accused(tmp_path: Path) -> None:
    summary = run_tiny(tmp_path, averaging(capabilities=CLAIMS))
    checks = checks_of(summary)
    assert [c.reason for c in checks if c.status is Verdict.FAIL] == []
    assert sum(c.status is Verdict.PASS for c in checks) >= 8
    assert summary.diagnoses == []


def test_a_wrong_index_is_seen_and_named_all_the_same(tmp_path: Path) -> None:
    """Half of one of these 32 pixels across 86 degrees is what a ray must be off by.

    Cases that it passes are no witnesses against that: it would pass them in any case.
    """
    light = averaging(sees=off_by(-0.25), capabilities=CLAIMS)
    summary = run_tiny(tmp_path, light, cases=("snell", "slab"))
    failed = {c.observable for c in checks_of(summary) if c.status is Verdict.FAIL}
    assert "internal_angle" in failed
    assert summary.diagnoses[0].cause is not None
    assert summary.diagnoses[0].cause.id == "index"
