"""What the viewer makes of pictures that are given: FLIP, and pictures larger than the screen."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("playwright.sync_api", reason="uv pip install playwright")

from playwright.sync_api import Page

from harness import record as records
from harness.record import CaseRecord, Verdict
from harness.report import pack, write_report
from harness.report.colours import BEYOND, NOT_FINITE, SCALE
from harness.report.links import page_name
from harness.report.pictures import display
from tests.harness.report_fixture import summary_of, write_run
from tests.harness.test_viewer_browser import colours_of

pytestmark = pytest.mark.browser

FLIP = Path(__file__).parents[1] / "data" / "flip" / "map.json"
Pixels = NDArray[np.float32]


def page_of(
    root: Path, pictures: Mapping[str, Pixels], ways: Mapping[str, Any] | None = None
) -> str:
    """The address of a case's page with these pictures."""
    images: list[pack.Image] = []
    for name, pixels in pictures.items():
        images.append(pack.image(name, "image", pixels, images[0] if images else None))
    pack.write(root / "data" / "given.js", "given", images, ways=ways)
    record = CaseRecord(
        id="given", case="given", family="given", title="Given", scene_sha256="0" * 64,
        scene_file="given/given.toml", quality="draft", snellcheck_version="0.1.0",
        started="2026-01-02T03:04:05+00:00", wall_s=1, status=Verdict.SKIP, runs=[], checks=[],
        pack="data/given.js",
    )  # fmt: skip
    write_report(write_run(root, [record], summary_of([record])))
    return (root / "cases" / page_name("given")).as_uri()


def open_page(page: Page, address: str) -> None:
    page.goto("about:blank")
    page.goto(address)
    page.wait_for_selector("#viewer[data-ready]")
    page.wait_for_timeout(100)  # the frame after


def shown_at(page: Page, *steps: int) -> NDArray[np.int64]:
    """The colours of the first pane's canvas so many of its pixels to the right of its middle."""
    found = page.evaluate(
        """steps => { const c = document.querySelector('.pane canvas');
        const copy = new OffscreenCanvas(c.width, 1)  // the page's own is not for reading
          .getContext('2d', { willReadFrequently: true });
        copy.drawImage(c, 0, -Math.floor(c.height / 2));
        const { data } = copy.getImageData(0, 0, c.width, 1);
        return steps.map((x) => [...data.slice(4 * (c.width / 2 + x), 4 * (c.width / 2 + x) + 3)]);
        }""",
        list(steps),
    )
    return np.array(found)


def test_approved_pictures_are_there_to_be_chosen(page: Page, tmp_path: Path) -> None:
    grey = np.full((8, 8, 3), 0.5, np.float32)
    address = page_of(tmp_path, {"tracer": grey, "povray": grey})
    path = tmp_path / "records" / "given.json"
    approved = pack.image("povray", "image", grey - np.float32(0.25))
    pack.write(tmp_path / "data" / "given.baseline.js", "given", [approved])
    others = {"baseline: ": "data/given.baseline.js"}
    records.write(records.read_case(path).model_copy(update={"other_packs": others}), path)
    write_report(tmp_path)
    open_page(page, address)
    assert page.locator(".pane canvas").count() == 2
    open_page(page, address + "#mode=diff&a=povray&b=baseline:%20povray&every=0&pin=1,1")
    label = page.locator(".pane canvas").get_attribute("aria-label")
    assert label == "|A − B| of A povray and B baseline: povray"
    assert page.locator("tr[data-off='povray'] td").first.inner_text() == "0.25"


def test_where_nobody_tells_its_rays_the_page_says_so(page: Page, tmp_path: Path) -> None:
    grey = np.full((8, 8, 3), 0.5, np.float32)
    ways = {"rays": [], "silent": [{"name": "povray", "reason": "<b>it does not tell"}]}
    open_page(page, page_of(tmp_path, {"povray": grey}, ways) + "#pin=2,3")
    assert "povray: <b>it does not tell" in page.locator("#ray").inner_text()
    assert page.locator("#ray select").count() == 0


# --- FLIP -----------------------------------------------------------------------------------------


def flipped() -> tuple[Pixels, Pixels]:
    """Two pictures of closed form: one shifted in part, tinted, with two odd pixels, and darker."""
    y, x = np.mgrid[0:36, 0:48]
    checks = ((x // 6 + y // 6) % 2) * 0.8 + 0.1
    a = np.stack([0.5 + 0.4 * np.sin(x / 5), 0.5 + 0.4 * np.cos(y / 4), checks], -1)
    b = a.copy()
    b[8:20, 10:26] = np.roll(a, 1, axis=1)[8:20, 10:26]
    b[..., 0] *= 1 + 0.05 * np.sin(y / 9)
    b[25, 30] = 1
    b[30, 5] = 0
    b[:, 40:] = 1.5 * b[:, 40:] ** 2
    return a.astype(np.float32), b.astype(np.float32)


def test_flip_is_what_its_authors_program_says(page: Page, tmp_path: Path) -> None:
    """The matrices of Rec. 709 agree to five digits: colours, of size 100, to 1e-3.

    Of a distance of 1e-3 equation 8 makes 0.95 / 16.5 * 1e-3 ** 0.7 = 5e-4.
    """
    told = json.loads(FLIP.read_text("utf-8"))
    a, b = flipped()
    open_page(page, page_of(tmp_path, {"tracer": a, "povray": b}))
    shown = np.array(page.evaluate("window.snellcheckMaps('tracer', 'povray').flip"))
    assert np.abs(shown - told["map"]).max() < 5e-4
    assert shown.max() > 0.5
    assert shown.mean() == pytest.approx(told["mean"], abs=1e-4)
    same = page.evaluate("window.snellcheckMaps('tracer', 'tracer').flip")
    assert set(same) == {0}
    page.get_by_role("button", name="FLIP", exact=True).click()
    page.wait_for_timeout(100)
    assert len(colours_of(page)) > 20


def test_flip_knows_no_answer_where_there_is_no_number(page: Page, tmp_path: Path) -> None:
    a, b = flipped()
    b[10, 20] = np.nan
    open_page(page, page_of(tmp_path, {"tracer": a, "povray": b}))
    shown = page.evaluate("window.snellcheckMaps('tracer', 'povray').flip.map(Number.isNaN)")
    assert np.array(shown).reshape(36, 48)[10, 20]


def test_bytes_are_those_of_the_picture_files(page: Page, tmp_path: Path) -> None:
    """From black to beyond white: the byte that Python rounds to, or where it rounds narrowly the
    one beside it; a float's first twelve bits decide, which is a twentieth of a byte at most.
    """
    row = np.geomspace(1e-9, 10, 256).astype(np.float32)
    row[:6] = 0, -1, -np.inf, np.nan, 1e-40, 65504
    address = page_of(tmp_path, {"tracer": np.repeat(row[None, :, None], 3, 2).repeat(256, 0)})
    columns = range(256)
    place = "mode=a&view=128,128,1"
    gains = {"": 1.0, "&ev=2.5": 2**2.5, "&ev=-1.5&enc=gamma": 2**-1.5}
    for how, gain in gains.items():
        open_page(page, f"{address}#{place}{how}")
        shown = shown_at(page, *(x - 128 for x in columns))
        linear = np.repeat(row[None, :, None], 3, 2).astype(float) * gain
        expected = display(linear)[0].astype(int)
        if "gamma" in how:
            finite = np.isfinite(linear[0]).all(axis=1)
            powers = np.rint(255 * np.clip(linear[0, finite], 0, 1) ** (1 / 2.2))
            expected[finite] = powers.astype(int)
        assert np.abs(shown - expected).max() <= 1, how
        assert (shown == expected).mean() > 0.9, how


# --- large pictures -------------------------------------------------------------------------------

WIDE, HIGH = 1501, 901


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Pictures of odd sides that differ in one pixel, and in one that is not a number."""
    y, x = np.mgrid[0:HIGH, 0:WIDE]
    one = np.stack([x / WIDE, y / HIGH, 0.2 + 0.5 * ((x // 50 + y // 50) % 2)], -1)
    other = one.astype(np.float32)
    other[333, 777] += 1.0
    other[700, 200] = np.nan
    root = tmp_path_factory.mktemp("large")
    return page_of(root, {"tracer": one.astype(np.float32), "povray": other})


def test_seen_from_afar_one_wrong_pixel_is_not_lost(page: Page, large: str) -> None:
    open_page(page, f"{large}#mode=diff&every=0")
    colours = colours_of(page)
    assert list(NOT_FINITE) in colours
    assert list(SCALE[-1]) in colours  # 1, where the scale ends
    assert list(SCALE[0]) in colours


def test_seen_from_afar_light_is_averaged(page: Page, large: str) -> None:
    """At a quarter of the size: within 2 of 255 of the mean of what is there, away from edges."""
    open_page(page, f"{large}#mode=a&a=tracer&view=725,475,0.25")
    there = np.array([[[725 / WIDE, 475 / HIGH, 0.2 + 0.5 * ((14 + 9) % 2)]]])
    assert np.abs(shown_at(page, 0)[0] - display(there)[0, 0].astype(int)).max() <= 2


def test_seen_from_near_each_pixel_is_itself(page: Page, large: str) -> None:
    open_page(page, f"{large}#mode=a&a=povray&ev=0.5&view=777.5,333.5,16")
    odd, beside = shown_at(page, 0, 16)
    assert odd.tolist() == [255, 255, 255]
    there = np.array([[[778 / WIDE, 333 / HIGH, 0.2 + 0.5 * ((15 + 6) % 2)]]]) * np.sqrt(2)
    assert np.abs(beside - display(there)[0, 0].astype(int)).max() <= 1


def test_what_was_coarse_while_dragged_is_sharp_at_rest(page: Page, large: str) -> None:
    open_page(page, f"{large}#mode=diff&every=0&view=777.5,333.5,1")
    for _ in range(3):
        page.keyboard.press("e")
    page.wait_for_timeout(600)
    odd, *beside = shown_at(page, 0, -1, 1, 2, 3)
    assert odd.tolist() == list(BEYOND)
    assert [colour.tolist() for colour in beside] == 4 * [list(SCALE[0])]


def test_beside_a_large_picture_there_is_nothing(page: Page, large: str) -> None:
    open_page(page, f"{large}#mode=a&a=tracer&view=-3000,-3000,4")
    assert colours_of(page) == [[0, 0, 0]]  # transparent
