"""The report in Firefox, from a file: every mode, the values, and the filters of the index.

Playwright drives a Firefox of its own build only, so this is driven by Mozilla's Marionette.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harness import imagefile
from harness import record as records
from harness.record import CaseRecord
from harness.report.links import page_name
from tests.harness.tiny import report_of_dense_glass

pytestmark = [
    pytest.mark.browser,
    # Marionette leaves the sockets open with which it waited for Firefox.
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

MODES = ("side", "swipe", "blink", "a", "b", "diff", "relative", "ssim", "deltae", "flip", "rays")
COLOURS = """(() => { const c = document.querySelector('.pane canvas');
const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; const s = new Set();
for (let i = 0; i < d.length; i += 4) s.add([d[i], d[i + 1], d[i + 2]].join());
return s.size; })()"""


class Firefox:
    """A page in Firefox."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def open(self, address: str) -> None:
        self.driver.navigate("about:blank")
        self.driver.navigate(address)

    def ask(self, expression: str) -> Any:
        return self.driver.execute_script(f"return {expression}", sandbox=None)

    def wait(self, expression: str) -> None:
        for _ in range(300):
            if self.ask(expression):
                return
            time.sleep(0.1)
        pytest.fail(f"never came true: {expression}")


@pytest.fixture(scope="module")
def firefox(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Firefox]:
    marionette = pytest.importorskip(
        "marionette_driver.marionette", reason="marionette-driver is for Linux"
    )
    program = next(filter(None, map(shutil.which, ("firefox-esr", "firefox"))), None)
    if program is None:
        pytest.skip("no Firefox: sudo apt-get install firefox-esr")
    # Beside the program itself, and not a link to it, lies what it is made of.
    binary = str(Path(program).resolve())
    log = str(tmp_path_factory.mktemp("firefox") / "gecko.log")
    driver = marionette.Marionette(bin=binary, headless=True, gecko_log=log, startup_timeout=120)
    try:
        driver.start_session()
        yield Firefox(driver)
    finally:
        driver.quit()


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, CaseRecord]:
    root = report_of_dense_glass(tmp_path_factory.mktemp("run"), "slab*thickness=1]")
    (record,) = map(records.read_case, (root / "records").glob("*.json"))
    return root, record


def test_every_mode_shows_something(firefox: Firefox, case: tuple[Path, CaseRecord]) -> None:
    root, record = case
    address = (root / "cases" / page_name(record.id)).as_uri()
    for mode in MODES:
        firefox.open(f"{address}#mode={mode}")
        firefox.wait("!!document.querySelector('#viewer[data-ready] .pane canvas')")
        firefox.wait(f"{COLOURS} > 1")
        assert firefox.ask("document.querySelector('.notice').textContent") == "", mode


def test_values_are_those_of_the_exr(firefox: Firefox, case: tuple[Path, CaseRecord]) -> None:
    root, record = case
    firefox.open((root / "cases" / page_name(record.id)).as_uri() + "#pin=11,1")
    firefox.wait("!!document.querySelector('#viewer[data-ready] .values td')")
    for of in record.runs:
        linear, _ = imagefile.read(root / of.images[0].path)
        texts = firefox.ask(
            f"[...document.querySelectorAll('tr[data-image=\"{of.name}\"] td')]"
            ".map((td) => td.textContent)"
        )
        shown = [np.float32(text.replace("−", "-")) for text in texts]
        assert np.array_equal(shown, linear[1, 11]), of.name


def test_the_index_filters(firefox: Firefox, case: tuple[Path, CaseRecord]) -> None:
    root, _ = case
    firefox.open((root / "index.html").as_uri() + "#q=nothing+like+it")
    firefox.wait("document.querySelectorAll('.row:not([hidden])').length === 0")
    firefox.open((root / "index.html").as_uri() + "#q=slab")
    firefox.wait("document.querySelectorAll('.row:not([hidden])').length === 1")
