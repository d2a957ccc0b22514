"""Every key that the help names does what it says; what pages are like in print and in motion."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="uv pip install playwright")

from playwright.sync_api import Browser, Page, expect

from tests.harness.test_viewer_browser import open_case, panes, record_of, wait_for_hash
from tests.harness.tiny import report_of_dense_glass

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball, a slab and a sweep by the tracer and by a student whose glass is too dense."""
    return report_of_dense_glass(tmp_path_factory.mktemp("run"), "ball*", "slab*", "snell*")


# --- keys -----------------------------------------------------------------------------------------

# What the help shows of a key: how it is pressed, and what the address says then, "!" that it does
# not. They are pressed one after the other.
KEYS = {
    "1 … 9": [("1", "a=tracer"), ("2", "!a=tracer")],
    "Shift 1 … 9": [("Shift+Digit2", "b=student"), ("Shift+Digit1", "!b=student")],
    "← →": [("ArrowLeft", "a=tracer"), ("ArrowRight", "!a=tracer"),
            ("Shift+ArrowRight", "b=student"), ("Shift+ArrowLeft", "!b=student")],
    "s": [("s", "mode=swipe"), ("s", "!mode=")],
    "b": [("b", "mode=blink"), ("b", "!mode=")],
    "a": [("a", "mode=a"), ("a", "!mode=")],
    "y": [("y", "mode=rays"), ("y", "!mode=")],
    "d": [("d", "mode=diff")],
    "m": [("m", "every=0"), ("m", "!every")],
    "e E": [("e", "ev=0.5"), ("E", "!ev="), ("E", "ev=-0.5")],
    "g": [("g", "enc=gamma")],
    "r": [("r", "!enc="), ("r", "!ev=")],
    "0": [("0", ",1&")],
    "+ −": [("+", ",2&"), ("=", ",4&"), ("-", ",2&")],
    "f": [("f", "!view=")],
    "Esc": [("Escape", "!pin=")],
}  # fmt: skip
# These are tested elsewhere: here, in test_viewer_browser.py, and in test_report_browser.py.
ELSEWHERE = {"Shift", "↑ ↓", "?", "j k", "n", "u", "/"}


def test_every_key_of_the_help_does_what_it_says(page: Page, run: Path) -> None:
    open_case(page, run, "slab", "#pin=12,1")
    page.keyboard.press("?")
    named = page.evaluate(
        """[...document.querySelectorAll('dialog.help dt')].map((dt) =>
        [...dt.querySelectorAll('kbd')].map((kbd) => kbd.textContent).join(' '))"""
    )
    assert set(named) == {*KEYS, *ELSEWHERE} - {"/"}
    page.keyboard.press("Escape")
    for steps in KEYS.values():
        for key, wanted in steps:
            page.keyboard.press(key)
            wait_for_hash(page, wanted.removeprefix("!"), there=not wanted.startswith("!"))


def test_arrows_step_through_modes_where_the_viewer_has_the_focus(page: Page, run: Path) -> None:
    open_case(page, run, "ball")
    page.locator(".viewer").focus()
    page.keyboard.press("ArrowDown")
    wait_for_hash(page, "mode=swipe")
    page.keyboard.press("ArrowUp")
    wait_for_hash(page, "mode=", there=False)
    page.locator(".viewer").blur()
    page.keyboard.press("ArrowDown")
    page.wait_for_timeout(300)
    assert "mode=" not in page.evaluate("location.hash")


def test_keys_lead_to_failures_and_back_to_the_index(page: Page, run: Path) -> None:
    page.goto((run / "index.html").as_uri())
    page.keyboard.press("n")
    page.keyboard.press("Enter")
    page.wait_for_url("**/cases/**")
    page.wait_for_selector("#viewer[data-ready]")
    first = page.url
    page.keyboard.press("n")
    page.wait_for_url(lambda url: url != first)
    page.keyboard.press("u")
    page.wait_for_url("**/index.html")


def test_a_check_leads_to_the_pixel_that_decides(page: Page, run: Path) -> None:
    open_case(page, run, "slab")
    link = page.locator("#checks a[href^='#pin=']").first
    pin = (link.get_attribute("href") or "").removeprefix("#pin=")
    link.click()
    x, y = pin.split(",")
    expect(page.locator(".inspector h3").first).to_have_text(f"Pixel ({x}, {y}), pinned")


def test_the_histogram_counts_every_pixel(page: Page, run: Path) -> None:
    """Those that are black and those that are no number apart from the rest."""
    record = open_case(page, run, "ball")
    assert record.runs[0].images
    text = page.locator(".histogram").inner_text()
    assert "A: 0 black, 0 not finite" in text.replace("\u202f", " ")


# --- motion, print, waiting -----------------------------------------------------------------------


def test_blinking_heeds_those_who_want_no_motion(browser: Browser, page: Page, run: Path) -> None:
    which = "() => document.querySelector('.pane .which').textContent"
    open_case(page, run, "ball", "#mode=blink")
    page.wait_for_timeout(1500)
    assert page.evaluate(which) == "A"
    context = browser.new_context(reduced_motion="no-preference")
    lively = context.new_page()
    open_case(lively, run, "ball", "#mode=blink")
    lively.wait_for_function(f"{which} === 'B'", timeout=5000)
    lively.wait_for_function(f"{which} === 'A'", timeout=5000)
    context.close()


def test_on_paper_there_are_all_pictures(page: Page, run: Path) -> None:
    record = open_case(page, run, "ball")
    page.emulate_media(media="print")
    pictures = page.locator("#pictures img, #differences img")
    assert pictures.count() == sum(len(r.images) for r in record.runs) + len(record.differences)
    for picture in pictures.all():
        assert picture.is_visible()
    assert not page.locator("#viewer").is_visible()
    printed = page.pdf(print_background=True)
    assert printed.count(b"/Subtype /Image") >= pictures.count()
    page.goto((run / "index.html").as_uri())
    for picture in page.locator(".thumb img").all():
        assert picture.is_visible()
    assert not page.locator(".filters").is_visible()


def test_while_pixels_load_the_page_says_so(page: Page, run: Path) -> None:
    page.add_init_script(
        "DecompressionStream = class { readable = new ReadableStream();"
        " writable = new WritableStream(); };"
    )
    record = record_of(run, "ball")
    page.goto(next((run / "cases").glob(f"{record.case}*")).as_uri())
    expect(page.locator(".viewer-state")).to_have_text("Loading pixels …")
    assert page.locator("#pictures img").first.is_visible()
    assert not panes(page)


# --- layout ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", range(1200, 1300, 20))
def test_pictures_stay_where_they_are_when_maps_take_their_place(
    width: int, page: Page, run: Path
) -> None:
    """The line of controls needs a second one below some of these widths."""
    page.set_viewport_size({"width": width, "height": 900})
    open_case(page, run, "ball", "#mode=a")
    top = "() => document.querySelector('.pane canvas').getBoundingClientRect().top + scrollY"
    before = page.evaluate(top)
    page.keyboard.press("d")
    wait_for_hash(page, "mode=diff")
    assert page.evaluate(top) == before


def test_on_a_telephone_checks_have_their_figures_in_sight(page: Page, run: Path) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    open_case(page, run, "slab")
    assert page.evaluate(
        """() => { const place = document.querySelector('#checks .scroll');
        return place.scrollWidth <= place.clientWidth; }"""
    )
    for figure in page.locator("#checks td.num").all():
        box = figure.bounding_box()
        assert box is not None
        assert 0 <= box["x"] < box["x"] + box["width"] <= 390
