"""The report in a browser, from a file: filters, search, keys, and not a single complaint."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="uv pip install playwright")

from playwright.sync_api import Browser, Locator, Page

from harness.record import CaseRecord, Table, Verdict
from harness.report import write_report
from harness.scene.load import find
from tests.harness.report_fixture import Draft, check, make_run, run_of, summary_of, write_run

pytestmark = pytest.mark.browser

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = make_run(tmp_path_factory.mktemp("run"), size=24)
    write_report(root)
    return root


def run_of_mixed_cases(root: Path) -> Path:
    """One case that a renderer passes, one fails and one crashed in, and one that passes."""
    verdicts = {
        "both": {"tracer": Verdict.PASS, "povray": Verdict.FAIL, "mytracer": Verdict.ERROR},
        "fine": {"tracer": Verdict.PASS, "povray": Verdict.PASS},
    }
    cases = []
    for name, found in verdicts.items():
        draft = Draft(name, "A slab only shifts the ray", "slab")
        for renderer, verdict in found.items():
            value = {Verdict.PASS: 1e-13, Verdict.FAIL: 1e-3}.get(verdict)
            draft.checks.append(
                check("slab_offset", renderer, value, 0.0, 1e-12, "units", status=verdict)
            )
            draft.runs.append(run_of(renderer, verdict))
        cases.append(draft.finished())
    write_report(write_run(root, cases))
    return root


def run_of_renderers(root: Path, names: list[str]) -> Path:
    """One case, with as long a figure as there is."""
    draft = Draft("slab-offset", "A slab only shifts the ray", "slab")
    for name in names:
        draft.checks.append(
            check("exit_point", name, 7.968e-11, 0.0, 3.5e-10, "units", status=Verdict.PASS)
        )
        draft.runs.append(run_of(name, Verdict.PASS))
    cases = [draft.finished()]
    summary = summary_of(cases)
    one = next(iter(summary.renderers.values()))
    summary = summary.model_copy(update={"renderers": dict.fromkeys(names, one)})
    write_report(write_run(root, cases, summary))
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


def test_a_failure_is_found_beside_a_renderer_that_crashed(page: Page, tmp_path: Path) -> None:
    """The case as a whole is an error then, which must not hide what else is wrong with it."""
    run = run_of_mixed_cases(tmp_path)
    page.goto((run / "index.html").as_uri())
    for status, cases in (("fail", ["both"]), ("error", ["both"]), ("pass", ["fine"])):
        chip(page, status).click()
        assert shown(page) == cases
        chip(page, status).click()


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
    first, second = (link.get_attribute("href") for link in page.locator(".case .name a").all()[:2])
    page.locator(".case .name a").first.click()
    page.wait_for_url(f"**/{first}")
    page.keyboard.press("j")
    page.wait_for_url(f"**/{second}")
    page.keyboard.press("k")
    page.wait_for_url(f"**/{first}")
    page.goto((run / "index.html").as_uri())
    page.locator("#search").fill("j")
    assert page.url.startswith((run / "index.html").as_uri())


@pytest.mark.parametrize("width", [390, 1400])
def test_pages_fit_their_window(page: Page, run: Path, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 900})
    for path in (run / "index.html", *sorted((run / "cases").glob("*.html"))):
        page.goto(path.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= width, path.name


def test_the_words_and_formulas_of_every_scene_fit(page: Page, tmp_path: Path) -> None:
    """Of each case the page as far as its scene decides it: no picture, no check."""
    cases = [
        CaseRecord(
            id=loaded.id, case=loaded.case, family=loaded.model.family, title=loaded.model.title,
            description=loaded.model.description.strip(), lecture=loaded.model.lecture,
            sources=list(loaded.model.sources), formula=loaded.model.formula,
            parameters=dict(loaded.parameters), scene_sha256="0" * 64, quality="normal",
            scene_file=f"{loaded.file.parent.name}/{loaded.file.name}", snellcheck_version="0.1.0",
            started="2026-01-02T03:04:05+00:00", wall_s=1, status=Verdict.SKIP, runs=[], checks=[],
            tables=[Table.model_validate(t.model_dump(mode="json")) for t in loaded.model.tables],
        )
        for loaded in {one.case: one for one in find((), SCENES)}.values()
    ]  # fmt: skip
    assert len(cases) > 50
    write_report(write_run(tmp_path, cases, summary_of(cases)))
    page.set_viewport_size({"width": 390, "height": 900})
    wide = []
    for path in sorted((tmp_path / "cases").glob("*.html")):
        page.goto(path.as_uri(), wait_until="domcontentloaded")
        if (width := page.evaluate("document.documentElement.scrollWidth")) > 390:
            wide.append(f"{path.name}: {width}")
    assert not wide


def test_without_script_everything_is_there(browser: Browser, run: Path) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto((run / "index.html").as_uri())
    assert len(shown(page)) == 12
    assert not page.locator(".filters").is_visible()
    page.locator(".case .name a").first.click()
    assert page.locator("h1").inner_text() == "Snell's law with the lecture's ratio"
    context.close()


def test_on_paper_no_figure_stands_in_the_next_column(page: Page, tmp_path: Path) -> None:
    """With six renderers a column is as narrow as it gets."""
    run = run_of_renderers(tmp_path, ["a", "b", "c", "d", "e", "f"])
    page.set_viewport_size({"width": 700, "height": 1000})  # A4 without its margins
    page.goto((run / "index.html").as_uri())
    page.emulate_media(media="print")
    assert page.locator(".row .cell").count() == 6
    assert page.evaluate(
        """() => [...document.querySelectorAll('.row .cell')].every((cell) =>
        [...cell.querySelectorAll('.num')].every((figure) => figure.scrollWidth <=
          cell.clientWidth && figure.getBoundingClientRect().right <=
          cell.getBoundingClientRect().right + 1))"""
    )
