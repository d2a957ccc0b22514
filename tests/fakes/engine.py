"""Engines for the worker, most of them faulty. They live in a child process."""

# ruff: noqa: T201 - printing is one of the faults

from __future__ import annotations

import ctypes
import os
import sys
import time
from pathlib import Path

import numpy as np

from harness.errors import RendererFailed, RendererMissing, RendererUnsupported
from harness.renderers.base import (
    Capability,
    Health,
    Image,
    RayPaths,
    Rays,
    RenderSettings,
    Status,
)
from harness.scene.resolved import ResolvedScene


class Plain:
    """Renders an even grey of value settings.seed / 100, or the process's number for seed 0."""

    name = "plain"
    capabilities = frozenset({Capability.IMAGE, Capability.SPHERE, Capability.FRESNEL})

    def version(self) -> str:
        return "1.2.3"

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        value = settings.seed / 100 if settings.seed else os.getpid()
        return Image(np.full((scene.film.height, scene.film.width, 3), value, np.float32))


class Full(Plain):
    """With everything that is optional."""

    capabilities = Plain.capabilities | {Capability.RAYS}

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        pixels = np.zeros((scene.film.height, scene.film.width, 3), np.float32)
        pixels[...] = (0.25, 0.5, 0.75)
        return Image(pixels, pixels / 100, seconds=0.125, log="fine", command="full --go")

    def trace(
        self, scene: ResolvedScene, rays: Rays, path: str, settings: RenderSettings
    ) -> RayPaths:
        n = len(rays.origins)
        status = np.full(n, Status.MISS, np.int8)
        status[0] = Status.HIT
        return RayPaths(
            status=status,
            surface=np.where(status == Status.HIT, 0, -1).astype(np.int32),
            point=np.where(status[:, None] == Status.HIT, rays.origins + 1, np.nan),
            direction=rays.directions,
            weight=np.full(n, float(len(path))),
            optical_length=np.arange(n, dtype=float),
            vertices=np.stack([rays.origins, rays.origins + rays.directions], axis=1),
        )

    def emit(self, scene: ResolvedScene, folder: Path) -> Path:
        (folder / "scene.txt").write_text(f"{scene.film.width}")
        return folder / "scene.txt"

    def health(self) -> Health:
        return Health("full", True, detail="well", path="/opt/full", facts={"variants": "1"})


class Chatty(Plain):
    """Prints to stdout from Python and from below it, and reads stdin."""

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        print("from Python")
        libc = ctypes.CDLL(None)
        libc.puts(b"from C")
        libc.fflush(None)
        os.system("echo from a child")  # noqa: S605
        assert sys.stdin.read() == ""
        return super().render(scene, settings)


class Faulty(Plain):
    """Does what the seed says."""

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        match settings.seed:
            case 1:
                print("about to abort", file=sys.stderr, flush=True)
                os.abort()
            case 2:
                print("about to hang", file=sys.stderr, flush=True)
                time.sleep(600)
            case 3:
                hoard = [bytearray(b"x") * (8 << 20)]
                while True:
                    hoard.append(bytearray(b"x") * (8 << 20))
                    time.sleep(0.01)
            case 4:
                os._exit(7)
            case 5:
                raise ZeroDivisionError("by nothing")
            case 6:
                raise RendererUnsupported("no prisms here")
            case 7:
                raise RendererFailed("it went wrong", log="line 1\nline 2")
            case 8:
                return Image(np.full((1, 1, 3), np.nan, np.float32))
            case 9:
                pixels = np.zeros((scene.film.height, scene.film.width, 3), np.float32)
                pixels[0, 0, 0] = np.nan
                return Image(pixels)
        return super().render(scene, settings)


class Missing:
    def __init__(self) -> None:
        raise RendererMissing("no such engine here")


class NotInstalled:
    def __init__(self) -> None:
        import snellcheck_no_such_module  # noqa: F401


class AbortsAtStart:
    def __init__(self) -> None:
        print("LLVM ERROR: out of luck", file=sys.stderr, flush=True)
        os.abort()
