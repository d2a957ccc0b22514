"""The values that the inspector shows are those of the EXR files, whichever renderer made them."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api", reason="uv pip install playwright")

from playwright.sync_api import Page

from harness import imagefile
from harness import record as records
from harness.measure import images
from harness.record import CaseRecord
from harness.renderers.persistent import WorkerRenderer
from harness.renderers.registry import create
from harness.report import write_report
from harness.report.links import page_name
from tests.harness.tiny import run_tiny

pytestmark = [pytest.mark.browser, pytest.mark.mitsuba, pytest.mark.povray, pytest.mark.slow]

NAMES = ["tracer", "povray", "mitsuba", "mitsuba-exact"]


@pytest.fixture(scope="module")
def case(
    tmp_path_factory: pytest.TempPathFactory, stock: WorkerRenderer, exact: WorkerRenderer
) -> tuple[Path, CaseRecord]:
    """The tiny ball by all renderers: the run's folder and its record."""
    if shutil.which("povray") is None:
        pytest.skip("no POV-Ray: sudo apt-get install povray")
    root = tmp_path_factory.mktemp("run")
    tracer = create("tracer")
    run_tiny(root, tracer, create("povray"), stock, exact, cases=["ball*"], helper=tracer)
    write_report(root)
    (record,) = map(records.read_case, (root / "records").glob("*.json"))
    return root, record


def linear(root: Path, record: CaseRecord, name: str) -> np.ndarray:
    (run,) = [r for r in record.runs if r.name == name]
    return imagefile.read(root / run.images[0].path)[0]


def test_the_inspector_says_what_the_exr_says_for_every_renderer(
    page: Page, case: tuple[Path, CaseRecord]
) -> None:
    root, record = case
    assert sorted(r.name for r in record.runs) == sorted(NAMES)
    pixels = [(0, 0), (11, 7), (23, 23)]
    address = (root / "cases" / page_name(record.id)).as_uri()
    for x, y in pixels:
        page.goto("about:blank")
        page.goto(f"{address}#pin={x},{y}")
        page.wait_for_selector("#viewer[data-ready]")
        for name in NAMES:
            row = page.locator(f"tr[data-image='{name}'] td").all_inner_texts()
            shown = [np.float32(text.replace("−", "-")) for text in row]
            assert np.array_equal(shown, linear(root, record, name)[y, x]), (name, x, y)


def test_worst_pixels_and_differences_are_those_of_the_exr(
    page: Page, case: tuple[Path, CaseRecord]
) -> None:
    root, record = case
    page.goto((root / "cases" / page_name(record.id)).as_uri() + "#mode=diff&b=tracer")
    page.wait_for_selector("#viewer[data-ready]")
    for name in NAMES[1:]:
        page.locator("select[aria-label='Picture A']").select_option(name)
        off = images.difference(linear(root, record, name), linear(root, record, "tracer"))
        y, x = np.unravel_index(int(off.argmax()), off.shape)
        first = page.locator(".jump").first
        assert f"({x}, {y})" in first.inner_text(), name
        first.click()
        shown = page.locator(f"tr[data-off='{name}'] td").first.inner_text()
        assert float(_plain(shown)) == pytest.approx(off.max(), rel=5e-3), name


def _plain(text: str) -> str:
    """A number as the page writes it, for Python."""
    plain = text.replace("\u202f", "").replace("−", "-").replace("×10", "e")
    return plain.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
