"""A scene as POV-Ray's users write it: with its defaults, at its own scale, coloured by `fade_*`.

The geometry is that of `harness.translate.povray`. What differs is what a tutorial would say, and
each of it has a price that the catalogue measures:

* `max_trace_level` and `adc_bailout` keep their defaults, 5 and 1/255, where a scene allows more:
  light that takes longer ways is lost.
* Lengths are not scaled: hits nearer than 1e-4 units are dropped.
* Absorption is `fade_power 1001`: T = exp(-(1 - c) L / d), exact on straight ways. A way that ends
  in a reflection by the finish, total reflection included, is not attenuated at all.
* Solids that share a face are written as they are: of the two hits there one is dropped.
* Glass that is to disperse has `dispersion`: the Fresnel factors stay those of one index, and what
  is totally reflected at some wavelengths only is lost.
"""

from __future__ import annotations

from collections.abc import Sequence

from harness.scene import resolved as rs
from harness.translate.povray import PovScene, Writer
from harness.translate.povray_fit import exposure
from harness.translate.povray_shapes import number, rgb

TRACE_LEVEL = 5
ADC_BAILOUT = 1 / 255
# `dispersion` is the index in violet over that in red, so many nm apart, with a power law between:
# n(wavelength) = n dispersion^((555 - wavelength) / SPAN), as measured with POV-Ray 3.7.
SPAN = 350
LINE_F, LINE_C = 486.1327, 656.2725  # nm


def translate(scene: rs.ResolvedScene) -> PovScene:
    """Raises RendererUnsupported where POV-Ray has no counterpart."""
    bright = exposure(scene)
    writer = StockWriter(scene, bright)
    header = (
        "// povray scene.ini\n"
        f"// as users write it; radiance is the image divided by {number(bright)}\n"
    )
    return PovScene(header + "\n".join(writer.blocks()) + "\n", writer.attachments, bright, 1.0)


class StockWriter(Writer):
    """Writes a scene with POV-Ray's defaults."""

    def trace_limits(self) -> tuple[int, float]:
        """A scene that asks for less depth, as probes do, gets it."""
        depth, bailout = super().trace_limits()
        return min(depth, TRACE_LEVEL), max(bailout, ADC_BAILOUT)

    def solid(self, k: int) -> str:
        """As it is, whatever it meets."""
        return self.alone(k)

    def interior(self, inside: int, outside: int) -> str:
        """With what spreads the lines F and C as far as the medium's Abbe number says.

        To first order in the spread, of which a heavy flint's square is 3e-4.
        """
        medium, said = self.scene.media[inside], super().interior(inside, outside)
        if medium.abbe is None:
            return said
        spread = 1 + (medium.ior - 1) / (medium.ior * medium.abbe)
        return f"{said} dispersion {number(spread ** (SPAN / (LINE_C - LINE_F)))}"

    def absorption(self, per_unit: Sequence[float]) -> str:
        """In the unit of length that makes the strongest channel's fading colour black."""
        strongest = max(per_unit)
        color = rgb([1 - sigma / strongest for sigma in per_unit])
        return f"fade_power 1001 fade_distance {number(1 / strongest)} fade_color {color}"
