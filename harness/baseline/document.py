"""A baseline: what one renderer measured for one case, approved by a person with a reason.

It is a JSON file small enough for git, with small pictures beside it. A baseline is not the truth;
it says whether something changed. It carries the hash of its own text, so that no figure in it can
change but by an approval.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import ConfigDict, Field, field_validator

from harness.documents import Model, parse, write_text
from harness.errors import InputError
from harness.record import Check, Stored, Verdict

BASELINE_SCHEMA: Literal["snellcheck-baseline/1"] = "snellcheck-baseline/1"
LARGEST_BASELINE = 4 * 2**20  # bytes; a case with a dozen checks has some thousands
MOST_EARLIER = 20  # approvals remembered before the present one
_DIGEST_LINE = re.compile(rb'^ "sha256": "[^"\n]*",\n', re.MULTILINE)
MEASURED = (Verdict.PASS, Verdict.FAIL, Verdict.KNOWN)


class Approval(Model):
    """Who approved a result, when, and why. `commit` is that of the working folder, if any."""

    at: str  # ISO 8601, UTC
    by: str
    reason: str
    commit: str = ""
    version: str  # of the renderer
    snellcheck_version: str
    record_sha256: str


class StoredImage(Model):
    """A picture as 16-bit linear PNG, from 0 for the radiance `darkest` to 65535 for `scale` more.

    `darkest` is below zero where a colour of the spectrum lies outside of linear sRGB.

    It lies in `file` beside the baseline, or in a store under `sha256`, or nowhere: then only
    `pixels_sha256` and the means tell whether a picture has changed.
    """

    role: str
    file: str = ""
    store: str = ""  # the URL of the store
    sha256: str = ""  # of the PNG
    pixels_sha256: str
    width: int = Field(ge=1, le=8192)
    height: int = Field(ge=1, le=8192)
    scale: float = Field(gt=0, allow_inf_nan=False)
    darkest: float = Field(default=0.0, le=0, allow_inf_nan=False)
    mean: list[float] = Field(default_factory=list)
    mean_error: list[float] = Field(default_factory=list)

    @field_validator("file")
    @classmethod
    def _beside(cls, name: str) -> str:
        if name and not re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,200}", name):
            raise ValueError("not the name of a file beside the baseline")
        return name

    @property
    def quantum(self) -> float:
        """The largest error of a stored radiance: half a step of 16 bits, and its own rounding."""
        return self.scale / 65535 * (0.5 + 1 / 128)


class Baseline(Model):
    """The approved results of `renderer` for `case`. `facts` are those of its preflight."""

    baseline_schema: Literal["snellcheck-baseline/1"] = Field(
        default=BASELINE_SCHEMA, alias="schema"
    )
    sha256: str = Field(default="", pattern=r"^([0-9a-f]{64})?$")  # see `digest_of`
    case: str
    renderer: str
    version: str
    quality: str
    settings: dict[str, float | int | str] = Field(default_factory=dict)
    scene_file: str
    scene_fingerprint: str = Field(pattern=r"^[0-9a-f]{64}$")
    platform: str = ""
    measured: str  # when the run began, ISO 8601, UTC
    capabilities: list[str] = Field(default_factory=list)
    facts: dict[str, float | int | str] = Field(default_factory=dict)
    checks: list[Check]
    images: list[StoredImage] = Field(default_factory=list)
    approval: Approval
    earlier: list[Approval] = Field(default_factory=list)

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)

    @field_validator("checks")
    @classmethod
    def _measured(cls, checks: list[Check]) -> list[Check]:
        for check in checks:
            numbers = (check.value, check.expected, check.tolerance)
            if check.status not in MEASURED:
                raise ValueError(f"check {check.id[:80]} was not measured")
            if not all(x is not None and math.isfinite(x) for x in numbers):
                raise ValueError(f"check {check.id[:80]} is not finite")
        if len(set(map(identity, checks))) < len(checks):
            raise ValueError("the same check twice")
        return checks

    @property
    def noisy(self) -> bool:
        """Whether the renderer samples, so that its pictures depend on samples and seed."""
        return "pixel-centres" not in self.capabilities

    @property
    def by_identity(self) -> Mapping[str, Check]:
        return {identity(check): check for check in self.checks}


def identity(check: Check) -> str:
    """The check's id, the same whichever of two renderers came first in the run."""
    if check.against in ("truth", "baseline"):
        return check.id
    what = check.id.removesuffix(f"/{check.renderer}/{check.against}")
    return "/".join((what, *sorted((check.renderer, check.against))))


@dataclass(frozen=True)
class Kept:
    """A baseline with the file that it was read from and that file's hash."""

    baseline: Baseline
    file: Path
    sha256: str

    def stored(self) -> Stored:
        """As records mark results that come from here."""
        approval = self.baseline.approval
        return Stored(
            version=self.baseline.version, approved=approval.at, by=approval.by,
            reason=approval.reason, sha256=self.sha256, file=self.file.name,
        )  # fmt: skip


def parse_baseline(data: bytes, file: Path) -> Kept:
    """Raises InputError where `data`, the content of `file`, is no baseline of this version."""
    if len(data) > LARGEST_BASELINE:
        raise InputError.of(f"larger than {LARGEST_BASELINE} bytes", file=file)
    baseline = parse(data, Baseline, file, "baseline")
    if baseline.sha256 != digest_of(data):
        raise InputError.of(
            "has changed since it was approved", file=file, key="sha256",
            value=baseline.sha256 or "nothing",
            expected=f"{digest_of(data)}; restore the file, or approve the results again",
        )  # fmt: skip
    return Kept(baseline, file, hashlib.sha256(data).hexdigest())


def digest_of(data: bytes) -> str:
    """The SHA-256 of a baseline's text without the line that holds it, line ends as on Unix."""
    return hashlib.sha256(_DIGEST_LINE.sub(b"", data.replace(b"\r\n", b"\n"), count=1)).hexdigest()


def baseline_text(baseline: Baseline) -> str:
    """The content of a baseline's file, without what is empty, so that diffs are short."""
    text = baseline.model_dump_json(
        by_alias=True, indent=1, exclude_defaults=True, exclude={"sha256"}
    )
    # The alias has a default and would be left out; a file without its schema says nothing.
    text = text.replace("{", f'{{\n "schema": "{BASELINE_SCHEMA}",', 1) + "\n"
    first, end, rest = text.partition(",\n")
    return f'{first}{end} "sha256": "{digest_of(text.encode())}",\n{rest}'


def write_baseline(baseline: Baseline, file: Path) -> None:
    """Writes it whole or not at all."""
    write_text(file, baseline_text(baseline))
