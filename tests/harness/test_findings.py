"""The findings page: made from records, and up to date in what it lists."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from harness.data import scenes_root
from harness.record import CaseRecord, Check, RendererRun, Verdict
from harness.report.findings import Sample, findings, heading, markdown
from harness.scene.load import load_cases, scene_files

PAGE = Path(__file__).parents[2] / "docs" / "findings.md"


def check(value: float, status: Verdict, probe: str = "through") -> Check:
    return Check(
        id=f"exit_point({probe})/ember/truth", renderer="ember", against="truth",
        observable="exit_point", value=value, expected=0.0, tolerance=1e-6, unit="units",
        status=status, reason="", cause="rays start beside the surface",
    )  # fmt: skip


def record(case: str, *checks: Check) -> CaseRecord:
    return CaseRecord(
        id=case, case=case, family="f", title="t", scene_sha256="", scene_file="f/t.toml",
        quality="normal", snellcheck_version="1", started="", wall_s=0.0, status=Verdict.KNOWN,
        runs=[RendererRun(name="ember", version="2.0", status=Verdict.KNOWN)], checks=list(checks),
    )  # fmt: skip


def test_what_is_known_is_listed_by_cause_with_its_largest_sizes() -> None:
    records = [
        record("a", check(1e-3, Verdict.KNOWN), check(4e-3, Verdict.KNOWN, "through~turned")),
        record("b", check(2e-3, Verdict.KNOWN)),
        record("c", check(9.0, Verdict.FAIL), check(0.0, Verdict.PASS)),
    ]
    (found,) = findings(records)
    assert (found.renderer, found.version, len(found.shown)) == ("ember", "2.0", 3)
    page = markdown(
        [found], {"exit_point": "units"}, lambda _: Sample("b", "pov", "sphere {}\n", "run it.")
    )
    assert "## ember: rays start beside the surface" in page
    assert "ember 2.0, in 3 checks of 2 cases." in page
    rows = [line for line in page.splitlines() if line.startswith("| `exit_point`")]
    assert [row.split("|")[-2].strip() for row in rows] == ["0.004 units", "0.002 units"]
    assert "```pov\nsphere {}\n```" in page


def test_without_findings_the_page_says_nothing_of_any() -> None:
    assert findings([record("a", check(0.0, Verdict.PASS))]) == []
    assert "## " not in markdown([], {}, lambda _: None)


def documented() -> dict[str, float]:
    """Heading of every deviation that a scene documents, and the least size that it says."""
    found: dict[str, float] = {}
    for path in scene_files(scenes_root()):
        for case in load_cases(path):
            for spec in case.model.checks:
                for known in spec.known:
                    title = heading(known.renderer, known.cause)
                    found[title] = max(found.get(title, 0.0), known.at_least)
    return found


def test_the_page_lists_what_the_scenes_document() -> None:
    """`make findings` writes it; a deviation that may be absent (size from 0 on) may be missing."""
    titles = set(re.findall(r"^## (.*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE))
    scenes = documented()
    assert titles <= set(scenes), "run make findings"
    assert {title for title, least in scenes.items() if least > 0} <= titles, "run make findings"


@pytest.mark.povray
def test_scenes_on_the_page_run_in_povray(tmp_path: Path) -> None:
    scenes = re.findall(r"```pov\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert scenes
    for k, text in enumerate(scenes):
        file = tmp_path / f"{k}.pov"
        file.write_text(text, encoding="utf-8")
        done = subprocess.run(
            ["povray", f"+I{file.name}", "+W32", "+H32", "-D", "+FP", f"+O{k}.ppm"],
            cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert any((tmp_path / f"{k}.ppm").read_bytes()[15:])
