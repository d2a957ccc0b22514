"""Media as a scene file describes them. `harness.scene.dispersion` says what index follows."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from harness.scene.shape_model import Finite, Rgb, Strict

Index = Annotated[float, Field(ge=0.001, le=1000, allow_inf_nan=False)]
Wavelength = Annotated[
    float, Field(ge=200, le=2500, allow_inf_nan=False, description="a wavelength in nm")
]
Coefficients = Annotated[tuple[Finite, ...], Field(min_length=1, max_length=8)]


class Sellmeier(Strict):
    """n² = 1 + Σ B λ² / (λ² - C), λ in µm, C in µm²."""

    B: Coefficients
    C: Coefficients


class Cauchy(Strict):
    """n = A + B / λ² + C / λ⁴, λ in µm."""

    A: Finite
    B: Finite
    C: Finite = 0.0


class Abbe(Strict):
    """The index at 587.56 nm, and the Abbe number (nd - 1) / (nF - nC)."""

    nd: Index
    vd: Annotated[
        float,
        Field(ge=1, le=1e6, allow_inf_nan=False, description="10 to 100 for glasses and fluids"),
    ]


class Medium(Strict):
    """One of `ior`, `glass`, `sellmeier`, `cauchy` and `abbe` says how it refracts.

    `ior` is absolute and the same at all wavelengths; the others are relative to the scene's air.
    `absorption` is per scene unit and colour channel: T = exp(-absorption L).
    """

    ior: Index | None = None
    glass: Literal["N-BK7", "SF11", "N-SF11", "fused silica", "water", "air"] | None = None
    sellmeier: Sellmeier | None = None
    cauchy: Cauchy | None = None
    abbe: Abbe | None = None
    absorption: Rgb = (0, 0, 0)


class Spectrum(Strict):
    """The picture is the sum of monochromatic ones, at these wavelengths in nm.

    Either `wavelengths` lists them, or they are `count` from `start` to `stop`, both included.
    """

    wavelengths: Annotated[tuple[Wavelength, ...], Field(min_length=2, max_length=200)] | None = (
        None
    )
    start: Wavelength | None = None
    stop: Wavelength | None = None
    count: Annotated[int, Field(ge=2, le=200)] | None = None
