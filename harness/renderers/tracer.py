"""Our own tracer as a renderer. A worker process hosts `TracerEngine`."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tracer
from harness.errors import RendererFailed
from harness.record import write_text
from harness.renderers.base import (
    MAIN_WAY,
    Capability,
    Health,
    Image,
    RayPaths,
    Rays,
    RenderSettings,
)
from harness.scene import resolved
from harness.scene.resolved import ResolvedScene

# All but RADIANCE_N2: radiance is not scaled with the square of the index, as in POV-Ray.
CAPABILITIES = frozenset(Capability) - {Capability.RADIANCE_N2, Capability.DISPERSION}


FAR = 1e30  # instead of infinity, which no image file should hold


class TracerEngine:
    """Deterministic: the same bits for any number of threads."""

    name = "tracer"
    capabilities = CAPABILITIES

    def version(self) -> str:
        return tracer.__version__

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        """Raises RendererFailed for a scene that the tracer refuses."""
        from harness.translate.tracer import sampling, translate

        start = time.perf_counter()
        film = scene.film
        try:
            image = tracer.render(
                translate(scene), film.width, film.height, settings.threads, sampling(film)
            )
        except tracer.SceneError as error:
            raise RendererFailed(f"the tracer refuses the scene: {error}") from error
        return Image(
            pixels=image.pixels.astype(np.float32),
            closest=np.minimum(image.closest, FAR).astype(np.float32),
            seconds=time.perf_counter() - start,
            cut=float(image.cut.mean()),
        )

    def trace(
        self, scene: ResolvedScene, rays: Rays, path: str, settings: RenderSettings
    ) -> RayPaths:
        """Follows rays along `path`, or the main way; of that the vertices are kept."""
        from harness.translate.tracer import translate

        main = path == MAIN_WAY
        try:
            found = tracer.follow(
                translate(scene),
                rays.origins,
                rays.directions,
                None if main else path,
                vertices=main,
                threads=settings.threads,
            )
        except tracer.SceneError as error:
            raise RendererFailed(f"the tracer refuses the rays: {error}") from error
        return RayPaths(
            status=found.status,
            surface=found.surface,
            point=found.point,
            direction=found.direction,
            weight=found.weight,
            optical_length=found.optical_length,
            **(_log(found) if main else {}),
        )

    def emit(self, scene: ResolvedScene, folder: Path) -> Path:
        """The tracer is called in its own process; what it is given is the scene itself."""
        file = folder / "scene.json"
        write_text(file, scene.model_dump_json(indent=1) + "\n")
        return file

    def health(self) -> Health:
        """Renders a grey background; the first time this compiles the kernels."""
        try:
            pixels = self.render(_grey_world(), RenderSettings()).pixels
        except Exception as error:  # whatever it is, the doctor shall hear of it
            return Health(self.name, usable=False, version=self.version(), detail=str(error))
        usable = bool((pixels == np.float32(0.5)).all())
        detail = "" if usable else f"a grey world of 0.5 was rendered as {pixels.mean():.6g}"
        return Health(self.name, usable, self.version(), str(Path(tracer.__file__).parent), detail)


def _log(found: tracer.Paths) -> dict[str, NDArray[np.float64]]:
    """What happened on the ways, no longer than the longest of them."""
    used = int(np.isfinite(found.vertices[..., 0]).sum(axis=1).max(initial=1))
    meetings = np.full((len(found.vertices), used, 3), np.nan)
    told = np.stack([found.cos_theta_i, found.cos_theta_t, found.reflectance], axis=-1)
    meetings[:, 1:] = told[:, : used - 1]
    return {"vertices": found.vertices[:, :used], "meetings": meetings}


def _grey_world() -> ResolvedScene:
    return ResolvedScene(
        film=resolved.Film(width=4, height=4),
        camera=resolved.Perspective(
            origin=(0, 0, 0), right=(1, 0, 0), up=(0, 1, 0), forward=(0, 0, -1), tan_half_fov_x=1
        ),
        media=(resolved.Medium(name="vacuum", ior=1.0),),
        background=(0.5, 0.5, 0.5),
        transport=resolved.Transport(max_depth=1, min_weight=0.0),
    )
