"""POV-Ray as a renderer: one process per image, in a private folder, without a shell.

Most of the wall time of a process is sleep, so the way to be quick is many processes at once: on
two cores 48 images of 256 x 256 took 0.08 s each as 16 processes at a time, 0.31 s each as frames
of one process, which saved 0.01 s of 0.08 s of processor time; so there is no batching here.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import sys
import threading
from pathlib import Path

import numpy as np

from harness.errors import (
    RendererError,
    RendererFailed,
    RendererMissing,
    RendererUnsupported,
)
from harness.fingerprint import code_digest, combined, file_digest, versions
from harness.renderers.base import Capability, Health, Image, RenderSettings
from harness.renderers.confinement import Confinement
from harness.renderers.delivery import delivered
from harness.renderers.developing import developed, of_samples
from harness.renderers.needs import require
from harness.renderers.process import Finished, run_limited
from harness.renderers.process_tree import attempts
from harness.renderers.proof import proof_scene, prove
from harness.scene import resolved as rs
from harness.temporary import make_folder, temporary_folder
from harness.translate.povray import MAX_TRACE_LEVEL, PovScene, options, translate
from harness.translate.povray_stock import translate as translate_stock

MACOS = sys.platform == "darwin"
INSTALL = "brew install povray" if MACOS else "sudo apt-get install povray"
REINSTALL = "brew reinstall povray" if MACOS else "sudo apt-get install --reinstall povray"
OLDEST = (3, 7)
GOODBYE = "POV-Ray finished"
# Its threads get two seconds to start, which a busy machine may not have: no fault of the scene.
LATE = "Timed out waiting for worker thread startup"
_BANNER = re.compile(
    r"Persistence of Vision\(tm\) Ray Tracer Version.*?"
    r"^Support libraries used by POV-Ray:\n(?:[^\n]+\n)+",
    re.DOTALL | re.MULTILINE,
)

# POV-Ray's own confinement. It was seen not to hold, so it is not what safety rests on: that is
# `translate.povray`, which lets numbers alone into the scene, and the system's confinement below.
# Without this file POV-Ray complains.
CONFIGURATION = """\
[File I/O Security]
restricted
[Shellout Security]
forbidden
[Permitted Paths]
read+write = .
"""

# What it may read beside the scene: itself, its libraries, and what the C library looks into.
SYSTEM = tuple(
    Path(name)
    for name in (
        "/usr", "/lib", "/lib32", "/lib64", "/bin", "/opt", "/nix/store", "/gnu/store",
        "/etc/ld.so.cache", "/etc/ld.so.preload", "/etc/ld.so.conf", "/etc/ld.so.conf.d",
        "/etc/alternatives", "/etc/povray", "/etc/localtime", "/etc/nsswitch.conf", "/etc/passwd",
        "/sys/devices/system/cpu", "/proc/self", "/proc/cpuinfo", "/proc/meminfo", "/proc/stat",
        "/dev/urandom", "/dev/random",
    )
)  # fmt: skip


class PovRayRenderer:
    """Implements `harness.renderers.base.Renderer` with the `povray` executable.

    Not claimed: THIN_SLAB, RAYS, RADIANCE_N2. `settings.samples` and `.seed` play no part: one ray
    goes through each pixel centre.
    """

    name = "povray"
    translate = staticmethod(translate)
    # A process sleeps most of its time: eight keep two cores busy.
    concurrency = 8
    capabilities = frozenset(
        {
            Capability.DOUBLE,
            Capability.IMAGE,
            Capability.PIXEL_CENTRES,
            Capability.LOBE_SWITCH,
            Capability.SPHERE,
            Capability.CONVEX,
            Capability.CYLINDER,
            Capability.CONE,
            Capability.LENS,
            Capability.CONIC,
            Capability.CSG,
            Capability.HALF_SPACE,
            Capability.PLANE,
            Capability.MESH,
            Capability.SMOOTH_MESH,
            Capability.MIRROR,
            Capability.DIFFUSE,
            Capability.PHONG,
            Capability.DIRECTIONAL_LIGHT,
            Capability.TRANSLUCENT,
            Capability.PICTURE,
            Capability.ENVIRONMENT,
            Capability.SAMPLING,
            Capability.ABSORPTION,
            Capability.FRESNEL,
            Capability.NESTED,
            Capability.PRIORITY,
            Capability.CAMERA_INSIDE,
        }
    )

    translates = True

    def __init__(self, executable: str = "povray") -> None:
        self._executable = executable
        self._version: str | None = None

    def version(self) -> str:
        if self._version is None:
            path = self._path()
            with temporary_folder() as folder:
                done = _run([path, "--version"], Path(folder), RenderSettings(timeout_s=30))
            found = re.search(r"^POV-Ray (\d+)\.(\d+)\S*", done.stdout + done.stderr, re.MULTILINE)
            if found is None:
                raise RendererFailed(f"{path} does not tell its version", log=done.stderr)
            if (int(found[1]), int(found[2])) < OLDEST:
                raise RendererMissing(f"{found[0]} is too old: POV-Ray 3.7 is needed; {INSTALL}")
            self._version = found[0].removeprefix("POV-Ray ")
        return self._version

    def fingerprint(self) -> str | None:
        """The executable's content and our adapter's code. Not the libraries that it loads."""
        found = shutil.which(self._executable)
        if found is None:
            return None
        code = code_digest(__name__)
        return combined(file_digest(Path(found)), code, versions("numpy", "netpbmfile"))

    def render(self, scene: rs.ResolvedScene, settings: RenderSettings) -> Image:
        require(scene, self.name, self.capabilities)
        if scene.film.samples > 1:
            return developed(self.render(of_samples(scene), settings), scene.film)
        path = self._path()
        translated = self.translate(scene)
        with temporary_folder() as name:
            folder = Path(name)
            _write(translated, scene, folder)
            arguments = ["scene.ini", f"+WT{max(1, settings.threads):d}"]
            for _ in attempts():
                done = _run([path, *arguments], folder, settings)
                if LATE not in done.stderr:
                    break
            log = messages(done.stderr)
            if done.returncode != 0:
                raise RendererFailed(_reason(log, done.returncode), log=log)
            pixels, info = delivered(folder / "image.ppm", scene.film, log=log, encoding="linear")
            statistics = _read_text(folder / "statistics.txt")
        if info.bits != 16:
            raise RendererFailed(f"wrote {info.bits} bits per channel instead of 16", log=log)
        _check_depth(scene, statistics)
        return Image(
            pixels=pixels / np.float32(translated.exposure),
            seconds=_trace_seconds(statistics, done.wall_s),
            log=log,
            command=shlex.join([self._executable, *arguments]),
        )

    def health(self) -> Health:
        try:
            path, version = self._path(), self.version()
            prove(self.render(proof_scene(self.capabilities), RenderSettings(timeout_s=30)))
        except RendererMissing as error:
            return Health(self.name, usable=False, detail=str(error), remedy=INSTALL)
        except RendererError as error:
            detail = " ".join(filter(None, (str(error), error.log)))
            return Health(self.name, usable=False, detail=detail, remedy=REINSTALL)
        return Health(self.name, usable=True, version=version, path=path)

    def emit(self, scene: rs.ResolvedScene, folder: Path) -> Path:
        """Writes `scene.pov`, its pictures, and `scene.ini`: ``povray scene.ini`` renders them."""
        folder.mkdir(parents=True, exist_ok=True)
        scene = of_samples(scene)
        return _write(self.translate(scene), scene, folder)

    def _path(self) -> str:
        path = shutil.which(self._executable)
        if path is None:
            raise RendererMissing(f"POV-Ray is not installed: {INSTALL}")
        return path


class StockPovRayRenderer(PovRayRenderer):
    """POV-Ray as its users write for it: see `harness.translate.povray_stock`."""

    name = "povray-stock"
    translate = staticmethod(translate_stock)
    # Solids that touch are written as users write them: what comes of it is documented.
    capabilities = PovRayRenderer.capabilities | {Capability.DISPERSION}


def _write(translated: PovScene, scene: rs.ResolvedScene, folder: Path) -> Path:
    for name, content in translated.attachments.items():
        (folder / name).write_bytes(content)
    (folder / "scene.ini").write_text(options(scene), encoding="ascii")
    main = folder / "scene.pov"
    main.write_text(translated.sdl, encoding="ascii")
    return main


class _Home:
    """A home for all of POV-Ray's processes, so that no settings of the user or site count.

    They may read it, not write to it. It goes with the temporary folders of this process.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """After a fork, too: the folder is the parent's, and a lost thread may hold the lock."""
        self._lock = threading.Lock()
        self._path: Path | None = None

    def path(self) -> Path:
        with self._lock:
            if self._path is None or not (self._path / INI).is_file():
                self._path = make_folder()
                for series in ("3.7", "3.8"):
                    configuration = self._path / ".povray" / series / "povray.conf"
                    configuration.parent.mkdir(parents=True)
                    configuration.write_text(CONFIGURATION, encoding="ascii")
                (self._path / INI).touch()
            return self._path


INI = "povray.ini"
_HOME = _Home()
os.register_at_fork(after_in_child=_HOME.forget)


def _run(argv: list[str], folder: Path, settings: RenderSettings) -> Finished:
    home = _HOME.path()
    env = {**os.environ, "HOME": str(home), "POVINI": str(home / INI), "TMPDIR": str(folder)}
    try:
        return run_limited(
            argv, cwd=folder, timeout_s=settings.timeout_s, memory_mb=settings.memory_mb,
            private=folder, confinement=confinement(argv[0], home), env=env,
        )  # fmt: skip
    except RendererFailed as error:
        raise RendererFailed(str(error), log=messages(error.log)) from None


def confinement(executable: str, *readable: Path) -> Confinement:
    """POV-Ray reads what belongs to the system and to itself, and writes beside its scene alone."""
    places = [Path(executable).resolve().parents[1], Path(executable).parent, *readable]
    loaded = os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep)
    places += [Path(place) for place in loaded if place]
    return Confinement(readable=(*SYSTEM, *places), shares=False)


def messages(stderr: str) -> str:
    """What POV-Ray said of the scene, word for word: stderr without banner and progress."""
    # A short parse may be over before the front end looks, which then says nothing of it: where the
    # banner ends must be told by the banner.
    lines = _BANNER.sub("", stderr, count=1).splitlines()
    said = [s for s in lines if s.strip() and not s.startswith("==== [") and s != GOODBYE]
    return "\n".join(said)


def _reason(log: str, returncode: int) -> str:
    """The first error in the log, which goes on over indented lines."""
    found = re.search(r"^.*\b(?:Error|error)\b.*(?:\n .*)*", log, re.MULTILINE)
    said = " ".join(found[0].split()) if found else f"exit status {returncode}"
    return f"POV-Ray did not render the scene: {said}"


def _read_text(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""


def _trace_seconds(statistics: str, wall_s: float) -> float:
    """POV-Ray's own time of tracing; the wall time of the process where it does not tell."""
    found = re.search(r"Trace Time:.*\((\d+\.\d+) seconds\)", statistics)
    return float(found[1]) if found else wall_s


def _check_depth(scene: rs.ResolvedScene, statistics: str) -> None:
    """POV-Ray cannot go deeper than 256: a scene that would is not rendered as asked."""
    found = re.search(r"Max Level:\s*(\d+)/", statistics)
    if scene.transport.max_depth > MAX_TRACE_LEVEL and found and int(found[1]) >= MAX_TRACE_LEVEL:
        raise RendererUnsupported(
            f"light takes more than POV-Ray's {MAX_TRACE_LEVEL} segments; "
            f"max_depth asks for {scene.transport.max_depth}"
        )
