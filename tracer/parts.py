"""How far functions are compiled that only other compiled functions call: to LLVM's language.

Numba would optimise each of them, make machine code of it, and then give both up for the function
into which it is linked, where LLVM optimises it once more. That is a fifth of all compilation.
"""

from __future__ import annotations

from typing import Any

import numba._dynfunc
import numba.core.codegen

_numba: Any = numba  # its own types cover little of it
JITCodeLibrary: Any = _numba.core.codegen.JITCodeLibrary
NativeLowering: Any = _numba.core.typed_passes.NativeLowering
CompilerBase: Any = _numba.core.compiler.CompilerBase
made_function: Any = _numba._dynfunc.make_function


class _Part(JITCodeLibrary):  # type: ignore[misc]
    """A function's code, which waits to be linked into others."""

    def _optimize_final_module(self) -> None:
        """Not here: in what it is linked into."""

    def _finalize_final_module(self) -> None:
        """Without handing it to the machine."""
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


@_numba.core.compiler_machinery.register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):  # type: ignore[misc]
    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """With a function at no address, by which Numba knows it when others call it.

        What Numba keeps beside machine code, for errors with arguments that are known only then, is
        left out with it: kernels raise none.
        """
        state.library = _Part(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered, of, name = state["cr"], state.library, state.func_id.func_name
        known = made_function(lowered.fndesc.lookup_module(), name, "", 0, lowered.env, (of,))
        state.targetctx.insert_user_function(known, lowered.fndesc, [of])
        state["cr"] = lowered._replace(cfunc=known)
        return True


class PartCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's way from Python to LLVM, but for its end."""

    def define_pipelines(self) -> list[Any]:
        steps = _numba.core.compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        steps.passes = [
            (_PartLowering if step is NativeLowering else step, why) for step, why in steps.passes
        ]
        steps.finalize()
        return [steps]
