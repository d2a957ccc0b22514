"""Approving and checking on the command line: what fails, what is refused, what is written."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from harness import cli, imagefile, record
from harness.baseline.document import parse_baseline, write_baseline
from harness.errors import RendererMissing
from harness.history.revision import Revision
from harness.history.store import History
from harness.record import BaselineState, Verdict
from harness.run import run as run_cases
from tests.fakes.student import student
from tests.harness.test_cli import REGISTERED, Invoke, invoke
from tests.harness.test_run import Absent
from tests.harness.tiny import SCENES, checks_of, prepared
from tests.harness.unpack import pixels, read_pack

__all__ = ["invoke"]  # a fixture

SLAB = "slab-offset[thickness=1]"


@pytest.fixture(scope="module")
def approved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run of two families by two students, one of them approved."""
    folder = tmp_path_factory.mktemp("approved")
    renderers = [student(), student(name="tracer")]
    run_cases(prepared("slab", "ball"), renderers, renderers[1], folder / "out")
    options = ["-r", "student", "--run", str(folder / "out"), "--reason", "first", "--by", "me"]
    options += ["--baseline", str(folder / "references")]
    done = CliRunner().invoke(cli.main, ["approve", "slab", "ball", *options])
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture
def work(invoke: Invoke, approved: Path, tmp_path: Path) -> Invoke:
    """The command line in a copy of that folder."""
    shutil.copytree(approved, tmp_path, dirs_exist_ok=True)
    return invoke


@pytest.fixture
def unapproved(work: Invoke) -> Invoke:
    """The same without the approval."""
    shutil.rmtree("references")
    return work


def run(invoke: Invoke, out: str, renderer: str = "student tracer", *more: str) -> int:
    names = [part for name in renderer.split() for part in ("-r", name)]
    options = ("--scenes", SCENES, "--out", out, *more)
    return invoke("run", "slab", "ball", *names, *options).exit_code


def swap(name: str, monkeypatch: pytest.MonkeyPatch, *faults: tuple[str, str], **more: str) -> None:
    """From now on `name` is a student with faults."""
    monkeypatch.setitem(REGISTERED, name, lambda: student(*faults, name=name))


def states(folder: str) -> set[BaselineState]:
    summary = record.read_summary(Path(folder) / "summary.json")
    return {check.baseline.state for check in checks_of(summary) if check.baseline}


def baselines() -> list[Path]:
    return sorted(Path("references").rglob("*.json"))


def test_what_has_not_changed_is_the_same(work: Invoke) -> None:
    result = work("check", "-r", "student", "--run", "out")
    assert result.exit_code == 0, result.output
    assert states("out") == {BaselineState.SAME}
    summary = record.read_summary(Path("out") / "summary.json")
    assert summary.baseline is not None
    assert not summary.baseline.failed
    cases = [record.read_case(path) for path in (Path("out") / "records").iterdir()]
    assert {c.baseline.state for case in cases for c in case.checks if c.baseline} == states("out")


def test_the_report_of_a_check_has_the_approved_pictures(work: Invoke) -> None:
    """To be chosen in the viewer, to half a step of sixteen bits; and only of what was approved."""
    for _ in range(2):
        assert work("check", "ball", "-r", "student", "--run", "out").exit_code == 0
        (path,) = Path("out/records").glob("ball*.json")
        known = record.read_case(path)
        packed = read_pack(Path("out") / known.other_packs["baseline: "])
        assert [image["name"] for image in packed["images"]] == ["student"]
        (image,) = next(r for r in known.runs if r.name == "student").images
        linear, _ = imagefile.read(Path("out") / image.path)
        assert np.abs(pixels(packed, 0) - linear).max() <= linear.max() / 65535
    page = next(Path("out/cases").glob("ball*.html")).read_text("utf-8")
    assert '"prefix":"baseline: ","aside":true' in page
    next(Path("references").rglob("ball*.png")).unlink()
    assert work("check", "ball", "-r", "student", "--run", "out").exit_code == 0
    assert record.read_case(path).other_packs == {}


def test_a_bug_regresses_and_fails(work: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    swap("student", monkeypatch, ("mu = ior_i / ior_t", "mu = ior_t / ior_i"))
    run(work, "buggy")
    result = work("check", "--run", "buggy")
    assert result.exit_code == 1
    assert "regressed" in result.output
    assert BaselineState.REGRESSED in states("buggy")


def test_a_deliberate_change_is_approved_and_remembered(
    work: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    swap("student", monkeypatch, ("mu = ior_i / ior_t", "mu = 1.001 * ior_i / ior_t"))
    run(work, "changed")
    assert work("check", SLAB, "--run", "changed").exit_code == 1
    before = {path: path.read_bytes() for path in baselines()}
    options = ("-r", "student", "--run", "changed", "--reason", "a new index", "--by", "me")
    result = work("approve", SLAB, *options)
    assert result.exit_code == 0
    assert "regressed" in result.output  # it shows what changes
    assert work("check", SLAB, "--run", "changed").exit_code == 0
    assert work("check", "--run", "changed").exit_code == 1  # the other slab was not approved
    (changed,) = [path for path in baselines() if path.read_bytes() != before[path]]
    data = json.loads(changed.read_text())
    assert (data["case"], data["approval"]["reason"]) == (SLAB, "a new index")
    assert [earlier["reason"] for earlier in data["earlier"]] == ["first"]


def test_approving_again_what_is_approved_writes_nothing(work: Invoke) -> None:
    before = {path: path.stat().st_mtime_ns for path in baselines()}
    options = ("-r", "student", "--run", "out", "--reason", "again", "--by", "me")
    result = work("approve", "slab", "ball", *options)
    assert result.exit_code == 0
    assert "nothing changes" in result.output
    assert {path: path.stat().st_mtime_ns for path in baselines()} == before


def test_a_dry_run_writes_nothing(unapproved: Invoke) -> None:
    assert (
        unapproved("approve", "slab", "--run", "out", "--reason", "x", "--dry-run").exit_code == 0
    )
    assert not Path("references").exists()


@pytest.mark.parametrize("renderer", ["crashing", "absent", "mirrored"])
def test_errors_are_not_approved(renderer: str, invoke: Invoke) -> None:
    run(invoke, "out", f"student {renderer}")
    options = ("--run", "out", "--reason", "x", "--by", "me", "-r", renderer, "-r", "student")
    result = invoke("approve", "slab", *options)
    assert result.exit_code == 2
    assert "cannot be approved" in result.output
    assert not Path("references").exists()  # not even those that could be


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["slab"], "say why"),
        (["slab", "--reason", "  "], "say why"),
        (["slabs", "--reason", "x"], "did you mean"),
        (["slab", "--reason", "x", "-r", "povray"], "not a renderer of the run"),
        (["--reason", "x"], "nothing to approve"),
        (["slab", "--reason", "x", "--from", "none.json"], "both cases and --from"),
        (["--reason", "x", "--from", "none.json"], "cannot be read"),
    ],
)
def test_how_not_to_approve(arguments: list[str], said: str, unapproved: Invoke) -> None:
    result = unapproved("approve", *arguments, "--run", "out", "--by", "me")
    assert result.exit_code == 2
    assert said in result.output
    assert not Path("references").exists()


def test_choices_made_on_the_page(unapproved: Invoke) -> None:
    choices = {
        "schema": "snellcheck-approvals/1",
        "approve": [
            {"case": SLAB, "renderer": "student", "reason": "of its own"},
            {"case": "ball-picture", "renderer": "student"},
        ],
    }
    Path("choices.json").write_text(json.dumps(choices))
    options = ("--run", "out", "--reason", "for all", "--by", "me")
    assert unapproved("approve", "--from", "choices.json", *options).exit_code == 0
    reasons = {json.loads(p.read_text())["case"]: json.loads(p.read_text())["approval"]["reason"]
               for p in baselines()}  # fmt: skip
    assert reasons == {SLAB: "of its own", "ball-picture": "for all"}


def test_git_says_who_and_where(
    unapproved: Invoke, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", str(tmp_path / "none"))
    monkeypatch.setenv("GIT_CONFIG_SYSTEM", str(tmp_path / "none"))
    nobody = unapproved("approve", SLAB, "--run", "out", "--reason", "x")
    assert nobody.exit_code == 2
    assert "--by" in nobody.output
    git("init", "--quiet")
    git("config", "user.name", "A. Person")
    git("config", "user.email", "a@example.org")
    git("commit", "--quiet", "--allow-empty", "--message", "one")
    assert unapproved("approve", SLAB, "--run", "out", "--reason", "x").exit_code == 0
    approval = json.loads(baselines()[0].read_text())["approval"]
    assert approval["by"] == "A. Person <a@example.org>"
    assert approval["commit"] == git("rev-parse", "HEAD")


def git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()


# --- what is missing or broken --------------------------------------------------------------------


def test_what_was_approved_and_is_not_in_the_run_fails(work: Invoke) -> None:
    work("run", "ball", "-r", "student", "-r", "tracer", "--scenes", SCENES, "--out", "less")
    result = work("check", "--run", "less")
    assert result.exit_code == 1
    assert f"missing {SLAB} student: the case is not in the run" in result.output
    assert work("check", "ball", "--run", "less").exit_code == 0
    result = work("check", "--partial", "--run", "less")
    assert result.exit_code == 0, result.output
    assert "missing" not in result.output


def test_a_part_of_a_run_must_have_its_renderers(work: Invoke) -> None:
    work("run", "ball", "-r", "tracer", "--scenes", SCENES, "--out", "less")
    result = work("check", "--partial", "--run", "less")
    assert result.exit_code == 1
    assert "missing" in result.output


def test_a_renderer_that_is_gone_fails(work: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(REGISTERED, "student", lambda: Absent(RendererMissing("gone"), "student"))
    run(work, "out", "student", "--no-stored")
    result = work("check", "--run", "out")
    assert result.exit_code == 1
    assert states("out") == {BaselineState.MISSING}


def test_nothing_to_compare_with_fails(unapproved: Invoke) -> None:
    Path("references").mkdir()
    result = unapproved("check", "--run", "out")
    assert result.exit_code == 1
    assert "never approved" in result.output


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda data: data[: len(data) // 2], "not a valid baseline"),
        (lambda data: b"", "not a valid baseline"),
        (lambda data: data.replace(b'"pass"', b'"skip"'), "was not measured"),
        (lambda data: data.replace(b"snellcheck-baseline/1", b"snellcheck-baseline/9"), "schema"),
        (lambda data: data.replace(b'"case":', b'"more": 1, "case":'), "more"),
        (lambda data: b"\xff" + data, "not a valid baseline"),
        (lambda data: data.replace(b'"reason": "first"', b'"reason": "fine"'), "has changed since"),
    ],
)
def test_an_unreadable_baseline_fails(damage: object, said: str, work: Invoke) -> None:
    path = baselines()[-1]
    path.write_bytes(damage(path.read_bytes()))  # type: ignore[operator]
    result = work("check", "--run", "out")
    assert result.exit_code == 1
    assert said in result.output.replace("\n", "")
    assert result.output.count(path.name) == 1


def test_a_changed_scene_makes_its_baseline_stale(work: Invoke, tmp_path: Path) -> None:
    changed = tmp_path / "scenes" / "slab"
    changed.mkdir(parents=True)
    text = (SCENES / "slab" / "offset.toml").read_text()
    (changed / "offset.toml").write_text(text.replace("ior = 1.5", "ior = 1.6"))
    assert "ior = 1.6" in (changed / "offset.toml").read_text()
    work("run", "slab", "-r", "student", "--scenes", tmp_path / "scenes", "--out", "out")
    assert work("check", "slab", "--run", "out").exit_code == 1
    assert states("out") == {BaselineState.STALE}


# --- other baselines ------------------------------------------------------------------------------


def test_an_earlier_run_is_a_baseline(work: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    swap("student", monkeypatch, ("mu = ior_i / ior_t", "mu = 1.001 * ior_i / ior_t"))
    run(work, "buggy")
    assert work("check", SLAB, "--run", "buggy", "--baseline", "out").exit_code == 1
    result = work("check", SLAB, "--run", "buggy", "--baseline", "buggy")
    assert result.exit_code == 0, result.output


def test_a_revision_of_git_is_a_baseline(work: Invoke) -> None:
    git("init", "--quiet")
    git("config", "user.name", "me")
    git("config", "user.email", "me@example.org")
    git("add", "references")
    git("commit", "--quiet", "--message", "approved")
    git("tag", "v1")
    for path in baselines():
        path.unlink()
    assert work("check", "--run", "out").exit_code == 1
    assert work("check", "--run", "out", "--baseline", "v1").exit_code == 0
    for wrong in ("v2", "--output=x", "v1:references", "a b"):
        result = work("check", "--run", "out", f"--baseline={wrong}")
        assert result.exit_code == 2
        assert "neither a folder nor a revision" in result.output
        assert "knows no such commit" in result.output


def test_why_git_knows_no_revision_is_told(work: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "not a git repository" in work("check", "--run", "out", "--baseline", "v1").output
    git("init", "--quiet", "source")
    source = Path("source").absolute()
    git("-C", str(source), "-c", "user.name=me", "-c", "user.email=me@example.org",
        "commit", "--quiet", "--allow-empty", "--message", "one")  # fmt: skip
    git("clone", "--quiet", "--depth=1", source.as_uri(), "clone")
    monkeypatch.chdir("clone")
    result = work("check", "--run", "../out", "--baseline", "HEAD~1")
    assert "this clone is shallow; `git fetch --unshallow`" in result.output
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")
    result = work("check", "--run", "../out", "--baseline", "HEAD")
    assert "dubious ownership" in result.output
    assert "git config --global --add safe.directory" in result.output
    monkeypatch.setenv("PATH", "")
    result = work("check", "--run", "../out", "--baseline", "HEAD")
    assert "git cannot be run" in result.output


def slid(count: int) -> Iterator[record.Summary]:
    """Summaries of the runs before that in `out`, a check of which slides towards what it is."""
    summary = record.read_summary(Path("out") / "summary.json")
    index = next(k for k, case in enumerate(summary.cases) if case.id == SLAB)
    case = summary.cases[index]
    first = case.checks[0]
    assert first.value is not None
    assert first.tolerance is not None
    for k in range(count):
        value = first.value - (count - k) * 0.01 * first.tolerance
        slid = first.model_copy(update={"value": value})
        started = f"2026-11-{k + 1:02}T00:00:00+00:00"
        cases = [case.model_copy(update={"checks": [slid, *case.checks[1:]]})]
        yield summary.model_copy(update={"cases": cases, "started": started})


def test_a_slide_over_runs_is_reported_though_each_run_is_fine(work: Invoke) -> None:
    for k, earlier in enumerate(slid(9)):  # ten runs in a row, that in `out` last
        record.write(earlier, Path(f"history/{k}/summary.json"))
    result = work("check", "--run", "out", "--history", "history")
    assert result.exit_code == 0
    assert "drifting" in result.output
    assert record.read_summary(Path("out") / "summary.json").baseline.runs == 10  # type: ignore[union-attr]


def test_slides_are_looked_for_in_the_history_as_runs_came(
    work: Invoke, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Whatever the clock said: here it goes back by a day from run to run."""
    history = History(tmp_path / "past.sqlite")
    monkeypatch.setenv("SNELLCHECK_HISTORY", str(history.file))
    for k, earlier in enumerate(slid(9)):
        turned = earlier.model_copy(update={"started": f"2026-10-{30 - k:02}T00:00:00+00:00"})
        assert history.add(turned, Revision("", dirty=False), Path("out")) == ""
    result = work("check", "--run", "out")
    assert result.exit_code == 0
    assert "drifting" in result.output
    history.file.write_bytes(b"no database at all" * 100)
    result = work("check", "--run", "out")
    assert result.exit_code == 0
    assert "slow slides are not looked for" in result.output
    monkeypatch.setenv("SNELLCHECK_HISTORY", str(tmp_path / "none.sqlite"))
    assert "there are 1" in work("check", "--run", "out").output


# --- standing in for what is missing --------------------------------------------------------------


def test_stored_results_stand_in_for_a_missing_renderer(
    work: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(REGISTERED, "student", lambda: Absent(RendererMissing("gone"), "student"))
    monkeypatch.setattr(
        "harness.renderers.registry.available",
        lambda: {name: REGISTERED[name] for name in ("student", "tracer")},
    )
    result = work("run", "slab", "ball", "--scenes", SCENES, "--out", "out")
    assert result.exit_code == 3, result.output  # it was asked for, and did not run
    assert "stored results of 1.0" in result.output.replace("\n", " ")
    summary = record.read_summary(Path("out") / "summary.json")
    assert summary.renderers["student"].status == "stored"
    mine = [check for check in checks_of(summary, "student") if check.against == "truth"]
    assert {check.status for check in mine} == {Verdict.SKIP}  # what is not measured is no pass
    assert all(check.stored == ["student"] for check in mine)
    assert all("it was pass then" in check.reason for check in mine)
    assert all(check.value is not None for check in mine)
    pairs = [c for c in checks_of(summary) if {c.renderer, c.against} == {"student", "tracer"}]
    assert len(pairs) == 3  # its stored picture against the live one
    stored = next(
        ran.stored
        for ran in record.read_case(next((Path("out") / "records").glob("ball*"))).runs
        if ran.name == "student"
    )
    assert stored is not None
    assert (stored.by, stored.reason, len(stored.sha256)) == ("me", "first", 64)
    # What is stored is not measured: it cannot be approved, and does not count in a check.
    again = work("approve", "slab", "--run", "out", "-r", "student", "--reason", "x", "--by", "me")
    assert "stored ones" in again.output
    assert work("check", "-r", "student", "--run", "out").exit_code == 1


def test_who_asks_for_a_renderer_by_name_wants_it_live(
    work: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(REGISTERED, "student", lambda: Absent(RendererMissing("gone"), "student"))
    assert run(work, "out", "student tracer") == 3


def test_who_brings_a_renderer_can_do_without_the_others(
    work: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is stored of them is enough to hold one's own against; one's own must run."""
    registry = "harness.renderers.registry"
    gone = {"student": lambda: Absent(RendererMissing("gone"), "student")}
    monkeypatch.setattr(f"{registry}.available", lambda: gone)
    monkeypatch.setattr(f"{registry}.command_renderer", lambda _: student(name="mine"))
    options = ("ball", "--scenes", SCENES, "--out", "out")
    result = work("run", *options, "--renderer-command", "mine {scene} {output}")
    assert result.exit_code == 0, result.output
    checks = checks_of(record.read_summary(Path("out") / "summary.json"))
    pairs = [check for check in checks if {check.renderer, check.against} == {"student", "mine"}]
    assert {check.status for check in pairs} == {Verdict.PASS}
    monkeypatch.setattr(f"{registry}.available", dict)
    monkeypatch.setattr(f"{registry}.command_renderer", lambda _: gone["student"]())
    result = work("run", *options, "--renderer-command", "student {scene} {output}")
    assert result.exit_code == 3, result.output


def test_a_live_run_wins(work: Invoke) -> None:
    run(work, "again")
    assert all(
        not check.stored for check in checks_of(record.read_summary(Path("again/summary.json")))
    )


def test_a_wrong_renderer_fails_against_a_stored_picture(
    work: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(REGISTERED, "student", lambda: Absent(RendererMissing("gone"), "student"))
    assert run(work, "out", "student inverted") == 1
    summary = record.read_summary(Path("out") / "summary.json")
    pairs = [c for c in checks_of(summary) if {c.renderer, c.against} == {"student", "inverted"}]
    assert Verdict.FAIL in {check.status for check in pairs}


@pytest.mark.parametrize("harm", ["scene", "picture", "gone"])
def test_stale_and_damaged_stored_results_are_refused(
    harm: str, work: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = next(path for path in baselines() if "ball" in path.name)
    picture = file.with_suffix(".png")
    if harm == "scene":
        approved = parse_baseline(file.read_bytes(), file).baseline
        write_baseline(approved.model_copy(update={"scene_fingerprint": "0" * 64}), file)
    elif harm == "picture":
        picture.write_bytes(picture.read_bytes()[:-1] + b"x")
    else:
        picture.unlink()
    monkeypatch.setitem(REGISTERED, "student", lambda: Absent(RendererMissing("gone"), "student"))
    assert run(work, "out", "student tracer") == 3
    summary = record.read_summary(Path("out") / "summary.json")
    ball = next(case for case in summary.cases if case.id == "ball-picture")
    said = [check.reason for check in ball.checks if check.status is Verdict.SKIP]
    assert any(
        "scene has changed" in s or "hash differs" in s or "cannot be read" in s for s in said
    )
