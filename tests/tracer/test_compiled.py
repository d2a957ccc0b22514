"""What is compiled is what is written, and importing the package compiles nothing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import tracer

PACKAGE = Path(tracer.__file__).parent


def run(folder: Path, code: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


def test_kernels_follow_a_change_in_what_they_call(tmp_path: Path) -> None:
    """Numba alone looks at the file of the kernel only, and would keep the old code."""
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, tmp_path / "tracer", ignore=ignore)
    code = "from tracer.optics import reflect; print(reflect((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)))"
    assert run(tmp_path, code) == "(1.0, 0.0, 0.0)"
    assert run(tmp_path, code) == "(1.0, 0.0, 0.0)"  # now from the cache
    called = tmp_path / "tracer" / "vector.py"
    right = called.read_text(encoding="utf-8")
    wrong = right.replace("return a[0] * b[0]", "return -a[0] * b[0]")
    assert wrong != right
    called.write_text(wrong, encoding="utf-8")
    assert run(tmp_path, code) != "(1.0, 0.0, 0.0)"


def test_where_nothing_can_be_kept_it_is_compiled_all_the_same() -> None:
    """As in a container that runs as somebody without a home."""
    code = (
        "from numba.core.caching import CompileResultCacheImpl as places\n"
        "places._locator_classes = []\n"
        "from tracer.optics import reflect\n"
        "print(reflect((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)))\n"
    )
    assert run(PACKAGE.parent, code) == "(1.0, 0.0, 0.0)"


def test_parts_of_kernels_are_no_machine_code_of_their_own() -> None:
    code = (
        "from tracer.compiled import called, compiled, inlined\n"
        "@inlined\n"
        "def double(x): return 2.0 * x\n"
        "@called\n"
        "def more(x): return double(x) + 1.0\n"
        "@compiled\n"
        "def most(x): return more(x) + double(x)\n"
        "print(most(3.0))\n"
        "for function in double, most:\n"
        "    (made,) = function.overloads.values()\n"
        "    engine, name = made.library.codegen._engine, made.fndesc.mangled_name\n"
        "    print(engine.is_symbol_defined(name))\n"
    )
    assert run(PACKAGE.parent, code).split() == ["13.0", "False", "True"]


def test_importing_the_package_imports_no_compiler() -> None:
    code = "import sys, tracer; print('numba' in sys.modules, 'numpy' in sys.modules)"
    assert run(PACKAGE.parent, code) == "False False"


def test_everything_it_offers_is_there() -> None:
    assert all(hasattr(tracer, name) for name in tracer.__all__)
