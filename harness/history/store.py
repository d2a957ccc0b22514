"""Figures of past runs in one SQLite file, so that a measurement can be followed over time.

It is a convenience, never evidence: verdicts come from records and baselines. So a history that is
damaged is put aside and a new one begun, and what cannot be written is said and left out.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from harness.baseline.document import MEASURED
from harness.baseline.trend import Deviations, in_tolerances
from harness.errors import InputError, utf8
from harness.history.revision import Revision
from harness.record import Summary

MOST_BEFORE = 100  # runs in which slides are looked for; many repeat the one before
MOST_RUNS = 2000  # a run of 500 checks takes some 50 KB
BUSY_S = 30.0  # two runs may end at the same time
SCHEMA = """
CREATE TABLE IF NOT EXISTS runs (
    id INTEGER PRIMARY KEY, started TEXT, commit_id TEXT, dirty INTEGER, folder TEXT,
    quality TEXT, snellcheck TEXT, exit_code INTEGER, wall_s REAL
);
CREATE TABLE IF NOT EXISTS renderers (
    run INTEGER REFERENCES runs ON DELETE CASCADE, name TEXT, version TEXT, status TEXT
);
CREATE TABLE IF NOT EXISTS checks (
    run INTEGER REFERENCES runs ON DELETE CASCADE, case_id TEXT, check_id TEXT, renderer TEXT,
    against TEXT, observable TEXT, value REAL, expected REAL, tolerance REAL, unit TEXT,
    status TEXT, reason TEXT
);
CREATE INDEX IF NOT EXISTS checks_of_case ON checks (case_id, run);
CREATE INDEX IF NOT EXISTS checks_of_run ON checks (run);
CREATE INDEX IF NOT EXISTS renderers_of_run ON renderers (run);
"""


@dataclass(frozen=True)
class Run:
    """A past run. `counts` are its checks by verdict."""

    id: int
    started: str
    commit: str
    dirty: bool
    quality: str
    snellcheck: str
    exit_code: int
    counts: dict[str, int]


@dataclass(frozen=True)
class Point:
    """One check in one past run. Numbers are None where nothing could be measured."""

    run: int
    started: str
    commit: str
    dirty: bool
    check: str
    renderer: str
    version: str
    observable: str
    value: float | None
    expected: float | None
    tolerance: float | None
    unit: str
    status: str

    @property
    def deviation(self) -> float | None:
        """Value less expected value."""
        if self.value is None or self.expected is None:
            return None
        return self.value - self.expected


def history_file() -> Path:
    """``SNELLCHECK_HISTORY``, or a file in the user's data folder. It may not exist yet."""
    if chosen := os.environ.get("SNELLCHECK_HISTORY"):
        return Path(chosen).expanduser()
    import platformdirs

    return platformdirs.user_data_path("snellcheck") / "history.sqlite"


class History:
    """The history in `file`."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def add(self, summary: Summary, revision: Revision, folder: Path) -> str:
        """Adds a run; returns what kept it from being added, "" where nothing did."""
        try:
            with self._open() as db:
                self._insert(db, summary, revision, folder)
        except sqlite3.OperationalError as error:  # locked, read-only, no room
            return f"cannot write {self.file}: {error}"
        except sqlite3.DatabaseError as error:
            return self._begin_anew(error, summary, revision, folder)
        except OSError as error:
            return f"cannot write {self.file}: {error.strerror}"
        return ""

    def runs(self, limit: int = 50) -> list[Run]:
        """The last runs, oldest first. Raises InputError where there is no history."""
        with self._reading() as db:
            rows = db.execute(
                "SELECT id, started, commit_id, dirty, quality, snellcheck, exit_code FROM runs "
                "ORDER BY id DESC LIMIT ?", (limit,),
            ).fetchall()  # fmt: skip
            found = []
            for row in reversed(rows):
                counts = dict(
                    db.execute(
                        "SELECT status, count(*) FROM checks WHERE run = ? GROUP BY status",
                        (row[0],),
                    ).fetchall()
                )
                number, started, commit, dirty, quality, snellcheck, code = row
                found.append(
                    Run(number, started, commit, bool(dirty), quality, snellcheck, code, counts)
                )
        return found

    def of_case(self, case: str, limit: int = 50) -> list[Point]:
        """All checks of a case in the last runs that had it, oldest first. Raises InputError."""
        with self._reading() as db:
            rows = db.execute(
                "SELECT c.run, r.started, r.commit_id, r.dirty, c.check_id, c.renderer, "
                "coalesce(v.version, ''), c.observable, c.value, c.expected, c.tolerance, "
                "c.unit, c.status FROM checks c JOIN runs r ON r.id = c.run "
                "LEFT JOIN renderers v ON v.run = c.run AND v.name = c.renderer "
                "WHERE c.case_id = ? AND c.run IN (SELECT DISTINCT run FROM checks "
                "WHERE case_id = ? ORDER BY run DESC LIMIT ?) ORDER BY c.run, c.rowid",
                (case, case, limit),
            ).fetchall()
        names = [field.name for field in dataclasses.fields(Point)]
        found = [dict(zip(names, row, strict=True)) for row in rows]
        return [Point(**{**one, "dirty": bool(one["dirty"])}) for one in found]

    def before(self, run: Summary, folder: Path) -> list[Deviations]:
        """The deviations of the runs into `folder` before `run`, of its quality, oldest first.

        In the order in which they were added, whatever the machine's clock said; all of them for a
        run that was not added. Raises InputError.
        """
        measured = ", ".join(f"'{status.value}'" for status in MEASURED)
        with self._reading() as db:
            runs = db.execute(
                "SELECT id FROM runs WHERE folder = :folder AND quality = :quality AND id < "
                "(SELECT coalesce(min(id), 9e18) FROM runs "
                "WHERE folder = :folder AND started = :started) ORDER BY id DESC LIMIT :most",
                {
                    "folder": _place(folder), "quality": run.quality, "started": run.started,
                    "most": MOST_BEFORE,
                },
            ).fetchall()  # fmt: skip
            rows = [
                db.execute(
                    "SELECT case_id, check_id, value, expected, tolerance FROM checks WHERE run = ?"
                    f" AND status IN ({measured}) AND value IS NOT NULL AND expected IS NOT NULL "
                    "AND tolerance IS NOT NULL", number,
                ).fetchall()
                for number in reversed(runs)
            ]  # fmt: skip
        return [
            {(case, check): in_tolerances(*figures) for case, check, *figures in one}
            for one in rows
        ]

    def cases(self) -> list[str]:
        """All cases of which anything is known. Raises InputError."""
        with self._reading() as db:
            return [row[0] for row in db.execute("SELECT DISTINCT case_id FROM checks")]

    @contextlib.contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        """A connection in which all that is done is done, or nothing."""
        self.file.parent.mkdir(parents=True, exist_ok=True)
        db = sqlite3.connect(self.file, timeout=BUSY_S)
        try:
            db.execute("PRAGMA foreign_keys = ON")
            db.executescript(SCHEMA)
            with db:
                yield db
        finally:
            db.close()

    @contextlib.contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        if not self.file.is_file():
            expected = "a run, which begins it"
            raise InputError.of("there is no history yet", file=self.file, expected=expected)
        try:
            with self._open() as db:
                yield db
        except sqlite3.DatabaseError as error:
            raise InputError.of(f"the history cannot be read: {error}", file=self.file) from error

    def _insert(
        self, db: sqlite3.Connection, summary: Summary, revision: Revision, folder: Path
    ) -> None:
        cursor = db.execute(
            "INSERT INTO runs (started, commit_id, dirty, folder, quality, snellcheck, exit_code, "
            "wall_s) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
            (
                summary.started, revision.commit, revision.dirty, _place(folder),
                summary.quality, summary.snellcheck_version, summary.exit_code, summary.wall_s,
            ),
        )  # fmt: skip
        run = cursor.lastrowid
        renderers = [(run, n, r.version, r.status) for n, r in summary.renderers.items()]
        db.executemany("INSERT INTO renderers VALUES (?, ?, ?, ?)", renderers)
        checks = [
            (
                run, case.id, c.id, c.renderer, c.against, c.observable, c.value, c.expected,
                c.tolerance, c.unit, c.status.value, c.reason,
            )
            for case in summary.cases
            for c in case.checks
        ]  # fmt: skip
        marks = ", ".join("?" * 12)
        db.executemany(f"INSERT INTO checks VALUES ({marks})", checks)
        db.execute(
            "DELETE FROM runs WHERE id NOT IN (SELECT id FROM runs ORDER BY id DESC LIMIT ?)",
            (MOST_RUNS,),
        )

    def _begin_anew(
        self, error: sqlite3.DatabaseError, summary: Summary, revision: Revision, folder: Path
    ) -> str:
        aside = self.file.with_name(f"{self.file.name}.damaged")
        self.file.replace(aside)
        with self._open() as db:
            self._insert(db, summary, revision, folder)
        return f"{self.file} was damaged ({error}); it is {aside} now, and a new history begins"


def _place(folder: Path) -> str:
    """A run's folder as the history names it."""
    return utf8(str(folder.resolve()))
