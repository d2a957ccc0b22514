"""The report in a browser, from a file: filters, search, keys, and not a single complaint."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="uv pip install playwright")

from playwright.sync_api import Browser, Locator, Page

from harness.report import write_report
from tests.harness.report_fixture import make_run

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = make_run(tmp_path_factory.mktemp("run"), size=24)
    write_report(root)
    return root


def shown(page: Page) -> list[str]:
    """The names of the cases that are to be seen."""
    return page.locator(".row:not([hidden]) .name").all_text_contents()


def chip(page: Page, name: str) -> Locator:
    return page.locator(".chip", has_text=name).first


def test_index_shows_all_cases_and_loads_its_pictures(page: Page, run: Path) -> None:
    page.goto((run / "index.html").as_uri())
    assert len(shown(page)) == 12
    assert page.locator("#found").inner_text() == "12 cases"
    for image in page.locator(".thumb img").all():
        image.scroll_into_view_if_needed()
    page.wait_for_function("[...document.images].every(i => i.complete && i.naturalWidth > 0)")


def test_search_narrows_and_escape_leaves_the_field(page: Page, run: Path) -> None:
    page.goto((run / "index.html").as_uri())
    page.keyboard.press("/")
    page.keyboard.type("slab 2.417")
    assert shown(page) == ["slab-offset"]
    assert page.locator("#found").inner_text() == "1 of 12 cases"
    page.keyboard.type(" nothing")
    assert shown(page) == []
    assert page.locator("#none-found").is_visible()
    page.locator("#clear").click()
    assert len(shown(page)) == 12
    page.keyboard.press("Escape")
    assert page.evaluate("document.activeElement === document.body")


def test_chips_filter_by_status_renderer_and_family(page: Page, run: Path) -> None:
    page.goto((run / "index.html").as_uri())
    chip(page, "error").click()
    assert sorted(shown(page)) == ["package-complete", "prism-deviation"]
    chip(page, "mitsuba").click()  # now the status of mitsuba alone counts
    assert shown(page) == ["package-complete"]
    assert page.locator(".head [data-column]:visible").all_inner_texts() == ["mitsuba"]
    chip(page, "error").click()
    chip(page, "slab").click()
    assert set(shown(page)) == {"slab-offset", "slab-thin-face"}
    assert chip(page, "slab").get_attribute("aria-pressed") == "true"


def test_filters_survive_in_the_address(page: Page, run: Path) -> None:
    page.goto((run / "index.html").as_uri())
    chip(page, "error").click()
    page.locator("#search").fill("prism")
    address = page.evaluate("location.href")
    assert address.endswith("#q=prism&status=error")
    page.goto("about:blank")
    page.goto(address)
    assert shown(page) == ["prism-deviation"]
    assert page.locator("#search").input_value() == "prism"


def test_keys_step_through_cases_but_not_while_typing(page: Page, run: Path) -> None:
    page.goto((run / "index.html").as_uri())
    page.locator(".case .name a").first.click()
    page.wait_for_url("**/prism-deviation*")
    page.keyboard.press("j")
    page.wait_for_url("**/package-complete.html")
    page.keyboard.press("k")
    page.wait_for_url("**/prism-deviation*")
    page.goto((run / "index.html").as_uri())
    page.locator("#search").fill("j")
    assert page.url.startswith((run / "index.html").as_uri())


@pytest.mark.parametrize("width", [390, 1400])
def test_pages_fit_their_window(page: Page, run: Path, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 900})
    for path in (run / "index.html", *sorted((run / "cases").glob("*.html"))):
        page.goto(path.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= width, path.name


def test_without_script_everything_is_there(browser: Browser, run: Path) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto((run / "index.html").as_uri())
    assert len(shown(page)) == 12
    assert not page.locator(".filters").is_visible()
    page.locator(".case .name a").first.click()
    assert page.locator("h1").inner_text() == "Deviation by a prism, and its minimum"
    context.close()
