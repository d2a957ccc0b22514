"""Landlock: what the calling thread, and all that it starts, may do with files (Linux 5.13+).

The three system calls of `landlock(7)`, whose numbers are the same on all machines. There is no
way back: a thread that has confined itself stays so.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import stat
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_ASK_VERSION = 1  # a flag of the first
_PATH_BENEATH = 1  # a kind of rule
_PR_SET_NO_NEW_PRIVS = 38

# Rights over files, include/uapi/linux/landlock.h.
_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_DIR = 1 << 0, 1 << 1, 1 << 2, 1 << 3
_REMOVE_AND_MAKE = sum(1 << bit for bit in range(4, 13))
_REFER, _TRUNCATE = 1 << 13, 1 << 14
_READ = _EXECUTE | _READ_FILE | _READ_DIR
_OF_FILES = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE  # the rest is for folders alone

_TCP = 0b11  # to bind and to connect
_SOCKETS, _SIGNALS = 0b01, 0b10  # abstract Unix sockets, signals to outsiders
SINCE_REFER, SINCE_TRUNCATE, SINCE_TCP, SINCE_SCOPES = 2, 3, 4, 6  # versions


class _Ruleset(ctypes.Structure):
    _fields_ = (
        ("files", ctypes.c_uint64),
        ("network", ctypes.c_uint64),
        ("scoped", ctypes.c_uint64),
    )


class _Beneath(ctypes.Structure):
    _pack_ = 1
    _layout_ = "ms"
    _fields_ = (("allowed", ctypes.c_uint64), ("parent", ctypes.c_int32))


def version() -> int:
    """The version of Landlock that this kernel has; 0 where it has none or must not use it."""
    if sys.platform != "linux":
        return 0
    try:
        return _called(_CREATE_RULESET, None, 0, _ASK_VERSION)
    except OSError:
        return 0


def restrict(
    readable: Sequence[Path] | None, writable: Sequence[Path], *, network: bool = False
) -> None:
    """Confines the calling thread. Where `readable` is None, everything may be read.

    `writable` are files and folders with all below them, which may be read, too; paths that are
    not there are left out. Without `network` no TCP port can be used. Signals reach nobody outside.
    What the kernel's version does not know of this stays allowed. Raises OSError.
    """
    known = version()
    handled = _WRITE_FILE | _REMOVE_AND_MAKE
    handled |= _REFER if known >= SINCE_REFER else 0
    handled |= _TRUNCATE if known >= SINCE_TRUNCATE else 0
    handled |= _READ if readable is not None else 0
    ports = _TCP if known >= SINCE_TCP and not network else 0
    scoped = _SIGNALS if network else _SIGNALS | _SOCKETS
    ruleset = _Ruleset(handled, ports, scoped if known >= SINCE_SCOPES else 0)
    rules = _called(_CREATE_RULESET, ctypes.byref(ruleset), ctypes.sizeof(ruleset), 0)
    try:
        for path in readable or ():
            _allow(rules, path, _READ)
        for path in writable:
            _allow(rules, path, handled)
        no_new_privileges()
        _called(_RESTRICT_SELF, rules, 0)
    finally:
        os.close(rules)


def no_new_privileges() -> None:
    """The calling thread can start nothing that has more rights. Raises OSError."""
    if _LIBC.prctl(_PR_SET_NO_NEW_PRIVS, *map(ctypes.c_ulong, (1, 0, 0, 0))) != 0:
        raise _error()


def _allow(rules: int, path: Path, rights: int) -> None:
    with _opened(path) as parent:
        if parent is None:
            return
        if not stat.S_ISDIR(os.fstat(parent).st_mode):
            rights &= _OF_FILES
        rule = _Beneath(rights, parent)
        _called(_ADD_RULE, rules, _PATH_BENEATH, ctypes.byref(rule), 0)


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[int | None]:
    try:
        descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:
        yield None
        return
    try:
        yield descriptor
    finally:
        os.close(descriptor)


_LIBC = ctypes.CDLL(None, use_errno=True)
_LIBC.syscall.restype = ctypes.c_long


def _called(number: int, *arguments: object) -> int:
    words = [ctypes.c_long(a) if isinstance(a, int) else a for a in arguments]
    result = int(_LIBC.syscall(ctypes.c_long(number), *words))
    if result < 0:
        raise _error()
    return result


def _error() -> OSError:
    number = ctypes.get_errno()
    return OSError(number, os.strerror(number))
