"""All renderers by name: ours and those of other packages, through the same entry points.

A package offers a renderer by an entry point of the group ``snellcheck.renderers``: a callable
without arguments that returns a `harness.renderers.base.Renderer`. Nothing is imported before a
renderer is asked for, and Mitsuba and the tracer never are in this process.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from harness.errors import InputError, RendererFailed, RendererMissing, nearest
from harness.fingerprint import code_digest, combined, versions
from harness.renderers.base import Renderer

if TYPE_CHECKING:
    from harness.scene.resolved import ResolvedScene

GROUP = "snellcheck.renderers"
Factory = Callable[[], Renderer]
# Renderers that are asked nothing but checks that name them: they are here to show what a stated
# way of using a renderer costs, in the scenes that are about it.
ONLY_WHERE_NAMED = frozenset({"povray-stock"})

# What stands between the harness and an engine in a worker, beside the engine's own adapter.
HOSTING = ("harness.truth.camera", "harness.renderers.persistent", "harness.renderers.worker")

INSTALL_MITSUBA = "pip install 'snellcheck[mitsuba]'"


def available() -> dict[str, Factory]:
    """All that are registered, by name, in alphabetical order.

    A factory raises RendererFailed where the package that registered it cannot be loaded, or
    where two packages claim the name.
    """
    found: dict[str, set[EntryPoint]] = {}
    for entry in entry_points(group=GROUP):
        found.setdefault(entry.name, set()).add(entry)
    return {name: functools.partial(_load, name, found[name]) for name in sorted(found)}


def create(name: str, option: str = "--renderer", besides: tuple[str, ...] = ()) -> Renderer:
    """The registered renderer `name`. Raises InputError where there is none, or as its factory.

    It was given as `option`, which takes the names in `besides`, too.
    """
    factories = available()
    if name not in factories:
        names = [*factories, *besides]
        raise InputError.of(
            "unknown renderer",
            key=option,
            value=name,
            expected="one of " + ", ".join(names),
            suggestion=nearest(name, names),
        )
    return factories[name]()


def command_renderer(template: str, folder: Path | None = None) -> Renderer:
    """The renderer of a command line like ``mytracer {scene} {output}``. Raises InputError."""
    from harness.renderers.command_file import renderer_from_command

    return renderer_from_command(template, folder or Path.cwd())


def configured_renderer(path: Path) -> Renderer:
    """The renderer that a snellcheck-renderer.toml describes. Raises InputError."""
    from harness.renderers.command_file import renderer_from_file

    return renderer_from_file(path)


def _load(name: str, entries: set[EntryPoint]) -> Renderer:
    if len(entries) > 1:
        claims = " and ".join(sorted(_origin(entry) for entry in entries))
        raise RendererFailed(f"two packages claim the renderer {name!r}: {claims}")
    (entry,) = entries
    try:
        renderer = entry.load()()
    except Exception as error:  # a third party's code can raise anything
        reason = f"{type(error).__name__}: {error}".rstrip(": ")
        message = f"the renderer {name!r} of {_origin(entry)} cannot be loaded: {reason}"
        raise RendererFailed(message) from error
    if missing := [m for m in ("version", "render", "health", "emit") if not hasattr(renderer, m)]:
        what = f"it is a {type(renderer).__name__} without {', '.join(missing)}"
        raise RendererFailed(f"the renderer {name!r} of {_origin(entry)} is none: {what}")
    return renderer  # type: ignore[no-any-return]


def _origin(entry: EntryPoint) -> str:
    package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else "an unknown package"
    return f"{package} ({entry.value})"


# --- the built-in renderers, registered in pyproject.toml -----------------------------------------


def tracer() -> Renderer:
    """The tracer of this project, in a worker."""
    from harness.renderers.persistent import WorkerRenderer, engine_program

    program = engine_program("harness.renderers.tracer:TracerEngine", *_caches_of_numba())
    return WorkerRenderer("tracer", program, fingerprint=_fingerprint_of_tracer)


def _caches_of_numba() -> tuple[Path, ...]:
    """Where Numba keeps the tracer as machine code: beside it, or in the user's cache."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return (Path(chosen),)
    import platformdirs

    found = find_spec("tracer")
    beside = [
        Path(place, "__pycache__") for place in (found and found.submodule_search_locations) or ()
    ]
    return (*beside, platformdirs.user_cache_path("numba"))


def _fingerprint_of_tracer() -> str:
    code = code_digest("harness.renderers.tracer", *HOSTING)
    return combined(code, versions("numpy", "numba", "llvmlite"))


def povray() -> Renderer:
    """The povray executable, one process an image."""
    from harness.renderers.povray import PovRayRenderer

    return PovRayRenderer()


def povray_stock() -> Renderer:
    """The same with POV-Ray's defaults, as its users write scenes."""
    from harness.renderers.povray import StockPovRayRenderer

    return StockPovRayRenderer()


def mitsuba() -> Renderer:
    """Mitsuba as its users run it, in a worker."""
    return _mitsuba("mitsuba", "StockEngine")


def mitsuba_exact() -> Renderer:
    """Mitsuba's scene and materials, with both lobes followed, in a worker."""
    return _mitsuba("mitsuba-exact", "ExactEngine")


def _mitsuba(name: str, engine: str) -> Renderer:
    from harness.renderers.mitsuba_variants import child_environment
    from harness.renderers.persistent import WorkerRenderer, engine_program

    # Dr.Jit keeps what it has compiled in the user's home.
    program = engine_program(f"harness.renderers.mitsuba:{engine}", Path.home() / ".drjit")
    return WorkerRenderer(
        name, program, env=child_environment, remedy=INSTALL_MITSUBA,
        fingerprint=_fingerprint_of_mitsuba, translate=_to_mitsuba_xml,
    )  # fmt: skip


def _to_mitsuba_xml(scene: ResolvedScene, folder: Path) -> Path:
    from harness.translate.mitsuba_xml import write

    return write(scene, folder)


def _fingerprint_of_mitsuba() -> str | None:
    """Our adapter, the files of Mitsuba and Dr.Jit as installed, and the compiler they load."""
    from harness.renderers.mitsuba_variants import choose

    try:
        choice = choose()
        installed = [distribution(name).read_text("RECORD") or "" for name in ("mitsuba", "drjit")]
    except (RendererMissing, PackageNotFoundError):
        return None
    compiler = ""
    if choice.library is not None:
        about = choice.library.path.stat()
        compiler = f"{choice.library.path} {about.st_size} {about.st_mtime_ns}"
    code = code_digest("harness.renderers.mitsuba", *HOSTING)
    told = versions("numpy", "mitsuba", "drjit")
    return combined(code, told, choice.variant, compiler, *installed)
