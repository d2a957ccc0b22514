"""A lane per renderer: it is calibrated once, then does its jobs, and reports each result.

Renderers run side by side, each as many jobs at a time as serves it: one for a worker process that
uses all cores itself, many for POV-Ray, whose processes mostly sleep. Everything that happens is
put on one queue, so that whoever listens needs no locks.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace

from harness.camera import primary_rays
from harness.errors import RendererError, RendererFailed, RendererMissing
from harness.plan import Job
from harness.preflight import preflight
from harness.record import Verdict
from harness.renderers.base import Image, RayTracingRenderer, Renderer, RenderSettings
from harness.results import Contender, Result


@dataclass(frozen=True)
class Calibrated:
    """A renderer is ready, or out with the reason; `remedy` is the command that mends it."""

    contender: Contender
    remedy: str = ""


@dataclass(frozen=True)
class Done:
    """A job's result after `seconds` of wall time."""

    case: int
    job: Job
    result: Result
    seconds: float


Event = Calibrated | Done
# What a renderer of someone else's may raise. Each must end as an event, or the run would wait for
# it for ever; SystemExit is no Exception.
ANYTHING = (Exception, SystemExit)
MakeExecutor = Callable[[int], Executor]


def threads(count: int) -> Executor:
    """The executor of a lane: jobs wait for child processes, so threads do."""
    return ThreadPoolExecutor(max_workers=count)


class Lane:
    """One renderer and the executor that runs its jobs."""

    def __init__(
        self,
        renderer: Renderer,
        settings: RenderSettings,
        events: queue.SimpleQueue[Event],
        make_executor: MakeExecutor = threads,
    ) -> None:
        self.renderer, self.settings, self.events = renderer, settings, events
        self.executor = make_executor(getattr(renderer, "concurrency", 1))

    def start(self) -> None:
        """Calibrates the renderer; a `Calibrated` event follows."""
        self.executor.submit(self._calibrate)

    def submit(self, case: int, jobs: Sequence[Job]) -> None:
        """Runs jobs; a `Done` event follows for each."""
        for job in jobs:
            self.executor.submit(self._perform, case, job)

    def close(self) -> None:
        """Drops what has not started and ends the renderer's process."""
        self.executor.shutdown(wait=False, cancel_futures=True)
        close = getattr(self.renderer, "close", None)
        if close is not None:
            close()

    def _calibrate(self) -> None:
        remedy = ""
        try:
            contender = calibrate(self.renderer, self.settings)
            if contender.absent is Verdict.SKIP:
                remedy = self.renderer.health().remedy
        except ANYTHING as error:
            reason = f"failed: {_described(error)}"
            contender = _out(self.renderer.name, Verdict.ERROR, reason)
        self.events.put(Calibrated(contender, remedy))

    def _perform(self, case: int, job: Job) -> None:
        start = time.perf_counter()
        result = perform(self.renderer, job)
        self.events.put(Done(case, job, result, time.perf_counter() - start))


def perform(renderer: Renderer, job: Job) -> Result:
    """Does one job; whatever goes wrong is the result, so one failure costs one result."""
    try:
        if job.path is None:
            start = time.perf_counter()
            image = renderer.render(job.scene, job.settings)
            return replace(image, seconds=image.seconds or time.perf_counter() - start)
        if not isinstance(renderer, RayTracingRenderer):
            return RendererFailed(f"{renderer.name} claims to trace rays but cannot")
        return renderer.trace(job.scene, primary_rays(job.scene), job.path, job.settings)
    except RendererError as error:
        return error
    except ANYTHING as error:
        return RendererFailed(_described(error))


def calibrate(renderer: Renderer, settings: RenderSettings) -> Contender:
    """The renderer as the judge sees it: out where it is missing, fails, or fails its preflight."""
    name = renderer.name
    try:
        version = renderer.version()
    except RendererMissing as error:
        return _out(name, Verdict.SKIP, f"not installed: {error}")
    except RendererError as error:
        return _out(name, Verdict.ERROR, f"failed to start: {error}{_tail(error)}")
    try:
        found = preflight(renderer, settings)
    except RendererMissing as error:
        return _out(name, Verdict.SKIP, f"not installed: {error}")
    except RendererError as error:
        return _out(name, Verdict.ERROR, f"failed its preflight: {error}{_tail(error)}", version)
    if found.findings:
        reason = "failed its preflight: " + "; ".join(found.findings)
        return _out(name, Verdict.ERROR, reason, version)
    return Contender(name, version, renderer.capabilities, found)


def _out(name: str, absent: Verdict, reason: str, version: str = "") -> Contender:
    return Contender(name, version, frozenset(), None, absent, reason)


def _described(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}".rstrip(": ")


def _tail(error: RendererError) -> str:
    lines = error.log.strip().splitlines()
    return f" ({lines[-1]})" if lines else ""


def picture_of(result: Result) -> Image | None:
    """The result where it is an image."""
    return result if isinstance(result, Image) else None
