"""A started process together with everything that it has started since.

A renderer may fork, daemonise or leave children behind. All of them count towards its memory,
and all of them end with it. Members are recognised by the session that the process leads and by
a token in their environment, so that a child which leaves the session is found too. (One that
leaves the session *and* empties its environment is not; no portable means finds it.)
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import IO

import psutil

from harness.errors import RendererFailed, RendererMissing
from harness.renderers.confinement import Confinement, start
from harness.temporary import TOKEN, new_token

Pipe = int | IO[bytes]

# Why a program could not be started for no fault of its own: no room for a process or its pipes
# just now, or somebody is still writing the file. That passes.
PASSING = frozenset({errno.EAGAIN, errno.ENOMEM, errno.ETXTBSY, errno.EMFILE, errno.ENFILE})
PAUSES_S = (0.1, 0.4, 1.6)  # before it is tried again


class Running:
    """What a run has started. `stop` ends it all, from any thread, and lets nothing begin.

    `retried` counts how often something had to be started again, since there was no room for it.
    """

    def __init__(self) -> None:
        self.retried = 0
        self._lock = threading.Lock()
        self._trees: weakref.WeakSet[ProcessTree] = weakref.WeakSet()
        self._stopped = False

    def add(self, tree: ProcessTree) -> None:
        """Raises RendererFailed, and ends `tree`, where the run was stopped."""
        with self._lock:
            self._trees.add(tree)
            stopped = self._stopped
        if stopped:
            tree.kill()
            tree.process.wait()
            raise RendererFailed("the run was stopped")

    def count_retry(self) -> None:
        with self._lock:
            self.retried += 1

    def stop(self) -> None:
        with self._lock:
            self._stopped = True
            trees = list(self._trees)
        for tree in trees:
            if not tree.ended:
                tree.kill()


class _Pids:
    """All processes of the machine, looked at once for all trees that ask about the same time."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """After a fork, too: a thread that is lost may have held the lock."""
        self._lock = threading.Lock()
        self._found: set[int] = set()
        self._when = -math.inf
        self._tokens: dict[int, str] = {}

    def listed(self, seconds: float) -> set[int]:
        """As of no more than `seconds` ago; not for the caller to change."""
        with self._lock:
            if time.monotonic() - self._when >= seconds:
                self._when = time.monotonic()
                self._found = set(psutil.pids())
                gone = self._tokens.keys() - self._found
                for pid in gone:
                    del self._tokens[pid]
            return self._found

    def token(self, pid: int) -> str:
        """The token in the environment of a listed process, "" where there is none to see.

        What one tree starts is new to all others that are watched, and each would ask.
        """
        with self._lock:
            if pid not in self._tokens:
                try:
                    self._tokens[pid] = psutil.Process(pid).environ().get(TOKEN, "")
                except psutil.Error:
                    self._tokens[pid] = ""
            return self._tokens[pid]


_PIDS = _Pids()
os.register_at_fork(after_in_child=_PIDS.forget)
_RUNNING: ContextVar[Running | None] = ContextVar("running", default=None)


def belong_to(running: Running) -> None:
    """What this thread starts from now on belongs to `running`."""
    _RUNNING.set(running)


class ProcessTree:
    """Made by `spawn`. `process` is the root; its standard streams are the caller's."""

    def __init__(self, process: subprocess.Popen[bytes], token: str, before: set[int]) -> None:
        self.process = process
        self._token = token
        self._before = before  # alive before the root was started, so no members
        self._members = {process.pid: psutil.Process(process.pid)}
        self._strangers: set[int] = set()
        self.ended = False  # by kill()

    def resident_mb(self, listed_s: float = 0.0) -> float:
        """Resident memory of all members in MiB; pages that they share are counted for each.

        Who started in the last `listed_s` may not be counted yet.
        """
        self._find_members(listed_s)
        total = 0
        for member in self._members.values():
            with contextlib.suppress(psutil.Error):
                total += member.memory_info().rss
        return total / 2**20

    def more_than(self, most: int) -> bool:
        """Whether more than `most` processes run, as of the last look at their memory."""
        members = list(self._members.values())  # those that have ended, too
        return len(members) > most and sum(map(_runs, members)) > most

    def kill(self) -> None:
        """Ends every member at once. Harmless where all of them are gone."""
        while True:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self.process.pid, signal.SIGKILL)
            known = len(self._members)
            self._find_members()
            for member in self._members.values():
                with contextlib.suppress(psutil.Error):
                    member.kill()  # psutil makes sure that the pid was not given to another
            if len(self._members) <= known:
                break
        # A killed process may still run for a moment. The root is for the caller to wait for.
        deadline = time.monotonic() + 2
        for pid, member in self._members.items():
            while pid != self.process.pid and _runs(member) and time.monotonic() < deadline:
                time.sleep(0.002)
        self.ended = True

    def _find_members(self, seconds: float = 0.0) -> None:
        """From a list of processes that is up to `seconds` old."""
        pids = _PIDS.listed(seconds)
        self._strangers &= pids
        for pid in pids - self._before - self._strangers - self._members.keys():
            if self._is_member(pid):
                with contextlib.suppress(psutil.Error):
                    self._members[pid] = psutil.Process(pid)
            else:
                self._strangers.add(pid)

    def _is_member(self, pid: int) -> bool:
        try:
            if os.getsid(pid) == self.process.pid:
                return True
        except OSError:
            return False
        return _PIDS.token(pid) == self._token


def _runs(process: psutil.Process) -> bool:
    try:
        return bool(process.is_running() and process.status() != psutil.STATUS_ZOMBIE)
    except psutil.Error:
        return False


def spawn(
    argv: Sequence[str],
    *,
    cwd: Path,
    env: Mapping[str, str] | None,
    stdin: Pipe,
    stdout: Pipe,
    stderr: Pipe,
    output_mb: int,
    confinement: Confinement | None = None,
    cpu_s: float | None = None,
) -> ProcessTree:
    """Starts `argv` (no shell) as the leader of its own session, with limits on Linux.

    No file that it writes may grow beyond `output_mb`, it dumps no core, and it may use `cpu_s`
    of processor time, which also ends it should we be killed and unable to. The limits are set
    on the running process, since code between fork and exec is not safe beside threads. macOS
    cannot do that and goes without them; time and memory are watched there all the same.
    `confinement` says what it may touch, None that it may whatever we may.

    Where there is no room for a process it is tried again, a few times. Raises RendererMissing
    where `argv[0]` cannot be found or is no program, RendererFailed where it cannot be started.
    """
    token, before = new_token(), set(psutil.pids())

    def begin() -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            list(argv),
            cwd=cwd,
            env={**(os.environ if env is None else env), TOKEN: token},
            stdin=stdin,
            stdout=stdout,
            stderr=stderr,
            start_new_session=True,
        )

    try:
        process = _patiently(begin if confinement is None else lambda: start(confinement, begin))
    except (FileNotFoundError, PermissionError, NotADirectoryError) as error:
        if not cwd.is_dir():
            raise RendererFailed(f"cannot be started: no folder {cwd}") from error
        raise RendererMissing(f"cannot run {argv[0]!r}: {error.strerror}") from error
    except (OSError, ValueError) as error:
        raise RendererFailed(f"cannot start {argv[0]!r}: {error}") from error
    _limit(process.pid, output_mb, cpu_s)
    tree = ProcessTree(process, token, before)
    if (running := _RUNNING.get()) is not None:
        running.add(tree)
    return tree


def attempts() -> Iterator[None]:
    """A turn at once and a few more, counted and after pauses, for what only the moment is against.

    Whoever succeeds leaves the loop.
    """
    yield
    for pause_s in PAUSES_S:
        if (running := _RUNNING.get()) is not None:
            running.count_retry()
        time.sleep(pause_s)
        yield


def _patiently(begin: Callable[[], subprocess.Popen[bytes]]) -> subprocess.Popen[bytes]:
    """What `begin` starts, after some more attempts where what is in its way will pass."""
    for _ in attempts():
        try:
            return begin()
        except OSError as error:
            if error.errno not in PASSING:
                raise
            trouble = error
    raise trouble


def _limit(pid: int, output_mb: int, cpu_s: float | None) -> None:
    if sys.platform != "linux":
        return
    import resource

    size = output_mb * 2**20
    limits = {resource.RLIMIT_FSIZE: (size, size), resource.RLIMIT_CORE: (0, 0)}
    if cpu_s is not None:
        # The signal that says what happened comes at the first, the one that ends all at the other.
        limits[resource.RLIMIT_CPU] = (int(cpu_s) + 1, int(cpu_s) + 2)
    for limit, values in limits.items():
        _, hard = resource.prlimit(pid, limit)
        soft, last = values if hard == resource.RLIM_INFINITY else (min(v, hard) for v in values)
        with contextlib.suppress(ProcessLookupError, PermissionError, ValueError):
            resource.prlimit(pid, limit, (soft, last))
