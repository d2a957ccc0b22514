"""A renderer that lives in a child process and survives from case to case.

The harness's end of the protocol of docs/worker-protocol.md. The child is started at the first
request, does one at a time, and is replaced when it dies, hangs or takes too much memory.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shutil
import sys
import tempfile
import threading
import weakref
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from harness.errors import RendererError, RendererFailed, RendererMissing, RendererUnsupported
from harness.imagefile import Encoding
from harness.renderers import wire
from harness.renderers.base import Capability, Health, Image, RayPaths, Rays, RenderSettings
from harness.renderers.child import Child
from harness.renderers.confinement import PRIVATE_ALONE, Confinement
from harness.renderers.delivery import delivered, described
from harness.renderers.needs import require
from harness.renderers.proof import proof_scene, prove
from harness.scene.resolved import ResolvedScene
from harness.temporary import make_folder

Environment = Mapping[str, str] | Callable[[], Mapping[str, str]] | None

Translate = Callable[[ResolvedScene, Path], Path]

START_S = 60.0  # to import the engine and say hello


@dataclasses.dataclass(frozen=True)
class Program:
    """What speaks the protocol: `argv`, run in `folder` (None: a private temporary one).

    It is asked to write images in `image_format`; `encoding` is what integer values in them mean.
    `env` is added to the environment. `confinement` says what it may touch beside the folders of
    its requests.
    """

    argv: tuple[str, ...]
    folder: Path | None = None
    image_format: str = "npy"
    encoding: Encoding | None = None
    env: Mapping[str, str] = dataclasses.field(default_factory=dict)
    confinement: Confinement = PRIVATE_ALONE


def engine_program(engine: str, *caches: Path) -> Program:
    """Serves `engine`, "module:Class", with our own worker, in our Python, from our places.

    `caches` are the folders where it keeps what it has compiled.
    """
    argv = (sys.executable, "-P", "-m", "harness.renderers.worker", engine)
    places = os.pathsep.join(entry or str(Path.cwd()) for entry in sys.path)
    harness = Path(__file__).parents[1]
    compiled = (harness / stage / "__pycache__" for stage in ("renderers", "translate", "truth"))
    confinement = Confinement(writable=(*compiled, *caches))
    return Program(argv, env={"PYTHONPATH": places}, confinement=confinement)


class WorkerRenderer:
    """The Renderer protocol on top of a worker.

    `engine` is "module:Class" (see `worker`) or any `Program`. `capabilities` default to those
    that the worker tells, so asking for them may start it; one that does not start has none, and
    `version` and `render` say why. `env` is added to the environment; a function is called at
    each start. `remedy` is the command that installs a missing engine. `fingerprint` is as in
    `harness.renderers.base.Renderer`. `translate` writes what the engine is given into a folder
    and returns the main file, where that takes no engine.

    Threads may share one renderer, and wait for each other. After a fork, the child process has
    a worker of its own.
    """

    def __init__(
        self,
        name: str,
        engine: str | Program,
        *,
        capabilities: frozenset[Capability] | None = None,
        env: Environment = None,
        remedy: str = "",
        fingerprint: Callable[[], str | None] = lambda: None,
        translate: Translate | None = None,
    ) -> None:
        self.fingerprint = fingerprint
        self._translate = translate
        self.translates = translate is not None
        self._name = name
        self._program = engine_program(engine) if isinstance(engine, str) else engine
        self._declared = capabilities
        self._env = env
        self._remedy = remedy
        self._hello: wire.Reply | None = None
        self._child: Child | None = None
        self._room: Path | None = None
        self._remove_room: weakref.finalize[..., WorkerRenderer] | None = None
        self._lock = threading.RLock()
        _RENDERERS.add(self)

    @property
    def name(self) -> str:
        return self._name

    @property
    def capabilities(self) -> frozenset[Capability]:
        try:
            return self._claimed()
        except RendererError:
            return frozenset()

    def version(self) -> str:
        """Raises RendererMissing or RendererFailed where the worker does not start."""
        return self._greeting().version

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        """Raises RendererMissing, RendererUnsupported or RendererFailed."""
        require(scene, self.name, self._claimed())
        with self._request() as folder:
            output = folder / f"image.{self._program.image_format}"
            reply = self._ask("render", settings, scene=_write(scene, folder), output=output)
            encoding = self._program.encoding
            pixels, info = delivered(output, scene.film, log=reply.log, encoding=encoding)
            variance = None
            if reply.variance is not None:
                variance, _ = delivered(reply.variance, scene.film, log=reply.log)
            log = "\n".join(filter(None, (reply.log, described(info))))
            closest = None
            if reply.closest is not None:
                closest = delivered(reply.closest, scene.film, log=reply.log)[0][..., 0]
            seconds = reply.seconds or 0.0
            return Image(pixels, variance, seconds, log, reply.command, closest, reply.cut)

    def trace(
        self, scene: ResolvedScene, rays: Rays, path: str, settings: RenderSettings
    ) -> RayPaths:
        """Raises RendererMissing, RendererUnsupported or RendererFailed."""
        require(scene, self.name, self._claimed())
        if "trace" not in self._greeting().operations:
            raise RendererUnsupported(f"{self.name} has no ray API")
        with self._request() as folder:
            given, output = folder / "rays.npy", folder / "paths.npy"
            wire.write_rays(given, rays)
            scene_file = _write(scene, folder)
            files = {"scene": scene_file, "rays": given, "output": output}
            reply = self._ask("trace", settings, path=path, **files)
            try:
                return wire.read_paths(output, len(rays.origins), reply.vertices, reply.meetings)
            except (OSError, ValueError, EOFError) as error:
                message = f"{self.name} wrote unusable ray paths: {error}"
                raise RendererFailed(message, log=reply.log) from error

    def emit(self, scene: ResolvedScene, folder: Path) -> Path:
        """What the engine makes of the scene where it can show it, or else scene.json."""
        if self._translate is not None:
            return self._translate(scene, folder)
        folder.mkdir(parents=True, exist_ok=True)
        with self._request() as private:
            main = scene_file = _write(scene, private)
            if "emit" in self._greeting().operations:
                reply = self._ask("emit", RenderSettings(), scene=scene_file, folder=private)
                if reply.file is not None and reply.file != scene_file:
                    main = reply.file
                    scene_file.unlink()
            if not main.is_relative_to(private):
                raise RendererFailed(f"{self.name} says that it wrote to {main}")
            shutil.copytree(private, folder, symlinks=True, dirs_exist_ok=True)
            return folder / main.relative_to(private)

    def health(self) -> Health:
        """Probes with a tiny render in a worker of its own. Never raises."""
        probe = WorkerRenderer(
            self.name,
            self._program,
            capabilities=self._declared,
            env=self._env,
            remedy=self._remedy,
        )
        version, found = "", wire.Reply(id=None, ok=True)
        try:
            greeting = probe._greeting()
            version = greeting.version
            if "health" in greeting.operations:
                found = probe._ask("health", RenderSettings())
            scene = proof_scene(probe.capabilities)
            prove(probe.render(scene, RenderSettings(samples=16)))
        except RendererError as error:
            said = [line for line in error.log.splitlines()[-1:] if line not in str(error)]
            detail = " ".join([str(error), *said])
            remedy = error.remedy or found.remedy or self._remedy
            return Health(self.name, False, version, found.path, detail, remedy, found.facts)
        except Exception as error:
            detail = f"{type(error).__name__}: {error}"
            return Health(self.name, False, version, detail=detail, remedy=self._remedy)
        finally:
            probe.close()
        return Health(
            self.name, found.usable, version, found.path, found.detail, found.remedy, found.facts
        )

    def close(self) -> None:
        """Ends the worker. A later request starts another."""
        with self._lock:
            self._end_child()
            if self._remove_room is not None:
                self._remove_room()
            self._room = None

    def _end_child(self) -> None:
        if self._child is not None:
            self._child.close()
        self._child = None

    @contextlib.contextmanager
    def _request(self) -> Iterator[Path]:
        """A folder for the files of one request, in the room that the worker may write to."""
        with (
            self._program.confinement.explained(),
            tempfile.TemporaryDirectory(prefix="request-", dir=self._private()) as name,
        ):
            yield Path(name)

    def _private(self) -> Path:
        """The room, which outlives a worker that has to be replaced."""
        with self._lock:
            if self._room is None:
                self._room = make_folder()
                self._remove_room = weakref.finalize(self, shutil.rmtree, self._room, True)
            return self._room

    def _claimed(self) -> frozenset[Capability]:
        return self._greeting().capabilities if self._declared is None else self._declared

    def _greeting(self) -> wire.Reply:
        """What the worker said when it was last started."""
        with self._lock:
            if self._hello is None:
                self._started()
            assert self._hello is not None
            return self._hello

    def _ask(self, operation: str, settings: RenderSettings, **more: Path | str) -> wire.Reply:
        """The reply to a request. Raises the error that it tells of."""
        request: dict[str, Any] = {"op": operation, "settings": dataclasses.asdict(settings)}
        request |= {key: str(value) for key, value in more.items()}
        with self._lock:
            child = self._started()
            output = more.get("output")
            private = output.parent if isinstance(output, Path) else None
            return child.ask(request, settings.timeout_s, settings.memory_mb, private)

    def _started(self) -> Child:
        """The living worker, after it has said hello."""
        if self._child is not None and self._child.usable():
            return self._child
        self._end_child()
        child, program = None, self._program
        confinement = program.confinement.and_writable(self._private())
        try:
            child = Child(self.name, program.argv, program.folder, self._environment(), confinement)
            hello = {"op": "hello", "protocol": wire.PROTOCOL}
            greeting = child.ask(hello, START_S, RenderSettings().memory_mb)
            if greeting.protocol != wire.PROTOCOL:
                spoken = f"protocol {greeting.protocol}, not {wire.PROTOCOL}"
                raise RendererFailed(f"{self.name} speaks {spoken}")
        except RendererError as error:
            if child is not None:
                child.close()
            if isinstance(error, RendererMissing) and self._remedy and not error.remedy:
                message = f"{error}; install it with: {self._remedy}"
                raise RendererMissing(message, log=error.log, remedy=self._remedy) from error
            raise
        self._hello, self._child = greeting, child
        return child

    def _environment(self) -> dict[str, str]:
        added = self._env() if callable(self._env) else self._env
        return {**os.environ, **self._program.env, **(added or {})}

    def _abandon(self) -> None:
        """After a fork: the worker is the parent's, and its lock may be held by a lost thread."""
        self._lock = threading.RLock()
        if self._child is not None:
            self._child.abandon()
        if self._remove_room is not None:
            self._remove_room.detach()
        self._child, self._room, self._remove_room = None, None, None


def _write(scene: ResolvedScene, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "scene.json"
    path.write_text(scene.model_dump_json(), encoding="utf-8")
    return path


_RENDERERS: weakref.WeakSet[WorkerRenderer] = weakref.WeakSet()


def _abandon_workers() -> None:
    for renderer in list(_RENDERERS):
        renderer._abandon()


os.register_at_fork(after_in_child=_abandon_workers)
