"""Dask distributed as the carrier of jobs: a scheduler somewhere, or workers on this machine."""

from __future__ import annotations

import concurrent.futures
import contextlib
import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from harness.errors import ConnectionLost, InputError
from harness.running.remote import Origin, RemoteRenderer

INSTALL = "pip install 'snellcheck[cluster]'"
CONNECT_S = 10.0
# A worker that has a job and one that waits for it never idles.
UNDER_WAY = 2


@dataclass(frozen=True)
class Cluster:
    """A connected client of a scheduler."""

    client: Any
    where: str

    @property
    def cores(self) -> int:
        """Threads of all workers that are there now, at least one."""
        return max(1, sum(int(count) for count in self.client.nthreads().values()))

    def renderer(self, name: str, origin: Origin) -> RemoteRenderer:
        """The renderer `name` as it is over there."""
        from distributed.client import ClosedClientError
        from distributed.scheduler import KilledWorker

        executor: concurrent.futures.Executor = self.client.get_executor(pure=False)
        return RemoteRenderer(
            name, origin, executor, concurrency=UNDER_WAY * self.cores,
            lost=(KilledWorker, concurrent.futures.CancelledError, ClosedClientError),
            gone=lambda: self.client.status not in ("running", "connecting"),
        )  # fmt: skip


@contextlib.contextmanager
def connected(text: str) -> Iterator[Cluster]:
    """The cluster at ``tcp://…``, or ``local:N``, N worker processes on this machine.

    Raises InputError where `text` is neither or Dask is not installed, ConnectionLost where
    nobody answers.
    """
    local = re.fullmatch(r"local:([1-9]\d{0,2})", text)
    if local is None and not re.match(r"(tcp|tls|ws|wss)://.", text):
        expected = "tcp://HOST:PORT of a Dask scheduler, or local:N"
        raise InputError.of("no cluster", key="--cluster", value=text, expected=expected)
    try:
        import dask
        import distributed
    except ModuleNotFoundError:
        raise InputError.of("a cluster needs Dask", key="--cluster", expected=INSTALL) from None
    _silence()
    with contextlib.ExitStack() as stack:
        address: Any = text
        direct = None  # left to Dask: whether workers can be reached past the scheduler
        if local is not None:
            # A lost worker is ours to notice and count, not Dask's to try again in silence.
            stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 0}))
            direct = True  # they are here; images would else be unpacked and packed on their way
            address = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=int(local[1]), threads_per_worker=1, processes=True,
                    dashboard_address=":0",  # any free port: 8787 may be taken
                )
            )  # fmt: skip
        try:
            client = stack.enter_context(
                distributed.Client(address, timeout=CONNECT_S, direct_to_workers=direct)
            )
        except OSError as error:
            raise ConnectionLost(f"no scheduler answers at {text}: {error}") from error
        yield Cluster(client, text)


def _silence() -> None:
    """What is lost is told once, by us; Dask would add a traceback for each of its own tasks.

    Its configuration gives levels to loggers far down, so each of them is set.
    """
    for package in ("distributed", "tornado", "asyncio"):
        below = [name for name in logging.root.manager.loggerDict if name.startswith(f"{package}.")]
        for name in (package, *below):
            logging.getLogger(name).setLevel(logging.CRITICAL)
