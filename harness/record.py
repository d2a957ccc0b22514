"""The record: one versioned JSON document per case and run, and the summary of a run.

This module is its only reader and writer. The report, the baseline check, JUnit and the summary
read nothing else.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import ConfigDict, Field

from harness.documents import Model, read
from harness.documents import write_bytes as write_bytes  # for those who write beside records
from harness.documents import write_pieces as write_pieces
from harness.documents import write_text as write_text
from harness.outcomes import SEVERITY as SEVERITY
from harness.outcomes import AgainstBaseline as AgainstBaseline
from harness.outcomes import BaselineState as BaselineState
from harness.outcomes import BaselineSummary as BaselineSummary
from harness.outcomes import LostCheck as LostCheck
from harness.outcomes import Stored as Stored
from harness.outcomes import Trend as Trend
from harness.outcomes import Verdict as Verdict
from harness.outcomes import worst as worst

RECORD_SCHEMA: Literal["snellcheck-record/1"] = "snellcheck-record/1"
SUMMARY_SCHEMA: Literal["snellcheck-summary/1"] = "snellcheck-summary/1"


class Attribution(Model):
    """Who is off, where a check compares two renderers or one with the truth.

    `how` is "truth" where a closed form decides, "agreement" where the renderers' majority does, or
    "undecided"; `confidence` is the probability that `off` are those who are wrong.
    """

    off: list[str]
    how: str
    confidence: float
    sentence: str


class Check(Model):
    """One comparison. `value` is compared with `expected` within `tolerance`.

    `value` and `expected` are None where nothing could be measured; then `status` is SKIP or
    ERROR and `reason` says why. `detail` holds further figures by name (max, rms, p999, pixels
    excluded and why, the worst ray); `derivation` says where the tolerance comes from.
    """

    id: str
    renderer: str
    against: str  # "truth", "baseline" or a renderer's name
    observable: str
    value: float | None
    expected: float | None
    tolerance: float | None
    unit: str
    status: Verdict
    reason: str
    derivation: str = ""
    cause: str = ""  # of a documented deviation, word for word as the scene has it
    detail: dict[str, float | int | str] = Field(default_factory=dict)
    stored: list[str] = Field(default_factory=list)  # renderers whose side was not rendered now
    baseline: AgainstBaseline | None = None
    attribution: Attribution | None = None


class Cause(Model):
    """A known cause with its fitted parameter: what the renderer does, as `sentence` says.

    `residual` is what it leaves of the deviation (root mean square, in units of the tolerances; 1
    is perfect), `explains` the share of the deviation that it takes away.
    """

    id: str
    sentence: str
    parameter: str = ""
    value: float | None = None
    uncertainty: float | None = None  # two standard errors
    unit: str = ""
    residual: float
    explains: float


class CauseFit(Model):
    """How well one cause fits one case, from which the cause of a whole run is computed.

    `score` is its cost (see `harness.diagnosis.fit`), which grows by `information` / 2 times the
    square of a change of the first of `values`. The one without an id is the truth's.
    """

    id: str
    values: list[float]
    score: float
    information: float
    fits: bool


class Diagnosis(Model):
    """Why a renderer is off, in one case or, with `cases`, in all of a run.

    `cause` is None where none of the known causes fits, and `sentence` says so; its id is
    "documented" where it is the one that scenes state of a KNOWN deviation. `deviation` is the
    size of what is to be explained, in units of the tolerances, `rays` how many rays tell of it.
    `cases` are those that the cause explains, `unexplained` those that it does not.
    """

    renderer: str
    sentence: str
    cause: Cause | None = None
    runner_up: Cause | None = None
    deviation: float = 0.0
    rays: int = 0
    iors: list[float] = Field(default_factory=list)
    fits: list[CauseFit] = Field(default_factory=list)
    cases: list[str] = Field(default_factory=list)
    unexplained: list[str] = Field(default_factory=list)


class ImageFile(Model):
    """A stored image; all paths are relative to the run's folder. `role` is "image", "probe", …

    `path` is the linear data (EXR); `picture` is the same at full size as a browser can show it,
    `thumbnail` a smaller one. `mean` is of each channel over the picture; `mean_error` is its
    standard error where the renderer samples. `cut` is the mean over the pixels of the weight that
    the renderer did not follow, where it tells.
    """

    role: str
    path: str
    picture: str | None = None
    thumbnail: str | None = None
    sha256: str
    width: int
    height: int
    mean: list[float] = Field(default_factory=list)
    mean_error: list[float] = Field(default_factory=list)
    cut: float | None = None


class DifferenceMap(Model):
    """|a - b| as a picture, in the colours of `harness.report.colours` up to `limit`.

    They are logarithmic from `low`; where that is 0 they are linear from 0.
    """

    a: str
    b: str
    path: str
    limit: float
    unit: str
    low: float = 0.0


class RendererRun(Model):
    """What one renderer did for one case."""

    name: str
    version: str
    status: Verdict
    reason: str = ""
    render_s: float = 0.0
    renders: int = 0
    command: str = ""
    log_tail: str = ""
    settings: dict[str, float | int | str] = Field(default_factory=dict)
    files: dict[str, str] = Field(default_factory=dict)  # name -> relative path: emitted scene …
    images: list[ImageFile] = Field(default_factory=list)
    capabilities: list[str] = Field(default_factory=list)
    facts: dict[str, float | int | str] = Field(default_factory=dict)  # of its preflight
    stored: Stored | None = None


class Series(Model):
    """One line of a chart. `renderer` is a renderer's name or "truth".

    Of residuals, `tolerance` is what this renderer may be off by at each x.
    """

    renderer: str
    x: list[float]
    y: list[float]
    tolerance: list[float] = Field(default_factory=list)


class RayPath(Model):
    """One ray from where it starts to where it ends: k + 1 `vertices` in scene units, k legs.

    `weights` say what each leg carries. `angles` are (incident, outgoing) at each of the k - 1
    vertices between, in degrees from the normal; a reflected ray leaves on the side it came from.
    """

    label: str = ""
    vertices: list[tuple[float, float, float]]
    weights: list[float]
    angles: list[tuple[float, float]]


class Curve(Model):
    """A measured curve beside its truth, with what is left when truth is taken away.

    `tolerance` (same length as residual x) draws the band within which residuals must lie, which is
    the widest of all renderers where they have tolerances of their own.
    """

    id: str
    title: str
    x_label: str
    y_label: str
    series: list[Series]
    residual_label: str = ""
    residuals: list[Series] = Field(default_factory=list)
    tolerance: list[float] = Field(default_factory=list)


class Table(Model):
    """A small table of text shown with the case, such as the lecture's erratum."""

    title: str
    columns: list[str]
    rows: list[list[str]]
    note: str = ""


class CaseRecord(Model):
    """Everything that is known of one permutation of one case after a run."""

    record_schema: Literal["snellcheck-record/1"] = Field(default=RECORD_SCHEMA, alias="schema")
    id: str
    case: str  # the scene file's name without its parameters
    family: str
    title: str
    description: str = ""
    lecture: str = ""
    sources: list[str] = Field(default_factory=list)
    formula: str = ""
    parameters: dict[str, float | int | str] = Field(default_factory=dict)
    scene_sha256: str
    scene_fingerprint: str = ""  # the same on all machines: see harness.scene.fingerprint
    scene_file: str
    scene_path: str = ""  # as it was found, from the working folder where it is below it
    platform: str = ""
    quality: str
    snellcheck_version: str
    started: str  # ISO 8601, UTC
    wall_s: float
    status: Verdict
    runs: list[RendererRun]
    checks: list[Check]
    curves: list[Curve] = Field(default_factory=list)
    differences: list[DifferenceMap] = Field(default_factory=list)
    tables: list[Table] = Field(default_factory=list)
    files: dict[str, str] = Field(default_factory=dict)  # name -> relative path: scene.json …
    diagnoses: list[Diagnosis] = Field(default_factory=list)  # of renderers that are off here
    pack: str | None = None  # relative path: pixels and rays as numbers, for the report's pages
    other_packs: dict[str, str] = Field(default_factory=dict)  # of other runs, by what names them

    model_config = ConfigDict(
        frozen=True, extra="forbid", populate_by_name=True, ser_json_inf_nan="strings"
    )


class RendererSummary(Model):
    version: str
    status: str  # "ok", "stored" in place of a missing one, "missing", "failed preflight", "failed"
    cases: int
    render_s: float
    reason: str = ""
    remedy: str = ""
    facts: dict[str, float | int | str] = Field(default_factory=dict)  # preflight resolution …


class Counts(Model):
    model_config = ConfigDict(extra="forbid", populate_by_name=True)

    passed: int = Field(default=0, alias="pass")
    fail: int = 0
    skip: int = 0
    error: int = 0
    known: int = 0


class Effort(Model):
    """What the jobs of a run cost: results `rendered` anew and `reused` from earlier.

    `retried` counts repetitions after failures that were not the renderer's (a lost machine, a
    process that could not be started), `damaged` entries of the cache that were made again.
    Processor time, user and system, went into `renderers_cpu_s`, the processes that renderers ran
    in on this machine, and into `own_cpu_s`, all the rest of the run. `memory_mb` is the most that
    all of them took at a time, in MiB (see `harness.running.memory`).
    """

    rendered: int = 0
    reused: int = 0
    retried: int = 0
    damaged: int = 0
    own_cpu_s: float = 0.0
    renderers_cpu_s: float = 0.0
    memory_mb: float = 0.0


class SummaryCase(Model):
    id: str
    family: str
    status: Verdict
    checks: list[Check]
    diagnoses: list[Diagnosis] = Field(default_factory=list)


class Summary(Model):
    """`summary.json`. `counts` counts checks."""

    summary_schema: Literal["snellcheck-summary/1"] = Field(default=SUMMARY_SCHEMA, alias="schema")
    snellcheck_version: str
    started: str
    wall_s: float
    quality: str
    command: str = ""
    exit_code: int
    renderers: dict[str, RendererSummary]
    counts: Counts
    cases: list[SummaryCase]
    baseline: BaselineSummary | None = None
    diagnoses: list[Diagnosis] = Field(default_factory=list)  # one per renderer that is off
    effort: Effort = Effort()
    confinement: str = ""  # what the system held renderers to
    interrupted: bool = False  # then cases that were not judged yet are ERROR and have no record

    model_config = ConfigDict(
        frozen=True, extra="forbid", populate_by_name=True, ser_json_inf_nan="strings"
    )


def write(document: CaseRecord | Summary, path: Path) -> None:
    """Writes a record or summary atomically."""
    write_text(path, document.model_dump_json(by_alias=True, indent=1) + "\n")


def read_case(path: Path) -> CaseRecord:
    """Raises InputError where `path` is unreadable or not a record of this version."""
    return read(path, CaseRecord)


def read_summary(path: Path) -> Summary:
    """Raises InputError where `path` is unreadable or not a summary of this version."""
    return read(path, Summary)
