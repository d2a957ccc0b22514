"""Images: a film of samples, each seen by double recursion, developed into pixels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tracer.arrays import Arrays, Floats, flatten, media_of, media_table
from tracer.camera import SIDE, camera_row, lens_point, pixel_centre, primary_ray
from tracer.compiled import compiled
from tracer.film import Sampling, developed, reach
from tracer.hit import new_stack
from tracer.recursion import Limits, Waiting, radiance
from tracer.scene import Scene
from tracer.surface import BLACK, Lobes
from tracer.threads import for_bands
from tracer.vector import add, scale

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


class Samples(NamedTuple):
    """Samples of some rows of the film."""

    radiance: Floats  # (h, w, 3)
    cut: Floats  # (h, w)
    closest: Floats
    rays: NDArray[np.int64]  # (h,)
    disperses: NDArray[np.uint8]  # (h, w), 1 where the wavelength matters


@compiled
def _expose(
    scene: Arrays,
    limits: Limits,
    lobes: Lobes,
    camera: Floats,
    first: int,
    height: int,
    begin: int,
    end: int,
    waiting: Waiting,
    stack: Floats,
    samples: Samples,
) -> None:
    """Takes rows [begin, end) of `samples`, whose row 0 is row `first` of a film of `height`.

    Where they say that the wavelength does not matter, they are left as they are.
    """
    width, side = samples.cut.shape[1], int(camera[SIDE])
    share = 1.0 / (side * side)
    for j in range(begin, end):
        samples.rays[j] = 0
        for i in range(width):
            if samples.disperses[j, i] == 0:
                continue
            x, y = pixel_centre(i, first + j, width, height)
            seen, cut, closest, disperses = BLACK, 0.0, np.inf, False
            for k in range(side * side):
                u, v = lens_point(k, side)
                o, d = primary_ray(camera, x, y, u, v)
                one = radiance(scene, limits, lobes, o, d, waiting, stack)
                seen = add(seen, scale(share, one.radiance))
                cut += share * one.cut
                closest = min(closest, one.closest)
                samples.rays[j] += one.rays
                disperses |= one.disperses
            for c in range(3):
                samples.radiance[j, i, c] = seen[c]
            samples.cut[j, i], samples.closest[j, i] = cut, closest
            samples.disperses[j, i] = disperses


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
        np.empty(height, np.int64),
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
    camera = camera_row(scene.camera, width, height)

    def some(begin: int, end: int) -> None:
        depth = transport.max_depth + 1
        waiting = Waiting(np.empty((depth, 9)), np.empty((depth, 5), np.int64))
        stack = new_stack(arrays)
        _expose(arrays, limits, lobes, camera, first, height, begin, end, waiting, stack, samples)

    for_bands(some, rows, BAND, threads)
    return int(samples.rays.sum())
