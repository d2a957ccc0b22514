"""A lane per renderer: it is calibrated once, then does its jobs, and reports each result.

Renderers run side by side, each as many jobs at a time as serves it: one for a worker process that
uses all cores itself, many for POV-Ray, whose processes mostly sleep. Everything that happens is
put on one queue, so that whoever listens needs no locks.
"""

from __future__ import annotations

import errno
import os
import queue
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from harness.cache.cache import Cache
from harness.errors import ConnectionLost, RendererError, RendererFailed, RendererMissing
from harness.judging.results import FAILED_PREFLIGHT, Contender, Result
from harness.plan import Job, way_pixels
from harness.preflight import Render, preflight
from harness.record import Verdict
from harness.renderers.base import (
    MAIN_WAY,
    Image,
    Rays,
    RayTracingRenderer,
    Renderer,
    RenderSettings,
)
from harness.renderers.process_tree import Running, belong_to
from harness.running.memo import Memo, memo_of
from harness.scene.resolved import ResolvedScene
from harness.truth.camera import primary_rays, rays_through

# With less room than this in the temporary folder, a failure that sounds like it is the disk's, and
# with hardly any room every failure is: not all programs say what kept them from writing.
SPARE_BYTES = 16 * 2**20
HARDLY_ANY_BYTES = 2**20


@dataclass(frozen=True)
class Calibrated:
    """A renderer is ready, or out with the reason; `remedy` is the command that mends it.

    `memo` is what is known of its work; it is `reused` where its calibration was part of that.
    """

    contender: Contender
    memo: Memo
    reused: bool = False
    remedy: str = ""


@dataclass(frozen=True)
class Done:
    """A job's result after `seconds` of wall time, spent in an earlier run where it is `reused`."""

    case: int
    job: Job
    result: Result
    seconds: float
    reused: bool = False


@dataclass(frozen=True)
class Halted:
    """Nothing can go on, for a reason that is no renderer's fault.

    The disk is full (OSError), or a cluster cannot be reached.
    """

    error: OSError | ConnectionLost


Event = Calibrated | Done | Halted
# What a renderer of someone else's may raise. Each must end as an event, or the run would wait for
# it for ever; SystemExit is no Exception.
ANYTHING = (Exception, SystemExit)
MakeExecutor = Callable[[int, Running], Executor]


def threads(count: int, running: Running) -> Executor:
    """The executor of a lane: jobs wait for child processes, so threads do."""
    return ThreadPoolExecutor(max_workers=count, initializer=belong_to, initargs=(running,))


@dataclass(frozen=True)
class Surroundings:
    """What all lanes of a run share: where they report, what is known, what has been started."""

    events: queue.SimpleQueue[Event]
    lasting: Cache | None
    passing: Cache
    running: Running
    make_executor: MakeExecutor = threads


class Lane:
    """One renderer and the executor that runs its jobs."""

    def __init__(
        self, renderer: Renderer, settings: RenderSettings, surroundings: Surroundings
    ) -> None:
        self.renderer, self.settings, self.around = renderer, settings, surroundings
        self.concurrency: int = getattr(renderer, "concurrency", 1)
        self.executor = surroundings.make_executor(self.concurrency, surroundings.running)
        self._memo = Memo(renderer.name, "", None, lasting=False)

    def start(self) -> None:
        """Calibrates the renderer; a `Calibrated` event follows."""
        self.executor.submit(self._reporting, self._calibrate)

    def submit(self, case: int, jobs: Sequence[Job]) -> None:
        """Runs jobs; a `Done` event follows for each."""
        for job in jobs:
            self.executor.submit(self._reporting, partial(self._perform, case, job))

    def close(self) -> None:
        """Drops what has not started and ends the renderer's process."""
        self.executor.shutdown(wait=False, cancel_futures=True)
        close = getattr(self.renderer, "close", None)
        if close is not None:
            close()

    def _reporting(self, work: Callable[[], Event]) -> None:
        try:
            self.around.events.put(work())
        except (OSError, ConnectionLost) as error:
            self.around.events.put(Halted(error))

    def _calibrate(self) -> Calibrated:
        self._memo = memo_of(self.renderer, self.around.lasting, self.around.passing)
        if (known := self._memo.calibration(self.settings)) is not None:
            return Calibrated(known, self._memo, reused=True)
        remedy = ""
        try:
            contender = calibrate(self.renderer, self.settings, self._render)
            if contender.absent is Verdict.SKIP:
                remedy = self.renderer.health().remedy
        except (ConnectionLost, DiskFull):
            raise
        except ANYTHING as error:
            reason = f"failed: {_described(error)}"
            contender = _out(self.renderer.name, Verdict.ERROR, reason)
        self._memo.keep_calibration(self.settings, contender)
        return Calibrated(contender, self._memo, remedy=remedy)

    def _render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        """An image for the calibration, which a run that was killed may have made before."""
        key = self._memo.key(Job(self.renderer.name, "calibration", scene, settings))
        if (known := self._memo.result(key)) is not None and isinstance(known.result, Image):
            return known.result
        start = time.perf_counter()
        try:
            image = self.renderer.render(scene, settings)
        except RendererFailed as failure:
            _blame_the_disk(failure)
            raise
        self._memo.keep(key, image, time.perf_counter() - start)
        return image

    def _perform(self, case: int, job: Job) -> Done:
        key = self._memo.key(job)
        if (known := self._memo.result(key)) is not None:
            return Done(case, job, known.result, known.seconds, reused=True)
        start = time.perf_counter()
        result = perform(self.renderer, job)
        seconds = time.perf_counter() - start
        self._memo.keep(key, result, seconds)
        return Done(case, job, result, seconds)


class DiskFull(OSError):
    """There is no room for the files of renderers: every other result would be lost as well."""


def perform(renderer: Renderer, job: Job) -> Result:
    """Does one job; whatever goes wrong is the result, so one failure costs one result.

    Raises DiskFull.
    """
    result = _performed(renderer, job)
    if isinstance(result, RendererFailed):
        _blame_the_disk(result)
    return result


def _performed(renderer: Renderer, job: Job) -> Result:
    try:
        if job.path is None:
            start = time.perf_counter()
            image = renderer.render(job.scene, job.settings)
            return replace(image, seconds=image.seconds or time.perf_counter() - start)
        if not isinstance(renderer, RayTracingRenderer):
            return RendererFailed(f"{renderer.name} claims to trace rays but cannot")
        return renderer.trace(job.scene, _rays_of(job), job.path, job.settings)
    except RendererError as error:
        return error
    except ConnectionLost:
        raise
    except ANYTHING as error:
        return RendererFailed(_described(error))


def _rays_of(job: Job) -> Rays:
    """The camera's rays, through all pixel centres or, for main ways, through a grid of them."""
    if job.path != MAIN_WAY:
        return primary_rays(job.scene)
    row, column = np.divmod(way_pixels(job.scene.film), job.scene.film.width)
    return rays_through(job.scene, column + 0.5, row + 0.5)


def _blame_the_disk(failure: RendererFailed) -> None:
    """Raises DiskFull where a renderer failed because there was no room for its files."""
    why = os.strerror(errno.ENOSPC)
    folder = tempfile.gettempdir()
    says_so = why in f"{failure} {failure.log}"
    if shutil.disk_usage(folder).free < (SPARE_BYTES if says_so else HARDLY_ANY_BYTES):
        raise DiskFull(errno.ENOSPC, why, folder)


def calibrate(
    renderer: Renderer, settings: RenderSettings, render: Render | None = None
) -> Contender:
    """The renderer as the judge sees it: out where it is missing, fails, or fails its preflight."""
    name = renderer.name
    try:
        version = renderer.version()
    except RendererMissing as error:
        return _out(name, Verdict.SKIP, f"not installed: {error}")
    except RendererError as error:
        return _out(name, Verdict.ERROR, f"failed to start: {error}{_tail(error)}")
    try:
        found = preflight(renderer, settings, render)
    except RendererMissing as error:
        return _out(name, Verdict.SKIP, f"not installed: {error}")
    except RendererError as error:
        return _out(name, Verdict.ERROR, f"{FAILED_PREFLIGHT}{error}{_tail(error)}", version)
    if found.findings:
        reason = FAILED_PREFLIGHT + "; ".join(found.findings)
        return _out(name, Verdict.ERROR, reason, version)
    return Contender(name, version, renderer.capabilities, found)


def _out(name: str, absent: Verdict, reason: str, version: str = "") -> Contender:
    return Contender(name, version, frozenset(), None, absent, reason)


def _described(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}".rstrip(": ")


def _tail(error: RendererError) -> str:
    lines = error.log.strip().splitlines()
    return f" ({lines[-1]})" if lines else ""
