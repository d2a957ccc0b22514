"""How fast the viewer is with large pictures: ``python tests/bench/report_shading.py [SIDE …]``.

Opens a case with two pictures of SIDE x SIDE pixels in Chromium, and measures from the change of
exposure, zoom or place to the frame that shows it, in milliseconds of wall time.
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
from playwright.sync_api import Page, sync_playwright

from harness import record as records
from harness.report import pack, write_report
from harness.report.links import page_name
from tests.bench.report_scale import make_run

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


def measured(page: Page, address: str) -> Iterator[tuple[str, float]]:
    page.goto(address)
    page.wait_for_selector("#viewer[data-ready]")
    page.evaluate(STEP, ["e", 1])
    yield "exposure_ms", statistics.median(page.evaluate(STEP, ["e", 7]))
    page.keyboard.press("0")
    yield "exposure_near_ms", statistics.median(page.evaluate(STEP, ["e", 7]))
    yield "zoom_ms", statistics.median(page.evaluate(STEP, ["+", 5]))
    page.keyboard.press("f")
    page.keyboard.press("d")
    page.evaluate(STEP, ["e", 1])
    yield "exposure_of_map_ms", statistics.median(page.evaluate(STEP, ["e", 7]))


def main() -> None:
    sides = [int(text) for text in sys.argv[1:]] or [256, 512, 1024, 2048]
    program = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as scratch:
        browser = playwright.chromium.launch(
            executable_path=program, args=["--no-sandbox", "--disable-gpu"]
        )
        for side in sides:
            address = run_with(Path(scratch) / str(side), side).as_uri()
            page = browser.new_page(viewport={"width": 1400, "height": 1000})
            figures = {k: round(v, 1) for k, v in measured(page, address)}
            sys.stdout.write(json.dumps({"side": side, **figures}) + "\n")
            page.close()
        browser.close()


if __name__ == "__main__":
    main()
