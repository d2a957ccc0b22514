"""The report's script: the committed bundle is what its sources give."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
UI = ROOT / "harness" / "report" / "ui"
BUNDLE = ROOT / "harness" / "report" / "assets" / "report.js"


def node() -> str:
    program = shutil.which("node")
    if program is None or not (UI / "node_modules").is_dir():
        pytest.skip("needs Node and the locked packages: make ui")
    return program


def test_the_bundle_is_what_its_sources_give(tmp_path: Path) -> None:
    out = tmp_path / "report.js"
    subprocess.run([node(), UI / "build.mjs", "--out", out], check=True, timeout=60)
    assert out.read_bytes() == BUNDLE.read_bytes(), "the sources have changed: make ui"


def test_the_sources_have_their_types() -> None:
    compiler = UI / "node_modules" / "typescript" / "bin" / "tsc"
    done = subprocess.run(
        [node(), compiler, "--noEmit", "-p", UI],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_the_bundle_is_a_classic_script_that_loads_nothing_from_elsewhere() -> None:
    text = BUNDLE.read_text("utf-8")
    assert text.startswith("// Built from harness/report/ui")
    for forbidden in ("import(", "export ", "fetch(", "XMLHttpRequest", "eval(", "innerHTML"):
        assert forbidden not in text
    assert text.replace("http://www.w3.org/2000/svg", "").count("://") == 0


def test_the_lock_names_versions_and_hashes_and_no_registry() -> None:
    locked = json.loads((UI / "package-lock.json").read_text("utf-8"))["packages"]
    for name, package in locked.items():
        assert "resolved" not in package, name
        assert not name or package["version"], name
        assert not name or package["integrity"], name


def test_sources_are_small() -> None:
    for path in sorted((UI / "src").glob("*.ts")):
        assert len(path.read_text("utf-8").splitlines()) <= 400, path.name
