"""A run: cases x renderers, judged as their results arrive, recorded case by case."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from harness import __version__, plan, record
from harness.archive import Archive
from harness.errors import InputError
from harness.explain import explain_run
from harness.judge import CaseJudge
from harness.lanes import Calibrated, Done, Event, Lane
from harness.pairs import camera_shift
from harness.plan import Job, PreparedCase
from harness.record import Counts, RendererSummary, Summary, SummaryCase, Verdict
from harness.renderers.base import Renderer, RenderSettings
from harness.results import Contender, Result, Results

SAMPLES = {"draft": 16, "normal": 64, "high": 256}
# The renderer that makes auxiliary pictures: part of snellcheck, and without noise.
HELPER = "tracer"


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


def run(
    cases: Sequence[PreparedCase],
    renderers: Sequence[Renderer],
    helper: Renderer,
    out: Path,
    *,
    quality: str = "normal",
    threads: int = 2,
    seed: int = 0,
    command: str = "",
    report: Callable[[Progress], None] = lambda _: None,
) -> Summary:
    """Runs everything, writes records, pictures and `summary.json` below `out`.

    `helper` makes auxiliary pictures and need not be among `renderers`. Returns the summary, whose
    `exit_code` is that of the command. Raises InputError where there is nothing to run.
    """
    if not cases:
        raise InputError.of("no case to run")
    if not renderers:
        raise InputError.of("no renderer to run")
    names = [renderer.name for renderer in renderers]
    for name in names:
        if names.count(name) > 1:
            raise InputError.of("two renderers of one name", key="--renderer", value=name)
    settings = RenderSettings(samples=SAMPLES[quality], seed=seed, threads=threads)
    session = _Session(cases, renderers, helper, Archive(out), settings, quality, report)
    try:
        session.work()
    finally:
        session.close()
    summary = session.summary(command)
    record.write(summary, out / "summary.json")
    return summary


class _Session:
    """The state of one run: which renderers are ready, and what each case still waits for."""

    def __init__(
        self,
        cases: Sequence[PreparedCase],
        renderers: Sequence[Renderer],
        helper: Renderer,
        archive: Archive,
        settings: RenderSettings,
        quality: str,
        report: Callable[[Progress], None],
    ) -> None:
        self.events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self.began, self.started = time.perf_counter(), now()
        self.names = [r.name for r in renderers]
        self.archive, self.settings, self.quality, self.report = archive, settings, quality, report
        self.helper = helper.name
        everyone = {r.name: r for r in (*renderers, helper)}
        self.lanes = {name: Lane(r, settings, self.events) for name, r in everyone.items()}
        self.contenders: dict[str, Contender] = {}
        self.remedies: dict[str, str] = {}
        self.states = [_CaseState(case, self.began) for case in cases]
        self.done = self.total = 0
        self.finished: list[SummaryCase | None] = [None] * len(cases)
        self.used: dict[str, set[int]] = {name: set() for name in self.names}
        self.render_s = dict.fromkeys(self.names, 0.0)

    def work(self) -> None:
        """Calibrates all renderers and handles events until every case is judged."""
        for lane in self.lanes.values():
            lane.start()
        while len(self.contenders) < len(self.lanes) or self.done < self.total:
            event = self.events.get()
            match event:
                case Calibrated():
                    self._calibrated(event)
                case Done():
                    self._done(event)
        for index, state in enumerate(self.states):  # those for which nobody could do anything
            if self.finished[index] is None:
                self._judge(index, state)

    def close(self) -> None:
        for lane in self.lanes.values():
            lane.close()

    def _calibrated(self, event: Calibrated) -> None:
        contender = event.contender
        self.contenders[contender.name] = contender
        self.remedies[contender.name] = event.remedy
        if contender.absent is None:
            for index, state in enumerate(self.states):
                jobs = self._jobs(contender, state.case)
                state.pending += len(jobs)
                self.total += len(jobs)
                self.lanes[contender.name].submit(index, jobs)
        self.report(Progress(self.done, self.total, f"{contender.name} {contender.version}"))
        if len(self.contenders) == len(self.lanes):
            for index, state in enumerate(self.states):
                self._judge_if_complete(index, state)

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
        if name in self.names:
            self.used[name].add(event.case)
            self.render_s[name] += event.seconds
            state.seconds[name] = state.seconds.get(name, 0.0) + event.seconds
        self.report(Progress(self.done, self.total, f"{state.case.loaded.id}: {name}"))
        self._judge_if_complete(event.case, state)

    def _judge_if_complete(self, index: int, state: _CaseState) -> None:
        everyone = len(self.contenders) == len(self.lanes)
        if everyone and state.pending == 0 and self.finished[index] is None:
            self._judge(index, state)

    def _judge(self, index: int, state: _CaseState) -> None:
        contenders = [self.contenders[name] for name in self.names]
        film = state.case.scene.film
        results = Results(state.results, film.width, film.height)
        judgement = CaseJudge(state.case, contenders, results, self.helper).judge()
        written = self.archive.write_case(
            state.case, contenders, results, judgement, state.seconds, self.settings,
            quality=self.quality, started=self.started, wall_s=time.perf_counter() - state.started,
        )  # fmt: skip
        self.finished[index] = SummaryCase(
            id=written.id, family=written.family, status=written.status, checks=written.checks,
            diagnoses=written.diagnoses,
        )  # fmt: skip
        state.results.clear()

    def summary(self, command: str) -> Summary:
        cases = [case for case in self.finished if case is not None]
        verdicts = [check.status for case in cases for check in case.checks]
        return Summary(
            snellcheck_version=__version__,
            started=self.started,
            wall_s=time.perf_counter() - self.began,
            quality=self.quality,
            command=command,
            exit_code=exit_code(cases, [self.contenders[name] for name in self.names]),
            renderers={name: self._renderer_summary(name) for name in self.names},
            counts=Counts.model_validate({v.value: verdicts.count(v) for v in Verdict}),
            cases=cases,
            diagnoses=explain_run([state.case for state in self.states], cases, self.names),
        )

    def _renderer_summary(self, name: str) -> RendererSummary:
        contender = self.contenders[name]
        status = "ok"
        if contender.absent is Verdict.SKIP:
            status = "missing"
        elif contender.absent is not None:
            status = "failed preflight" if "preflight" in contender.reason else "failed"
        return RendererSummary(
            version=contender.version,
            status=status,
            cases=len(self.used[name]),
            render_s=self.render_s[name],
            reason=contender.reason,
            remedy=self.remedies.get(name, ""),
            facts=contender.preflight.facts() if contender.preflight else {},
        )


def exit_code(cases: list[SummaryCase], contenders: list[Contender]) -> int:
    """0 all passed, 1 a check failed or there was none, 3 something asked for could not run.

    A case without checks is an ERROR, and where everything is skipped nothing has run.
    """
    verdicts = [check.status for case in cases for check in case.checks]
    if Verdict.FAIL in verdicts or not verdicts:
        return 1
    if any(case.status is Verdict.ERROR for case in cases):
        return 3
    if any(contender.absent is not None for contender in contenders):
        return 3
    return 0 if {Verdict.PASS, Verdict.KNOWN} & set(verdicts) else 3


def now() -> str:
    """UTC, ISO 8601, to the second."""
    return datetime.now(UTC).replace(microsecond=0).isoformat()
