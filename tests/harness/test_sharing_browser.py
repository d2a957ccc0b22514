"""Reports that were handed on, in a browser."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="uv pip install playwright")

from playwright.sync_api import Page

from harness.baseline.two_runs import two_runs
from harness.renderers.registry import create
from harness.report import write_report
from harness.report.single import write_single
from tests.fakes.student import student
from tests.harness.test_report_sharing import DENSE
from tests.harness.tiny import run_tiny

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("run")
    tracer = create("tracer")
    run_tiny(root, tracer, student(DENSE), cases=["ball*"], helper=tracer)
    return root


def test_a_single_file_opens_its_cases_with_pixels(page: Page, run: Path, tmp_path: Path) -> None:
    written = write_single(run, tmp_path / "report.html")
    page.goto(written.path.as_uri())
    page.locator(".case .name a").first.click()
    page.wait_for_selector("#viewer[data-ready]")
    assert page.locator("h1").inner_text() == "A glass ball before a ramp"
    assert page.locator(".pane canvas").count() == 2
    page.keyboard.press("d")
    page.wait_for_url(lambda url: "mode=diff" in url)
    assert "page=cases" in page.url
    page.reload()
    page.wait_for_selector("#viewer[data-ready]")
    assert page.locator(".pane canvas").first.get_attribute("aria-label", timeout=5000)
    page.keyboard.press("u")
    page.wait_for_selector(".matrix")
    assert "page=" not in page.url


def test_without_its_pixels_a_single_file_shows_pictures(
    page: Page, run: Path, tmp_path: Path
) -> None:
    written = write_single(run, tmp_path / "report.html", room=0)
    page.goto(written.path.as_uri())
    page.locator(".case .name a").first.click()
    page.wait_for_selector("#viewer[data-ready]")
    assert "there was no room for them" in page.locator("#viewer").inner_text()
    page.wait_for_function("document.querySelector('#pictures img').naturalWidth > 0")


def test_a_comparison_shows_pictures_of_both_runs(page: Page, run: Path, tmp_path: Path) -> None:
    two_runs(run, run, tmp_path / "out")
    write_report(tmp_path / "out")
    case = next((tmp_path / "out" / "cases").glob("*.html"))
    page.goto(case.as_uri() + "#mode=diff&every=0")
    page.wait_for_selector("#viewer[data-ready]")
    label = page.locator(".pane canvas").first.get_attribute("aria-label")
    assert label == "|A − B| of A student and B before: student"
    assert "No pixel differs" in page.locator(".worst-pixels").inner_text()
