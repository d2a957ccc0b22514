"""The viewer of a case in a browser: modes, keys, values, permalinks, and every state it can be in.

The run is a small real one, so that pixels and rays are those of renderers.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api", reason="uv pip install playwright")

from playwright.sync_api import Page, expect

from harness import imagefile
from harness import record as records
from harness.measure import images
from harness.record import CaseRecord
from harness.report import pack, write_report
from harness.report.links import page_name
from tests.harness.report_fixture import make_run, write_run
from tests.harness.tiny import passes_at, report_of_dense_glass
from tests.harness.unpack import floats, read_pack

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball, a slab and a critical angle by the tracer and a student whose glass is too dense."""
    return report_of_dense_glass(tmp_path_factory.mktemp("run"), "ball*", "slab*", "tir*")


def record_of(run: Path, name: str) -> CaseRecord:
    paths = sorted((run / "records").glob("*.json"))
    return next(r for r in map(records.read_case, paths) if r.case.startswith(name))


def open_case(page: Page, run: Path, name: str, hash_: str = "") -> CaseRecord:
    record = record_of(run, name)
    page.goto((run / "cases" / page_name(record.id)).as_uri() + hash_)
    page.wait_for_selector("#viewer[data-ready]")
    return record


def panes(page: Page) -> list[str]:
    return [c.get_attribute("aria-label") or "" for c in page.locator(".pane canvas").all()]


def wait_for_hash(page: Page, part: str, *, there: bool = True) -> None:
    """Waits until the address holds `part`, or does not: the page writes it a little later."""
    held = "part => decodeURIComponent(location.hash).includes(part)"
    page.wait_for_function(held if there else held.replace("=> ", "=> !"), arg=part, timeout=5000)


def wait_for_colours(page: Page) -> None:
    """Waits until a pane shows more than one colour."""
    for _ in range(50):
        if len(colours_of(page)) > 1:
            return
        page.wait_for_timeout(100)
    pytest.fail("the pane shows one colour alone")


def colours_of(page: Page, pane: int = 0) -> list[list[int]]:
    """The distinct colours of a pane's canvas."""
    data = page.evaluate(
        """(k) => { const c = document.querySelectorAll('.pane canvas')[k];
        const copy = new OffscreenCanvas(c.width, c.height)  // the page's own is not for reading
          .getContext('2d', { willReadFrequently: true });
        copy.drawImage(c, 0, 0);
        const d = copy.getImageData(0, 0, c.width, c.height).data;
        const s = new Set(); for (let i = 0; i < d.length; i += 4)
        s.add([d[i], d[i+1], d[i+2]].join()); return [...s]; }""",
        pane,
    )
    return [[int(v) for v in text.split(",")] for text in data]


# --- what is shown --------------------------------------------------------------------------------


def test_every_mode_has_its_panes(page: Page, run: Path) -> None:
    open_case(page, run, "ball")
    assert panes(page) == ["tracer", "student"]
    expected = {
        "Swipe": ["student and tracer"],
        "Blink": ["student and tracer"],
        "A": ["student"],
        "B": ["student"],
        "|A − B|": ["|A − B| of A student and B tracer"],
        "Signed": ["(A − B) / max(|A|, |B|) of A student and B tracer"],
        "SSIM": ["1 − SSIM of A student and B tracer"],
        "ΔE": ["ΔE₀₀ of A student and B tracer"],
        "FLIP": ["FLIP of A student and B tracer"],
    }
    for label, wanted in expected.items():
        page.get_by_role("button", name=label, exact=True).click()
        assert panes(page) == wanted, label
        wait_for_colours(page)


def test_ray_errors_are_shown_per_renderer(page: Page, run: Path) -> None:
    open_case(page, run, "slab", "#mode=rays")
    assert panes(page) == ["Ray error of tracer", "Ray error of student"]
    assert "µrad" in page.locator(".colour-scale").inner_text()
    assert "not measured" in page.locator(".colour-scale").inner_text()


def test_the_inspector_says_what_the_exr_says(page: Page, run: Path) -> None:
    record = open_case(page, run, "ball", "#pin=11,7")
    for of in record.runs:
        linear, _ = imagefile.read(run / of.images[0].path)
        row = page.locator(f"tr[data-image='{of.name}'] td").all_inner_texts()
        shown = [np.float32(text.replace("−", "-")) for text in row]
        assert np.array_equal(shown, linear[7, 11]), of.name


def test_maps_are_those_of_the_metrics_that_judge(page: Page, run: Path) -> None:
    """The page's maps of SSIM and ΔE against scikit-image and colour-science."""
    record = open_case(page, run, "ball", "#mode=ssim")
    a, b = (
        imagefile.read(run / next(r for r in record.runs if r.name == name).images[0].path)[0]
        for name in ("student", "tracer")
    )
    maps = page.evaluate("window.snellcheckMaps('student', 'tracer')")
    assert np.allclose(maps["diff"], images.difference(a, b).reshape(-1), rtol=1e-6)
    delta = images.delta_e(a, b).reshape(-1)
    assert np.allclose(maps["deltae"], delta, atol=2e-3)  # white points of five digits
    shape = a.shape[:2]
    similar = (
        1 - np.array(maps["ssim"]).reshape(shape)[5:-5, 5:-5]
    )  # scikit-image leaves the rim out
    assert similar.mean() == pytest.approx(
        images.ssim(a, b, float(max(a.max(), b.max()))), abs=1e-6
    )


def test_worst_pixels_are_the_worst(page: Page, run: Path) -> None:
    record = open_case(page, run, "ball")
    a, b = (imagefile.read(run / r.images[0].path)[0] for r in record.runs)
    off = images.difference(a, b)
    y, x = np.unravel_index(int(off.argmax()), off.shape)
    first = page.locator(".jump").first
    assert f"({x}, {y})" in first.inner_text()
    first.click()
    wait_for_hash(page, f"pin={x},{y}")
    assert page.locator(".inspector h3").first.inner_text() == f"Pixel ({x}, {y}), pinned"


def test_a_pinned_pixel_shows_its_ray(page: Page, run: Path) -> None:
    record = open_case(page, run, "slab", "#pin=12,1")
    assert record.pack
    probe = read_pack(run / record.pack)["probes"][0]
    step = probe["step"]
    columns = -(-probe["width"] // step)
    k = round(1 / step) * columns + round(12 / step)
    theta_i = floats(probe["thetaI"]["data"]).reshape(probe["thetaI"]["shape"])[0, k]
    text = page.locator(".ray-facts").inner_text()
    assert f"{theta_i:.4f}°" in text
    assert "tracer" in text
    assert page.locator(".section .true-ray").count() == 1
    assert page.locator(".section .solid").count() >= 1
    assert f"{theta_i:.3f}°" in (page.locator(".section").text_content() or "")
    outside = """() => [...document.querySelectorAll(".section .angle")].filter((label) => {
        const [box, all] = [label, label.closest("svg")].map((e) => e.getBoundingClientRect());
        return box.left < all.left || box.right > all.right || box.bottom > all.bottom; }).length"""
    assert page.evaluate(outside) == 0


def test_a_pinned_pixel_of_a_picture_shows_its_ray(page: Page, run: Path) -> None:
    """By the closed form: a ray that passes a unit ball's centre at b meets it at asin(b)."""
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    record = open_case(page, run, "ball", "#pin=13,9")
    assert record.pack
    (rays,) = read_pack(run / record.pack)["ways"]["rays"]
    choose = page.locator("#ray select")
    assert choose.locator("option").all_inner_texts()[-1] == "picture, as tracer tells"
    choose.select_option(label="picture, as tracer tells")
    text = page.locator(".ray-facts").inner_text()
    found = re.search(r"Ray of pixel \((\d+), (\d+)\)", text)
    assert found
    column, row = (int(number) for number in found.groups())
    step, width, height = rays["step"], rays["width"], rays["height"]
    assert (column, row) == (round(13 / step) * step, round(9 / step) * step)
    camera = json.loads((run / record.files["scene.json"]).read_text("utf-8"))["camera"]
    theta_i = np.degrees(np.arcsin(passes_at(camera, column, row, width, height)))
    theta_t = np.degrees(np.arcsin(np.sin(np.radians(theta_i)) / rays["media"][1]["ior"]))
    table = page.locator(".ray-facts .mini-table").first
    assert table.locator("td.num").all_inner_texts() == [
        f"{angle:.4f}°" for angle in (theta_i, theta_t, theta_t, theta_i)
    ]
    assert table.locator("tbody tr").all_inner_texts()[0].split()[1] == "transmitted"
    assert page.locator(".section .true-ray").count() == 1
    assert page.locator(".section circle.solid").count() == 1
    assert f"{theta_i:.3f}°" in (page.locator(".section").text_content() or "")
    assert "student: it does not tell where its rays go" in text
    assert errors == []


def test_curves_tell_their_values_and_show_the_ray(page: Page, run: Path) -> None:
    open_case(page, run, "slab")
    chart = page.locator("svg.chart").first
    chart.scroll_into_view_if_needed()
    chart.hover(position={"x": 300, "y": 100})
    readout = page.locator(".readout").first
    assert "tracer" in readout.inner_text()
    assert "°" in readout.inner_text()
    chart.click(position={"x": 300, "y": 100})
    wait_for_hash(page, "pin=")


# --- keys -----------------------------------------------------------------------------------------


def test_keys_do_what_the_help_says(page: Page, run: Path) -> None:
    open_case(page, run, "ball")
    steps = {
        "d": "mode=diff", "b": "mode=blink", "s": "mode=swipe", "a": "mode=a",
        "e": "ev=0.5", "g": "enc=gamma", "+": "view=",
    }  # fmt: skip
    for key, wanted in steps.items():
        page.keyboard.press(key)
        wait_for_hash(page, wanted)
    page.keyboard.press("f")
    wait_for_hash(page, "view=", there=False)
    page.keyboard.press("r")
    wait_for_hash(page, "ev=", there=False)
    page.keyboard.press("E")
    wait_for_hash(page, "ev=-0.5")
    page.keyboard.press("1")
    wait_for_hash(page, "a=tracer")
    page.keyboard.press("Shift+Digit2")
    wait_for_hash(page, "b=student")
    page.keyboard.press("ArrowRight")
    wait_for_hash(page, "a=tracer", there=False)
    page.keyboard.press("?")
    help_text = page.locator("dialog.help").inner_text()
    assert "exposure" in help_text
    page.keyboard.press("Escape")
    assert not page.locator("dialog.help[open]").count()


def test_holding_shift_shows_the_reference(page: Page, run: Path) -> None:
    open_case(page, run, "ball", "#mode=a")
    which = page.locator(".pane .which")
    assert which.inner_text() == "A"
    page.keyboard.down("Shift")
    expect(which).to_have_text("B")
    page.keyboard.up("Shift")
    expect(which).to_have_text("A")


def test_keys_mean_nothing_while_typing(page: Page, run: Path) -> None:
    page.goto((run / "index.html").as_uri())
    page.locator("#search").fill("")
    page.locator("#search").press("?")
    assert page.locator("#search").input_value() == "?"
    assert not page.locator("dialog.help[open]").count()


def test_a_permalink_brings_everything_back(page: Page, run: Path) -> None:
    address = "#mode=diff&a=tracer&b=student&every=0&ev=-1.5&view=12.5,9,20&pin=3,4;11,7"
    open_case(page, run, "ball", address)
    assert panes(page) == ["|A − B| of A tracer and B student"]
    assert page.locator(".exposure output").inner_text() == "−1.5"
    assert page.locator(".inspector h3").first.inner_text() == "Pixel (11, 7), pinned"
    page.keyboard.press("m")
    wait_for_hash(page, "every", there=False)
    wait_for_hash(page, "view=12.5,9,20")
    wait_for_hash(page, "pin=3,4;11,7")


def test_nonsense_in_a_permalink_is_left_out(page: Page, run: Path) -> None:
    open_case(
        page, run, "ball", "#mode=constructor&a=nobody&ev=NaN&view=1,2&pin=x;;9e9,1&__proto__=1"
    )
    assert panes(page) == ["tracer", "student"]


# --- states ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def states(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The fixture's run, with packs for its balls: one of odd pixels and sizes, one broken."""
    root = make_run(tmp_path_factory.mktemp("states"), size=24)
    cases = [records.read_case(path) for path in sorted((root / "records").glob("*.json"))]
    odd = np.full((8, 8, 3), 0.5, np.float32)
    odd[2, 3] = np.nan
    odd[4, 5, 0] = np.inf
    first = pack.image("tracer", "image", np.full((8, 8, 3), 0.25, np.float32))
    second = pack.image("povray", "image", odd, first)
    third = pack.image("mytracer", "image", np.zeros((5, 9, 3), np.float32), first)
    pack.write(root / "data" / "odd.js", "odd", [first, second, third])
    records.write_text(root / "data" / "broken.js", "snellcheckPack({'schema': 'other'});\n")
    packs = {"ball-checkerboard": "data/odd.js", "ball-beach": "data/broken.js"}
    changed = [c.model_copy(update={"pack": packs.get(c.id)}) for c in cases]
    write_run(root, changed, records.read_summary(root / "summary.json"))
    write_report(root)
    return root


def test_pixels_that_are_not_finite_are_marked_and_named(page: Page, states: Path) -> None:
    open_case(page, states, "ball-checkerboard", "#pin=3,2&a=povray")
    assert [255, 0, 255] in colours_of(page, 1)
    assert page.locator("tr[data-image='povray'] td").all_inner_texts() == ["NaN"] * 3
    worst = page.locator(".jump").all_inner_texts()
    assert "(3, 2)" in worst[0]
    assert "not finite" in worst[0]
    page.goto(page.url.replace("pin=3,2", "pin=5,4"))
    page.reload()
    page.wait_for_selector("#viewer[data-ready]")
    assert page.locator("tr[data-image='povray'] td").first.inner_text() == "∞"


def test_where_nothing_was_measured_is_not_what_is_no_number(page: Page, run: Path) -> None:
    """Rays that are totally reflected have no error, and nothing is wrong with them."""
    record = open_case(page, run, "tir", "#mode=rays&every=0&a=tracer")
    assert record.pack
    probe = read_pack(run / record.pack)["probes"][0]
    missed = np.isnan(floats(probe["renderers"][0]["error"]["data"]))
    assert missed.any()
    colours = colours_of(page)
    assert [142, 146, 152] in colours
    assert [255, 0, 255] not in colours


def test_sizes_that_differ_are_said_to(page: Page, states: Path) -> None:
    open_case(page, states, "ball-checkerboard", "#mode=diff&a=mytracer&every=0")
    assert (
        "Sizes differ: mytracer is 9 × 5, tracer is 8 × 8" in page.locator(".notice").inner_text()
    )


def test_absent_renderers_are_named_with_their_reason(page: Page, states: Path) -> None:
    open_case(page, states, "ball-checkerboard")
    missing = page.locator(".pane.missing").inner_text()
    assert "mitsuba-exact" in missing
    assert "is not installed: .venv/bin/uv pip install" in missing


def test_a_broken_pack_leaves_the_pictures(page: Page, states: Path) -> None:
    record = record_of(states, "ball-beach")
    page.goto((states / "cases" / page_name(record.id)).as_uri())
    page.wait_for_selector("#viewer[data-ready]")
    assert "Pixel data could not be shown" in page.locator("#viewer").inner_text()
    assert page.locator("#pictures img").first.is_visible()


def test_without_a_pack_the_page_says_so(page: Page, states: Path) -> None:
    record = record_of(states, "slab-thin-face")
    page.goto((states / "cases" / page_name(record.id)).as_uri())
    page.wait_for_selector("#viewer[data-ready]")
    assert "Pixel data not included" in page.locator("#viewer").inner_text()


def test_data_blocks_are_json(states: Path) -> None:
    for path in sorted((states / "cases").glob("*.html")):
        text = path.read_text("utf-8")
        (block,) = re.findall(
            r'<script type="application/json" id="case-data">(.*?)</script>', text
        )
        assert json.loads(block)["id"]
