"""What a renderer may touch, held by the operating system: POV-Ray's own rules were seen not to.

On Linux a renderer can write to its private folder alone and has no network; whatever else it
needs must be opened to it by name. `described` says what this machine can hold it to.

The rules are laid upon a thread of ours that ends at once: what that thread starts inherits them,
and nothing of ours runs between fork and exec, where it would not be safe beside other threads.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import gc
import os
import re
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Generic, TypeVar

from harness.errors import RendererFailed
from harness.renderers import landlock, seccomp

SWITCH = "SNELLCHECK_CONFINEMENT"  # "off" lets renderers do what their user may
_LINUX = sys.platform == "linux"

# What any program may write to: devices that keep nothing, and the GPU's.
DEVICES = tuple(Path("/dev", name) for name in ("null", "zero", "full", "tty", "dri", "kfd"))
GPUS = "nvidia*"  # of /dev, too
# Its processes share memory there, and semaphores.
SHARED_MEMORY = Path("/dev/shm")
# What programs say who were refused something, in their own words or in those of the C library.
_REFUSED = re.compile(
    r"permission ?(denied|error)|eacces|not permitted|cross-device|read-only file"
    r"|(cannot|could not|can't|couldn't|unable to|failed to) (open|write|create|cache|connect)",
    re.IGNORECASE,
)
_ONE_AT_A_TIME = threading.Lock()
Started = TypeVar("Started")


@dataclass(frozen=True)
class Confinement:
    """What a renderer may touch beside its private folder.

    `writable` are files and folders with all below them, which may be read, too; a folder that is
    not there is made. `readable` None is everything. `network` lets it use one, `shares` lets its
    processes share memory.
    """

    writable: tuple[Path, ...] = ()
    readable: tuple[Path, ...] | None = None
    network: bool = False
    shares: bool = True

    def and_writable(self, *folders: Path) -> Confinement:
        """The same with more that may be written."""
        return replace(self, writable=(*self.writable, *folders))

    @contextlib.contextmanager
    def explained(self) -> Iterator[None]:
        """Adds to a failure that sounds as if something had been refused what may be the cause."""
        try:
            yield
        except RendererFailed as error:
            if active() and _REFUSED.search(f"{error} {error.log}"):
                network = "" if self.network else " and uses no network"
                error.args = (
                    f"{error}; note that it writes to its private folder alone{network}, unless "
                    "`writable` or `network` in its snellcheck-renderer.toml says otherwise",
                )
            raise


PRIVATE_ALONE = Confinement()


def start(confinement: Confinement, begin: Callable[[], Started]) -> Started:
    """What `begin` returns or raises, called in a thread that is confined, as is all it starts.

    Where the system can confine nothing, it is called all the same. Raises RendererFailed where it
    can, but refuses to, OSError where there is no room for a thread.
    """
    if not active():
        return begin()
    for folder in confinement.writable:
        with contextlib.suppress(OSError):
            if not folder.exists():
                folder.mkdir(parents=True)
    thread = _Confined(confinement, begin)
    with _ONE_AT_A_TIME, _no_collection():
        try:
            thread.start()
        except RuntimeError as error:
            raise OSError(errno.EAGAIN, str(error)) from error
        thread.join()
    return thread.outcome()


class _Confined(threading.Thread, Generic[Started]):
    def __init__(self, confinement: Confinement, begin: Callable[[], Started]) -> None:
        super().__init__(name="confined")
        self._confinement, self._begin = confinement, begin
        self._results: list[Started] = []
        self._error: BaseException | None = None

    def run(self) -> None:
        try:
            self._confine()
            self._results.append(self._begin())
        except BaseException as error:  # it is raised again, in the thread that asked
            self._error = error

    def outcome(self) -> Started:
        if self._error is not None:
            raise self._error
        return self._results[0]

    def _confine(self) -> None:
        asked = self._confinement
        landlocked, filtered = _holds()
        try:
            if landlocked:
                writable = [*asked.writable, *DEVICES, *Path("/dev").glob(GPUS)]
                writable += [SHARED_MEMORY] if asked.shares else []
                landlock.restrict(asked.readable, writable, network=asked.network)
            if filtered and not asked.network:
                landlock.no_new_privileges()
                seccomp.forbid_network()
        except OSError as error:
            message = f"cannot be confined: {error.strerror}; {SWITCH}=off does without"
            raise RendererFailed(message) from error


@contextlib.contextmanager
def _no_collection() -> Iterator[None]:
    """Or Python might collect garbage in the confined thread, where no file can be removed."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def active() -> bool:
    """Whether anything is held back here."""
    return not _switched_off() and any(_holds())


def described() -> str:
    """What renderers are held to on this machine, in a line."""
    if _switched_off():
        return f"none, since {SWITCH} is off"
    landlocked, filtered = _holds()
    if not (landlocked or filtered):
        why = "this kernel has neither Landlock nor seccomp" if _LINUX else "it takes Linux"
        return f"none: {why}"
    files = f"files by Landlock {landlocked}" if landlocked else "files free: no Landlock here"
    network = "network free: no seccomp here"
    if filtered:
        network = "network by seccomp"
    elif landlocked >= landlock.SINCE_TCP:
        network = "TCP by Landlock, no seccomp here"
    return f"{files}, {network}"


def _switched_off() -> bool:
    return os.environ.get(SWITCH, "").lower() == "off"


@functools.cache
def _holds() -> tuple[int, bool]:
    """The version of Landlock, 0 where there is none, and whether system calls can be filtered."""
    return landlock.version(), seccomp.available()
