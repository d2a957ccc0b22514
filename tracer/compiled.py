"""The one decorator that turns a Python function into machine code.

Numba keys its cache on the file of the compiled function alone, so a kernel would outlive a change
in a function that it calls from another file. Here every kernel carries a stamp of the whole
package: after any change to any of its files, all of it is compiled anew.
"""

from __future__ import annotations

import gc
import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from tracer.parts import PartCompiler

_numba: Any = numba  # its own types cover little of it
Function = TypeVar("Function", bound=Callable[..., Any])


def _package_stamp() -> str:
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.name.encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


_STAMP = _package_stamp()


def compiled(function: Function) -> Function:
    """Compiles `function` on its first call, and keeps the result on disk, where there is a place.

    IEEE arithmetic as written (no fast-math, no fused multiply-add): the same bits everywhere.
    The interpreter lock is released, so threads run side by side. Arrays are only borrowed: there
    is no reference counting, which threads would fight over, so none can be made inside either.
    With the environment variable ``NUMBA_DISABLE_JIT=1`` it stays a Python function, for
    debuggers and coverage.
    """
    return _compiled(function, keep=True, forceinline=True)


def inlined(function: Function) -> Function:
    """As `compiled`, for parts of compiled functions; Python cannot call it.

    That saves the code that unpacks Python's arguments, machine code (see `tracer.parts`), and a
    twentieth of all compilation as it is not kept on disk by itself. It is merged into its callers,
    because a scene's arrays are a hundred arguments, too many to pass for every ray.
    """
    return _part(function, forceinline=True)


def called(function: Function) -> Function:
    """As `inlined`, for what is too large, or called too rarely, to be merged by force.

    This has to be said, or a function takes after the one for which it is compiled.
    """
    return _part(function, forceinline=False)


def merged(function: Function) -> Function:
    """As `inlined`, for what one function alone calls: merged first, and compiled once."""
    return _part(function, inline="always")


def _part(function: Function, **options: Any) -> Function:
    return _compiled(function, no_cpython_wrapper=True, pipeline_class=PartCompiler, **options)


@contextmanager
def _no_collections() -> Iterator[None]:
    """Keeps Python from looking for garbage, again and again among all that a compiler makes.

    That would take a twentieth of the time, to find some 100 MB at the end.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def _compiled(function: Function, keep: bool = False, **options: Any) -> Function:
    options |= {"nogil": True, "_nrt": False, "no_cfunc_wrapper": True}  # C calls none of it
    try:
        dispatcher = _numba.njit(error_model="numpy", cache=keep, **options)(function)
    except RuntimeError:  # neither beside the package nor at home may anything be written
        dispatcher = _numba.njit(error_model="numpy", **options)(function)
    if hasattr(dispatcher, "py_func"):
        if hasattr(dispatcher._cache, "_cache_file"):
            dispatcher._cache._cache_file._source_stamp = _STAMP
        specialise = dispatcher.compile

        def compile_once(signature: Any) -> Any:
            """Not anew for every constant that a caller passes, which Numba takes for a type."""
            if isinstance(signature, tuple):
                signature = tuple(_numba.types.unliteral(argument) for argument in signature)
            with _no_collections():
                return specialise(signature)

        dispatcher.compile = compile_once
    return cast(Function, dispatcher)
