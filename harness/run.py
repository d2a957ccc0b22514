"""A run: cases x renderers, judged as their results arrive, recorded case by case."""

from __future__ import annotations

import contextlib
import shutil
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path

from harness import __version__, record
from harness.archive import Archive
from harness.baseline.stand_in import StandIns
from harness.cache.cache import Cache
from harness.cache.stores import FolderStore
from harness.errors import InputError, utf8
from harness.judging.explain import explain_run
from harness.judging.results import Contender
from harness.plan import PreparedCase
from harness.record import Counts, RendererSummary, Summary, SummaryCase, Verdict
from harness.renderers.base import Renderer, RenderSettings
from harness.renderers.confinement import described
from harness.running import lanes, memory
from harness.running.remote import RemoteRenderer
from harness.running.session import Progress, Session, Storage
from harness.running.shard import write_times

__all__ = ["EXIT_INTERRUPTED", "HELPER", "SAMPLES", "UNFINISHED", "Progress", "exit_code", "run"]

SAMPLES = {"draft": 16, "normal": 64, "high": 256}
# The renderer that makes auxiliary pictures: part of snellcheck, and without noise.
HELPER = "tracer"
# In a run's folder until it is done: results that are kept nowhere else.
UNFINISHED = ".unfinished"
EXIT_INTERRUPTED = 130  # as shells have it


def run(
    cases: Sequence[PreparedCase],
    renderers: Sequence[Renderer],
    helper: Renderer,
    out: Path,
    *,
    quality: str = "normal",
    threads: int = 2,
    seed: int = 0,
    timeout_s: float = RenderSettings.timeout_s,
    memory_mb: int = RenderSettings.memory_mb,
    command: str = "",
    stand_ins: StandIns | None = None,
    must_run: Collection[str] = (),
    report: Callable[[Progress], None] = lambda _: None,
    cache: Cache | None = None,
    make_executor: lanes.MakeExecutor = lanes.threads,
) -> Summary:
    """Runs everything, writes records, pictures and `summary.json` below `out`.

    `helper` makes auxiliary pictures and need not be among `renderers`. `stand_ins` are stored
    results for renderers that are missing; those in `must_run` count as missing all the same. What
    `cache` holds is not done again; nor is what an earlier run into `out` had done when it was
    killed. Returns the summary, whose `exit_code` is that of the command; after Ctrl-C it holds
    what was judged so far, and says so. Raises InputError where there is nothing to run or another
    run writes to `out`, OSError where the disk is full.
    """
    if not cases:
        raise InputError.of("no case to run")
    if not renderers:
        raise InputError.of("no renderer to run")
    names = [renderer.name for renderer in renderers]
    for name in names:
        if names.count(name) > 1:
            raise InputError.of("two renderers of one name", key="--renderer", value=name)
    settings = RenderSettings(SAMPLES[quality], seed, threads, timeout_s, memory_mb)
    with _alone(out):
        passing = Cache(FolderStore(out / UNFINISHED), limit=2**50)
        archive = Archive(out)
        archive.sweep()
        storage = Storage(archive, cache, passing)
        session = Session(
            cases, renderers, helper, storage, settings, quality, report, stand_ins, make_executor
        )
        interrupted, spent = False, _processor_time()
        (out / "summary.json").unlink(missing_ok=True)  # an old one would belie what is there now
        with memory.watched() as peak:
            try:
                session.work()
            except KeyboardInterrupt:
                interrupted = True
                session.give_up("the run was interrupted before this was judged")
            finally:
                session.close()
        own, theirs = (b - a for a, b in zip(spent, _processor_time(), strict=True))
        session.effort = session.effort.model_copy(
            update={"own_cpu_s": own, "renderers_cpu_s": theirs, "memory_mb": peak.mb}
        )
        summary = _summary(session, command, must_run, interrupted)
        write_times(out, session.records)
        record.write(summary, out / "summary.json")
        if not interrupted:
            shutil.rmtree(out / UNFINISHED, ignore_errors=True)
        if cache is not None:
            cache.trim()
    return summary


@contextlib.contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Keeps a second run out of the folder. Raises InputError where there is one."""
    import fcntl

    out.mkdir(parents=True, exist_ok=True)
    with (out / ".lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError.of(
                "another run is writing into this folder", key="--out", value=str(out)
            ) from None
        yield


def _processor_time() -> tuple[float, float]:
    """Seconds, user and system, of this process, and of those that it started and that ended."""
    import resource

    usages = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    own, theirs = (usage.ru_utime + usage.ru_stime for usage in usages)
    return own, theirs


def _summary(
    session: Session, command: str, must_run: Collection[str], interrupted: bool
) -> Summary:
    cases = [case for case in session.finished if case is not None]
    verdicts = [check.status for case in cases for check in case.checks]
    contenders = [
        session.contenders[name]
        for name in session.names
        if name in session.contenders and (name in must_run or not session.stood_in_for(name))
    ]
    caches = {id(c): c for c in (session.storage.lasting, session.storage.passing) if c}
    damaged = sum(cache.damaged for cache in caches.values())
    retried = sum(getattr(lane.renderer, "retried", 0) for lane in session.lanes.values())
    retried += session.running.retried
    elsewhere = all(isinstance(lane.renderer, RemoteRenderer) for lane in session.lanes.values())
    return Summary(
        snellcheck_version=__version__,
        started=session.started,
        wall_s=time.perf_counter() - session.began,
        quality=session.quality,
        command=utf8(command),
        exit_code=EXIT_INTERRUPTED if interrupted else exit_code(cases, contenders),
        renderers={name: _renderer_summary(session, name) for name in session.names},
        counts=Counts.model_validate({v.value: verdicts.count(v) for v in Verdict}),
        cases=cases,
        diagnoses=explain_run(
            [state.case for state in session.states], cases, {c.name: c.reason for c in contenders}
        ),
        effort=session.effort.model_copy(update={"damaged": damaged, "retried": retried}),
        confinement="as on the cluster's machines" if elsewhere else described(),
        interrupted=interrupted,
    )


def _renderer_summary(session: Session, name: str) -> RendererSummary:
    contender = session.contenders.get(name)
    if contender is None:
        reason = "the run was interrupted before it was ready"
        return RendererSummary(version="", status="failed", cases=0, render_s=0.0, reason=reason)
    status = "ok"
    stored = [stood for stood in session.stood_in[name] if stood.stored is not None]
    if stored:
        status, contender = "stored", stored[0]
    elif contender.absent is Verdict.SKIP:
        status = "missing"
    elif contender.absent is not None:
        status = "failed preflight" if "preflight" in contender.reason else "failed"
    return RendererSummary(
        version=contender.version,
        status=status,
        cases=len(session.used[name]),
        render_s=session.render_s[name],
        reason=contender.reason,
        remedy=session.remedies.get(name, ""),
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
