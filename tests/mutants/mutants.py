"""The wrong renderers: which fault, how large, where it is from, and what a diagnosis should say.

`P` numbers are classes of bugs that real renderers had. `causes` are the ids of the hypotheses that
name the fault: more than one where they are the same fault at that size. None stands for "none of
the known causes fits", and "preflight" for what calibration says before anything is judged.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from harness.renderers import registry
from harness.renderers.base import Renderer

PROGRAM = Path(__file__).parent / "renderer.py"
INDEX = ("index", "index-fixed", "index-pulled", "ratio-power")


@dataclass(frozen=True)
class Mutant:
    """`fault` of renderer.py by `amount`; `source` is the thread of a bug that somebody had."""

    fault: str
    amount: float
    causes: tuple[str | None, ...]
    source: str = ""

    @property
    def name(self) -> str:
        return f"{self.fault}={self.amount:g}"

    def __str__(self) -> str:
        return self.name


def outside_renderer(
    mutant: Mutant, folder: Path, *, shows: str = "float", float32: bool = False
) -> Renderer:
    """The mutant as users bring a renderer: by a TOML file, in a process of its own."""
    single = " --float32" if float32 else ""
    command = (
        f'"{sys.executable}" "{PROGRAM}" --fault {mutant.fault} --amount {mutant.amount!r} '
        f"--shows {shows}{single}"
    )
    file = folder / f"{mutant.fault}.toml"
    file.write_text(
        f'[renderer]\nname = "mutant"\ncommand = {command!r}\nformat = "npy"\npersistent = true\n',
        encoding="utf-8",
    )
    return registry.configured_renderer(file)


CLEAN = Mutant("none", 0.0, ())

MUTANTS = (
    # --- where rays go
    Mutant("ratio-inverted", 1.0, ("ratio-inverted",), "P1 pyRT#28"),
    Mutant("ratio-inverted", 0.3, ("ratio-power",), "P1 pyRT#28"),
    Mutant("ratio-inverted", 0.001, ("ratio-power", *INDEX), "P1 pyRT#28"),
    Mutant("not-squared", 1.0, ("unsquared",), "P2 OpticsWorkbench#19"),
    Mutant("not-squared", 0.1, ("unsquared",), "P2 OpticsWorkbench#19"),
    Mutant("side-ignored", 1.0, ("no-flip-on-exit",), "P3 optiland#882, VTS#136"),
    Mutant("ratio-not-swapped", 1.0, ("no-swap-on-exit",), "P3 optiland#882"),
    Mutant("not-unit", 0.05, ("directions-not-unit",), "P4 raytracing.github.io#1082"),
    Mutant("not-unit", 0.0001, ("directions-not-unit",), "P4 raytracing.github.io#1082"),
    Mutant("index-hardcoded", 1.0, ("index-fixed", "index-pulled"), "P5 playcanvas#8434"),
    Mutant("index-hardcoded", 0.1, ("index-pulled",), "P5 playcanvas#8434"),
    Mutant("index-off", -0.01, ("index",)),
    Mutant("index-off", 1e-4, ("index",)),
    Mutant("index-off", 1e-6, ("index",)),
    Mutant("ambient-air", 1.0, ("ambient-air",), "P6 VulkanPBRT#31, eic/epic#430"),
    Mutant("ambient-air", 0.01, ("ambient-air",), "P6 VulkanPBRT#31, eic/epic#430"),
    # Those that keep total reflection as it is are told so by their diagnosis.
    Mutant("linear", 1.0, ("linear", "linear-but-total")),
    Mutant("printed-table", 1.0, ("table", "table-but-total"), "the lecture's printed table"),
    Mutant("degrees", 1.0, ("degrees",)),
    Mutant("tangents", 1.0, ("unsquared",)),
    Mutant("w-is-direction", 1.0, ("tangent-reversed",), "an erratum of the lecture"),
    Mutant("straight", 1.0, ("straight-on", "straight-on-but-total")),
    Mutant("straight-in", 1.0, ("entry-straight",)),
    Mutant("gap-swallowed", 0.02, ("near-surfaces-lost",), "P18 Baikal#142, mitsuba3#1871"),
    Mutant("normal-nudge", 1e-3, ("spawn-normal", "spawn-normal-relative"), "P19 mitsuba3#219"),
    Mutant("normal-nudge", 1e-5, ("spawn-normal", "spawn-normal-relative"), "P19 mitsuba3#219"),
    Mutant("normal-nudge-relative", 1e-4, ("spawn-normal-relative", "spawn-normal-scaled"),
           "P19 mitsuba3#219"),
    Mutant("never-leaves", 1.0, ("exit-straight",), "P20 THREE.js-PathTracing-Renderer#27"),
    Mutant("tir-leaks", 1.0, ("tir-leaks",)),
    # Rays that graze the surface land nowhere: what is seen is that their light is missing.
    Mutant("tir-clamped", 1.0, ("tir-clamped", "tir-dark")),
    Mutant("normals-by-matrix", 0.5, ("normals-stretched-y",), "P23 OloEngineBase#1326"),
    Mutant("normals-by-matrix", 0.001, ("normals-stretched-y",), "P23 ANARI-SDK#8"),
    Mutant("mesh-inside-out", 1.0, ("mesh-inside-out",)),
    Mutant("mesh-mirrored", 0, ("mesh-mirrored-x",)),
    Mutant("mesh-leaks", 0.02, ("mesh-leaks",), "P24 tinybvh#168, PyTissueOptics#81"),
    Mutant("thin-offset", 0.0, ("offset",)),
    Mutant("thin-offset", 2.0, ("offset",)),
    Mutant("thin-offset", 1.001, ("offset",)),
    # --- how much light they bring
    Mutant("tir-black", 1.0, ("tir-dark",), "P7 yocto-gl#452, pbrt-v3#254"),
    Mutant("tir-black", 0.01, ("tir-dark",), "P7 yocto-gl#452, pbrt-v3#254"),
    Mutant("fresnel-hardcoded", 1.0, ("fresnel-fixed",), "P8 three-gpu-pathtracer#394"),
    Mutant("fresnel-index-off", 0.01, ("fresnel-index",)),
    Mutant("exit-clear", 1.0, ("exit-clear",)),
    Mutant("entry-clear", 1.0, ("entry-clear",)),
    Mutant("nan-at-normal", 1e-12, ("nan-at-normal",), "P9 raytracing.github.io#559"),
    Mutant("schlick-right", 1.0, ("schlick",)),
    Mutant("schlick-wrong-cosine", 1.0, ("schlick-inside",), "P10 raytracing.github.io#140"),
    Mutant("rs-denominator", 1.0, ("rs-denominator",), "P11 prysm#88"),
    Mutant("rs-denominator", 0.01, ("rs-denominator",), "P11 prysm#88"),
    Mutant("fresnel-swapped", 1.0, ("fresnel-swapped",), "P12 Hikari.jl#5, PyTissueOptics#9"),
    Mutant("transmission-power", 1.0, ("transmission-power",), "P13 three.js#22331"),
    Mutant("transmission-power", -1.0, ("transmission-power",), "conserve_energy is missing"),
    Mutant("transmission-power", 0.01, ("transmission-power",), "P13 three.js#22331"),
    Mutant("n2-scaling", 1.0, ("radiance-n2",), "P14 caramel#36"),
    Mutant("n2-scaling", 0.01, ("radiance-n2",), "P14 caramel#36"),
    Mutant("n2-missing", 1.0, ("radiance-n2",), "P14 caramel#36"),
    Mutant("selection-probability", 1.0, ("lobe-power",), "P15 GLSL-PathTracer#24"),
    Mutant("selection-probability", 0.01, ("lobe-power",), "P15 GLSL-PathTracer#24"),
    Mutant("depth-capped", 3, ("recursion-depth",), "P16 RadeonRays_SDK#47, YafaRay/Core#51"),
    Mutant("equal-indices-black", 1e-3, ("equal-indices-dark",), "P17 Unity SRP#3518"),
    Mutant("one-polarisation", 1.0, ("polarisation",)),
    Mutant("one-polarisation", 0.0, ("polarisation",)),
    Mutant("one-polarisation", 0.51, ("polarisation",)),
    Mutant("inner-exit-clear", 1.0, ("inner-exit-clear",), "POV-Ray's ComputeRelativeIOR"),
    Mutant("reflects-constantly", 0.04, ("constant-reflectance",)),
    Mutant("absorption-complement", 1.0, ("absorption-complement",), "P21 bevy#24516"),
    Mutant("absorption-complement", 0.01, ("absorption-complement",), "P21 bevy#24516"),
    Mutant("absorption-depth", 1.0, ("absorption-depth",), "P22 bevy-aqua#12"),
    Mutant("absorption-depth", 0.01, ("absorption-depth",), "P22 bevy-aqua#12"),
    Mutant("absorption-view-depth", 1.0, ("absorption-view-depth",), "P22 bevy-aqua#12"),
    Mutant("absorption-scaled", 0.0, ("absorption",)),
    Mutant("absorption-scaled", 2.302585, ("absorption",), "decadic for Napierian"),
    Mutant("absorption-scaled", 1.001, ("absorption",)),
    Mutant("absorption-legs", 1.0, ("absorption-reflected-legs",), "POV-Ray's fade_power"),
    Mutant("start-ahead", 1e-4, ("spawn-ahead",)),
    # --- where the camera looks, and what the file holds
    Mutant("pixel-shift", 0.5, ("pixel-shift",), "P25 raysect#391, VisRTX#327"),
    Mutant("pixel-shift", 0.005, ("pixel-shift",), "P25 raysect#391, VisRTX#327"),
    Mutant("last-pixel", 1.0, ("last-pixel", "pixel-shift", "field-of-view", "preflight"),
           "P26 raytracing.github.io#923"),
    Mutant("fov-of-portrait", 1.0, ("fov-axis",), "P27 tungsten#23"),
    Mutant("fov-of-portrait", 0.01, ("fov-axis",), "P27 tungsten#23"),
    Mutant("fov-of-height", 1.0, ("fov-axis",)),
    Mutant("mirrored", 1.0, ("mirrored-x",)),
    Mutant("upside-down", 1.0, ("mirrored-y",)),
    Mutant("rotated", 1.0, ("rotated-180",)),
    Mutant("gamma", 2.2, ("gamma",)),
    Mutant("brighter", 1.1, ("gain",)),
)  # fmt: skip

# Wrong in ways that no hypothesis knows: found, and said to be none of them.
UNLISTED = (
    Mutant("twisted", 0.05, (None,)),
    Mutant("coarse-normals", 0.01, (None,)),
    Mutant("index-by-angle", 0.1, (None,)),
    Mutant("fresnel-squared", 1.0, (None,)),
    Mutant("absorption-saturates", 1.0, (None,)),
    Mutant("stale-normal", 1.0, (None,)),
    Mutant("fresnel-swapped-out", 1.0, (None,)),
    Mutant("popped-twice", 1.0, (None,)),
    Mutant("pole-normals", 1e-3, (None,)),
    Mutant("grid-positions", 1e-3, (None,)),
    Mutant("channels-swapped", 1.0, (None,)),
    Mutant("tir-early", 0.1, (None,)),
    Mutant("rows-flicker", 0.01, ("preflight",)),
    Mutant("far-root", 0.5, (None,)),
    Mutant("table-lookup", 64, (None,)),
    Mutant("index-rounded", 0.01, (None,)),
    Mutant("index-drifts", 1e-6, (None,)),
    Mutant("clip-far", 8, (None,)),
    Mutant("fresnel-mean", 1.0, (None,)),
    Mutant("half-schlick", 0.5, (None,)),
    Mutant("cosine-clamped", 0.1, (None,)),
    Mutant("weak-dropped", 0.05, (None,)),
    Mutant("reflected-medium-lost", 1.0, (None,)),
    Mutant("old-image", 1.0, ("preflight",)),
    Mutant("tile-seams", 1.0, ("preflight",)),
    Mutant("blocks-lost", 1.0, (None,)),
)

# Right, though they look wrong: nobody may accuse them.
CONTROLS = (
    Mutant("control-relative-r0", 1.0, ()),
    Mutant("control-sign-of-rp", 1.0, ()),
    Mutant("control-n2-elsewhere", 1.0, ()),
    Mutant("control-snells-window", 1.0, ()),
)
