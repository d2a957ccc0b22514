"""Can everybody read the report? axe-core on all kinds of pages, light, dark, wide and narrow."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import pytest

pytest.importorskip("playwright.sync_api", reason="uv pip install playwright")
pytest.importorskip("axe_playwright_python.sync_playwright")

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page

from harness.record import BaselineState
from harness.renderers.registry import create
from harness.report import write_report
from tests.fakes.student import student
from tests.harness.report_fixture import make_run, summary_of, write_run
from tests.harness.test_report_changes import case
from tests.harness.tiny import run_tiny

pytestmark = pytest.mark.browser

GRAVE = ("critical", "serious", "moderate")


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Addresses of pages in every state worth looking at."""
    made = make_run(tmp_path_factory.mktemp("made"), size=24)
    real = tmp_path_factory.mktemp("real")
    tracer = create("tracer")
    dense = ("mu = ior_i / ior_t", "mu = ior_i / (1.01 * ior_t)")
    run_tiny(real, tracer, student(dense), cases=["slab*"], helper=tracer)
    changed = tmp_path_factory.mktemp("changed")
    write_run(changed, [case(BaselineState.REGRESSED, 0.5)])
    nothing = tmp_path_factory.mktemp("nothing")
    write_run(nothing, [], summary_of([], exit_code=1))
    for root in (made, real, changed, nothing):
        write_report(root)
    crashed = next((made / "cases").glob("package-complete*"))
    slab = next((real / "cases").glob("slab*"))
    return {
        "index": (made / "index.html").as_uri(),
        "crashed case": crashed.as_uri(),
        "case with a ray": slab.as_uri() + "#mode=rays&pin=12,1",
        "case with a map": slab.as_uri() + "#mode=diff",
        "changed index": (changed / "index.html").as_uri(),
        "changed case": (changed / "cases" / "slab.html").as_uri(),
        "no cases": (nothing / "index.html").as_uri(),
    }


@pytest.fixture(params=["light", "dark"])
def eye(browser: Browser, request: pytest.FixtureRequest) -> Iterator[Page]:
    scheme: Literal["light", "dark"] = request.param
    width = 1400 if scheme == "light" else 390
    context = browser.new_context(
        color_scheme=scheme, viewport={"width": width, "height": 900}, reduced_motion="reduce"
    )
    yield context.new_page()
    context.close()


def findings(page: Page) -> list[str]:
    violations = Axe().run(page).response["violations"]
    return [
        f"{v['id']} ({v['impact']}): {v['help']}: {node['html'][:160]}"
        for v in violations
        if v["impact"] in GRAVE
        for node in v["nodes"][:3]
    ]


def test_no_page_has_a_grave_finding(eye: Page, pages: dict[str, str]) -> None:
    found = {}
    for name, address in pages.items():
        eye.goto(address)
        if "case" in name and "cases" not in name:
            eye.wait_for_selector("#viewer[data-ready]")
        if said := findings(eye):
            found[name] = said
    assert not found


def test_the_help_has_none_either(eye: Page, pages: dict[str, str]) -> None:
    eye.goto(pages["index"])
    eye.keyboard.press("?")
    assert eye.locator("dialog.help").is_visible()
    assert not findings(eye)


def test_axe_finds_what_is_wrong(eye: Page) -> None:
    """The check itself can fail."""
    eye.set_content("<html lang=en><title>x</title><main><h1>x</h1><img src=x><button></button>")
    assert any("image-alt" in text for text in findings(eye))


def test_everything_can_be_reached_with_the_keyboard(eye: Page, pages: dict[str, str]) -> None:
    """Tab walks from the skip link to the viewer's controls, and what has the focus shows it."""
    eye.goto(pages["case with a ray"])
    eye.wait_for_selector("#viewer[data-ready]")
    seen = []
    for _ in range(60):
        eye.keyboard.press("Tab")
        seen.append(eye.evaluate("document.activeElement.textContent.trim().slice(0, 40)"))
    assert seen[0] == "Skip to content"
    assert "Side by side" in seen
    assert "unpin" in seen
