"""Reports to hand on: one file with everything in it, and two runs side by side."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from harness import record as records
from harness.baseline.two_runs import BEFORE, two_runs
from harness.cli import main
from harness.errors import InputError
from harness.record import BaselineState
from harness.renderers.registry import create
from harness.report import write_report
from harness.report.single import write_single
from tests.fakes.student import student
from tests.harness.tiny import run_tiny

DENSE = ("mu = ior_i / ior_t", "mu = ior_i / (1.01 * ior_t)")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A run with a good student, and one with a student whose glass is too dense."""
    tracer = create("tracer")
    folders = []
    for faults in ((), (DENSE,)):
        root = tmp_path_factory.mktemp("run")
        run_tiny(root, tracer, student(*faults), cases=["slab*", "ball*"], helper=tracer)
        folders.append(root)
    return folders[0], folders[1]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


# --- two runs -------------------------------------------------------------------------------------


def test_a_comparison_says_what_became_worse(runs: tuple[Path, Path], tmp_path: Path) -> None:
    before = [contents(run) for run in runs]
    found = two_runs(*runs, tmp_path / "out")
    assert found.failed
    assert found.counts[BaselineState.REGRESSED]
    index = write_report(tmp_path / "out").read_text("utf-8")
    assert "Since the baseline" in index
    assert 'data-change="regressed"' in index
    for path in sorted((tmp_path / "out" / "records").glob("*.json")):
        record = records.read_case(path)
        assert (tmp_path / "out" / record.other_packs[BEFORE]).is_file()
        states = {c.renderer: c.baseline.state for c in record.checks if c.baseline}
        assert states["tracer"] in (BaselineState.SAME, BaselineState.REGRESSED)
    assert [contents(run) for run in runs] == before


def test_a_run_compared_with_itself_is_the_same(runs: tuple[Path, Path], tmp_path: Path) -> None:
    found = two_runs(runs[0], runs[0], tmp_path / "out")
    assert not found.failed
    assert set(found.counts) == {BaselineState.SAME}


def test_a_comparison_replaces_an_earlier_one_and_nothing_else(
    runs: tuple[Path, Path], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    two_runs(*runs, out)
    (out / "old").write_text("old")
    two_runs(*runs, out)
    assert not (out / "old").exists()
    for taken in (runs[0], runs[1]):
        with pytest.raises(InputError, match="folder of its own"):
            two_runs(*runs, taken)
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="not empty"):
        two_runs(*runs, mine)
    assert contents(mine) == {"letter.txt": b"dear"}


def test_the_command_compares_and_refuses_what_is_no_run(
    runs: tuple[Path, Path], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = CliRunner().invoke(main, ["report", *map(str, runs), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert (out / "index.html").is_file()
    for wrong in (["report", str(tmp_path), str(runs[0])], ["report", str(runs[0]), "--out", "x"]):
        failed = CliRunner().invoke(main, wrong)
        assert failed.exit_code == 2
        assert "Traceback" not in failed.output


# --- one file -------------------------------------------------------------------------------------


def test_a_single_file_needs_nothing_else(runs: tuple[Path, Path], tmp_path: Path) -> None:
    written = write_single(runs[1], tmp_path / "report.html")
    text = written.path.read_text("utf-8")
    assert written.size == len(text.encode())
    assert not written.without_pixels
    assert text.count("<template ") == 3
    assert text.count("data-pack=") == 3
    for source in re.findall(r'<(?:img|script|link)\b[^>]*?(?:src|href)="([^"]*)"', text):
        assert source.startswith("data:image/webp;base64,")
    for target in re.findall(r'<a [^>]*?href="([^"]*)"', text):
        assert re.fullmatch(r"(#.*|(\.\./)?(cases/)?[^/:]+\.html(#.*)?)", target), target


def test_a_single_file_admits_its_own_script_and_style_only(
    runs: tuple[Path, Path], tmp_path: Path
) -> None:
    text = write_single(runs[1], tmp_path / "report.html").path.read_text("utf-8")
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)
    assert policy
    assert "unsafe" not in policy[1]
    for tag in ("style", "script"):
        (body,) = re.findall(rf"<{tag}>(.*?)</{tag}>", text, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in policy[1]


def test_without_room_pixels_stay_out_and_are_named(
    runs: tuple[Path, Path], tmp_path: Path
) -> None:
    written = write_single(runs[1], tmp_path / "report.html", room=0)
    assert len(written.without_pixels) == 3
    assert "data-pack=" not in written.path.read_text("utf-8").partition("<template")[2]
    out = tmp_path / "x.html"
    arguments = ["report", str(runs[1]), "--single-file", "--out", str(out), "--pixels", "0"]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 0, done.output
    assert "3 cases have pictures only" in done.output
