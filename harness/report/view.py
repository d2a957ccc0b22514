"""What pages show, as plain values: sorted, worded, with links that exist. Templates only place it.

Nothing is judged here: verdicts come from the records.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from harness.record import (
    CaseRecord,
    Check,
    Curve,
    ImageFile,
    RendererRun,
    Summary,
    SummaryCase,
    Verdict,
    worst,
)
from harness.report.changes import Change, change
from harness.report.chart import sparkline
from harness.report.checks import (
    BAD,
    CheckView,
    elsewhere,
    failing,
    ranked,
    sorted_views,
    told,
)
from harness.report.digest import Digest
from harness.report.links import RunFolder, clean
from harness.report.spool import Piece

BROWSER_TYPES = (".png", ".webp", ".jpg", ".jpeg", ".gif", ".avif", ".svg")


# --- pictures -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Picture:
    """What to show of an image. `shown` is None where the picture is absent."""

    shown: str | None
    full: str | None
    data: str | None  # the linear data, where it is no picture itself
    role: str
    width: int
    height: int
    sha256: str
    kind: str  # of the linear data: "EXR"


def picture(image: ImageFile, folder: RunFolder) -> Picture:
    data = folder.href(image.path)
    viewable = data if image.path.lower().endswith(BROWSER_TYPES) else None
    full = folder.href(image.picture) or viewable or folder.href(image.thumbnail)
    return Picture(
        shown=folder.href(image.thumbnail) or full,
        full=full,
        data=data if data != full else None,
        role=clean(image.role),
        width=image.width,
        height=image.height,
        sha256=clean(image.sha256),
        kind=clean(image.path.rpartition(".")[2].upper()),
    )


def main_picture(images: Sequence[ImageFile], folder: RunFolder) -> Picture | None:
    """The image proper before any probe."""
    ordered = sorted(images, key=lambda image: image.role != "image")
    return picture(ordered[0], folder) if ordered else None


# --- index ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cell:
    """One case with one renderer. `status` is None where the renderer had no part in it."""

    renderer: str
    status: Verdict | None
    main: CheckView | None
    checks: int
    bad: int
    elsewhere: str  # who is off, where all that is bad here is so by comparison with them
    reason: str
    picture: Picture | None
    change: Change | None
    stored: bool  # an approved result stands in for the renderer


@dataclass(frozen=True)
class Worst:
    """The picture of a case's worst: a map of differences, or else residuals of a curve."""

    href: str | None
    spark: Markup | None
    text: str  # whose


@dataclass(frozen=True)
class Row:
    """`sort` holds what columns are sorted by: error over tolerance of each cell's worst check."""

    id: str
    name: str
    parameters: list[tuple[str, str]]
    family: str
    title: str
    status: Verdict
    note: str  # why there is no page or no record
    page: str | None
    cells: list[Cell]
    worst: Worst | None
    sort: str
    change: Change | None
    diagnoses: list[tuple[str, str, str]]  # (tone, renderer, sentence)


@dataclass(frozen=True)
class Line:
    """What the index needs of a row once it is written out: little, for there may be thousands."""

    id: str
    family: str
    status: Verdict
    page: str | None
    change: Change | None
    verdicts: tuple[Verdict | None, ...]
    excused: tuple[bool, ...]  # of each renderer, whether only others are off where it fails
    html: Piece


def line(row: Row, html: Piece) -> Line:
    verdicts = tuple(cell.status for cell in row.cells)
    excused = tuple(bool(cell.elsewhere) for cell in row.cells)
    return Line(row.id, row.family, row.status, row.page, row.change, verdicts, excused, html)


def split_id(case_id: str) -> tuple[str, list[tuple[str, str]]]:
    """The name and the parameters of an id such as "slab-offset[n=1.5,t=1]"."""
    name, bracket, rest = clean(case_id).partition("[")
    if not bracket or not rest.endswith("]"):
        return clean(case_id), []
    pairs = [part.partition("=") for part in rest[:-1].split(",")]
    return name, [(key, value) for key, _, value in pairs]


def row(
    case: SummaryCase,
    record: CaseRecord | None,
    renderers: Sequence[str],
    colours: Mapping[str, str],
    folder: RunFolder,
    *,
    page: str | None,
    note: str,
) -> Row:
    runs = {run.name: run for run in record.runs} if record else {}
    curve = record.curves[0] if record and record.curves else None
    name, parameters = split_id(case.id)
    cells = [_cell(renderer, case.checks, runs.get(renderer), folder) for renderer in renderers]
    return Row(
        id=clean(case.id),
        name=name,
        parameters=parameters,
        family=clean(case.family),
        title=clean(record.title) if record else "",
        status=case.status,
        note=note,
        page=page,
        cells=cells,
        worst=_worst(record, curve, cells, colours, folder) if record else None,
        sort=_sort_keys(cells),
        change=change(case.checks),
        diagnoses=_diagnoses(case),
    )


def _diagnoses(case: SummaryCase) -> list[tuple[str, str, str]]:
    return [
        (tone, d.renderer, told(d.renderer, d.sentence))
        for tone, d in ranked(case.diagnoses, failing(case.checks))
    ]


def _sort_keys(cells: Sequence[Cell]) -> str:
    """How much of its tolerance each cell's worst check uses; -1 where it is not known."""
    return " ".join(f"{_sortable(cell.main.ratio if cell.main else None):g}" for cell in cells)


def _sortable(ratio: float | None) -> float:
    """Unknown below everything, NaN and infinity above."""
    if ratio is None:
        return -1.0
    return float(f"{ratio:.4g}") if ratio < 1e30 else 1e30


def _worst(
    record: CaseRecord,
    curve: Curve | None,
    cells: Sequence[Cell],
    colours: Mapping[str, str],
    folder: RunFolder,
) -> Worst | None:
    if record.differences:
        pairs = {frozenset((m.a, m.b)): m for m in record.differences}
        between = [
            check for check in record.checks if frozenset((check.renderer, check.against)) in pairs
        ]
        views = sorted_views(between)
        first = (
            pairs[frozenset((views[0].check.renderer, views[0].check.against))]
            if views
            else record.differences[0]
        )
        return Worst(folder.href(first.path), None, f"{clean(first.a)} − {clean(first.b)}")
    if curve is None:
        return None
    known = [cell for cell in cells if cell.main]
    named = [s.renderer for s in curve.residuals]
    ordered = sorted(known, key=lambda cell: cell.main.rank if cell.main else (9, 0.0))
    renderer = next((cell.renderer for cell in ordered if cell.renderer in named), None)
    spark = sparkline(curve, renderer, colours) if renderer else None
    return Worst(None, spark, f"residuals of {clean(renderer or '')}") if spark else None


def _cell(
    renderer: str,
    checks: Iterable[Check],
    run: RendererRun | None,
    folder: RunFolder,
) -> Cell:
    views = sorted_views(check for check in checks if check.renderer == renderer)
    shown = main_picture(run.images, folder) if run else None
    status = renderer_verdict(renderer, (view.check for view in views), run)
    reason = clean(run.reason) if run and run.status != Verdict.PASS else ""
    if run and (words := last_words(run)):
        reason = f"{reason}: {words}" if reason else words
    main = views[0] if views else None
    if not reason and main and main.check.value is None:
        reason = clean(main.check.reason)
    return Cell(
        renderer=renderer,
        status=status,
        main=main,
        checks=len(views),
        bad=sum(view.check.status in BAD for view in views),
        elsewhere=elsewhere(renderer, (view.check for view in views)),
        reason=reason,
        picture=shown,
        change=change(view.check for view in views),
        stored=run is not None and run.stored is not None,
    )


def last_words(run: RendererRun) -> str:
    """The last line of the log of a renderer that did not answer: mostly the exception's."""
    if run.status != Verdict.ERROR or not run.log_tail.strip():
        return ""
    return " ".join(clean(run.log_tail).strip().splitlines()[-1].split())


def renderer_verdict(
    renderer: str, checks: Iterable[Check], run: RendererRun | None
) -> Verdict | None:
    """Of a renderer in one case: its run's and its checks' worst.

    None where it had no part; a run that nothing was checked in has not passed.
    """
    verdicts = [check.status for check in checks if check.renderer == renderer]
    if run and (verdicts or run.status is not Verdict.PASS):
        verdicts.append(run.status)
    return worst(verdicts) if verdicts else None


def renderer_names(summary: Summary, digest: Digest) -> list[str]:
    """Those the run knew, then any that only checks name."""
    return list(dict.fromkeys([*summary.renderers, *digest.by_renderer]))
