"""What has to be rendered for a case: pure jobs, from which the judge takes its measurements.

A job is everything that determines a result and nothing else; its role is the name under which the
judge finds the result again.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from harness.measure.furnace import is_furnace
from harness.measure.observables import IMAGE_OBSERVABLES, Observable
from harness.measure.statistics import samples_needed
from harness.preflight import Preflight
from harness.probe.scenes import AXES, all_light_scene, code_scene, light_scene, ramp_scene
from harness.renderers import registry
from harness.renderers.base import MAIN_WAY, Capability, RenderSettings
from harness.scene import model
from harness.scene.findings import SceneInvalid, input_error
from harness.scene.load import LoadedCase
from harness.scene.resolve import expand_thin_slabs, probe_planes, resolve, spectral_media
from harness.scene.resolved import (
    Constant,
    Emissive,
    Film,
    Medium,
    Rectangle,
    ResolvedScene,
    Surface,
)
from harness.scene.variants import varied
from harness.translate.mitsuba_scale import scaled

IMAGE = "image"
SECOND_IMAGE = "image, second seed"
BASE_IMAGE = "unshifted"
AREA_IMAGE = "area"
WAYS = "image, main ways"
# Rays of a picture that can be looked at, per side of the film.
MOST_WAYS = 48
SHIFTED = ("shifted left", "shifted right", "shifted up", "shifted down")
# Samples per pixel of the picture of a path's light, by `samples_needed`.
LIGHT_SAMPLES = samples_needed()
# Where media absorb, a sample stands for the colour that it was drawn for: its value is up to 3 and
# its variance 3 p - p^2, below 1 for all that coloured glass lets through.
ABSORBED_SAMPLES = samples_needed(variance=1.0)
# Samples per pixel side of the image that is averaged over pixel areas.
AREA_FACTOR = 4


@dataclass(frozen=True)
class Job:
    """One render of `scene`, or with `path` one trace of its camera's rays along that path.

    Of rays that take the `MAIN_WAY` there are those of `way_pixels`.
    """

    renderer: str
    role: str
    scene: ResolvedScene
    settings: RenderSettings
    path: str | None = None


def asks(check: model.CheckSpec, renderer: str) -> bool:
    """Whether a check is about `renderer`."""
    if renderer in registry.ONLY_WHERE_NAMED:
        return renderer in check.renderers
    return not check.renderers or renderer in check.renderers


@dataclass(frozen=True)
class Form:
    """A case as its file has it, name "", or one of its variants; lengths are `scale` as large.

    `planes` are the rectangles on which each probe's rays are caught.
    """

    name: str
    scene: ResolvedScene
    planes: Mapping[str, tuple[Rectangle, ...]]
    scale: float = 1.0


@dataclass(frozen=True)
class PreparedCase:
    """A case with its resolved scene, and those of its variants.

    Where it has a spectrum, `passes` are the wavelengths, in nm, of the monochromatic pictures that
    make up each of its pictures, and the media at each.
    """

    loaded: LoadedCase
    scene: ResolvedScene
    variants: tuple[Form, ...] = ()
    passes: tuple[tuple[float, tuple[Medium, ...]], ...] = ()

    @property
    def wavelengths(self) -> tuple[float, ...]:
        """Of its spectrum, in nm; empty where it has none."""
        return tuple(wavelength for wavelength, _ in self.passes)

    @cached_property
    def forms(self) -> tuple[Form, ...]:
        """The case itself and its variants."""
        probes = self.loaded.model.probes
        return (Form("", self.scene, {p.name: probe_planes(p) for p in probes}), *self.variants)

    def wants_image(self, renderer: str) -> bool:
        """Whether any check looks at a picture by `renderer`."""
        checks = self.loaded.model.checks
        return any((Observable(c.observable) in IMAGE_OBSERVABLES and asks(c, renderer))
                   or c.against == renderer for c in checks)  # fmt: skip

    def asked_probes(self, renderer: str) -> list[model.Probe]:
        """The probes that checks of `renderer` need."""
        used = {c.probe for c in self.loaded.model.checks if asks(c, renderer)}
        return [probe for probe in self.loaded.model.probes if probe.name in used]

    def wants_ways(self, renderer: str) -> bool:
        """Whether a picture by `renderer` is shown whose rays no probe follows."""
        probes = self.asked_probes(renderer)
        lit = bool(probes) and all(probe.measure != "position" for probe in probes)
        return self.wants_image(renderer) or lit

    @property
    def wants_radiance(self) -> bool:
        """Whether a check holds a picture with noise against the truth; a furnace has none."""
        checks = self.loaded.model.checks
        radiance = any(c.observable == Observable.RADIANCE for c in checks)
        return radiance and not is_furnace(self.scene)

    @property
    def compares_images(self) -> bool:
        """Whether any check compares the pictures of two renderers."""
        return any(c.against != "truth" for c in self.loaded.model.checks)

    def compares_rays(self, probe: model.Probe) -> bool:
        """Whether rays of a ray API are to be compared with coded images."""
        return any(
            c.observable == Observable.RAY_AGREEMENT and c.probe == probe.name
            for c in self.loaded.model.checks
        )

    def probe(self, name: str | None) -> model.Probe:
        """The probe of that name, or the first one."""
        probes = self.loaded.model.probes
        return next((p for p in probes if p.name == name), probes[0])

    def planes(self, probe: model.Probe) -> tuple[Rectangle, ...]:
        """The rectangles on which the probe's rays are caught."""
        return self.forms[0].planes[probe.name]


def prepare(loaded: LoadedCase) -> PreparedCase:
    """Resolves the scene and its variants. Raises InputError where one cannot be."""
    variants = (_form(loaded, variant) for variant in loaded.model.variants)
    return PreparedCase(loaded, resolve(loaded), tuple(variants), spectral_media(loaded))


def _form(loaded: LoadedCase, variant: model.Variant) -> Form:
    try:
        other = replace(loaded, model=varied(loaded.model, variant))
    except SceneInvalid as error:
        raise input_error(error.findings, loaded.file) from None
    scene, probes = resolve(other), other.model.probes
    planes = {p.name: probe_planes(p) for p in probes}
    if variant.scale == 1.0:
        return Form(variant.name, scene, planes)
    shown = {name: _grown(scene, rectangles, variant.scale) for name, rectangles in planes.items()}
    return Form(variant.name, scaled(scene, variant.scale), shown, variant.scale)


def _grown(
    scene: ResolvedScene, planes: tuple[Rectangle, ...], scale: float
) -> tuple[Rectangle, ...]:
    """Planes grow as a scene's surfaces do."""
    dark = Emissive(pattern=Constant(radiance=(0.0, 0.0, 0.0)))
    faces = tuple(Surface(name="plane", shape=plane, material=dark) for plane in planes)
    grown = scaled(scene.model_copy(update={"solids": (), "surfaces": faces}), scale)
    return tuple(s.shape for s in grown.surfaces if isinstance(s.shape, Rectangle))


def scene_for(scene: ResolvedScene, capabilities: Collection[Capability]) -> ResolvedScene:
    """`scene` as a renderer can take it: without thin faces, a real slab stands in their place."""
    return scene if Capability.THIN_SLAB in capabilities else expand_thin_slabs(scene)


def jobs_of(
    case: PreparedCase,
    renderer: str,
    capabilities: Collection[Capability],
    preflight: Preflight,
    settings: RenderSettings,
) -> list[Job]:
    """All jobs that `renderer` must do for `case`."""
    scene = scene_for(case.scene, capabilities)
    jobs = []
    if case.wants_image(renderer):
        asked = for_light(scene, settings, preflight) if case.wants_radiance else settings
        jobs += _picture(case, Job(renderer, IMAGE, scene, asked))
        if preflight.noisy:
            other = replace(asked, seed=settings.seed + 1)
            jobs += _picture(case, Job(renderer, SECOND_IMAGE, scene, other))
    for form in case.forms:
        shown = scene_for(form.scene, capabilities)
        for probe in case.asked_probes(renderer):
            made = _probe_scenes(
                shown, probe, form, capabilities, preflight, case.compares_rays(probe)
            )
            asked = (
                settings if probe.measure == "position" else for_light(shown, settings, preflight)
            )
            jobs += [
                Job(renderer, role, made_scene, asked, path) for role, made_scene, path in made
            ]
    if case.wants_ways(renderer) and Capability.MAIN_WAY in capabilities:
        jobs.append(Job(renderer, WAYS, scene_of_ways(case, capabilities), settings, MAIN_WAY))
    return jobs


def scene_of_ways(case: PreparedCase, capabilities: Collection[Capability]) -> ResolvedScene:
    """In which the rays of a picture are followed: with a spectrum, in the middle of it."""
    scene = scene_for(case.scene, capabilities)
    middle = _middle(case)
    return scene if middle is None else scene.model_copy(update={"media": middle[1]})


def wavelength_of_ways(case: PreparedCase) -> float | None:
    """That of `scene_of_ways`, in nm; None where there is no spectrum."""
    middle = _middle(case)
    return None if middle is None else middle[0]


def _middle(case: PreparedCase) -> tuple[float, tuple[Medium, ...]] | None:
    return case.passes[len(case.passes) // 2] if case.passes else None


def way_step(film: Film) -> int:
    """Every so many pixels, in both directions, has its ray followed."""
    return -(-max(film.width, film.height) // MOST_WAYS)


def way_pixels(film: Film) -> NDArray[np.int64]:
    """The pixels whose rays are followed, row by row: numbers of row * width + column."""
    step = way_step(film)
    pixels = np.arange(film.height * film.width).reshape(film.height, film.width)
    return np.asarray(pixels[::step, ::step].reshape(-1), np.int64)


def light_samples(scene: ResolvedScene, samples: int) -> int:
    """So many samples show that the light of `scene` is right; `samples` at least."""
    absorbs = any(max(medium.absorption) > 0 for medium in scene.media)
    return max(samples, ABSORBED_SAMPLES if absorbs else LIGHT_SAMPLES)


def for_light(
    scene: ResolvedScene, settings: RenderSettings, preflight: Preflight
) -> RenderSettings:
    """The settings of a picture that is held against the truth."""
    if not preflight.noisy:
        return settings
    return replace(settings, samples=light_samples(scene, settings.samples))


def _picture(case: PreparedCase, job: Job) -> list[Job]:
    """The jobs that make up a picture: one, or one per wavelength."""
    if not case.passes:
        return [job]
    return [
        replace(
            job,
            role=pass_role(job.role, wavelength),
            scene=job.scene.model_copy(update={"media": media}),
        )
        for wavelength, media in case.passes
    ]


def _probe_scenes(
    scene: ResolvedScene,
    probe: model.Probe,
    form: Form,
    capabilities: Collection[Capability],
    preflight: Preflight,
    both_ways: bool,
) -> Iterator[tuple[str, ResolvedScene, str | None]]:
    """Role, scene and, for a trace, path of everything that measures `probe` in one form."""
    planes = form.planes[probe.name]
    if probe.measure == "all-light":
        yield light_role(probe, form.name), all_light_scene(scene, planes[0]), None
        return
    if probe.measure == "light":
        yield light_role(probe, form.name), light_scene(scene, planes[0], probe.path), None
        return
    if Capability.RAYS in capabilities:
        coded = code_scene(scene, planes[0], AXES[0], 1, probe.path)
        yield trace_role(probe, form.name), coded, probe.path
        if not both_ways or form.name:
            return
    cells = min(preflight.cells, probe.cells)
    for index, plane in enumerate(planes):
        for axis in AXES:
            coded = code_scene(scene, plane, axis, cells, probe.path, probe.total_reflection)
            yield code_role(probe, index, axis, form.name), coded, None


def shown_to(
    case: PreparedCase, probe_name: str | None, capabilities: Collection[Capability]
) -> ResolvedScene:
    """The scene that shows what a probe measures, to look at; without a probe the case's own."""
    scene = scene_for(case.scene, capabilities)
    if probe_name is None:
        return scene
    probe = case.probe(probe_name)
    plane = case.planes(probe)[0]
    if probe.measure == "all-light":
        return all_light_scene(scene, plane)
    if probe.measure == "light":
        return light_scene(scene, plane, probe.path)
    return ramp_scene(scene, plane, probe.path, probe.total_reflection)


def auxiliary_jobs(
    case: PreparedCase, helper: str, shift: float, area: bool, settings: RenderSettings
) -> list[Job]:
    """Renders that say how sensitive a picture is: shifted by `shift` units, and area-averaged.

    They are made by `helper`, a renderer without noise that is always there.
    """
    if not case.compares_images:
        return []
    jobs = [Job(helper, BASE_IMAGE, case.scene, settings)]
    jobs += [
        Job(helper, role, shifted(case.scene, dx * shift, dy * shift), settings)
        for role, (dx, dy) in zip(SHIFTED, ((-1, 0), (1, 0), (0, 1), (0, -1)), strict=True)
    ]
    if area:
        film = case.scene.film
        fine = Film(width=film.width * AREA_FACTOR, height=film.height * AREA_FACTOR)
        jobs.append(Job(helper, AREA_IMAGE, case.scene.model_copy(update={"film": fine}), settings))
    return [part for job in jobs for part in _picture(case, job)]


def shifted(scene: ResolvedScene, dx: float, dy: float) -> ResolvedScene:
    """The scene with its camera moved sideways by (dx, dy) units along its right and up."""
    camera = scene.camera
    axes = zip(camera.origin, camera.right, camera.up, strict=True)
    origin = tuple(o + dx * r + dy * u for o, r, u in axes)
    return scene.model_copy(update={"camera": camera.model_copy(update={"origin": origin})})


def pass_role(role: str, wavelength: float) -> str:
    """The role of the monochromatic part of a picture."""
    return f"{role} at {wavelength:.10g} nm"


def light_role(probe: model.Probe, form: str = "") -> str:
    return f"{probe_label(probe.name, form)}: light"


def trace_role(probe: model.Probe, form: str = "") -> str:
    return f"{probe_label(probe.name, form)}: rays"


def code_role(probe: model.Probe, plane: int, axis: str, form: str = "") -> str:
    return f"{probe_label(probe.name, form)}: plane {plane} {axis}"


def probe_label(probe: str, form: str) -> str:
    """A probe in one form of its case, for people and for ids: ``through~mesh``."""
    return f"{probe}~{form}" if form else probe
