"""One living child process that answers requests, and the limits under which it does."""

from __future__ import annotations

import contextlib
import json
import os
import select
import shutil
import subprocess
import time
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from pydantic import ValidationError

from harness.errors import RendererError, RendererFailed, RendererMissing, RendererUnsupported
from harness.renderers.confinement import Confinement
from harness.renderers.limits import OUTPUT_MB, Watch
from harness.renderers.process import describe_signal, tail
from harness.renderers.process_tree import ProcessTree, spawn
from harness.renderers.wire import Reply
from harness.temporary import make_folder

LINE_BYTES = 1 << 20  # no reply is longer
_ERRORS: dict[str, type[RendererError]] = {
    "failed": RendererFailed,
    "missing": RendererMissing,
    "unsupported": RendererUnsupported,
}


class Child:
    """`argv`, run in `folder` (or in a private temporary one) until `close` or its own end.

    `confinement` says what it may touch beside its private folder. Not for use by several threads
    at a time.
    """

    def __init__(
        self,
        name: str,
        argv: Sequence[str],
        folder: Path | None,
        env: Mapping[str, str],
        confinement: Confinement,
    ) -> None:
        self._name = name
        self._private = make_folder()
        self._log = (self._private / "stderr").open("ab+", buffering=0)
        try:
            self._tree = spawn(
                argv,
                cwd=folder or self._private,
                env={**env, "TMPDIR": str(self._private)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._log,
                output_mb=OUTPUT_MB,
                confinement=confinement.and_writable(self._private),
            )
        except BaseException:
            self._log.close()
            shutil.rmtree(self._private, ignore_errors=True)
            raise
        self._requests = 0
        self._buffer = b""
        # Also at the interpreter's exit, and where nobody called close.
        self._end = weakref.finalize(self, _end, self._tree, self._log, self._private)

    def usable(self) -> bool:
        """Whether it still runs, as far as one can see."""
        return self._end.alive and self._tree.process.poll() is None

    def ask(
        self,
        request: Mapping[str, Any],
        timeout_s: float,
        memory_mb: int,
        private: Path | None = None,
    ) -> Reply:
        """The reply to `request`, to which an id is added.

        A child that dies, does not answer within `timeout_s`, holds more than `memory_mb` of
        resident memory, fills the folder `private` or answers something else is ended:
        RendererFailed, with the tail of what it wrote to stderr. An answer that says no is raised
        as the error that it names.
        """
        self._requests += 1
        self._log.truncate(0)  # what follows in the log belongs to this request
        started = time.monotonic()
        try:
            self._send({"id": self._requests, **request})
            watch = Watch(self._tree, memory_mb, private=private)
            reply = self._reply(self._receive(started + timeout_s, timeout_s, watch))
        except _Broken as broken:
            message = f"{self._name} {broken}"
            self._tree.kill()
            log = self.log()
            self.close()
            raise RendererFailed(message, log=log) from None
        except BaseException:
            self.close()
            raise
        if not reply.ok:
            message = reply.message or "the renderer gave no reason"
            raise _ERRORS[reply.error](message, log=tail(reply.log) or self.log())
        seconds = time.monotonic() - started if reply.seconds is None else reply.seconds
        log = tail(reply.log) or self.log()
        return reply.model_copy(update={"seconds": seconds, "log": log})

    def log(self) -> str:
        """The tail of what the child has written to stderr since the last request."""
        size = os.fstat(self._log.fileno()).st_size
        return tail(
            os.pread(self._log.fileno(), 1 << 16, max(0, size - (1 << 16))).decode(
                "utf-8", errors="replace"
            )
        )

    def close(self) -> None:
        """Ends the child and everything that it started."""
        self._end()

    def abandon(self) -> None:
        """In a fork of our process: lets go of a child that belongs to the parent."""
        self._end.detach()
        self._log.close()
        for pipe in (self._tree.process.stdin, self._tree.process.stdout):
            if pipe is not None:
                pipe.close()
        self._tree.process.returncode = 0  # or Popen would warn that nobody waited for it

    def _send(self, request: Mapping[str, Any]) -> None:
        pipe = self._tree.process.stdin
        assert pipe is not None
        try:
            pipe.write(json.dumps(request).encode() + b"\n")
            pipe.flush()
        except OSError:
            raise _Broken(self._death()) from None

    def _receive(self, deadline: float, timeout_s: float, watch: Watch) -> bytes:
        """One line, however long it takes within the limits. Raises _Broken."""
        pipe = self._tree.process.stdout
        assert pipe is not None
        while b"\n" not in self._buffer:
            if select.select([pipe], [], [], watch.rest_s(deadline))[0]:
                chunk = os.read(pipe.fileno(), 1 << 16)
                if not chunk:
                    raise _Broken(self._death())
                self._buffer += chunk
            if len(self._buffer) > LINE_BYTES:
                raise _Broken("floods its stdout")
            if time.monotonic() > deadline:
                raise _Broken(f"did not answer within {timeout_s:g} s")
            if passed := watch.passed():
                raise _Broken(passed)
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line

    def _reply(self, line: bytes) -> Reply:
        try:
            reply = Reply.model_validate_json(line)
        except ValidationError as error:
            first = error.errors()[0]
            why = ": ".join([*map(str, first["loc"]), first["msg"]])
            said = line[:80].decode("utf-8", errors="replace")
            hint = "messages for people belong on stderr"
            raise _Broken(f"answered {said!r}: {why}; {hint}") from None
        if reply.id != self._requests:
            raise _Broken(f"answered request {reply.id} instead of {self._requests}")
        return reply

    def _death(self) -> str:
        """How it ended, once its stdout has."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._tree.process.wait(timeout=1)
        code = self._tree.process.returncode
        if code is None:
            return "closed its stdout"
        if code < 0:
            return describe_signal(-code, output_mb=OUTPUT_MB)
        return f"ended with exit code {code} instead of an answer"


class _Broken(Exception):
    """The child cannot be used any more; the message continues after its name."""


def _end(tree: ProcessTree, log: IO[bytes], private: Path) -> None:
    tree.kill()
    tree.process.wait()
    log.close()
    for pipe in (tree.process.stdin, tree.process.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):  # what was not sent yet
                pipe.close()
    shutil.rmtree(private, ignore_errors=True)
