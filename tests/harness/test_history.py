"""The figures of past runs: kept, found again, drawn, and no more than a convenience."""

from __future__ import annotations

import sqlite3
import subprocess
import threading
from pathlib import Path

import pytest
from click.testing import CliRunner

from harness.baseline.trend import deviations
from harness.cli import main
from harness.errors import InputError
from harness.history import show as show_history
from harness.history.revision import Revision, revision
from harness.history.store import MOST_RUNS, History
from harness.record import Summary
from harness.report.history import write_history
from tests.fakes.student import student
from tests.harness.tiny import checks_of, run_tiny

COMMIT = Revision("c0ffee" + 34 * "0", dirty=True)


@pytest.fixture(scope="module")
def summary(tmp_path_factory: pytest.TempPathFactory) -> Summary:
    wrong = student(("mu = ior_i / ior_t", "mu = ior_t / ior_i"), name="wrong")
    return run_tiny(tmp_path_factory.mktemp("run"), student(), wrong, cases=["snell", "slab"])


@pytest.fixture
def history(tmp_path: Path) -> History:
    return History(tmp_path / "deep" / "history.sqlite")


def test_a_run_is_found_again(history: History, summary: Summary, tmp_path: Path) -> None:
    assert history.add(summary, COMMIT, tmp_path) == ""
    (run,) = history.runs()
    assert (run.started, run.exit_code) == (summary.started, summary.exit_code)
    assert (run.commit, run.dirty) == (COMMIT.commit, True)
    counts = summary.counts.model_dump(by_alias=True)
    assert run.counts == {verdict: count for verdict, count in counts.items() if count}
    for case in summary.cases:
        points = history.of_case(case.id)
        assert [(p.check, p.value, p.expected, p.tolerance, p.status) for p in points] == [
            (c.id, c.value, c.expected, c.tolerance, c.status) for c in case.checks
        ]
        assert {p.version for p in points} == {"1.0"}
    assert sorted(history.cases()) == sorted(case.id for case in summary.cases)


def test_only_the_last_runs_are_asked_for(
    history: History, summary: Summary, tmp_path: Path
) -> None:
    for _ in range(4):
        history.add(summary, COMMIT, tmp_path)
    assert [run.id for run in history.runs(2)] == [3, 4]
    assert {point.run for point in history.of_case("snell-sweep", 3)} == {2, 3, 4}


def test_old_runs_are_forgotten(
    history: History, summary: Summary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert MOST_RUNS >= 1000
    monkeypatch.setattr("harness.history.store.MOST_RUNS", 2)
    for _ in range(4):
        history.add(summary, COMMIT, tmp_path)
    assert [run.id for run in history.runs()] == [3, 4]
    with sqlite3.connect(history.file) as db:
        for table in ("checks", "renderers"):
            assert db.execute(f"SELECT min(run) FROM {table}").fetchone() == (3,)
    db.close()


def test_runs_that_end_at_the_same_time_are_all_there(
    history: History, summary: Summary, tmp_path: Path
) -> None:
    said: list[str] = []

    def add() -> None:
        said.append(History(history.file).add(summary, COMMIT, tmp_path))

    threads = [threading.Thread(target=add) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert said == [""] * 8
    assert len(history.runs()) == 8
    assert len(history.of_case("snell-sweep")) == 8 * 2


def test_the_runs_before_one_are_those_of_its_folder_and_quality(
    history: History, summary: Summary, tmp_path: Path
) -> None:
    def begun(started: str, **more: object) -> Summary:
        return summary.model_copy(update={"started": started, **more})

    here, there = tmp_path / "here", tmp_path / "there"
    for one, folder in (
        (begun("3"), here), (begun("2"), there), (begun("1", quality="high"), here),
        (begun("0"), here), (begun("now"), here),
    ):  # fmt: skip
        history.add(one, COMMIT, folder)
    before = history.before(begun("now"), here)
    assert before == [deviations(summary)] * 2
    assert before[0]
    assert len(history.before(begun("0"), here)) == 1  # what came later is not before it
    assert history.before(begun("3"), here) == []
    assert len(history.before(begun("not added"), here)) == 3


def test_a_damaged_history_is_put_aside(history: History, summary: Summary, tmp_path: Path) -> None:
    history.add(summary, COMMIT, tmp_path)
    data = bytearray(history.file.read_bytes())
    data[:100] = bytes(100)
    history.file.write_bytes(data)
    with pytest.raises(InputError, match="cannot be read"):
        history.runs()
    assert "a new history begins" in history.add(summary, COMMIT, tmp_path)
    assert len(history.runs()) == 1
    assert history.file.with_name("history.sqlite.damaged").read_bytes() == data


def test_a_history_that_cannot_be_written_is_said(summary: Summary, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    said = History(tmp_path / "file" / "history.sqlite").add(summary, COMMIT, tmp_path)
    assert said.startswith("cannot write")


def test_without_a_history(history: History) -> None:
    for ask in (history.runs, history.cases, lambda: history.of_case("snell-sweep")):
        with pytest.raises(InputError, match="no history yet"):
            ask()
    assert not history.file.exists()


def test_the_page_has_a_chart_per_check_and_a_line_per_run(
    history: History, summary: Summary, tmp_path: Path
) -> None:
    for _ in range(3):
        history.add(summary, COMMIT, tmp_path)
    points = history.of_case("snell-sweep")
    curves = show_history.curves("snell-sweep", points)
    assert [curve.id for curve in curves] == ["internal_angle(inside) against truth"]
    assert {s.renderer: s.x for s in curves[0].series} == {
        "student": [1.0, 2.0, 3.0], "wrong": [1.0, 2.0, 3.0]
    }  # fmt: skip
    value = {c.renderer: c.value for c in checks_of(summary) if "inside" in c.id}
    assert [s.y for s in curves[0].series] == [[value[s.renderer]] * 3 for s in curves[0].series]
    allowed = {c.renderer: c.tolerance for c in checks_of(summary) if "inside" in c.id}
    assert len(set(allowed.values())) == 2  # each is measured by its own, the band is the widest
    assert {s.renderer: s.tolerance[0] for s in curves[0].residuals} == allowed
    assert curves[0].tolerance == [max(t for t in allowed.values() if t is not None)] * 3
    page = write_history(tmp_path, "snell-<sweep>", curves, show_history.rows(points))
    text = page.read_text()
    assert text.count('<svg class="chart"') == 1
    assert text.count("c0ffee000+") == 3
    assert "snell-&lt;sweep&gt; over past runs" in text
    assert "<script" not in text
    assert "http" not in text.replace("http-equiv", "").replace("http://www.w3.org", "")


@pytest.mark.parametrize(
    ("values", "drawn"),
    [([], ""), ([0.0, 0.0], "▁▁"), ([None, 1.0, -8.0, 8.0], " ▂██"), ([1.0, None], "█ ")],
)
def test_blocks(values: list[float | None], drawn: str) -> None:
    assert show_history.blocks(values) == drawn


# --- the command ----------------------------------------------------------------------------------


def test_the_command(
    history: History, summary: Summary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SNELLCHECK_HISTORY", str(history.file))
    monkeypatch.chdir(tmp_path)
    nothing = CliRunner().invoke(main, ["history"])
    assert nothing.exit_code == 2
    assert "no history yet" in nothing.output
    history.add(summary, COMMIT, tmp_path)
    listed = CliRunner().invoke(main, ["history"])
    assert listed.exit_code == 0
    shown = CliRunner().invoke(main, ["history", "snell-sweep", "-r", "student"])
    assert shown.exit_code == 0, shown.output
    assert (tmp_path / "reports" / "history-snell-sweep.html").is_file()
    wrong = CliRunner().invoke(main, ["history", "snell-swep"])
    assert wrong.exit_code == 2
    assert "did you mean snell-sweep" in wrong.output


# --- revisions ------------------------------------------------------------------------------------


def test_the_revision_of_a_folder(tmp_path: Path) -> None:
    assert revision(tmp_path) == Revision()
    identity = ["-c", "user.name=a", "-c", "user.email=a@example.com"]
    for arguments in (["init", "-q"], [*identity, "commit", "-q", "--allow-empty", "-m", "one"]):
        subprocess.run(["git", "-C", str(tmp_path), *arguments], check=True)
    found = revision(tmp_path)
    assert len(found.commit) == 40
    assert not found.dirty
    (tmp_path / "file").write_text("")
    subprocess.run(["git", "-C", str(tmp_path), "add", "file"], check=True)
    assert revision(tmp_path).dirty
