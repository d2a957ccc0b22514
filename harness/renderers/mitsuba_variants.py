"""Which of Mitsuba's variants work on this machine, found out by rendering with them.

Mitsuba's fast variants compile with the system's libLLVM, and a wrong one does not fail: versions
15 and 16 abort the whole process ("Cannot select: fminimum"). So every probe is a tiny render in a
child process. What worked is remembered in the cache folder; what failed is tried again, because
it may have been mended since.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import json
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from harness.data import cache_root
from harness.errors import RendererMissing
from harness.record import write_text

FAST, SLOW = "llvm_ad_rgb", "scalar_rgb"
VARIANT = "SNELLCHECK_MITSUBA_VARIANT"
LIBRARY = "DRJIT_LIBLLVM_PATH"  # Dr.Jit's own variable; what a user sets in it is tried first
OLDEST_LLVM = 17
INSTALL = "pip install 'snellcheck[mitsuba]'"
PROBE_TIMEOUT_S = 60.0  # an import and a small compilation take 1 to 3 s

_LIBRARIES = (
    "/usr/lib/*-linux-gnu/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/llvm*/lib*/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
    "/usr/local/opt/llvm*/lib/libLLVM*.dylib",
)

# A glass ball in a world of radiance 0.5 is invisible: all of the image is 0.5. Spectral variants
# sample wavelengths, so it is so on average only.
_RENDER = """
import sys
import mitsuba as mi
mi.set_variant(sys.argv[1])
scene = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "path", "max_depth": 64, "rr_depth": 1000},
    "sensor": {
        "type": "perspective",
        "to_world": mi.ScalarTransform4f().look_at([0, 0, 6], [0, 0, 0], [0, 1, 0]),
        "film": {"type": "hdrfilm", "width": 8, "height": 8, "pixel_format": "rgb"},
    },
    "ball": {"type": "sphere", "bsdf": {"type": "dielectric"}},
    "world": {"type": "constant", "radiance": {"type": "rgb", "value": 0.5}},
})
import numpy as np
print("\\nmean", float(np.array(mi.render(scene, spp=64)).mean()))
"""


@dataclass(frozen=True)
class Library:
    """A libLLVM. `major` is None where its file does not tell."""

    path: Path
    major: int | None


@dataclass(frozen=True)
class Probe:
    """What came of a render with a variant; `detail` says why it is not usable."""

    variant: str
    library: Library | None
    usable: bool
    detail: str = ""


@dataclass(frozen=True)
class Choice:
    """The variant to render with. `note` says what is wrong with it and `remedy` mends that."""

    variant: str
    library: Library | None
    note: str = ""
    remedy: str = ""


# --- libraries ------------------------------------------------------------------------------------


def libraries(
    patterns: Iterable[str] = _LIBRARIES, environment: Mapping[str, str] = os.environ
) -> list[Library]:
    """The user's own choice first, then every libLLVM of at least `OLDEST_LLVM`, newest first."""
    found: dict[Path, Library] = {}
    for pattern in patterns:
        for name in Path("/").glob(pattern.removeprefix("/")):
            path = name.resolve()
            major = version_in(name) or version_in(path)
            if path.is_file() and major is not None and major >= OLDEST_LLVM:
                found[path] = Library(path, major)
    newest_first = sorted(found.values(), key=lambda lib: (-(lib.major or 0), lib.path))
    if chosen := environment.get(LIBRARY):
        own = Path(chosen)
        return [Library(own, version_in(own.resolve())), *newest_first]
    return newest_first


def version_in(path: Path) -> int | None:
    """The major version that a library's name or folder tells.

    libLLVM.so.19.1, libLLVM-19.so.1, llvm-19/lib/libLLVM.so, llvm@19/lib/libLLVM.dylib,
    Cellar/llvm/19.1.7/lib/libLLVM.dylib.
    """
    forms = (r"llvm[-@/]?(\d+)[^/]*/lib", r"libLLVM-(\d+)", r"libLLVM\.so\.(\d\d+)")
    for form in forms:
        if match := re.search(form, str(path)):
            return int(match[1])
    return None


# --- probes ---------------------------------------------------------------------------------------


def probe(variant: str, library: Library | None = None) -> Probe:
    """Renders a few pixels with `variant` in a child process, or remembers that it worked."""
    key = _key(variant, library)
    if key in _remembered():
        return Probe(variant, library, usable=True)
    found = _try(variant, library)
    if found.usable:
        _remember(key)
    return found


def _try(variant: str, library: Library | None) -> Probe:
    environment = dict(os.environ)
    if library is not None:
        environment[LIBRARY] = str(library.path)
    argv = [sys.executable, "-c", _RENDER, variant]
    try:
        child = subprocess.run(
            argv, env=environment, capture_output=True, text=True, timeout=PROBE_TIMEOUT_S
        )
    except subprocess.TimeoutExpired:
        return Probe(variant, library, usable=False, detail=f"hung for {PROBE_TIMEOUT_S:g} s")
    mean = re.search(r"^mean (\S+)$", child.stdout, re.MULTILINE)
    if child.returncode == 0 and mean is not None:
        usable = 0.45 < float(mean[1]) < 0.55
        wrong = "" if usable else f"rendered {mean[1]} where 0.5 is right"
        return Probe(variant, library, usable, wrong)
    return Probe(variant, library, usable=False, detail=_reason(child.returncode, child.stderr))


def _reason(code: int, log: str) -> str:
    """The line of `log` that says most about why a child ended with `code`."""
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    told = [
        line
        for line in lines
        if re.search(r"LLVM ERROR|Error: |_drjit_ext|cannot open shared object", line)
    ]
    said = (told or lines or ["said nothing"])[-1][:300]
    return f"ended by signal {-code}: {said}" if code < 0 else said


def _key(variant: str, library: Library | None) -> str:
    """All that decides whether a probe succeeds, as far as it can be told without trying."""
    parts = [
        importlib.metadata.version("mitsuba"),
        platform.python_version(),
        variant,
        _processor(),
    ]
    if library is not None:
        parts += [str(library.path), str(library.path.stat().st_mtime_ns)]
    return " | ".join(parts)


def _processor() -> str:
    """A cache folder may travel to another machine, and whether LLVM works depends on it."""
    try:
        about = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return platform.machine()
    model = re.search(r"^model name\s*:\s*(.+)$", about, re.MULTILINE)
    return model[1] if model else platform.machine()


def _memory() -> Path:
    return cache_root() / "mitsuba-variants.json"


def _remembered() -> set[str]:
    """The keys of probes that succeeded. An unreadable memory is an empty one."""
    try:
        keys = json.loads(_memory().read_text(encoding="utf-8"))
        return {str(key) for key in keys}
    except (OSError, ValueError, TypeError):
        return set()


def _remember(key: str) -> None:
    with contextlib.suppress(OSError):  # it would cost a second at the next start, no more
        write_text(_memory(), json.dumps(sorted(_remembered() | {key}), indent=1) + "\n")


# --- the choice -----------------------------------------------------------------------------------


@functools.cache
def choose() -> Choice:
    """The fast variant with the newest libLLVM that works, or else the slow one, with a note.

    Raises RendererMissing, with the command that mends it, where Mitsuba does not work at all.
    """
    try:
        importlib.metadata.version("mitsuba")
    except importlib.metadata.PackageNotFoundError:
        raise RendererMissing(f"Mitsuba is not installed: {INSTALL}", remedy=INSTALL) from None
    failures = []
    for library in _existing(libraries()):
        found = probe(FAST, library)
        if found.usable:
            return Choice(FAST, library)
        failures.append(f"{library.path}: {found.detail}")
    found = probe(SLOW)
    if not found.usable:
        remedy = missing_library(found.detail)
        message = f"Mitsuba does not work ({found.detail})"
        message += f": {remedy}" if remedy else ""
        raise RendererMissing(message, log=found.detail, remedy=remedy)
    why = "; ".join(failures) or f"no libLLVM of version {OLDEST_LLVM} or later was found"
    return Choice(SLOW, None, f"renders with {SLOW}, which is slow: {why}", llvm_remedy())


def _existing(candidates: Iterable[Library]) -> list[Library]:
    return [library for library in candidates if library.path.is_file()]


def child_environment() -> dict[str, str]:
    """What a process that hosts Mitsuba needs in its environment. Raises RendererMissing."""
    choice = choose()
    environment = {VARIANT: choice.variant}
    if choice.library is not None:
        environment[LIBRARY] = str(choice.library.path)
    return environment


def usable_variants() -> list[Probe]:
    """A probe of every variant that Mitsuba was built with, two at a time; for the doctor.

    Variants for graphics cards are left out: results from them are not reproducible elsewhere.
    """
    library = choose().library
    names = [name for name in _built() if not name.startswith("cuda")]
    with ThreadPoolExecutor(max_workers=2) as pool:
        return list(pool.map(lambda name: _probe_with(name, library), names))


def _probe_with(variant: str, library: Library | None) -> Probe:
    if not variant.startswith("llvm"):
        return probe(variant)
    if library is None:
        return Probe(variant, None, usable=False, detail="no usable libLLVM")
    return probe(variant, library)


def _built() -> list[str]:
    script = "import mitsuba; print(*mitsuba.variants())"
    child = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=PROBE_TIMEOUT_S
    )
    return child.stdout.split()


# --- remedies -------------------------------------------------------------------------------------


def missing_library(detail: str) -> str:
    """The command that installs what a failed import complains of; "" where it is unknown."""
    if "libatomic" in detail or "_drjit_ext" in detail:
        # Where libatomic is missing, Dr.Jit's import ends in "name '_drjit_ext' is not defined".
        return "sudo apt-get install libatomic1"
    return ""


def llvm_remedy(system: str = "") -> str:
    """The command that installs a libLLVM that works."""
    if (system or platform.system()) == "Darwin":
        return "brew install llvm"
    return f"sudo apt-get install {_newest_package()}"


def _newest_package() -> str:
    """The newest libLLVM that apt offers: libllvm19, or libllvm17t64 on Ubuntu 24.04."""
    argv = ["apt-cache", "search", "--names-only", r"^libllvm[0-9]+(t64)?$"]
    try:
        child = subprocess.run(argv, capture_output=True, text=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return "libllvm19"
    offered = {
        int(match[2]): match[1]
        for match in re.finditer(r"^(libllvm(\d+)(?:t64)?) ", child.stdout, re.MULTILINE)
        if int(match[2]) >= OLDEST_LLVM
    }
    return offered[max(offered)] if offered else "libllvm19"
