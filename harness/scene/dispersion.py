"""The index of refraction of a medium at a wavelength: formulas, and the glasses known by name.

Catalogues give the index of glass relative to air, at wavelengths in air; a scene's `ior` is
absolute. So a formula's value is multiplied by the index of the scene's air at that wavelength:
by 1 where the air is left a vacuum, so that light bends at the glass as in a laboratory, and by
1.00027 where the scene says that it is air. The air itself is relative to vacuum.
"""

from __future__ import annotations

import math
from itertools import pairwise

from harness.scene import media_model as model
from harness.scene.crosscheck import WAYS
from harness.scene.findings import Finding, SceneInvalid, quoted

LINE_F, LINE_D, LINE_C = 486.1327, 587.5618, 656.2725  # nm; Fraunhofer's F, d and C
VISIBLE, FEWEST = (400.0, 700.0), 6

# N-BK7, SF11, N-SF11: Schott, data sheets of optical glass. SF11, which holds lead, and N-SF11,
# which does not, are two glasses of one nd. Fused silica: I. Malitson, J. Opt. Soc. Am. 55, 1205
# (1965). Water at 20 °C: M. Daimon, A. Masumura, Appl. Opt. 46, 3811 (2007).
GLASSES = {
    "N-BK7": model.Sellmeier(
        B=(1.03961212, 0.231792344, 1.01046945), C=(0.00600069867, 0.0200179144, 103.560653)
    ),
    "SF11": model.Sellmeier(
        B=(1.73848403, 0.311168974, 1.17490871), C=(0.0136068604, 0.0615960463, 121.922711)
    ),
    "N-SF11": model.Sellmeier(
        B=(1.73759695, 0.313747346, 1.89878101), C=(0.013188707, 0.0623068142, 155.23629)
    ),
    "fused silica": model.Sellmeier(
        B=(0.6961663, 0.4079426, 0.8974794), C=(0.0684043**2, 0.1162414**2, 9.896161**2)
    ),
    "water": model.Sellmeier(
        B=(0.5684027565, 0.1726177391, 0.02086189578, 0.1130748688),
        C=(0.005101829712, 0.01821153936, 0.02620722293, 10.69792721),
    ),
}


def index(medium: model.Medium, wavelength: float, air: float) -> float:
    """The absolute index of `medium` at `wavelength` nm, in a scene whose air has the index `air`.

    Raises SceneInvalid, at a key of the medium, where its formula has no value there.
    """
    if medium.ior is not None:
        return medium.ior
    if medium.glass == "air":
        return air_index(wavelength)
    relative = _relative(medium, wavelength)
    if not 1e-3 <= relative <= 1e3:
        way = next(way for way in WAYS if getattr(medium, way) is not None)
        message = f"no index of refraction at {wavelength:g} nm"
        raise SceneInvalid(Finding((way,), message, f"n = {relative:.6g}", "0.001 to 1000"))
    return relative * air


def abbe_number(medium: model.Medium, wavelength: float, air: model.Medium) -> float | None:
    """(n - 1) / (nF - nC), n at `wavelength` nm; None where the medium does not disperse.

    Raises SceneInvalid where the medium has no index at one of the lines.
    """
    n, n_F, n_C = (
        index(medium, line, index(air, line, 1.0)) for line in (wavelength, LINE_F, LINE_C)
    )
    return (n - 1) / (n_F - n_C) if n_F != n_C else None


def _relative(medium: model.Medium, wavelength: float) -> float:
    if medium.glass is not None:
        return _sellmeier(GLASSES[medium.glass], wavelength)
    if medium.sellmeier is not None:
        if len(medium.sellmeier.B) != len(medium.sellmeier.C):
            counts = f"{len(medium.sellmeier.B)} B, {len(medium.sellmeier.C)} C"
            raise SceneInvalid(Finding(("sellmeier",), "coefficients go in pairs", counts))
        return _sellmeier(medium.sellmeier, wavelength)
    if medium.cauchy is not None:
        return _cauchy(medium.cauchy, wavelength)
    assert medium.abbe is not None
    return _cauchy(of_abbe(medium.abbe), wavelength)


def _sellmeier(glass: model.Sellmeier, wavelength: float) -> float:
    """``n^2 = 1 + sum B l^2 / (l^2 - C)``, l in micrometres; NaN where there is none."""
    square = (wavelength / 1000) ** 2
    if square in glass.C:
        return math.nan
    n2 = 1 + sum(b * square / (square - c) for b, c in zip(glass.B, glass.C, strict=True))
    return math.sqrt(n2) if n2 > 0 else math.nan


def _cauchy(glass: model.Cauchy, wavelength: float) -> float:
    """``n = A + B / l^2 + C / l^4``, l in micrometres."""
    square = (wavelength / 1000) ** 2
    return glass.A + glass.B / square + glass.C / square**2


def of_abbe(glass: model.Abbe) -> model.Cauchy:
    """The two Cauchy terms that have the index `nd` and the Abbe number `vd`."""
    per_square = {line: (1000 / line) ** 2 for line in (LINE_F, LINE_D, LINE_C)}
    B = (glass.nd - 1) / (glass.vd * (per_square[LINE_F] - per_square[LINE_C]))
    return model.Cauchy(A=glass.nd - B * per_square[LINE_D], B=B)


def air_index(wavelength: float) -> float:
    """Standard dry air: 15 °C, 101325 Pa, 450 ppm CO2; within 1e-8 of what is measured.

    P. Ciddor, Appl. Opt. 35, 1566 (1996), equation 1. It wants wavelengths in vacuum: that they
    are given in air here changes the result by 1e-11.
    """
    wavenumber = (1000 / wavelength) ** 2  # squared, per square micrometre
    dispersive = 0.05792105 / (238.0185 - wavenumber) + 0.00167917 / (57.362 - wavenumber)
    return 1 + dispersive


def wavelengths(spectrum: model.Spectrum) -> tuple[float, ...]:
    """All of them, rising. Raises SceneInvalid at a key of the spectrum."""
    span = spectrum.start, spectrum.stop, spectrum.count
    if spectrum.wavelengths is not None:
        if any(part is not None for part in span):
            expected = "either wavelengths, or start, stop and count"
            raise SceneInvalid(Finding((), "wavelengths are said twice", None, expected))
        listed = spectrum.wavelengths
    else:
        start, stop, count = span
        if start is None or stop is None or count is None:
            expected = "wavelengths, or start, stop and count"
            raise SceneInvalid(Finding((), "says no wavelengths", None, expected))
        listed = tuple(start + (stop - start) * k / (count - 1) for k in range(count))
    if any(a >= b for a, b in pairwise(listed)):
        value = quoted(list(listed))
        raise SceneInvalid(Finding((), "wavelengths must rise, each one once", value))
    if sum(VISIBLE[0] <= w <= VISIBLE[1] for w in listed) < FEWEST:
        expected = f"{FEWEST} or more from {VISIBLE[0]} to {VISIBLE[1]} nm"
        message = "too few visible wavelengths to tell colours apart"
        raise SceneInvalid(Finding((), message, quoted(list(listed)), expected))
    return listed
