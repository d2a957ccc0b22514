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

    BREWSTER_ANGLE = "brewster_angle", "deg", "angle at which refracted and reflected are square"
    STACK_OFFSET = "stack_offset", "units", "sideways shift of a ray through parallel layers"
    FOLDED_DIRECTION = (
        "folded_direction",
        "µrad",
        "direction of a ray out of a reflecting prism, against the one mirrored in its faces",
    )
    RETURN_ERROR = (
        "return_error",
        "µrad",
        "angle between a ray out of a corner cube and the way it came",
    )
    REVERSIBILITY = "reversibility", "µrad", "whether a reversed ray takes the same way back"
    SAGITTAL_DEPTH = "sagittal_depth", "units", "apparent depth across the plane of incidence"
    TANGENTIAL_DEPTH = "tangential_depth", "units", "apparent depth in the plane of incidence"
    FOCUS = "focus", "units", "where rays parallel to the axis cross it"
    FOCAL_LENGTH = "focal_length", "units", "effective focal length of rays near the axis"
    BACK_FOCAL_LENGTH = "back_focal_length", "units", "from the last vertex to the focus"
    SPHERICAL_ABERRATION = (
        "spherical_aberration",
        "units",
        "how far from the focus the outermost ray crosses the axis",
    )
    APLANATIC_IMAGE = "aplanatic_image", "units", "image distance of a sphere's aplanatic point"
    CARTESIAN_FOCUS = (
        "cartesian_focus",
        "units",
        "the one point where a Cartesian surface focuses rays of any height",
    )
    SKEWNESS = "skewness", "units", "index x distance from an axis x sine of the angle to it"
    RAINBOW_ANGLE = "rainbow_angle", "deg", "angle of a rainbow from the point opposite to the sun"
    OPTICAL_LENGTH = "optical_length", "units", "optical length of the path: sum of index x way"
    VARIANT_AGREEMENT = (
        "variant_agreement",
        "units",
        "landing points in a variant of a case against those in the case itself",
    )
    RAY_AGREEMENT = "ray_agreement", "units", "a ray API's landing points against coded images"

    # Light.
    REFLECTANCE = "reflectance", "", "reflected part of the radiance"
    TRANSMITTANCE = "transmittance", "", "transmitted part of the radiance"
    BREWSTER_REFLECTANCE = "brewster_reflectance", "", "reflectance at Brewster's angle"
    TOTAL_REFLECTANCE = "total_reflectance", "", "light sent back by all paths together"
    TOTAL_TRANSMITTANCE = "total_transmittance", "", "light let through by all paths together"
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
        Observable.BREWSTER_REFLECTANCE,
    }
)

# Observables of a probe that shows the light of all paths together.
ALL_LIGHT_OBSERVABLES = frozenset({Observable.TOTAL_REFLECTANCE, Observable.TOTAL_TRANSMITTANCE})

# Observables that only a renderer with a ray API can answer; no other one is asked.
RAY_API_OBSERVABLES = frozenset({Observable.OPTICAL_LENGTH, Observable.RAY_AGREEMENT})

# Observables of a single renderer, which have a truth; all others compare two pictures.
TRUTH_OBSERVABLES = frozenset(Observable) - IMAGE_OBSERVABLES | {Observable.RADIANCE}

# Observables that follow from others and are not asked for by name.
IMPLIED_OBSERVABLES = frozenset({Observable.VARIANT_AGREEMENT})

# Observables of a probe that look at directions alone: where a ray runs beside itself passes them.
DIRECTION_OBSERVABLES = frozenset(
    {
        Observable.EXIT_DIRECTION,
        Observable.DEVIATION,
        Observable.MINIMUM_DEVIATION,
        Observable.FOLDED_DIRECTION,
        Observable.RETURN_ERROR,
        Observable.REVERSIBILITY,
        Observable.RAINBOW_ANGLE,
    }
)
