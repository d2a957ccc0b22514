"""Runs one program to its end within limits of time, memory and output."""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from harness.errors import RendererFailed
from harness.renderers.confinement import Confinement
from harness.renderers.limits import LOG_MB, OUTPUT_MB, Watch
from harness.renderers.process_tree import ProcessTree, spawn

LOG_CHARACTERS = 4000  # how much of a log an error carries


@dataclass(frozen=True)
class Finished:
    """A program that came to its own end. A `returncode` other than 0 is the caller's to judge.

    `stdout` and `stderr` are decoded as UTF-8, undecodable bytes shown as U+FFFD. `cpu_s` is
    user and system time of the program and of the children that it waited for.
    """

    returncode: int
    stdout: str
    stderr: str
    wall_s: float
    cpu_s: float


def run_limited(
    argv: Sequence[str],
    *,
    cwd: Path,
    timeout_s: float,
    memory_mb: int,
    output_mb: int = OUTPUT_MB,
    private: Path | None = None,
    confinement: Confinement | None = None,
    stdin: bytes | None = None,
    env: Mapping[str, str] | None = None,
) -> Finished:
    """Runs `argv` without a shell, in a session of its own, and takes all of it down at the end.

    * `timeout_s` of wall time; on Linux also that much processor time on every core.
    * `memory_mb` of resident memory, summed over the program and all that it starts. Resident
      rather than reserved memory (RLIMIT_AS), because compilers and garbage collectors reserve
      many times what they use. It is looked at every 50 ms where little is left, so a program
      that fills memory at full speed can overshoot by what it touches in that time.
    * `output_mb` for each file that it writes (Linux) and for all files in `private` together,
      and 64 MB for its stdout and stderr.
    * 256 processes.
    * What `confinement` says that it may touch beside `private`; None is whatever we may.

    `env` replaces the environment. Raises RendererMissing where the program cannot be found,
    RendererFailed, with the tail of its log, where a limit or a signal ended it.
    """
    started = time.monotonic()
    cpu_s = timeout_s * (os.cpu_count() or 1)
    source = subprocess.DEVNULL if stdin is None else subprocess.PIPE
    if confinement is not None and private is not None:
        confinement = confinement.and_writable(private)
    tree = spawn(
        argv,
        cwd=cwd,
        env=env,
        stdin=source,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        output_mb=output_mb,
        confinement=confinement,
        cpu_s=cpu_s,
    )
    streams = _Streams(tree.process, stdin or b"", min(output_mb, LOG_MB) * 2**20)
    watch = Watch(tree, memory_mb, output_mb, private)
    try:
        usage = _wait(tree, streams, started + timeout_s, timeout_s, watch)
    except _Limit as limit:
        raise RendererFailed(str(limit), log=streams.log()) from None
    finally:
        tree.kill()
        _reap(tree.process, 0)
        streams.close()
    code = tree.process.returncode
    if code < 0:
        raise RendererFailed(describe_signal(-code, cpu_s, output_mb), log=streams.log())
    out, err = (streams.text(pipe) for pipe in ("stdout", "stderr"))
    return Finished(code, out, err, time.monotonic() - started, usage)


def describe_signal(number: int, cpu_s: float = 0.0, output_mb: int = 0) -> str:
    """What it means that a signal ended a renderer."""
    try:
        name = signal.Signals(number).name
    except ValueError:
        name = str(number)
    reasons = {
        "SIGXFSZ": f": it wrote a file larger than {output_mb} MB",
        "SIGXCPU": f": it used more than {cpu_s:g} s of processor time",
        "SIGKILL": ": perhaps the system ran out of memory",
    }
    return f"ended by signal {name}{reasons.get(name, '')}"


def tail(text: str, characters: int = LOG_CHARACTERS) -> str:
    """The end of a log, from the beginning of a line where there is one."""
    if len(text) <= characters:
        return text.strip()
    text = text[-characters:]
    return "… " + text[text.find("\n") + 1 :].strip()


class _Limit(Exception):
    """A limit was passed; the message says which."""


def _wait(
    tree: ProcessTree, streams: _Streams, deadline: float, timeout_s: float, watch: Watch
) -> float:
    """Waits for the end; returns processor seconds. Raises _Limit."""
    while True:
        streams.pump(watch.rest_s(deadline))
        usage = _reap(tree.process, os.WNOHANG)
        if usage is not None:
            streams.drain()
            return usage
        if streams.overflowed:
            raise _Limit("wrote too much to stdout and stderr")
        if time.monotonic() > deadline:
            raise _Limit(f"not done after {timeout_s:g} s")
        if passed := watch.passed():
            raise _Limit(passed)


def _reap(process: subprocess.Popen[bytes], options: int) -> float | None:
    """Processor seconds of an ended process, None while it runs.

    As Popen.poll or Popen.wait, but through wait4, the only call that tells the time.
    """
    if process.returncode is not None:
        return 0.0
    pid, status, usage = os.wait4(process.pid, options)
    if pid == 0:
        return None
    process.returncode = os.waitstatus_to_exitcode(status)
    return usage.ru_utime + usage.ru_stime


class _Streams:
    """Feeds stdin and collects stdout and stderr of one process, without threads."""

    def __init__(self, process: subprocess.Popen[bytes], stdin: bytes, limit: int) -> None:
        self._limit = limit
        self._rest = memoryview(stdin)
        self._selector = selectors.DefaultSelector()
        self._text = {"stdout": bytearray(), "stderr": bytearray()}
        self._pause = 0.001
        for name, pipe in (("stdout", process.stdout), ("stderr", process.stderr)):
            assert pipe is not None
            os.set_blocking(pipe.fileno(), False)
            self._selector.register(pipe, selectors.EVENT_READ, name)
        if process.stdin is not None:
            os.set_blocking(process.stdin.fileno(), False)
            self._selector.register(process.stdin, selectors.EVENT_WRITE, "stdin")

    @property
    def overflowed(self) -> bool:
        return sum(len(text) for text in self._text.values()) > self._limit

    def text(self, name: str) -> str:
        return self._text[name].decode("utf-8", errors="replace")

    def log(self) -> str:
        """The tail of what it said: stderr, or stdout where stderr is empty."""
        return tail(self.text("stderr").strip() or self.text("stdout"))

    def pump(self, wait_s: float) -> bool:
        """Moves what can be moved, waiting at most `wait_s`; False where nothing did."""
        if not self._selector.get_map():
            # All pipes are closed, so the end is near, but nothing will wake us.
            time.sleep(min(self._pause, wait_s))
            self._pause *= 2
            return False
        ready = self._selector.select(wait_s)
        for key, _ in ready:
            self._move(key)
        return bool(ready)

    def drain(self) -> None:
        """Takes what is still in the pipes of a process that has ended."""
        while self._selector.get_map() and not self.overflowed and self.pump(0.0):
            pass

    def close(self) -> None:
        for key in list(self._selector.get_map().values()):
            self._drop(key)
        self._selector.close()

    def _move(self, key: selectors.SelectorKey) -> None:
        if key.data == "stdin":
            try:
                sent = os.write(key.fd, self._rest[: 1 << 16])
            except (BrokenPipeError, BlockingIOError) as error:
                sent = len(self._rest) if isinstance(error, BrokenPipeError) else 0
            self._rest = self._rest[sent:]
            if not self._rest:
                self._drop(key)
            return
        chunk = os.read(key.fd, 1 << 16)
        self._text[key.data] += chunk
        if not chunk:
            self._drop(key)

    def _drop(self, key: selectors.SelectorKey) -> None:
        self._selector.unregister(key.fileobj)
        key.fileobj.close()  # type: ignore[union-attr]
