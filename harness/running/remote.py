"""Renderers on other machines: a job travels whole, in one parcel, and its result comes back so.

What carries the parcels is any `concurrent.futures.Executor`: `harness.running.cluster` has Dask's.
The other side needs snellcheck and the renderer, and nothing else: no shared disk, no open port of
ours, no scene files.
"""

from __future__ import annotations

import concurrent.futures
import functools
import platform
import threading
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from harness.cache.entry import Entry, decode
from harness.errors import ConnectionLost, RendererError, RendererFailed, SnellcheckError
from harness.judging.results import Result
from harness.plan import Job
from harness.renderers import registry
from harness.renderers.base import (
    Capability,
    Health,
    Image,
    RayPaths,
    Rays,
    Renderer,
    RenderSettings,
)
from harness.running.lanes import perform
from harness.running.parcel import Parcel, pack_job, pack_result, unpack_job, unpack_result
from harness.scene.resolved import ResolvedScene

ATTEMPTS = 4  # of a job whose worker was lost; one that kills every worker is to blame itself
POLL_S = 0.5  # how often it is looked whether there is anybody left to wait for
_CARRIED = "parcel"  # the key of entries that travel


@dataclass(frozen=True)
class Origin:
    """How the other side makes the renderer: by name, from a command line, from a file of its own.

    `folder` is where a command is run.
    """

    kind: Literal["registered", "command", "config"]
    text: str
    folder: str = ""


# --- over there -----------------------------------------------------------------------------------


def answer(request: bytes) -> bytes:
    """Does what a parcel asks. Never raises: whatever goes wrong is the answer."""
    try:
        asked = decode(request, _CARRIED)
        origin = Origin(**asked.meta["origin"])
        renderer, about = _made(origin), _about(origin)
        if asked.meta["op"] == "hello":
            parcel = Parcel({}, {})
        else:
            job = unpack_job(Parcel(asked.meta["job"], asked.blocks))
            parcel = pack_result(_performed(renderer, job))
    except RendererError as error:
        about, parcel = {}, pack_result(error)
    except Exception as error:  # it would have to be unpickled by whoever waits
        told = f"{type(error).__name__}: {error}"
        about, parcel = {}, pack_result(RendererFailed(f"{platform.node()}: {told}"))
    return Entry(_CARRIED, {**parcel.meta, "about": about}, parcel.blocks).encode()


def _performed(renderer: Renderer, job: Job) -> Result:
    try:
        return perform(renderer, job)
    except OSError as error:  # a full disk over there is no reason to stop everybody
        return RendererFailed(f"{platform.node()}: {error.strerror}")


@functools.cache
def _made(origin: Origin) -> Renderer:
    """One per process, so that workers that speak the protocol stay alive from job to job."""
    if origin.kind == "registered":
        return registry.create(origin.text)
    if origin.kind == "command":
        return registry.command_renderer(origin.text, Path(origin.folder))
    return registry.configured_renderer(Path(origin.text))


@functools.cache
def _about(origin: Origin) -> dict[str, Any]:
    """What the renderer over there is. Raises RendererError where it is missing."""
    renderer = _made(origin)
    tell = getattr(renderer, "fingerprint", None)
    return {
        "version": renderer.version(),
        "fingerprint": tell() if tell is not None else None,
        "capabilities": sorted(renderer.capabilities),
    }


# --- over here ------------------------------------------------------------------------------------


class RemoteRenderer:
    """A renderer behind an executor, as `harness.renderers.base.Renderer` and with `trace`.

    `lost` are the exceptions with which the executor says that a worker died; such a job is given
    to another one, and counted in `retried`. `gone` says whether all is lost. `concurrency` bounds
    the jobs that are under way, and with them the memory that their scenes take.
    """

    def __init__(
        self,
        name: str,
        origin: Origin,
        executor: concurrent.futures.Executor,
        *,
        concurrency: int,
        lost: tuple[type[BaseException], ...] = (),
        gone: Callable[[], bool] = lambda: False,
    ) -> None:
        self._name, self._origin, self._executor = name, origin, executor
        self._lost, self._gone = lost, gone
        self.concurrency = concurrency
        self.retried = 0
        self._lock = threading.Lock()
        self._hello: Mapping[str, Any] | None = None

    @property
    def name(self) -> str:
        return self._name

    @property
    def capabilities(self) -> frozenset[Capability]:
        return frozenset(Capability(name) for name in self._known()["capabilities"])

    def version(self) -> str:
        """Raises RendererMissing or RendererFailed where the other side has none that works."""
        return str(self._known()["version"])

    def fingerprint(self) -> str | None:
        """That of the renderer over there."""
        told: str | None = self._known()["fingerprint"]
        return told

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        """Raises RendererMissing, RendererUnsupported, RendererFailed or ConnectionLost."""
        image = self._done(Job(self._name, "", scene, settings))
        if not isinstance(image, Image):
            raise RendererFailed(f"{self._name} delivered ray paths for an image")
        return image

    def trace(
        self,
        scene: ResolvedScene,
        rays: Rays,  # noqa: ARG002 - the camera's, which the other side finds itself
        path: str,
        settings: RenderSettings,
    ) -> RayPaths:
        """Raises as `render`."""
        paths = self._done(Job(self._name, "", scene, settings, path))
        if not isinstance(paths, RayPaths):
            raise RendererFailed(f"{self._name} delivered an image for ray paths")
        return paths

    def health(self) -> Health:
        """Whether anybody over there has it. Never raises."""
        try:
            return Health(self._name, usable=True, version=self.version())
        except SnellcheckError as error:
            return Health(self._name, usable=False, detail=str(error))

    def emit(self, scene: ResolvedScene, folder: Path) -> Path:
        """Writes scene.json; what the renderer makes of it is made over there."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "scene.json"
        path.write_text(scene.model_dump_json(), encoding="utf-8")
        return path

    def _known(self) -> Mapping[str, Any]:
        with self._lock:
            if self._hello is None:
                entry = self._ask({"op": "hello"}, {})
                self._hello = entry.meta["about"]
            return self._hello

    def _done(self, job: Job) -> Image | RayPaths:
        known, parcel = self._known(), pack_job(job)
        entry = self._ask({"op": "job", "job": parcel.meta}, parcel.blocks)
        if entry.meta["about"] != known:
            seen, expected = entry.meta["about"].get("version"), known["version"]
            raise RendererFailed(
                f"machines differ: {self._name} {seen} on one of them, {expected} on another, "
                "or their installations do"
            )
        result = unpack_result(Parcel(entry.meta, entry.blocks))
        if isinstance(result, RendererError):
            raise result
        return result

    def _ask(self, meta: Mapping[str, Any], blocks: Mapping[str, bytes]) -> Entry:
        """The answer of whoever takes the job. Raises the error that it tells of."""
        request = Entry(_CARRIED, {**meta, "origin": asdict(self._origin)}, blocks).encode()
        for attempt in range(ATTEMPTS):
            try:
                entry = decode(self._carried(request), _CARRIED)
            except self._lost as error:
                if self._gone():
                    raise ConnectionLost(f"lost the machines that {self._name} ran on") from error
                if attempt + 1 == ATTEMPTS:
                    told = f"{ATTEMPTS} workers died over it, one after the other"
                    raise RendererFailed(told) from error
                self.retried += 1
            else:
                return self._checked(entry)
        raise AssertionError("the last attempt returns or raises")

    @staticmethod
    def _checked(entry: Entry) -> Entry:
        """The entry, where the renderer was there at all. Raises what it says otherwise."""
        if entry.meta["about"]:
            return entry
        failure = unpack_result(Parcel(entry.meta, entry.blocks))
        assert isinstance(failure, RendererError)
        raise failure

    def _carried(self, request: bytes) -> bytes:
        future = self._executor.submit(answer, request)
        while True:
            try:
                return future.result(timeout=POLL_S)
            except concurrent.futures.TimeoutError:
                if self._gone():  # nobody is left to be told that it is not wanted any more
                    raise ConnectionLost(f"lost the machines that {self._name} ran on") from None


def origin_of_command(template: str) -> Origin:
    """A command line of the user's own, run over there in a folder of the same name as here."""
    return Origin("command", template, str(Path.cwd()))


def origin_of_config(path: Path) -> Origin:
    """A snellcheck-renderer.toml, which must be at the same place over there."""
    return Origin("config", str(path.resolve()))
