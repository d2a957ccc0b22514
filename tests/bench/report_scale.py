"""How the report copes with many cases: ``python tests/bench/report_scale.py [CASES [FOLDER]]``.

Makes a run of that many cases with four renderers, and of a quarter of them, builds their reports,
and opens the larger in Chromium where that is. What a browser does is measured several times, since
others may be at work: the shortest wall time counts, and the least that its main thread worked.
Writes the figures to reports/report_scale.json. Tests look at sizes only.
"""

from __future__ import annotations

import json
import multiprocessing
import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from harness import record as records
from harness.record import (
    CaseRecord,
    Check,
    Curve,
    DifferenceMap,
    ImageFile,
    RendererRun,
    Series,
    Summary,
    SummaryCase,
    Verdict,
    write_text,
)
from harness.report import pack, pictures, write_report
from harness.report.links import page_name

if TYPE_CHECKING:
    from playwright.sync_api import CDPSession, Page

Result = TypeVar("Result")
RENDERERS = ("tracer", "povray", "mitsuba", "mitsuba-exact")
FAMILIES = ("slab", "snell", "ball", "prism", "fresnel", "tir")
SIDE = 192  # pixels of a picture
TIMES = 5  # that each thing is measured in the browser


def case(k: int, shared: dict[str, ImageFile], difference: str) -> CaseRecord:
    """Case number k: every 40th fails, every 11th is known to deviate."""
    rng = np.random.default_rng(k)
    family = FAMILIES[k % len(FAMILIES)]
    case_id = f"{family}-sweep[ior={1.3 + 0.001 * k:.3f},thickness={0.1 + k % 7}]"
    x = np.linspace(0, 80, 96)
    tolerance = 2e-6 * (1 + (x / 80) ** 4)
    residual = {r: rng.normal(0, 4e-7, 96) for r in RENDERERS}
    checks, runs = [], []
    for n, renderer in enumerate(RENDERERS):
        bad = k % 40 == 0 and n == 2
        status = Verdict.FAIL if bad else Verdict.KNOWN if k % 11 == n else Verdict.PASS
        for observable in ("exit_point", "exit_direction", "slab_offset"):
            checks.append(  # noqa: PERF401
                Check(
                    id=f"{observable}(through)/{renderer}/truth", renderer=renderer,
                    against="truth", observable=observable, unit="units", expected=0.0,
                    value=float(abs(rng.normal(0, 1e-6))) * (300 if bad else 1), tolerance=4e-6,
                    status=status, reason="off by 3e-4 units, 75 times the tolerance" * bad,
                    derivation="quantum of the image + 8 eps per rounding chain x condition",
                    detail={"max": 1e-6, "rms": 3e-7, "rays": 36864, "worst_pixel_x": 3},
                )
            )  # fmt: skip
        runs.append(
            RendererRun(
                name=renderer, version="1.0", status=status, render_s=0.1, renders=5,
                images=[shared[renderer]], settings={"samples": 64},
            )
        )  # fmt: skip
    curve = Curve(
        id="slab_offset-through", title="Slab offset", x_label="angle of incidence (°)",
        y_label="offset (units)", residual_label="measured − truth",
        series=[Series(renderer="truth", x=x.tolist(), y=np.sin(np.radians(x)).tolist())]
        + [
            Series(renderer=r, x=x.tolist(), y=(np.sin(np.radians(x)) + e).tolist())
            for r, e in residual.items()
        ],
        residuals=[Series(renderer=r, x=x.tolist(), y=e.tolist()) for r, e in residual.items()],
        tolerance=tolerance.tolist(),
    )  # fmt: skip
    return CaseRecord(
        id=case_id, case=f"{family}-sweep", family=family, title="A slab only shifts the ray",
        parameters={"ior": 1.3 + 0.001 * k}, scene_sha256="0" * 64, scene_file="slab/x.toml",
        quality="normal", snellcheck_version="0.1.0", started="2026-01-02T03:04:05+00:00",
        wall_s=0.5, status=records.worst([c.status for c in checks]), runs=runs, checks=checks,
        curves=[curve], pack="data/shared.js",
        differences=[
            DifferenceMap(a="mitsuba", b="tracer", path=difference, limit=1e-3, unit="radiance")
        ],
    )  # fmt: skip


def make_run(root: Path, count: int) -> Path:
    """Writes the run: every case has a record of its own, pictures and pixels are shared."""
    rng = np.random.default_rng(0)
    base = rng.random((SIDE, SIDE, 3)).astype(np.float32)
    shared, images = {}, []
    for renderer in RENDERERS:
        pixels = (base + rng.normal(0, 1e-6, base.shape)).astype(np.float32)
        images.append(pack.image(renderer, "image", pixels, images[0] if images else None))
        for name, longest in (("large", SIDE), ("small", 96)):
            path = root / f"images/{renderer}-{name}.webp"
            pictures.write_thumbnail(pixels, path, longest=longest)
        shared[renderer] = ImageFile(
            role="image", path=f"images/{renderer}-large.webp", width=SIDE, height=SIDE,
            picture=f"images/{renderer}-large.webp", sha256="0" * 64,
            thumbnail=f"images/{renderer}-small.webp",
        )  # fmt: skip
    pack.write(root / "data/shared.js", "shared", images)
    difference = "images/difference.webp"
    pictures.write_difference(base, base + np.float32(1e-4), 1e-3, root / difference)
    cases = []
    for record in (case(k, shared, difference) for k in range(count)):
        records.write(record, root / "records" / page_name(record.id).replace(".html", ".json"))
        cases.append(
            SummaryCase(
                id=record.id, family=record.family, status=record.status, checks=record.checks
            )
        )
    verdicts = [c.status for one in cases for c in one.checks]
    summary = Summary(
        snellcheck_version="0.1.0", started="2026-01-02T03:04:05+00:00", wall_s=60,
        quality="normal", exit_code=1, cases=cases,
        counts=records.Counts.model_validate({v.value: verdicts.count(v) for v in Verdict}),
        renderers={
            name: records.RendererSummary(
                version="1.0", status="ok", cases=count, render_s=float(10 + k),
                facts={"position_resolution": 10.0 ** -(k + 6)},
            )
            for k, name in enumerate(RENDERERS)
        },
    )  # fmt: skip
    records.write(summary, root / "summary.json")
    return root


def build(root: Path, count: int) -> dict[str, float]:
    """Makes a run, and its report in a process of its own, for its memory.

    The run is made in another one: the most that a process ever held is also that of those which
    it starts.
    """
    apart(make_run, root, count)
    return apart(_build, root, count)


def apart(function: Callable[[Path, int], Result], root: Path, count: int) -> Result:
    """What `function` returns in a process of its own."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        return pool.submit(function, root, count).result()


def _build(root: Path, count: int) -> dict[str, float]:
    start = time.process_time()
    index = write_report(root)
    seconds = time.process_time() - start
    return {
        "cases_per_cpu_second": count / seconds,
        "index_megabytes": index.stat().st_size / 1e6,
        "peak_megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
    }


READY = "performance.getEntriesByType('navigation')[0].domContentLoadedEventEnd"
# From the key to the frame that shows what it did.
FRAME = "await new Promise((r) => requestAnimationFrame(() => setTimeout(r)));"
FILTER = f"""async (text) => {{ const s = document.getElementById('search');
const t = performance.now(); s.value = text; s.dispatchEvent(new Event('input'));
{FRAME} return performance.now() - t; }}"""
SCROLL = f"""async () => {{ let worst = 0; for (let k = 1; k <= 20; k++) {{
const t = performance.now(); scrollTo(0, k * document.body.scrollHeight / 21);
{FRAME} worst = Math.max(worst, performance.now() - t); }} return worst; }}"""


def opened(page: Page, address: str, until: str, ready: str) -> tuple[float, float]:
    """Wall time until a page is ready, and the time that its main thread worked, in ms."""
    page.goto("about:blank")
    session = page.context.new_cdp_session(page)
    session.send("Performance.setTimeDomain", {"timeDomain": "threadTicks"})
    session.send("Performance.enable")
    before = worked(session)
    page.goto(address)
    page.wait_for_selector(until)
    wall = page.evaluate(ready)
    return wall, worked(session) - before


def worked(session: CDPSession) -> float:
    """What the main thread has worked so far, in ms of the domain that was set."""
    found = session.send("Performance.getMetrics")["metrics"]
    return 1000 * next(m["value"] for m in found if m["name"] == "TaskDuration")


def browse(root: Path) -> Iterator[tuple[str, float]]:
    from playwright.sync_api import sync_playwright

    program = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
    if program is None:
        return
    with sync_playwright() as playwright:
        flags = ["--no-sandbox", "--disable-gpu"]
        browser = playwright.chromium.launch(executable_path=program, args=flags)
        page = browser.new_page(viewport={"width": 1400, "height": 1000})
        index = (root / "index.html").as_uri()
        case = sorted((root / "cases").glob("*.html"))[0].as_uri()
        pages = (
            ("index_ready", index, ".matrix", READY),
            ("case_open", case, "#viewer[data-ready]", "performance.now()"),
        )
        for name, *how in pages:
            wall, worked = zip(*(opened(page, *how) for _ in range(TIMES)), strict=True)
            yield f"{name}_ms", min(wall)
            yield f"{name}_main_thread_ms", min(worked)
        page.goto(index)
        for text in ("1.4", "ball", ""):
            yield (
                f"filter_ms_{text or 'all'}",
                min(page.evaluate(FILTER, text) for _ in range(TIMES)),
            )
        yield "scroll_worst_ms", min(page.evaluate(SCROLL) for _ in range(TIMES))
        browser.close()


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(scratch) / "all"
        quarter = build(Path(scratch) / "quarter", count // 4)
        figures = {"cases": count, **build(root, count)}
        figures["peak_megabytes_of_a_quarter"] = quarter["peak_megabytes"]
        figures |= dict(browse(root))
    text = json.dumps({k: round(v, 2) for k, v in figures.items()}, indent=1)
    write_text(Path("reports/report_scale.json"), text + "\n")
    sys.stdout.write(text + "\n")


if __name__ == "__main__":
    main()
