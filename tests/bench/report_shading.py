"""How fast the viewer is with large pictures: ``python tests/bench/report_shading.py [SIDE …]``.

Opens a case with two pictures of SIDE x SIDE pixels in Chromium, and measures how long that takes,
and then from the change of exposure or zoom to the frame that shows it. In milliseconds: the median
of the wall time, and the processor time of the page's main thread, which tells more where others
are at work.
Once side by side on 1400 x 1000, once one picture alone on a screen of 3840 x 2160 (twice as many
pixels each way as CSS counts).
"""

from __future__ import annotations

import json
import shutil
import statistics
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from playwright.sync_api import CDPSession, Page, sync_playwright

from harness import record as records
from harness.report import pack, write_report
from harness.report.links import page_name
from tests.bench.report_scale import make_run, worked

# A pixel is read back, so that what was drawn has been drawn.
STEP = """async ([key, times]) => { const found = [];
const read = () => [...document.querySelectorAll('.pane canvas')]
  .map((c) => c.getContext('2d').getImageData(0, 0, 1, 1));
for (let k = 0; k < times; k++) { const t = performance.now();
dispatchEvent(new KeyboardEvent('keydown', { key })); await new Promise(requestAnimationFrame);
read(); found.push(performance.now() - t); } return found; }"""


def run_with(root: Path, side: int) -> Path:
    """A run of one case with two pictures; returns its page."""
    make_run(root, 1)
    rng = np.random.default_rng(0)
    first = rng.random((side, side, 3)).astype(np.float32)
    second = first + rng.normal(0, 1e-3, first.shape).astype(np.float32)
    a = pack.image("tracer", "image", first)
    pack.write(root / "data/shared.js", "shared", [a, pack.image("povray", "image", second, a)])
    write_report(root)
    (record,) = (root / "records").glob("*.json")
    return root / "cases" / page_name(records.read_case(record).id)


def frames(page: Page, session: CDPSession, key: str, times: int) -> tuple[float, float]:
    """Median wall time of a frame after `key`, and mean processor time, in ms."""
    page.evaluate(STEP, [key, 1])
    before = worked(session)
    wall = statistics.median(page.evaluate(STEP, [key, times]))
    return wall, (worked(session) - before) / times


def measured(page: Page, address: str) -> Iterator[tuple[str, float]]:
    session = page.context.new_cdp_session(page)
    session.send("Performance.setTimeDomain", {"timeDomain": "threadTicks"})
    session.send("Performance.enable")
    page.goto(address)
    page.wait_for_selector("#viewer[data-ready]", timeout=300_000)
    yield "opens_ms", page.evaluate("performance.now()")
    yield "opens_cpu_ms", worked(session)
    steps = (
        ("exposure", "", "e", 9), ("exposure_near", "0", "e", 9), ("zoom", "", "+", 5),
        ("exposure_of_map", "fd", "e", 9),
    )  # fmt: skip
    for name, first, key, times in steps:
        for press in first:
            page.keyboard.press(press)
        wall, cpu = frames(page, session, key, times)
        yield f"{name}_ms", wall
        yield f"{name}_cpu_ms", cpu
    page.keyboard.press("f")
    page.keyboard.press("d")
    page.wait_for_timeout(400)
    before = worked(session)
    page.keyboard.press("g")  # all pixels of the screen, as after a drag
    page.wait_for_timeout(400)
    yield "at_rest_cpu_ms", worked(session) - before


SCREENS = {"two": ((1400, 1000), 1, ""), "alone": ((1920, 1080), 2, "#mode=a")}


def main() -> None:
    sides = [int(text) for text in sys.argv[1:]] or [256, 1024, 2048, 4096]
    program = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as scratch:
        browser = playwright.chromium.launch(
            executable_path=program, args=["--no-sandbox", "--disable-gpu"]
        )
        for side in sides:
            address = run_with(Path(scratch) / str(side), side).as_uri()
            for name, ((width, height), ratio, mode) in SCREENS.items():
                page = browser.new_page(
                    viewport={"width": width, "height": height}, device_scale_factor=ratio
                )
                figures = {k: round(v, 1) for k, v in measured(page, address + mode)}
                line = {"side": side, "pictures": name, **figures}
                sys.stdout.write(json.dumps(line) + "\n")
                sys.stdout.flush()
                page.close()
        browser.close()


if __name__ == "__main__":
    main()
