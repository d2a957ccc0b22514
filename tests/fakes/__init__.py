"""Renderers that are not: for tests of everything that uses renderers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from harness.renderers.base import Capability, Health, Image, RenderSettings
from harness.scene.resolved import ResolvedScene

MISBEHAVE = Path(__file__).parent / "misbehave.py"

Picture = Callable[[ResolvedScene], np.ndarray]


def grey(scene: ResolvedScene) -> np.ndarray:
    """An even 0.25."""
    return np.full((scene.film.height, scene.film.width, 3), 0.25, np.float32)


class FakeRenderer:
    """In this process; shows `picture` or raises `error`. `rendered` lists what it was asked."""

    def __init__(
        self,
        name: str = "fake",
        picture: Picture = grey,
        *,
        error: Exception | None = None,
        capabilities: frozenset[Capability] = frozenset(Capability)
        - {Capability.RAYS, Capability.MAIN_WAY},
    ) -> None:
        self.name = name
        self.capabilities = capabilities
        self.rendered: list[tuple[ResolvedScene, RenderSettings]] = []
        self._picture = picture
        self._error = error

    def version(self) -> str:
        return "1.0"

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        self.rendered.append((scene, settings))
        if self._error is not None:
            raise self._error
        return Image(self._picture(scene).astype(np.float32), seconds=0.01)

    def health(self) -> Health:
        return Health(self.name, usable=self._error is None, version="1.0")

    def emit(self, scene: ResolvedScene, folder: Path) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "scene.json").write_text(scene.model_dump_json(), encoding="utf-8")
        return folder / "scene.json"
