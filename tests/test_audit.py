"""`make audit` is green only where an answer came for every locked package."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FINE = {"name": "numpy", "version": "2.0", "vulns": []}
VULNERABLE = {
    "name": "pillow",
    "version": "9.0.0",
    "vulns": [{"id": "PYSEC-2022-8", "fix_versions": ["9.0.1"]}],
}
UNKNOWN = {"name": "rich", "skip_reason": "Dependency not found and could not be audited"}


def audit(folder: Path, script: str) -> tuple[int, str]:
    """The audit by a program of ours: its exit code and what it says."""
    fake = folder / "auditor.py"
    fake.write_text(
        f"import json, sys, pathlib\noutput = sys.argv[sys.argv.index('--output') + 1]\n{script}"
    )
    done = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "audit"), sys.executable, str(fake)],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout


def answer(*packages: dict[str, object]) -> str:
    text = json.dumps({"dependencies": packages, "fixes": []})
    return f"pathlib.Path(output).write_text({text!r})"


@pytest.mark.parametrize(
    ("script", "code", "said"),
    [
        (answer(FINE), 0, "3 locked packages asked about, 0 vulnerabilities known, 0 answers"),
        (answer(FINE, VULNERABLE), 1, "vulnerable: pillow 9.0.0: PYSEC-2022-8, fixed in 9.0.1"),
        (answer(FINE, VULNERABLE) + "; sys.exit(1)", 1, "3 vulnerabilities known"),
        (answer(FINE, UNKNOWN), 3, "not asked: rich: Dependency not found"),
        (answer(), 3, "0 locked packages asked about"),
        ("sys.exit('ConnectionError: no such host')", 3, "ConnectionError: no such host"),
        ("pathlib.Path(output).write_text('half')", 3, "not asked: dev.txt"),
        ("pass", 3, "not asked: dev.txt"),
    ],
)
def test_what_could_not_be_asked_is_no_success(
    script: str, code: int, said: str, tmp_path: Path
) -> None:
    got, text = audit(tmp_path, script)
    assert got == code, text
    assert said in text


def test_an_auditor_that_is_not_there_is_no_success() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "audit"), "snellcheck-no-such-program"],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert done.returncode == 3
    assert "not asked" in done.stdout
