"""Mitsuba in two modes, as engines for a worker process.

`StockEngine` is what Mitsuba's users run: its `path` or `volpath` integrator. `ExactEngine` follows
both lobes of every interface through Mitsuba's scene and BSDF API, without sampling, so that its
results are deterministic. Geometry, BSDFs, textures and single precision are Mitsuba's in both;
they differ in the integrator and in how rays leave a surface: the stock one offsets them along the
normal, which displaces what is seen through glass.

Nothing here loads Mitsuba before an engine is made.
"""

from __future__ import annotations

import gc
import itertools
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harness.errors import RendererMissing, RendererUnsupported
from harness.renderers import mitsuba_variants as variants
from harness.renderers.base import (
    MAIN_WAY,
    Capability,
    Float,
    Health,
    Image,
    RayPaths,
    Rays,
    RenderSettings,
)
from harness.renderers.developing import developed, of_samples
from harness.renderers.mitsuba_load import Live, load
from harness.scene import resolved as rs
from harness.scene.resolved import ResolvedScene
from harness.translate.mitsuba import describe
from harness.translate.mitsuba_scale import length_scale, scaled
from harness.translate.mitsuba_shapes import not_in_mitsuba

STOCK_CAPABILITIES = frozenset(
    {
        Capability.IMAGE,
        Capability.SPHERE,
        Capability.CONVEX,
        Capability.CYLINDER,
        Capability.MESH,
        Capability.SMOOTH_MESH,
        Capability.MIRROR,
        Capability.DIFFUSE,
        Capability.DIRECTIONAL_LIGHT,
        Capability.TRANSLUCENT,
        Capability.PICTURE,
        Capability.ENVIRONMENT,
        Capability.ABSORPTION,
        Capability.FRESNEL,
        Capability.NESTED,
        Capability.CAMERA_INSIDE,
        Capability.RADIANCE_N2,
    }
)
EXACT_CAPABILITIES = STOCK_CAPABILITIES | {
    Capability.RAYS,
    Capability.MAIN_WAY,
    Capability.PIXEL_CENTRES,
    Capability.LOBE_SWITCH,
    Capability.LENS,
    Capability.CONIC,
    Capability.CONE,
    Capability.CSG,
    Capability.HALF_SPACE,
    Capability.PRIORITY,
    Capability.SAMPLING,
}

# An ordinary image is the mean of this many renders with seeds of their own, which tell its
# variance; more samples per pixel are more samples per render.
SEEDS = 16
# A ray towards a position code is sampled until light arrives, a few times at first and at most
# this often, or `settings.samples` if that is more.
CODE_SAMPLES = 64
CODE_SAMPLES_AT_FIRST = 4
CODE_RAYS_AT_ONCE = 1 << 20  # samples of all rays together: 150 MB
SEED_STRIDE = 1 << 16  # so that settings.seed and settings.seed + 1 share no seed

Indices = NDArray[np.uint32]


class _Engine:
    """Mitsuba with its variant set; common to both modes."""

    name: str

    def __init__(self) -> None:
        variant = os.environ.get(variants.VARIANT)
        if variant is None:
            os.environ.update(variants.child_environment())
            variant = os.environ[variants.VARIANT]
        import mitsuba as mi

        mi.set_variant(variant)
        from harness.renderers.mitsuba_code import register

        register()
        mi.set_log_level(mi.LogLevel.Warn)
        self.variant = variant
        self._mi = mi

    def version(self) -> str:
        """Version and variant, since results depend on both."""
        return f"{self._mi.__version__} ({self.variant})"

    def health(self) -> Health:
        """What was found about variants and libLLVM; the render is the caller's."""
        choice = variants.choose()
        probes = variants.usable_variants()
        facts = {
            "variant": self.variant,
            "usable variants": ", ".join(p.variant for p in probes if p.usable),
            "libLLVM": str(choice.library.path) if choice.library else "none",
        }
        path = str(Path(self._mi.__file__).parent)
        return Health(self.name, True, self.version(), path, choice.note, choice.remedy, facts)

    def _load(self, scene: ResolvedScene, settings: RenderSettings) -> Live:
        """The live scene. Of the one before nothing is left: its plugins would be compiled in."""
        import drjit as dr

        gc.collect()
        dr.set_thread_count(settings.threads)
        without = [k for k, solid in enumerate(scene.solids) if self._is_ours(solid)]
        return load(self._mi, describe(scene, settings.samples, without))

    def _is_ours(self, _solid: rs.Solid) -> bool:
        """Whether Mitsuba is not told of it."""
        return False

    def _command(self) -> str:
        return f"mitsuba -m {self.variant} scene.xml"


class StockEngine(_Engine):
    """Mitsuba as its users run it. Its `spawn_ray` and its noise are part of the result."""

    name = "mitsuba"
    capabilities = STOCK_CAPABILITIES

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        """An ordinary render with a box filter, or the codes that rays through pixel centres see.

        The variance of a render comes from independent seeds. In a scene with a position code rays
        go through pixel centres, and since every sample that arrives brings the same code, ratios
        of channels are exact; how bright they are is not, and has no variance.
        """
        start = time.perf_counter()
        live = self._load(scene, settings)
        if _has_code(scene):
            mean, variance = self._codes(live, scene, settings), None
        else:
            mean, variance = _moments(self._renders(live, settings))
        shape = (scene.film.height, scene.film.width, 3)
        return Image(
            pixels=mean.reshape(shape).astype(np.float32),
            variance=None if variance is None else variance.reshape(shape).astype(np.float32),
            seconds=time.perf_counter() - start,
            log=variants.choose().note,
            command=self._command(),
        )

    def _renders(self, live: Live, settings: RenderSettings) -> Iterator[Float]:
        """Independent renders, each (n, 3)."""
        renders = min(SEEDS, settings.samples)
        samples = -(-settings.samples // renders)
        for k in range(renders):
            image = self._mi.render(live.scene, spp=samples, seed=_seed(settings, k))
            yield np.array(image, np.float64).reshape(-1, 3)

    def _codes(self, live: Live, scene: ResolvedScene, settings: RenderSettings) -> Float:
        """What the integrator sees along the rays through the pixel centres, (n, 3)."""
        import drjit as dr

        from harness.renderers.mitsuba_sensor import centre_rays

        mi = self._mi
        if not dr.is_jit_v(mi.Float):
            raise RendererUnsupported(
                f"rays through pixel centres need {variants.FAST}: {variants.llvm_remedy()}"
            )
        # None but where the camera's medium absorbs: only then was Mitsuba told of it.
        medium = live.media.get(f"medium_{scene.camera.medium}")
        integrator, sampler = live.scene.integrator(), mi.load_dict({"type": "independent"})
        rays = centre_rays(live.scene, scene)
        seeds = itertools.count()

        def sample(chosen: Indices, times: int) -> Float:
            """The sums of `times` samples of each chosen ray."""
            lane = dr.arange(mi.UInt32, len(chosen) * times) // dr.opaque(mi.UInt32, times)
            some = dr.gather(mi.Ray3f, rays, dr.gather(mi.UInt32, mi.UInt32(chosen), lane))
            dr.eval(some)  # or else the integrator's kernel would depend on where numpy's array is
            sampler.seed(_seed(settings, next(seeds)), len(chosen) * times)
            radiance, _, _ = integrator.sample(live.scene, sampler, some, medium)
            values = np.array(radiance, np.float64).T.reshape(len(chosen), times, 3)
            sums: Float = values.sum(axis=1)
            return sums

        n = scene.film.width * scene.film.height
        width = CODE_RAYS_AT_ONCE // CODE_SAMPLES_AT_FIRST
        blocks = np.array_split(np.arange(n, dtype=np.uint32), -(-n // width))
        most = max(settings.samples, CODE_SAMPLES)
        return np.concatenate([_until_lit(sample, block, most) for block in blocks])


def _until_lit(sample: Callable[[Indices, int], Float], rays: Indices, most: int) -> Float:
    """Means over as many samples of each ray as it takes to see light, and not over `most`."""
    total, count = np.zeros((len(rays), 3)), np.zeros((len(rays), 1))
    dark = np.arange(len(rays))
    while dark.size and count[dark[0]] < most:
        done = int(count[dark[0], 0])
        room = CODE_RAYS_AT_ONCE // dark.size if done else CODE_SAMPLES_AT_FIRST
        times = min(room, most - done)
        total[dark] += sample(rays[dark], times)
        count[dark] += times
        dark = dark[~total[dark].any(axis=1)]
    return total / count


class ExactEngine(_Engine):
    """Mitsuba without sampling: the tree of both lobes, from pixel centres."""

    name = "mitsuba-exact"
    capabilities = EXACT_CAPABILITIES

    def __init__(self) -> None:
        super().__init__()
        if self.variant != variants.FAST:
            raise RendererMissing(
                f"following both lobes needs Mitsuba's {variants.FAST}, and only {self.variant} "
                f"works here: {variants.llvm_remedy()}"
            )

    def _is_ours(self, solid: rs.Solid) -> bool:
        """What Mitsuba has no shapes for, or cannot place: `mitsuba_world` finds its boundary."""
        return not_in_mitsuba(solid)

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        """Radiance at the pixel centres; the same bits in every run and for any threads."""
        from harness.renderers.mitsuba_image import render
        from harness.renderers.mitsuba_sensor import centre_rays

        if scene.film.samples > 1:
            return developed(self.render(of_samples(scene), settings), scene.film)
        start = time.perf_counter()
        live = self._load(scene, settings)
        rays = centre_rays(live.scene, scene)
        pixels = render(live.scene, scaled(scene, length_scale(scene)), rays.o, rays.d)
        return Image(
            pixels=pixels.reshape(scene.film.height, scene.film.width, 3).astype(np.float32),
            seconds=time.perf_counter() - start,
        )

    def trace(
        self, scene: ResolvedScene, rays: Rays, path: str, settings: RenderSettings
    ) -> RayPaths:
        """Follows rays along `path`, or the main way; single precision, in float64 arrays."""
        from harness.renderers.mitsuba_rays import trace
        from harness.renderers.mitsuba_ways import follow

        scale = length_scale(scene)
        live = self._load(scene, settings)
        scaled_rays = Rays(rays.origins * scale, rays.directions)
        if path == MAIN_WAY:
            paths = follow(live.scene, scaled(scene, scale), scaled_rays)
        else:
            paths = trace(live.scene, scaled(scene, scale), scaled_rays, path)
        return RayPaths(
            status=paths.status,
            surface=paths.surface,
            point=paths.point / scale,
            direction=paths.direction,
            weight=paths.weight,
            optical_length=paths.optical_length / scale,
            vertices=None if paths.vertices is None else paths.vertices / scale,
            meetings=paths.meetings,
        )


def _has_code(scene: ResolvedScene) -> bool:
    return any(
        isinstance(surface.material, rs.Emissive)
        and isinstance(surface.material.pattern, rs.PositionCode)
        for surface in scene.surfaces
    )


def _seed(settings: RenderSettings, k: int) -> int:
    return (settings.seed * SEED_STRIDE + k) % (1 << 32)


def _moments(renders: Iterator[Float]) -> tuple[Float, Float | None]:
    """The mean of independent renders, and its variance where there are two or more.

    Sums are of differences to the first one, so that equal values have variance 0.
    """
    first = next(renders)
    count, total, squares = 1, np.zeros_like(first), np.zeros_like(first)
    for render in renders:
        difference = render - first
        total += difference
        squares += np.square(difference)
        count += 1
    if count == 1:
        return first, None
    spread = np.maximum(squares - np.square(total) / count, 0.0)
    return first + total / count, spread / (count - 1) / count
