"""The lecture's notebook runs from its first cell to its last, and its pictures are pictures."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOK = ROOT / "docs" / "notebooks" / "complete_package.ipynb"

# In a process of its own: what Jupyter warns of is not ours.
EXECUTE = """
import sys
import nbformat
from nbclient import NotebookClient

notebook = nbformat.read(sys.argv[1], as_version=4)
try:
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
finally:
    nbformat.write(notebook, sys.argv[2])
"""


def test_the_notebook_is_kept_without_outputs() -> None:
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


@pytest.mark.slow
def test_every_cell_of_the_notebook_runs(tmp_path: Path) -> None:
    executed = tmp_path / "executed.ipynb"
    command = [sys.executable, "-c", EXECUTE, str(NOTEBOOK), str(executed)]
    done = subprocess.run(command, cwd=NOTEBOOK.parent, capture_output=True, text=True, timeout=400)
    assert done.returncode == 0, done.stderr[-3000:]
    cells = json.loads(executed.read_text(encoding="utf-8"))["cells"]
    outputs = [output for cell in cells for output in cell.get("outputs", [])]
    shown = [kind for output in outputs for kind in output.get("data", {})]
    assert shown.count("image/svg+xml") == 4  # sections: ball, slab, prism, package
    assert shown.count("image/png") >= 8
    assert not [output for output in outputs if output["output_type"] == "error"]
    texts = "".join("".join(output.get("text", "")) for output in outputs)
    # What the notebook says of itself: three derivations agree, and offset and formula.
    assert texts.count("25.373993939179°") == 3
    traced, formula = (
        float(line.split()[1])
        for line in texts.splitlines()
        if line.startswith(("traced ", "formula "))
    )
    assert traced == pytest.approx(formula, rel=1e-12)
