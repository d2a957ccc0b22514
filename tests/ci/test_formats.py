"""What CI systems are told: the same of every run, and nothing of it can be mistaken for markup."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from itertools import takewhile
from pathlib import Path

import pytest
from click.testing import CliRunner

from harness import cli, record
from harness.baseline.run_folder import RunFolder, read_run
from harness.ci.findings import findings
from harness.ci.github import line_of, workflow_commands
from harness.ci.junit import junit
from harness.ci.markdown import PICTURE, markdown, plain
from harness.errors import RendererFailed
from harness.record import AgainstBaseline, BaselineState, Check, Verdict
from harness.report import write_report
from harness.report.checks import check_view
from harness.run import run
from tests.fakes import FakeRenderer
from tests.fakes.student import CAPABILITIES, student
from tests.harness.tiny import SCENES, prepared

INVERTED = ("mu = ior_i / ior_t", "mu = ior_t / ior_i")
HOSTILE = '"><script>&\n::error::x\x1b[31m%0A| `@you` [a](b) \ud800'.encode(
    "utf-8", "replace"
).decode()


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """A run of a right, a wrong and a crashing renderer."""
    out = tmp_path_factory.mktemp("run")
    crash = FakeRenderer("crashing", error=RendererFailed("boom"), capabilities=CAPABILITIES)
    renderers = [student(), student(INVERTED, name="inverted"), crash]
    run(prepared("slab", "snell"), renderers, renderers[0], out)
    write_report(out)
    return read_run(out)


def with_reason(finished: RunFolder, reason: str) -> RunFolder:
    """The run with that reason given for each failure."""

    def said(check: Check) -> Check:
        return check.model_copy(update={"reason": reason}) if check.reason else check

    cases = [
        case.model_copy(update={"checks": [said(c) for c in case.checks]})
        for case in finished.summary.cases
    ]
    summary = finished.summary.model_copy(update={"cases": cases})
    return RunFolder(finished.folder, summary, finished.records)


def of_verdict(finished: RunFolder, verdict: Verdict) -> int:
    return sum(check.status is verdict for case in finished.summary.cases for check in case.checks)


def test_junit_counts_as_the_summary_does(finished: RunFolder) -> None:
    root = ET.fromstring(junit(finished))
    tests = sum(len(case.checks) for case in finished.summary.cases)
    assert root.get("tests") == str(tests) == str(len(root.findall(".//testcase")))
    assert root.get("failures") == str(of_verdict(finished, Verdict.FAIL)) != "0"
    assert root.get("errors") == str(of_verdict(finished, Verdict.ERROR)) != "0"
    suites = root.findall("testsuite")
    assert [suite.get("name") for suite in suites] == [c.id for c in finished.summary.cases]
    failure = root.find(".//failure")
    assert failure is not None
    assert failure.text is not None
    assert "expected" in failure.text
    assert "page: " in failure.text


def test_annotations_stand_at_the_check_in_the_scene_file(finished: RunFolder) -> None:
    commands = list(workflow_commands(finished))
    assert commands
    for command in commands:
        assert re.match(r"::(error|notice) ", command)
        assert "\n" not in command
    for finding in findings(finished):
        line = line_of(finding.scene, finding.check)
        assert line is not None
        text = Path(finding.scene).read_text(encoding="utf-8").splitlines()
        assert text[line - 1] == "[[checks]]"
        assert f'observable = "{finding.check.observable}"' in text[line : line + 4]


def test_annotations_are_few_and_say_what_is_left_out(finished: RunFolder) -> None:
    crowd = [
        case.model_copy(update={"id": f"{case.id}-{k}"})
        for case in finished.summary.cases
        for k in range(20)
    ]
    records = {
        case.id: (
            finished.records[case.id.rpartition("-")[0]][0].model_copy(
                update={"scene_path": f"{case.id}.toml"}
            ),
            "",
        )
        for case in crowd
    }
    many = RunFolder(finished.folder, finished.summary.model_copy(update={"cases": crowd}), records)
    commands = list(workflow_commands(many))
    assert len(commands) == 11
    assert re.search(r"::notice .*::\d+ more", commands[-1])


def test_markdown_names_what_is_red_and_who(finished: RunFolder) -> None:
    text = markdown(finished)
    red = len(list(findings(finished)))
    assert f"❌ Refraction: {red} of" in text
    assert "| slab\\-offset" in text
    assert "**crashing** fails its preflight" in text


def lines_of(text: str, start: str) -> list[list[str]]:
    """The cells of a table's lines, from the one below the rule under the head `start`."""
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(start)) + 2
    table = takewhile(lambda line: line.startswith("|"), lines[first:])
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table]


def test_markdown_tells_failures_that_are_alike_once_and_of_each_who_is_off(
    finished: RunFolder,
) -> None:
    told = lines_of(markdown(finished), "| who is off")
    assert {line[0] for line in told[:2]} == {"inverted", "crashing"}
    assert len({(line[0], line[1], line[2].split(":")[0]) for line in told}) == len(told)
    more = sum(int(line[4] or 0) for line in told)
    assert len(told) + more == len(list(findings(finished)))


def test_markdown_has_the_figures_of_the_pictures_that_differ_most(tmp_path: Path) -> None:
    renderers = [student(), student(name="also"), student(INVERTED, name="inverted")]
    run(prepared("ball"), renderers, renderers[0], tmp_path)
    write_report(tmp_path)
    finished = read_run(tmp_path)
    (line,) = lines_of(
        markdown(finished), "| case | pictures"
    )  # the pairs of the wrong one are two
    assert "inverted" in line[1]
    (case,) = finished.summary.cases
    pair = [c for c in case.checks if f"{c.renderer} − {c.against}" == line[1]]
    assert pair
    for name, figure in zip(PICTURE, line[2:], strict=True):
        shown = [check_view(check) for check in pair if check.observable == name]
        assert figure == "–" or all(plain(view.main) in figure for view in shown)
        for view in shown:
            assert figure.startswith("**") is (view.check.status is Verdict.FAIL)


def test_markdown_stays_short_however_much_is_red(finished: RunFolder) -> None:
    reasons = iter(range(10**6))
    cases = [
        case.model_copy(
            update={
                "checks": [
                    c.model_copy(update={"reason": f"{next(reasons)} {'x' * 99}", "status": status})
                    for c in case.checks
                    for status in (Verdict.ERROR,) * 500
                ]
            }
        )
        for case in finished.summary.cases
    ]
    summary = finished.summary.model_copy(update={"cases": cases})
    text = markdown(RunFolder(finished.folder, summary, finished.records))
    assert next(reasons) > 5000
    assert len(text.encode()) < 20_000


@pytest.mark.parametrize("verdicts", [{Verdict.FAIL}, set()])
def test_what_was_approved_is_not_red(verdicts: set[Verdict], finished: RunFolder) -> None:
    """With a baseline its states decide, in every format."""
    same = AgainstBaseline(state=BaselineState.SAME, status=Verdict.FAIL)
    worse = AgainstBaseline(state=BaselineState.REGRESSED, reason="it was better")
    cases = [
        case.model_copy(
            update={
                "checks": [
                    c.model_copy(update={"baseline": worse if c.status in verdicts else same})
                    for c in case.checks
                ]
            }
        )
        for case in finished.summary.cases
    ]
    told = RunFolder(
        finished.folder, finished.summary.model_copy(update={"cases": cases}), finished.records
    )
    expected = sum(of_verdict(finished, v) for v in verdicts)
    root = ET.fromstring(junit(told))
    assert int(root.get("failures", "")) + int(root.get("errors", "")) == expected
    assert bool(list(workflow_commands(told))) == bool(expected)


def test_nothing_that_a_renderer_says_becomes_markup(finished: RunFolder) -> None:
    hostile = with_reason(finished, HOSTILE)
    root = ET.fromstring(junit(hostile))  # well-formed
    assert "\x1b" not in ET.tostring(root, encoding="unicode")
    for command in workflow_commands(hostile):
        assert "\n" not in command
        assert command.count("::error") <= 2  # the second is data, inside the one line
        assert not command.startswith("::error::")
    text = markdown(hostile)
    assert "<script>" not in text
    assert "\n::error" not in text
    assert "](b)" not in text
    for line in text.splitlines():
        assert not re.search(r"(?<!\\)`@you", line)


def test_plain_text_stays_what_it_is() -> None:
    assert plain("a|b\n*c*") == "a\\|b \\*c\\*"


@pytest.mark.parametrize("target", ["junit", "markdown", "github"])
def test_the_command_writes_each_format(target: str, finished: RunFolder, tmp_path: Path) -> None:
    options = ["export", target, "--run", str(finished.folder)]
    shown = CliRunner().invoke(cli.main, options)
    assert shown.exit_code == 0
    file = tmp_path / "deep" / "file"
    assert CliRunner().invoke(cli.main, [*options, "--out", str(file)]).exit_code == 0
    assert file.read_text(encoding="utf-8") == shown.output


def test_a_run_that_is_not_there(tmp_path: Path) -> None:
    done = CliRunner().invoke(cli.main, ["export", "junit", "--run", str(tmp_path / "none")])
    assert done.exit_code == 2
    assert "there is no run" in done.output


def test_scenes_are_where_records_say(finished: RunFolder) -> None:
    for case in finished.summary.cases:
        found = record.read_case(next((finished.folder / "records").glob(f"{case.id[:4]}*")))
        assert Path(found.scene_path).is_relative_to(SCENES) or Path(found.scene_path).is_file()
