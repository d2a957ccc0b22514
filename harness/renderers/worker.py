"""A renderer as a child process: ``python -m harness.renderers.worker module:Class``.

Serves an engine over the protocol of docs/worker-protocol.md: one JSON object a line on stdin and
stdout, pictures and arrays in files. An engine is a class like this; all but the first two are
optional::

    class Engine:
        def version(self) -> str: ...
        def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image: ...

        name: str
        capabilities: frozenset[Capability]
        def trace(self, scene, rays, path, settings) -> RayPaths: ...
        def emit(self, scene: ResolvedScene, folder: Path) -> Path: ...
        def health(self) -> Health: ...

It is imported and made at the first request. What it prints goes to stderr, and so does what
libraries below Python print: the protocol's streams are moved out of their reach.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, BinaryIO

from harness import imagefile
from harness.errors import RendererMissing, RendererUnsupported, SnellcheckError
from harness.renderers import wire
from harness.renderers.base import Capability, RenderSettings
from harness.scene.resolved import ResolvedScene

Message = dict[str, Any]


class Server:
    """Answers requests with one engine. Whatever the engine raises becomes an answer."""

    def __init__(self, target: str) -> None:
        self._target = target
        self._engine: Any = None
        self._operations: dict[str, Callable[[Message], Message]] = {
            "hello": self._hello,
            "render": self._render,
            "trace": self._trace,
            "emit": self._emit,
            "health": self._health,
        }

    def answer(self, line: bytes) -> Message:
        """The reply to one request."""
        reply: Message = {"id": None}
        started = time.perf_counter()
        try:
            request = json.loads(line)
            reply["id"] = request["id"]
            operation = self._operations.get(request["op"])
            if operation is None:
                raise RendererUnsupported(f"no operation {request['op']!r}")
            reply |= {"ok": True} | operation(request)
            reply.setdefault("seconds", time.perf_counter() - started)
        except SnellcheckError as error:
            log = getattr(error, "log", "")
            reply |= {"ok": False, "error": _kind(error), "message": str(error), "log": log}
        except ModuleNotFoundError as error:
            reply |= {"ok": False, "error": "missing", "message": str(error)}
        except Exception as error:  # an engine can raise anything
            message = f"{type(error).__name__}: {error}".rstrip(": ")
            log = traceback.format_exc(limit=-8)
            reply |= {"ok": False, "error": "failed", "message": message, "log": log}
        return reply

    @property
    def engine(self) -> Any:
        if self._engine is None:
            module, _, name = self._target.partition(":")
            self._engine = getattr(importlib.import_module(module), name)()
        return self._engine

    def _hello(self, _: Message) -> Message:
        optional = [op for op in ("trace", "emit", "health") if hasattr(self.engine, op)]
        capabilities: Iterable[Capability] = getattr(self.engine, "capabilities", ())
        return {
            "protocol": wire.PROTOCOL,
            "name": getattr(self.engine, "name", self._target),
            "version": self.engine.version(),
            "capabilities": sorted(str(capability) for capability in capabilities),
            "operations": ["render", *optional],
        }

    def _render(self, request: Message) -> Message:
        output = Path(request["output"])
        image = self.engine.render(_scene(request), _settings(request))
        imagefile.write_npy(output, image.pixels)
        reply: Message = {"log": image.log, "command": image.command}
        if image.seconds:
            reply["seconds"] = image.seconds
        if image.cut is not None:
            reply["cut"] = image.cut
        if image.variance is not None:
            variance = output.with_name(f"{output.stem}.variance.npy")
            imagefile.write_npy(variance, image.variance)
            reply["variance"] = str(variance)
        if image.closest is not None:
            closest = output.with_name(f"{output.stem}.closest.npy")
            imagefile.write_npy(closest, image.closest[..., None].repeat(3, axis=2))
            reply["closest"] = str(closest)
        return reply

    def _trace(self, request: Message) -> Message:
        rays = wire.read_rays(Path(request["rays"]))
        settings = _settings(request)
        paths = self.engine.trace(_scene(request), rays, request["path"], settings)
        files = wire.write_paths(Path(request["output"]), paths)
        return {name: str(file) for name, file in files.items()}

    def _emit(self, request: Message) -> Message:
        return {"file": str(self.engine.emit(_scene(request), Path(request["folder"])))}

    def _health(self, _: Message) -> Message:
        found = self.engine.health()
        return {
            "usable": found.usable,
            "path": found.path,
            "detail": found.detail,
            "remedy": found.remedy,
            "facts": {str(key): str(value) for key, value in found.facts.items()},
        }


def _kind(error: SnellcheckError) -> str:
    if isinstance(error, RendererMissing):
        return "missing"
    return "unsupported" if isinstance(error, RendererUnsupported) else "failed"


def _scene(request: Message) -> ResolvedScene:
    return ResolvedScene.model_validate_json(Path(request["scene"]).read_bytes())


def _settings(request: Message) -> RenderSettings:
    return RenderSettings(**request["settings"])


def _take_streams() -> tuple[BinaryIO, BinaryIO]:
    """The protocol's streams, on descriptors of their own. fd 0 is empty, fd 1 is stderr now."""
    requests = os.fdopen(os.dup(0), "rb")
    replies = os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return requests, replies


def _leave_with_parent() -> None:
    """Ends this process when its parent is gone, even in the middle of a render."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def main(arguments: list[str]) -> int:
    """Serves until stdin ends."""
    if len(arguments) != 1 or ":" not in arguments[0]:
        sys.stderr.write("usage: python -m harness.renderers.worker module:Class\n")
        return 2
    requests, replies = _take_streams()
    _leave_with_parent()
    server = Server(arguments[0])
    for line in requests:
        reply = json.dumps(server.answer(line)).encode() + b"\n"
        sys.stdout.flush()
        sys.stderr.flush()
        replies.write(reply)
        replies.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
