"""Renderers and a browser that tests share, because each start of one costs a second."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from harness.errors import RendererMissing
from harness.renderers import mitsuba_variants as variants
from harness.renderers.persistent import WorkerRenderer

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Request

CHROMIUM = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


def _mitsuba(name: str, engine: str) -> Iterator[WorkerRenderer]:
    try:
        variants.choose()
    except RendererMissing as missing:
        pytest.skip(str(missing))
    target = f"harness.renderers.mitsuba:{engine}"
    renderer = WorkerRenderer(name, target, env=variants.child_environment)
    try:
        renderer.version()
    except RendererMissing as missing:  # following both lobes needs libLLVM
        pytest.skip(str(missing))
    yield renderer
    renderer.close()


@pytest.fixture(scope="session")
def exact() -> Iterator[WorkerRenderer]:
    """Mitsuba without sampling, in a worker."""
    yield from _mitsuba("mitsuba-exact", "ExactEngine")


@pytest.fixture(scope="session")
def stock() -> Iterator[WorkerRenderer]:
    """Mitsuba as its users run it, in a worker."""
    yield from _mitsuba("mitsuba", "StockEngine")


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    playwright = pytest.importorskip("playwright.sync_api", reason="uv pip install playwright")
    program = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if program is None:
        pytest.skip("no Chromium: sudo apt-get install chromium")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=program, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A page in which any error, refusal by the policy or foreign request fails the test."""
    context = browser.new_context(viewport={"width": 1400, "height": 1000}, reduced_motion="reduce")
    page = context.new_page()
    complaints: list[str] = []

    def judge(request: Request) -> None:
        if not request.url.startswith("file:"):
            complaints.append(f"asked for {request.url}")

    def judge_failure(request: Request) -> None:
        if request.failure != "net::ERR_ABORTED":  # the page was left before it was all there
            complaints.append(f"{request.failure}: {request.url}")

    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", judge)
    page.on("requestfailed", judge_failure)
    yield page
    assert complaints == []
    context.close()
