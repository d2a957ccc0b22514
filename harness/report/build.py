"""Writes the pages: `index.html` and `cases/<id>.html`, from a run's records alone.

Records are read one at a time, so memory does not grow with curves and logs of all cases. What is
unreadable or missing is shown as such: the report of a broken run is the one that is needed most.
"""

from __future__ import annotations

import hashlib
import importlib.resources
import json
import re
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from harness import record as records
from harness.errors import InputError
from harness.record import CaseRecord, Verdict
from harness.report import changes, chart, checks, mathml, overview, quantity, view
from harness.report.colours import BEYOND, NOT_FINITE, SCALE_HEX, colour_classes
from harness.report.detection import detection
from harness.report.differences import differences
from harness.report.digest import Place, digest_of
from harness.report.given import given_files
from harness.report.links import RunFolder, breakable, clean, page_name, url
from harness.report.pagedata import case_data
from harness.report.spool import Spool
from harness.report.trends import Trends
from harness.summary_file import SummaryFile

if TYPE_CHECKING:
    import jinja2

PACKAGE = "harness.report"
ASSETS = ("report.css", "report.js")
COARSE = 180  # pictures narrower than this are shown enlarged, so let their pixels be seen
OF_RUN = re.compile(r'<meta name="snellcheck-run" content="[^"]*">')
GENERATOR = '<meta name="generator" content="snellcheck'


def write_report(run_folder: Path) -> Path:
    """Builds the report of the run in `run_folder`. Returns the path of its index page.

    Reads `summary.json` and `records/*.json`. Raises InputError where the summary is missing or
    unreadable; a case whose record is, is listed with the reason.
    """
    report = _Report(run_folder, SummaryFile(run_folder / "summary.json"))
    for name in ASSETS:
        text = importlib.resources.files(PACKAGE).joinpath("assets", name).read_text("utf-8")
        records.write_text(run_folder / "assets" / name, text)
    index = run_folder / "index.html"
    with tempfile.TemporaryFile() as file:
        rows = report.write_cases(Spool(file))
        _remove_stale(run_folder / "cases", {page_name(row.id) for row in report.order})
        records.write_pieces(index, (part.encode("utf-8") for part in report.index(rows)))
    return index


def _own_digest() -> str:
    """A hash of the code and the templates that make pages."""
    here = Path(__file__).parent
    files = sorted([*here.glob("*.py"), *here.glob("templates/*.j2")])
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


@dataclass(frozen=True)
class Neighbours:
    """The pages before and after a case's in the order of the index."""

    previous: tuple[str, str] | None  # (link, name)
    following: tuple[str, str] | None
    failing: tuple[str, str] | None  # the next one that fails
    position: int
    total: int


class _Report:
    """What all pages of one run share."""

    def __init__(self, run_folder: Path, file: SummaryFile) -> None:
        self.folder = run_folder
        self.top, self.below = RunFolder(run_folder), RunFolder(run_folder, up="../")
        self.file = file
        self.summary = summary = file.head
        self.digest = digest_of(file)
        self.order = self.digest.order()
        self.place = {case.id: k for k, case in enumerate(self.order)}
        self.next_failing = _next_failing(self.order)
        self.renderers = view.renderer_names(summary, self.digest)
        self.colours = colour_classes(self.renderers)
        self.trends = Trends(self.renderers, self.colours)
        self.code = _own_digest()
        self.stray: list[str] = []  # record files that belong to no case of the summary
        self.environment = environment()
        self.absent = {name for name, known in summary.renderers.items() if known.status != "ok"}
        self.row_template = self.environment.get_template("row.html.j2")
        self.environment.globals.update(
            colours=self.colours,
            summary=summary,
            generator=f"snellcheck {summary.snellcheck_version}",
            scale=SCALE_HEX,
            beyond="#{:02x}{:02x}{:02x}".format(*BEYOND),
            not_finite="#{:02x}{:02x}{:02x}".format(*NOT_FINITE),
        )

    def write_cases(self, spool: Spool) -> list[view.Line]:
        """Writes a page per record, and returns the index's rows in their order."""
        rows: dict[str, view.Line] = {}
        problems: list[str] = []
        for path in sorted((self.folder / "records").glob("*.json")):
            try:
                record = records.read_case(path)
            except InputError as error:
                problems.append(f"{path.name}: {error.problems[0].message}")
                continue
            if record.id not in self.place:
                self.stray.append(path.name)
                continue
            self._write_case(self._page_path(record.id), record, path)
            rows[record.id] = self._row(record.id, record, "", spool)
            for curve in record.curves:
                self.trends.add(curve)
        missing = "no readable record of this case"
        if problems:
            missing += " (unreadable: " + "; ".join(problems[:3]) + ")"
        for case in self.order:
            if case.id not in rows:
                self._page_path(case.id).unlink(missing_ok=True)
                rows[case.id] = self._row(case.id, None, missing, spool)
        return [rows[case.id] for case in self.order]

    def _page_path(self, case_id: str) -> Path:
        return self.folder / "cases" / page_name(case_id)

    def _row(self, case_id: str, record: CaseRecord | None, note: str, spool: Spool) -> view.Line:
        page = f"cases/{url(page_name(case_id))}" if record else None
        case = self.file.case(self.order[self.place[case_id]].span)
        row = view.row(
            case, record, self.renderers, self.colours, self.top, page=page, note=clean(note)
        )
        return view.line(row, spool.keep(self.row_template.render(row=row, absent=self.absent)))

    def _write_case(self, page: Path, record: CaseRecord, path: Path) -> None:
        """Writes the page of a case, or only names the run in it where all else is as it was."""
        stamp = self._stamp(record, path)
        written = page.read_text(encoding="utf-8") if page.is_file() else ""
        if f'<meta name="snellcheck-page" content="{stamp}">' in written[:2000]:
            told = f'<meta name="snellcheck-run" content="{clean(self.summary.started)}">'
            records.write_text(page, OF_RUN.sub(lambda _: told, written, count=1))
        else:
            records.write_text(page, self.case(record, path, stamp))

    def _stamp(self, record: CaseRecord, path: Path) -> str:
        """A hash of all that a case's page shows, but for the time of the run."""
        images = [image for run in record.runs for image in run.images]
        named = [*record.files.values(), record.pack, *record.other_packs.values()]
        named += [path for run in record.runs for path in run.files.values()]
        named += [d.path for d in record.differences]
        named += [name for image in images for name in (image.path, image.picture, image.thumbnail)]
        there = [self.top.href(name) for name in named if name]
        neighbours = repr(self._neighbours(record.id))
        shown = [self.code, self.summary.snellcheck_version, dict(self.colours), there, neighbours]
        return hashlib.sha256(path.read_bytes() + json.dumps(shown).encode()).hexdigest()

    def case(self, record: CaseRecord, path: Path, stamp: str) -> str:
        folder = self.below
        runs = [
            (run, verdict, [view.picture(image, folder) for image in run.images])
            for run in record.runs
            if (verdict := view.renderer_verdict(run.name, record.checks, run)) or run.images
        ]
        charts = [chart.draw(curve, self.colours) for curve in record.curves]
        name, parameters = view.split_id(record.id)
        views = checks.sorted_views(record.checks)
        return self.environment.get_template("case.html.j2").render(
            stamp=stamp,
            record=record,
            name=name,
            id_parameters=parameters,
            headings=_parameters(record),
            formula=mathml.typeset(record.formula),
            checks=checks.grouped(views),
            change_of=changes.change,
            diagnoses=checks.ranked(record.diagnoses, checks.failing(record.checks)),
            worst_of={v.check.renderer: v for v in reversed(views)},
            last_words={run.name: view.last_words(run) for run, _, _ in runs},
            elsewhere={run.name: checks.elsewhere(run.name, record.checks) for run, _, _ in runs},
            runs=runs,
            pictured=any(images for _, _, images in runs),
            coarse=all(i.width < COARSE for run in record.runs for i in run.images),
            differences=differences(record, folder),
            charts=charts,
            record_href=folder.href(f"records/{path.name}"),
            files=_files(record, folder),
            given={run.name: given_files(run, folder) for run, _, _ in runs},
            neighbours=self._neighbours(record.id),
            data=case_data(record, folder, self.colours, charts),
        )

    def _neighbours(self, case_id: str) -> Neighbours:
        at, ids = self.place[case_id], self.order

        def link(k: int | None) -> tuple[str, str] | None:
            if k is None or not 0 <= k < len(ids):
                return None
            return url(page_name(ids[k].id)), clean(ids[k].id)

        failing = self.next_failing[at]
        return Neighbours(link(at - 1), link(at + 1), link(failing), at + 1, len(ids))

    def index(self, rows: list[view.Line]) -> Iterator[str]:
        """The index page, part after part."""
        families = sorted({row.family for row in rows})
        seen = {status for row in rows for status in (row.status, *row.verdicts)}
        statuses = [v.value for v in records.SEVERITY if v in seen]
        verdict = overview.headline(self.summary, self.digest)
        return self.environment.get_template("index.html.j2").generate(
            headline=verdict,
            tally=overview.tally(self.digest.counts),
            started=overview.started(self.summary),
            lines=overview.renderer_lines(self.summary, self.digest, self.renderers, rows),
            rows=rows,
            families=families,
            statuses=statuses,
            renderers=self.renderers,
            exit_meaning=overview.EXIT_CODES.get(self.summary.exit_code, "unknown"),
            stray=self.stray,
            verdicts=[verdict.value for verdict in Verdict],
            diagnoses=checks.ranked(self.summary.diagnoses, self.digest.failing()),
            changed=changes.panel(self.summary.baseline),
            changes=_change_chips(rows),
            failures=overview.failures(self.digest),
            pages={row.id: row.page for row in rows},
            trends=self.trends.panels(self.summary),
            detection=detection(),
            worst_page=_page_of(rows, verdict.worst_case),
        )


def _next_failing(order: list[Place]) -> list[int | None]:
    """For each case the place of the next one after it that fails."""
    found: list[int | None] = []
    ahead: int | None = None
    for k in range(len(order) - 1, -1, -1):
        found.append(ahead)
        if order[k].status in (Verdict.FAIL, Verdict.ERROR):
            ahead = k
    return found[::-1]


def _change_chips(rows: list[view.Line]) -> list[tuple[str, str, str]]:
    """(state, tone, word) of each state that cases are in, where there is more than one."""
    states = {row.change.state: row.change for row in rows if row.change}
    known = [states[state.value] for state in changes.ORDER if state.value in states]
    return [(c.state, c.tone, c.text) for c in known] if len(known) > 1 else []


def _page_of(rows: list[view.Line], case_id: str) -> str | None:
    return next((row.page for row in rows if row.id == clean(case_id)), None)


def _parameters(record: CaseRecord) -> list[tuple[str, str]]:
    return [
        (clean(key), clean(value) if isinstance(value, str) else quantity.number(value, digits=6))
        for key, value in record.parameters.items()
    ]


def _files(record: CaseRecord, folder: RunFolder) -> list[tuple[str, str]]:
    """Links to the files of the case that are there."""
    found = ((clean(name), folder.href(path)) for name, path in record.files.items())
    return [(name, href) for name, href in found if href]


def _remove_stale(folder: Path, wanted: set[str]) -> None:
    """Removes pages of ours whose case is no longer part of the run; nothing else."""
    for path in _pages(folder):
        if path.name not in wanted:
            path.unlink()


def _pages(folder: Path) -> Iterator[Path]:
    for path in folder.glob("*.html"):
        with path.open(encoding="utf-8", errors="replace") as file:
            if GENERATOR in file.read(2000):
                yield path


def environment() -> jinja2.Environment:
    import jinja2  # here, because the command line imports this module's package

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(PACKAGE),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        clean=clean,
        breakable=breakable,
        number=quantity.number,
        seconds=quantity.seconds,
        count=quantity.count,
        size=quantity.size,
        check=checks.check_view,
        told=checks.told,
        meaning=checks.meaning,
    )
    return environment
