"""How the index of refraction depends on the wavelength, and the glasses that we know by name.

Wavelengths are in nanometres, in air. Catalogues give the index of glass relative to air: with
vacuum around it, light bends at such a glass as it does in a laboratory. An image in colours of
the spectrum is one render per wavelength, each with media of the index at that wavelength.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tracer.errors import SceneError

# Fraunhofer's lines, in nm, at which glass makers state indices.
LINE_F, LINE_D, LINE_C = 486.1327, 587.5618, 656.2725


@dataclass(frozen=True)
class Sellmeier:
    """``n^2 = 1 + sum B l^2 / (l^2 - C)`` with the wavelength l in micrometres."""

    B: tuple[float, ...]
    C: tuple[float, ...]

    def ior(self, wavelength_nm: float) -> float:
        square = (wavelength_nm / 1000.0) ** 2
        if any(square == c for c in self.C):
            raise SceneError(f"{wavelength_nm} nm is where this glass absorbs: {self}")
        terms = (b * square / (square - c) for b, c in zip(self.B, self.C, strict=True))
        return _index(1.0 + sum(terms), 0.5, wavelength_nm, self)


@dataclass(frozen=True)
class Cauchy:
    """``n = A + B / l^2 + C / l^4`` with the wavelength l in micrometres."""

    A: float
    B: float
    C: float = 0.0

    def ior(self, wavelength_nm: float) -> float:
        square = (wavelength_nm / 1000.0) ** 2
        return _index(
            self.A + self.B / square + self.C / (square * square), 1.0, wavelength_nm, self
        )


def _index(base: float, power: float, wavelength_nm: float, formula: object) -> float:
    if not 0.0 < base < math.inf:
        raise SceneError(f"no index of refraction at {wavelength_nm} nm: {formula}")
    return float(base**power)


Dispersion = Sellmeier | Cauchy


def abbe_number(glass: Dispersion) -> float:
    """``V = (n_d - 1) / (n_F - n_C)``: large where the glass spreads colours little."""
    return (glass.ior(LINE_D) - 1.0) / (glass.ior(LINE_F) - glass.ior(LINE_C))


def from_abbe(ior_d: float, abbe: float) -> Cauchy:
    """The glass of two Cauchy terms with the index `ior_d` and the Abbe number `abbe`."""
    inverse_square = {line: (1000.0 / line) ** 2 for line in (LINE_F, LINE_D, LINE_C)}
    B = (ior_d - 1.0) / (abbe * (inverse_square[LINE_F] - inverse_square[LINE_C]))
    return Cauchy(ior_d - B * inverse_square[LINE_D], B)


# Schott, optical glass data sheets; I. Malitson, J. Opt. Soc. Am. 55, 1965;
# M. Daimon, A. Masumura, Appl. Opt. 46, 2007 (water at 20 C).
GLASSES = {
    "N-BK7": Sellmeier(
        (1.03961212, 0.231792344, 1.01046945), (0.00600069867, 0.0200179144, 103.560653)
    ),
    "SF11": Sellmeier(
        (1.73848403, 0.311168974, 1.17490871), (0.0136068604, 0.0615960463, 121.922711)
    ),
    "N-SF11": Sellmeier(
        (1.73759695, 0.313747346, 1.89878101), (0.013188707, 0.0623068142, 155.23629)
    ),
    "fused silica": Sellmeier(
        (0.6961663, 0.4079426, 0.8974794), (0.0684043**2, 0.1162414**2, 9.896161**2)
    ),
    "water": Sellmeier(
        (0.5684027565, 0.1726177391, 0.02086189578, 0.1130748688),
        (0.005101829712, 0.01821153936, 0.02620722293, 10.69792721),
    ),
}
