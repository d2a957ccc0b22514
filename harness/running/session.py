"""The state of one run: which renderers are ready, and what each case still waits for."""

from __future__ import annotations

import contextlib
import queue
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from harness import plan
from harness.archive import Archive
from harness.baseline.stand_in import StandIns
from harness.cache.cache import Cache
from harness.errors import RendererError
from harness.judging import spectral
from harness.judging.judge import CaseJudge
from harness.judging.pairs import camera_shift
from harness.judging.results import Contender, Result, Results
from harness.plan import Job, PreparedCase
from harness.record import CaseRecord, Effort, SummaryCase, Verdict
from harness.renderers.base import Renderer, RenderSettings
from harness.renderers.process_tree import Running
from harness.running import bundle
from harness.running.lanes import (
    Calibrated,
    Done,
    Event,
    Halted,
    Lane,
    MakeExecutor,
    Surroundings,
    threads,
)
from harness.running.memo import Memo
from harness.scene.resolved import ResolvedScene
from harness.verdict import unmeasured

# Lanes get the jobs of so many cases at a time, counted from the first that is not judged: a fast
# renderer that is through with all of them before a slow one has begun fills memory with results.
AHEAD = 16


@dataclass(frozen=True)
class Progress:
    """How far a run is. `total` grows as renderers get ready."""

    done: int
    total: int
    message: str


@dataclass
class _CaseState:
    case: PreparedCase
    started: float
    results: dict[tuple[str, str], Result] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    pending: int = 0
    key: str | None = None  # under which the case is kept once it is judged
    contenders: list[Contender] | None = None  # those of this case, stored ones among them
    given: dict[str, ResolvedScene] = field(default_factory=dict)  # what renderers got first


@dataclass(frozen=True)
class Storage:
    """Where a run writes, and what it knows: `lasting` from earlier runs, `passing` from itself."""

    archive: Archive
    lasting: Cache | None
    passing: Cache


class Session:
    """Calibrates renderers, hands out jobs, judges each case when its last result is there.

    While all renderers turn out to be known from earlier runs, it waits for the last of them, and
    then takes from the cache the cases in which nothing changed. As soon as one is not, all of
    them get to work, none more than `AHEAD` cases before the slowest.
    """

    def __init__(
        self,
        cases: Sequence[PreparedCase],
        renderers: Sequence[Renderer],
        helper: Renderer,
        storage: Storage,
        settings: RenderSettings,
        quality: str,
        report: Callable[[Progress], None],
        stand_ins: StandIns | None = None,
        make_executor: MakeExecutor = threads,
    ) -> None:
        self.events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self.began, self.started = time.perf_counter(), now()
        self.names = [r.name for r in renderers]
        self.storage, self.settings = storage, settings
        self.quality, self.report = quality, report
        self.helper, self.stand_ins = helper.name, stand_ins
        self.stood_in: dict[str, list[Contender]] = {name: [] for name in self.names}
        self.running = Running()
        around = Surroundings(
            self.events, storage.lasting, storage.passing, self.running, make_executor
        )
        everyone = {r.name: r for r in (*renderers, helper)}
        self.lanes = {name: Lane(r, settings, around) for name, r in everyone.items()}
        self.contenders: dict[str, Contender] = {}
        self.memos: dict[str, Memo] = {}
        self.remedies: dict[str, str] = {}
        self.waiting: list[str] = []  # calibrated, but without jobs so far
        self.held: dict[str, deque[tuple[int, list[Job]]]] = {name: deque() for name in everyone}
        self.ahead = max(AHEAD, *(2 * lane.concurrency for lane in self.lanes.values()))
        self.first = 0  # of the cases that are not judged
        self.all_known = True
        self.states = [_CaseState(case, self.began) for case in cases]
        self.done = self.total = 0
        self.finished: list[SummaryCase | None] = [None] * len(cases)
        self.used: dict[str, set[int]] = {name: set() for name in self.names}
        self.render_s = dict.fromkeys(self.names, 0.0)
        self.effort = Effort()
        self.records: list[CaseRecord] = []

    @property
    def everyone_is_here(self) -> bool:
        """Whether every renderer has been calibrated, or is out."""
        return len(self.contenders) == len(self.lanes)

    def work(self) -> None:
        """Handles events until every case is judged. Raises OSError where the disk is full."""
        for lane in self.lanes.values():
            lane.start()
        while not self.everyone_is_here or self.done < self.total:
            event = self.events.get()
            match event:
                case Calibrated():
                    self._calibrated(event)
                case Done():
                    self._done(event)
                case Halted():
                    raise event.error
        for index, state in enumerate(self.states):  # those for which nobody could do anything
            if self.finished[index] is None:
                self._judge(index, state)

    def close(self) -> None:
        """Ends everything that was started."""
        self.running.stop()
        for lane in self.lanes.values():
            lane.close()

    def give_up(self, reason: str) -> None:
        """Every check of every case that is not judged yet becomes an ERROR with `reason`."""
        for index, state in enumerate(self.states):
            if self.finished[index] is None:
                loaded = state.case.loaded
                checks = [
                    unmeasured(spec, name, spec.against, Verdict.ERROR, reason)
                    for spec in loaded.model.checks
                    for name in self.names
                    if not spec.renderers or name in spec.renderers
                ]
                self.finished[index] = SummaryCase(
                    id=loaded.id, family=loaded.model.family, status=Verdict.ERROR, checks=checks
                )

    def _calibrated(self, event: Calibrated) -> None:
        name = event.contender.name
        self.contenders[name] = event.contender
        self.memos[name] = event.memo
        self.remedies[name] = event.remedy
        self.waiting.append(name)
        self.all_known = self.all_known and (event.reused or event.contender.absent is not None)
        self.report(Progress(self.done, self.total, f"{name} {event.contender.version}"))
        if self.everyone_is_here:
            self._restore()
        if self.everyone_is_here or not self.all_known:
            for ready in self.waiting:
                self._put_to_work(self.contenders[ready])
            self.waiting.clear()
        if self.everyone_is_here:
            for index, state in enumerate(self.states):
                self._judge_if_complete(index, state)

    def _restore(self) -> None:
        """Takes from the cache what is there, and notes under which keys to keep the rest."""
        contenders = [self.contenders[name] for name in self.names]
        suite = bundle.suite_key(
            contenders, self.memos, self.helper, self.settings, self.quality
        )  # fmt: skip
        if suite is None or self.storage.lasting is None:
            return
        for index, state in enumerate(self.states):
            stored = [c for c in self._contenders_of(state) if c.stored is not None]
            state.key = bundle.case_key(state.case, suite, stored, state.results)
            if self.all_known:
                found = bundle.restore(
                    self.storage.lasting, state.key, self.storage.archive, state.case
                )
                if found is not None:
                    self._take(index, found)

    def _take(self, index: int, found: bundle.Restored) -> None:
        for run in found.record.runs:
            if run.renders and run.name in self.used:
                self.used[run.name].add(index)
                self.render_s[run.name] += run.render_s
        self.done += found.results
        self.total += found.results
        self._spend(reused=found.results)
        self._finish(index, found.record)
        self.report(Progress(self.done, self.total, found.record.id))

    def _put_to_work(self, contender: Contender) -> None:
        if contender.absent is not None:
            return
        for index, state in enumerate(self.states):
            if self.finished[index] is None:
                jobs = self._jobs(contender, state.case)
                if jobs and contender.name in self.names:
                    state.given[contender.name] = jobs[0].scene
                state.pending += len(jobs)
                self.total += len(jobs)
                self.held[contender.name].append((index, jobs))
        self._hand_out()

    def _hand_out(self) -> None:
        """Gives the lanes the jobs of all cases that are not too far ahead."""
        while self.first < len(self.finished) and self.finished[self.first] is not None:
            self.first += 1
        for name, held in self.held.items():
            while held and held[0][0] < self.first + self.ahead:
                self.lanes[name].submit(*held.popleft())

    def _jobs(self, contender: Contender, case: PreparedCase) -> list[Job]:
        assert contender.preflight is not None
        jobs: list[Job] = []
        if contender.name in self.names:
            jobs += plan.jobs_of(
                case, contender.name, contender.capabilities, contender.preflight, self.settings
            )
        if contender.name == self.helper:
            shift = camera_shift(case.scene)
            jobs += plan.auxiliary_jobs(case, self.helper, shift, True, self.settings)
        return jobs

    def _done(self, event: Done) -> None:
        state, name = self.states[event.case], event.job.renderer
        state.results[name, event.job.role] = event.result
        state.pending -= 1
        self.done += 1
        self._spend(rendered=not event.reused, reused=event.reused)
        if name in self.names:
            self.used[name].add(event.case)
            self.render_s[name] += event.seconds
            state.seconds[name] = state.seconds.get(name, 0.0) + event.seconds
        self.report(Progress(self.done, self.total, f"{state.case.loaded.id}: {name}"))
        self._judge_if_complete(event.case, state)

    def _spend(self, rendered: int = 0, reused: int = 0) -> None:
        self.effort = self.effort.model_copy(
            update={
                "rendered": self.effort.rendered + rendered,
                "reused": self.effort.reused + reused,
            }
        )

    def _judge_if_complete(self, index: int, state: _CaseState) -> None:
        if self.everyone_is_here and state.pending == 0 and self.finished[index] is None:
            self._judge(index, state)

    def _judge(self, index: int, state: _CaseState) -> None:
        contenders = self._contenders_of(state)
        film = state.case.scene.film
        gathered = spectral.gathered(state.results, state.case.wavelengths)
        results = Results(gathered, film.width, film.height)
        judgement = CaseJudge(state.case, contenders, results, self.helper).judge()
        written = self.storage.archive.write_case(
            state.case, contenders, results, judgement, state.seconds, self.settings,
            partial(self._translated, state),
            quality=self.quality, started=self.started, wall_s=time.perf_counter() - state.started,
        )  # fmt: skip
        if state.key is not None and self.storage.lasting is not None:
            delivered = list(state.results.values())
            bundle.keep(
                self.storage.lasting, state.key, self.storage.archive, state.case, delivered
            )
        self._finish(index, written)
        state.results.clear()
        state.given.clear()

    def _translated(self, state: _CaseState, name: str, folder: Path) -> None:
        """Writes into `folder` what the renderer `name` was given first, where it is translated."""
        renderer, scene = self.lanes[name].renderer, state.given.get(name)
        if scene is not None and getattr(renderer, "translates", False):
            with contextlib.suppress(RendererError):  # its results say what is wrong with it
                renderer.emit(scene, folder)

    def _contenders_of(self, state: _CaseState) -> list[Contender]:
        """The renderers of a case; once all are known, for stored pictures are added to it."""
        if state.contenders is None:
            state.contenders = [
                self._or_stand_in(self.contenders[name], state) for name in self.names
            ]
        return state.contenders

    def _or_stand_in(self, contender: Contender, state: _CaseState) -> Contender:
        """The contender, or what is stored of it where it is missing; stored pictures are added."""
        if contender.absent is not Verdict.SKIP or self.stand_ins is None:
            return contender
        stood, images = self.stand_ins.stand_in(contender, state.case, self.settings)
        for role, image in images.items():
            state.results[contender.name, role] = image
        self.stood_in[contender.name].append(stood)
        return stood

    def stood_in_for(self, name: str) -> bool:
        """Whether stored results stood in for a missing renderer in every case."""
        stood = self.stood_in[name]
        return bool(stood) and all(contender.stored is not None for contender in stood)

    def _finish(self, index: int, written: CaseRecord) -> None:
        # Curves are long, and nobody asks for them here.
        self.records.append(written.model_copy(update={"curves": [], "checks": []}))
        self.finished[index] = SummaryCase(
            id=written.id, family=written.family, status=written.status, checks=written.checks,
            diagnoses=written.diagnoses,
        )  # fmt: skip
        self._hand_out()


def now() -> str:
    """UTC, ISO 8601, to the second."""
    return datetime.now(UTC).replace(microsecond=0).isoformat()
