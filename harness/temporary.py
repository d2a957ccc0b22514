"""Temporary folders, all in one room of this process, so that none stays behind for good.

Who is killed cannot tidy up. So each process has a room in the system's temporary folder and holds
it locked; the kernel lets go of the lock however the process ends, in whatever container it was.
Whoever makes a room first clears those of the same user that nobody holds, and ends the programs
that were started from them.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import re
import secrets
import shutil
import tempfile
import threading
import weakref
from pathlib import Path

import psutil

PREFIX = "snellcheck-room-"
_ROOM = re.compile(re.escape(PREFIX) + r"[a-z0-9_]{8}")
# In the environment of all that we start: ROOM/NUMBER, so that it can be told whose it was.
TOKEN = "SNELLCHECK_PROCESS"


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """A new folder, to be used in a ``with``. Raises OSError where none can be made."""
    return tempfile.TemporaryDirectory(prefix="", dir=_room())


def make_folder() -> Path:
    """A new folder, for the caller to remove. Raises OSError where none can be made."""
    return Path(tempfile.mkdtemp(prefix="", dir=_room()))


def new_token() -> str:
    """What tells a program that this process starts from all others. Raises OSError."""
    return f"{_room().name}/{secrets.token_hex(8)}"


class _Room:
    """A locked folder; removed when this process ends, by whoever comes next where it cannot."""

    def __init__(self) -> None:
        self.path, self._lock = _locked()
        self._end = weakref.finalize(self, _close, self.path, self._lock)

    def abandon(self) -> None:
        """In a fork of our process: the room is the parent's."""
        self._end.detach()
        os.close(self._lock)


class _Current:
    """The room of this process, made when it is first needed."""

    def __init__(self) -> None:
        self.room: _Room | None = None
        self.lock = threading.Lock()

    def abandon(self) -> None:
        if self.room is not None:
            self.room.abandon()
        self.room, self.lock = None, threading.Lock()  # a lost thread may hold the old one


_CURRENT = _Current()
os.register_at_fork(after_in_child=_CURRENT.abandon)


def _room() -> Path:
    with _CURRENT.lock:
        if _CURRENT.room is None or not _CURRENT.room.path.is_dir():
            clear_abandoned()
            _CURRENT.room = _Room()
        return _CURRENT.room.path


def _locked() -> tuple[Path, int]:
    """A new folder and the descriptor that holds its lock."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=PREFIX)).resolve()
        lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        # Before it was locked, somebody may have taken it for abandoned. Where the file system
        # knows no locks, nobody gets one, and rooms of the dead stay.
        if _lock(lock) is not False and os.path.lexists(path):
            return path, lock
        os.close(lock)


def _lock(descriptor: int) -> bool | None:
    """Whether we have the lock now; None where there are no locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return False if error.errno in (errno.EWOULDBLOCK, errno.EACCES) else None
    return True


def _close(path: Path, lock: int) -> None:
    shutil.rmtree(path, ignore_errors=True)
    os.close(lock)


def clear_abandoned() -> None:
    """Removes this user's rooms whose processes are no more, and ends what these have started."""
    with contextlib.suppress(OSError), os.scandir(tempfile.gettempdir()) as entries:
        for entry in entries:
            if _ROOM.fullmatch(entry.name):
                with contextlib.suppress(OSError):  # another process clears it, too
                    _clear_if_abandoned(Path(entry.path))


def _clear_if_abandoned(path: Path) -> None:
    lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        if os.fstat(lock).st_uid == os.geteuid() and _lock(lock):
            _end_orphans(path.name)
            shutil.rmtree(path, ignore_errors=True)
    finally:
        os.close(lock)


def _end_orphans(room: str) -> None:
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            theirs = process.environ().get(TOKEN, "").startswith(f"{room}/")
            if theirs and process.pid != os.getpid():
                process.kill()
