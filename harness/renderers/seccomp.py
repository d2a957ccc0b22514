"""A filter of system calls that leaves the calling thread, and all that it starts, no network.

Landlock knows TCP alone. This refuses every socket but Unix ones, through which the processes of
one renderer may talk to each other, and io_uring, which could open sockets behind its back.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import sys
from dataclasses import dataclass

_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06  # BPF: classes and modes joined
_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000  # the latter with a number of errno
_NUMBER, _MACHINE, _FIRST_ARGUMENT = 0, 4, 16  # offsets in struct seccomp_data, little-endian
_SET_FILTER, _ASK_FOR_ACTION = 1, 2
_WITHOUT_SLOWDOWN = 4  # SPEC_ALLOW: or old kernels switch off speculation, and renders are slower
_AF_UNIX, _IO_URING_SETUP = 1, 425
_X32 = 0x40000000  # calls of x86-64's third way to call
_NOT_THERE, _DENIED = _REFUSE | errno.ENOSYS, _REFUSE | errno.EACCES


@dataclass(frozen=True)
class _Machine:
    """Numbers of seccomp(2) and socket(2), also for the 32-bit programs that it can run."""

    audit: int
    seccomp: int
    socket: int
    compatible: int
    compatible_sockets: tuple[int, ...]  # socket, and socketcall where there is one


_MACHINES = {
    "x86_64": _Machine(0xC000003E, 317, 41, 0x40000003, (359, 102)),
    "aarch64": _Machine(0xC00000B7, 277, 198, 0x40000028, (281, 102)),
}

Instruction = tuple[int, int, int, int]  # operation, jump where true, jump where false, operand


def available() -> bool:
    """Whether this kernel can filter, and we know its numbers."""
    machine = _machine()
    if machine is None:
        return False
    action = ctypes.c_uint32(_REFUSE)
    return _called(machine, _ASK_FOR_ACTION, 0, ctypes.byref(action)) == 0


def forbid_network() -> None:
    """From now on the calling thread opens no sockets but Unix ones. Raises OSError.

    It must have no way to more rights before (`landlock.no_new_privileges`).
    """
    machine = _machine()
    if machine is None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    words = program(machine)
    table = (_Instruction * len(words))(*(_Instruction(*word) for word in words))
    if _called(machine, _SET_FILTER, _WITHOUT_SLOWDOWN, ctypes.byref(_Program(len(words), table))):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def program(machine: _Machine) -> list[Instruction]:
    """The filter; each comparison that does not hold skips the instruction after it."""
    foreign: list[Instruction] = [(_LOAD, 0, 0, _NUMBER)]
    for number in machine.compatible_sockets:
        foreign += [(_EQUAL, 0, 1, number), (_RETURN, 0, 0, _DENIED)]
    foreign += [(_RETURN, 0, 0, _ALLOW)]
    return [
        (_LOAD, 0, 0, _MACHINE),
        (_EQUAL, 0, len(foreign), machine.compatible),
        *foreign,
        (_EQUAL, 1, 0, machine.audit),
        (_RETURN, 0, 0, _NOT_THERE),
        (_LOAD, 0, 0, _NUMBER),
        (_AT_LEAST, 0, 1, _X32),
        (_RETURN, 0, 0, _NOT_THERE),
        (_EQUAL, 0, 1, _IO_URING_SETUP),
        (_RETURN, 0, 0, _NOT_THERE),
        (_EQUAL, 1, 0, machine.socket),
        (_RETURN, 0, 0, _ALLOW),
        (_LOAD, 0, 0, _FIRST_ARGUMENT),
        (_EQUAL, 0, 1, _AF_UNIX),
        (_RETURN, 0, 0, _ALLOW),
        (_RETURN, 0, 0, _DENIED),
    ]


class _Instruction(ctypes.Structure):
    _fields_ = (
        ("operation", ctypes.c_uint16),
        ("true", ctypes.c_uint8),
        ("false", ctypes.c_uint8),
        ("operand", ctypes.c_uint32),
    )


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_uint16), ("table", ctypes.POINTER(_Instruction)))


def _machine() -> _Machine | None:
    return _MACHINES.get(platform.machine()) if sys.platform == "linux" else None


_LIBC = ctypes.CDLL(None, use_errno=True)
_LIBC.syscall.restype = ctypes.c_long


def _called(machine: _Machine, operation: int, flags: int, argument: object) -> int:
    numbers = map(ctypes.c_long, (machine.seccomp, operation, flags))
    return int(_LIBC.syscall(*numbers, argument))
