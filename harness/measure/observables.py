"""The observables: everything that a check can measure, by its stable name.

The names appear in scene files, in records and in `summary.json`; scripts rely on them, so they
are added to and never renamed.
"""

from __future__ import annotations

import enum


class Observable(enum.StrEnum):
    """A measurable quantity. `unit` is "" for pure numbers; `meaning` is one line for people."""

    unit: str
    meaning: str

    def __new__(cls, name: str, unit: str = "", meaning: str = "") -> Observable:
        member = str.__new__(cls, name)
        member._value_ = name
        member.unit = unit
        member.meaning = meaning
        return member

    # Two images, pixel by pixel.
    SSIM = "ssim", "", "structural similarity of two images, 1 where they are equal"
    RMSE = "rmse", "radiance", "root of the mean squared difference of two images"
    PSNR = "psnr", "dB", "peak signal-to-noise ratio of two images"
    MAX_DIFFERENCE = "max_difference", "radiance", "largest difference of any pixel and channel"
    P999_DIFFERENCE = "p999_difference", "radiance", "99.9th percentile of the differences"
    DELTA_E = "delta_e", "", "colour difference CIEDE2000"

    # Rays, measured through position codes or a ray API.
    INTERNAL_ANGLE = "internal_angle", "deg", "direction of the refracted ray inside the medium"
    EXIT_DIRECTION = "exit_direction", "µrad", "direction in which a ray leaves the glass"
    EXIT_POINT = "exit_point", "units", "where a ray that left the glass lands on the backdrop"
    SLAB_OFFSET = "slab_offset", "units", "sideways shift of a ray through a slab"
    TIR = "tir", "", "rays whose total internal reflection is wrongly decided"
    CRITICAL_ANGLE = "critical_angle", "deg", "angle at which total internal reflection begins"
    DEVIATION = "deviation", "deg", "angle by which a prism turns a ray"
    MINIMUM_DEVIATION = "minimum_deviation", "deg", "smallest deviation over all incidences"
    FIRST_TRANSMITTING_ANGLE = (
        "first_transmitting_angle",
        "deg",
        "smallest angle of incidence at which a prism transmits",
    )
    INVERSION = "inversion", "", "magnification of the view through a lens; negative: upside down"

    # Light.
    REFLECTANCE = "reflectance", "", "reflected part of the radiance"
    TRANSMITTANCE = "transmittance", "", "transmitted part of the radiance"
    RADIANCE = "radiance", "radiance", "radiance of a pixel or a region"

    # Polygons in place of a smooth shape.
    TESSELLATION_ERROR = (
        "tessellation_error",
        "µrad",
        "RMS angle between rays through the polygons and rays through the sphere they stand for",
    )


# Observables of a picture, as opposed to a probe.
IMAGE_OBSERVABLES = frozenset(
    {
        Observable.SSIM,
        Observable.RMSE,
        Observable.PSNR,
        Observable.MAX_DIFFERENCE,
        Observable.P999_DIFFERENCE,
        Observable.DELTA_E,
        Observable.RADIANCE,
    }
)

# Observables of a probe that shows light; all others of a probe show where rays went.
LIGHT_OBSERVABLES = frozenset(
    {
        Observable.REFLECTANCE,
        Observable.TRANSMITTANCE,
        Observable.CRITICAL_ANGLE,
        Observable.FIRST_TRANSMITTING_ANGLE,
    }
)

# Observables of a single renderer, which have a truth; all others compare two pictures.
TRUTH_OBSERVABLES = frozenset(Observable) - IMAGE_OBSERVABLES | {Observable.RADIANCE}
