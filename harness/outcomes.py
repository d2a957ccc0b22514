"""What a check can come to: a verdict, and a state against what was approved."""

from __future__ import annotations

import enum

from pydantic import Field

from harness.documents import Model


class Verdict(enum.StrEnum):
    """PASS and KNOWN are green; KNOWN is a deviation of the size that the scene documents."""

    PASS = "pass"
    FAIL = "fail"
    SKIP = "skip"
    ERROR = "error"
    KNOWN = "known"


# The order in which verdicts of parts decide the verdict of the whole, worst first.
SEVERITY = (Verdict.ERROR, Verdict.FAIL, Verdict.SKIP, Verdict.KNOWN, Verdict.PASS)


def worst(verdicts: list[Verdict]) -> Verdict:
    """The verdict of a whole; nothing at all is an ERROR, because it shows nothing."""
    return min(verdicts, key=SEVERITY.index, default=Verdict.ERROR)


class BaselineState(enum.StrEnum):
    """How a check of a run stands to the approved result. Only the first five are harmless."""

    SAME = "same"
    DRIFTED = "drifted"  # moved, and still within tolerance
    IMPROVED = "improved"
    NEW = "new"  # nothing was approved yet
    RENDERER_CHANGED = "renderer-changed"  # another version, the same numbers
    REGRESSED = "regressed"
    MISSING = "missing"  # approved, and not measured now
    STALE = "stale"  # approved for another scene or other settings, so not comparable


class AgainstBaseline(Model):
    """What was approved for a check, and how the present result stands to it.

    `shift` is the change of the deviation from truth in tolerances, None where there is none.
    """

    state: BaselineState
    reason: str = ""
    value: float | None = None
    expected: float | None = None
    tolerance: float | None = None
    status: Verdict | None = None
    shift: float | None = None
    version: str = ""  # of the renderer when it was approved
    approved: str = ""  # when, by whom and why


class Stored(Model):
    """Says of a renderer that its results were not measured now but stored when approved."""

    version: str
    approved: str  # ISO 8601, UTC
    by: str
    reason: str
    sha256: str  # of the baseline's file
    file: str


class LostCheck(Model):
    """A check that was approved and is not in the run, or whose baseline cannot be read."""

    case: str
    renderer: str
    check: str = ""
    state: BaselineState
    reason: str


class Trend(Model):
    """A check that moves in one direction over `runs` runs; `slope` is in tolerances per run.

    Runs that repeat the one before them do not count.
    """

    case: str
    check: str
    runs: int
    slope: float
    p_value: float
    reason: str


class BaselineSummary(Model):
    """The outcome of `snellcheck check`: against what, how many in which state, what is lost.

    `runs` is how many runs `trends` were looked for in, this one among them.
    """

    source: str
    failed: bool
    counts: dict[str, int]
    lost: list[LostCheck] = Field(default_factory=list)
    trends: list[Trend] = Field(default_factory=list)
    runs: int = 1
