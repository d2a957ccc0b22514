"""Images: a film of samples, each seen by double recursion, developed into pixels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tracer.apart import CROWD
from tracer.arrays import Arrays, Floats, flatten, media_of, media_table
from tracer.camera import SIDE, camera_row, lens_point, pixel_centre, primary_ray
from tracer.compiled import called, compiled
from tracer.exposure import Exposure, Limits, Samples, exposure, wave_at
from tracer.film import Sampling, developed, reach
from tracer.hit import NOTHING, UNKNOWN
from tracer.inside import bounce
from tracer.recursion import go_on
from tracer.scene import Scene
from tracer.surface import Lobes
from tracer.threads import Work, for_bands
from tracer.wave import PIXEL, SIZE, STRIDE, Ray, Wave, nearest_hits, padded, put_ray

BAND = 4  # rows of samples that a thread takes at a time
CENTRES = Sampling()
STRIP = 1 << 22  # samples that are held at a time


@dataclass(frozen=True, eq=False)
class Render:
    """`pixels` (H, W, 3) radiance, row 0 at the top; `cut` (H, W), the weight not followed.

    In a world of radiance 1 without absorption, pixels + cut is 1. `closest` (H, W) is the shortest
    way between two surfaces on any ray that carries at least 1e-4, infinite where there is none:
    a ray through a corner of glass, which a renderer that cannot resolve it loses. `rays` is how
    many were followed in all.
    """

    pixels: Floats
    cut: Floats
    closest: Floats
    rays: int


class Film(NamedTuple):
    """Of `width` x `height` samples; those that are taken begin with row `first`."""

    width: int
    height: int
    first: int


@called
def _primary_rays(
    camera: Floats, film: Film, at: int, end: int, samples: Samples, wave: Wave
) -> tuple[int, int]:
    """A wave of rays from the camera; (how many, the sample and point of the lens to go on with).

    Both are counted in one, `at` and up to `end`. Samples of which is known that the wavelength
    does not matter are left as they are.
    """
    side, n, floats, ints = int(camera[SIDE]), 0, wave.floats, wave.ints
    points = side * side
    pixel, k = at // points, at % points
    i, j = pixel % film.width, film.first + pixel // film.width
    while n < SIZE and at < end:
        if k == 0 and samples.disperses[pixel] == 0:
            at, k = at + points, points
        else:
            if k == 0:
                samples.disperses[pixel], samples.cut[pixel] = 0, 0.0
                samples.closest[pixel] = np.inf
                for c in range(3):
                    samples.radiance[pixel, c] = 0.0
            floats[n], floats[STRIDE + n] = pixel_centre(i, j, film.width, film.height)
            u, v = lens_point(k, side) if points > 1 else (0.0, 0.0)
            floats[2 * STRIDE + n], floats[3 * STRIDE + n] = u, v
            ints[PIXEL + n] = pixel
            n, at, k = n + 1, at + 1, k + 1
        if k == points:
            pixel, k, i = pixel + 1, 0, i + 1
            if i == film.width:
                i, j = 0, j + 1
    for m in range(padded(n)):  # for LLVM to make several at once
        x, y, u, v = floats[m], floats[STRIDE + m], floats[2 * STRIDE + m], floats[3 * STRIDE + m]
        o, d = primary_ray(camera, x, y, u, v)
        put_ray(
            wave, m, Ray(o, d, (1.0, 1.0, 1.0), ints[PIXEL + m], 1, UNKNOWN, NOTHING, -1, False)
        )
    return n, at


@compiled
def _expose(
    scene: Arrays, exposure: Exposure, camera: Floats, film: Film, begin: int, end: int
) -> int:
    """Takes samples [begin, end), and tells how many rays that took."""
    waiting = exposure.waiting
    points = int(camera[SIDE]) * int(camera[SIDE])
    at, rays, height = begin * points, 0, 0
    while True:
        fresh = height == 0
        row = waiting.order[0 if fresh else height - 1]
        if not fresh and waiting.inside[row] != CROWD:
            height, n = bounce(scene, exposure, height - 1)
            rays += n
            continue
        wave = wave_at(waiting, row)
        if fresh:
            height = 1
            waiting.filled[row], at = _primary_rays(
                camera, film, at, end * points, exposure.samples, wave
            )
        n = waiting.filled[row]
        if n == 0:
            return rays
        rays += n
        nearest_hits(scene, wave, n, fresh, exposure.scratch)
        height = go_on(scene, exposure, height - 1)


def render(
    scene: Scene,
    width: int,
    height: int,
    threads: int | None = None,
    sampling: Sampling = CENTRES,
) -> Render:
    """The image that the scene's camera sees, by default through its pixels' centres.

    Raises SceneError for a scene that cannot be traced. The same bits for any number of threads.
    """
    return render_spectrum(scene, width, height, (scene.wavelength,), threads, sampling)[0]


def render_spectrum(
    scene: Scene,
    width: int,
    height: int,
    wavelengths: Sequence[float],
    threads: int | None = None,
    sampling: Sampling = CENTRES,
) -> list[Render]:
    """One image per wavelength, in nm, of the scene with its media as they are there.

    Geometry is prepared once, and what shows no dispersion is traced once: the more wavelengths,
    the cheaper each.
    """
    arrays, media = flatten(scene), media_of(scene)
    scenes = [arrays._replace(media=media_table(media, w)) for w in wavelengths]
    if sampling == CENTRES:
        return _of_centres(scene, scenes, width, height, threads)
    film = (height, width)
    images = [Render(np.empty((*film, 3)), np.empty(film), np.empty(film), 0) for _ in scenes]
    for begin, end in _strips(width, height, sampling):
        side, around = sampling.side, reach(sampling)
        first, last = max(0, begin * side - around), min(height * side, end * side + around)
        samples = _unexposed(last - first, width * side)
        for k, one in enumerate(scenes):
            rays = _take(scene, one, height * side, first, samples, threads)
            image, rows = images[k], slice(begin, end)
            for pixels, sampled in ((image.pixels, samples.radiance), (image.cut, samples.cut)):
                pixels[rows] = developed(sampled, sampling, first, begin, end, height)
            own = samples.closest[begin * side - first : end * side - first]
            blocks = own.reshape(end - begin, side, width, side)
            image.closest[rows] = blocks.min(axis=(1, 3))
            images[k] = replace(image, rays=image.rays + rays)
    return images


def _of_centres(
    scene: Scene, scenes: list[Arrays], width: int, height: int, threads: int | None
) -> list[Render]:
    """As `render_spectrum` where a sample is a pixel: nothing is developed."""
    samples, images = _unexposed(height, width), []
    for one in scenes:
        rays = _take(scene, one, height, 0, samples, threads)
        pixels, cut, closest = samples.radiance, samples.cut, samples.closest
        if one is not scenes[-1]:
            pixels, cut, closest = pixels.copy(), cut.copy(), closest.copy()
        images.append(Render(pixels, cut, closest, rays))
    return images


def _strips(width: int, height: int, sampling: Sampling) -> Iterator[tuple[int, int]]:
    rows = max(1, STRIP // (width * sampling.side**2))
    for begin in range(0, height, rows):
        yield begin, min(begin + rows, height)


def _unexposed(height: int, width: int) -> Samples:
    film = (height, width)
    return Samples(
        np.empty((*film, 3)),
        np.empty(film),
        np.empty(film),
        np.ones(film, np.uint8),
    )


def _take(
    scene: Scene, arrays: Arrays, height: int, first: int, samples: Samples, threads: int | None
) -> int:
    """Exposes `samples` whose row 0 is row `first` of a film of `height`; how many rays it took."""
    transport = scene.transport
    limits = Limits(transport.max_depth, transport.min_weight)
    lobes = Lobes(transport.reflection, transport.transmission, transport.radiance_n2)
    rows, width = samples.cut.shape
    camera, film = camera_row(scene.camera, width, height), Film(width, height, first)
    share = 1.0 / camera[SIDE] ** 2
    flat = Samples(
        samples.radiance.reshape(-1, 3),
        samples.cut.reshape(-1),
        samples.closest.reshape(-1),
        samples.disperses.reshape(-1),
    )
    rays: list[int] = []

    def worker() -> Work:
        own = exposure(arrays, limits, lobes, share, flat)

        def some(begin: int, end: int) -> None:
            rays.append(_expose(arrays, own, camera, film, begin * width, end * width))

        return some

    for_bands(worker, rows, BAND, threads)
    return sum(rays)
