"""A renderer that survives many short runs: started once, calibrated once.

A run ends its renderers and calibrates them anew. Where each case is a run of its own, that would
be most of the time.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from harness.renderers.base import (
    Capability,
    Health,
    Image,
    RayPaths,
    Rays,
    RayTracingRenderer,
    Renderer,
    RenderSettings,
)
from harness.scene.resolved import ResolvedScene


class Reused:
    """Passes everything on, but does not close, and remembers what it showed of bare charts."""

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        self._charts: dict[tuple[str, RenderSettings], Image] = {}
        self.name = renderer.name
        self.concurrency: int = getattr(renderer, "concurrency", 1)

    @property
    def capabilities(self) -> frozenset[Capability]:
        """Asked each time: some renderers learn theirs when they start."""
        return self._renderer.capabilities

    def version(self) -> str:
        """As the renderer's."""
        return self._renderer.version()

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        """As the renderer's; scenes without solids are calibration, and always the same."""
        if scene.solids:
            return self._renderer.render(scene, settings)
        key = (scene.model_dump_json(), settings)
        if key not in self._charts:
            self._charts[key] = self._renderer.render(scene, settings)
        return self._charts[key]

    def health(self) -> Health:
        """As the renderer's."""
        return self._renderer.health()

    def emit(self, scene: ResolvedScene, folder: Path) -> Path:
        """As the renderer's."""
        return self._renderer.emit(scene, folder)

    def close_for_good(self) -> None:
        """Ends the renderer's process."""
        close: Callable[[], None] = getattr(self._renderer, "close", lambda: None)
        close()


class ReusedTracing(Reused):
    """The same for a renderer with a ray API."""

    def __init__(self, renderer: RayTracingRenderer) -> None:
        super().__init__(renderer)
        self._tracing = renderer

    def trace(
        self, scene: ResolvedScene, rays: Rays, path: str, settings: RenderSettings
    ) -> RayPaths:
        """As the renderer's."""
        return self._tracing.trace(scene, rays, path, settings)


def reused(renderer: Renderer) -> Reused:
    """`renderer`, to be used in many runs and then closed for good."""
    if isinstance(renderer, RayTracingRenderer):
        return ReusedTracing(renderer)
    return Reused(renderer)
