"""The one decorator that turns a Python function into machine code.

Numba keys its cache on the file of the compiled function alone, so a kernel would outlive a change
in a function that it calls from another file. Here every kernel carries a stamp of the whole
package: after any change to any of its files, all of it is compiled anew.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def _package_stamp() -> str:
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.name.encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


_STAMP = _package_stamp()


def compiled(function: Function) -> Function:
    """Compiles `function` on its first call, and keeps the result on disk.

    IEEE arithmetic as written (no fast-math, no fused multiply-add): the same bits everywhere.
    The interpreter lock is released, so threads run kernels side by side. With the environment
    variable ``NUMBA_DISABLE_JIT=1`` it stays a Python function, for debuggers and coverage.
    """
    dispatcher = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    cache = getattr(dispatcher, "_cache", None)
    if cache is not None:
        cache._cache_file._source_stamp = _STAMP
    return cast(Function, dispatcher)
