"""What each observable is held against: the closed form, where it is derived, where it holds.

Every check against truth rests on one of these; a scene adds its own formula and sources. What is
compared between renderers instead has an oracle: the other renderer, which the record names with
its version.
"""

from __future__ import annotations

from dataclasses import dataclass

from harness.measure.observables import Observable

HECHT = "E. Hecht, Optics, 5th ed."
BORN_WOLF = "M. Born, E. Wolf, Principles of Optics, 7th ed."


@dataclass(frozen=True)
class Truth:
    """`form` is what is expected, `derived` where that stands, `domain` where it holds.

    `condition` names what a check's condition number, in its detail, is the derivative of: with
    respect to a relative change of all indices, at the ray for which it is largest.
    """

    form: str
    derived: str
    domain: str
    condition: str


_POINT, _DIRECTION, _LEVEL = "landing point", "direction", "light of the pixel"
_CHAIN = "Snell's law at each interface of the path, chained in closed form through the scene"
_ANY = "spheres, convex polyhedra, cylinders, cones, lenses, meshes, and what they compose"
_VECTOR = f"{HECHT}, section 4.4.1, in vector form: T = eta D + (eta c - cos_t) N"
_ONE_PATH = (
    "product of the unpolarised Fresnel factors along the path, times exp(-absorption x way)"
)

TRUTHS = {
    Observable.EXIT_POINT: Truth(_CHAIN, _VECTOR, _ANY, _POINT),
    Observable.EXIT_DIRECTION: Truth(_CHAIN, _VECTOR, _ANY, _DIRECTION),
    Observable.INTERNAL_ANGLE: Truth(
        "asin(n_i sin(theta_i) / n_t)", f"{HECHT}, section 4.4.1",
        "one interface, below the critical angle", _POINT,
    ),
    Observable.SLAB_OFFSET: Truth(
        "t sin(theta_i) (1 - cos(theta_i) / sqrt(n^2 - sin^2(theta_i)))",
        f"{HECHT}, section 4.4, problem 4.16", "two parallel faces with one medium around", _POINT,
    ),
    Observable.STACK_OFFSET: Truth(
        "cos(theta_i) sum_k t_k (tan(theta_i) - tan(theta_k))",
        f"{HECHT}, section 4.4, problem 4.16, applied to each layer",
        "parallel faces, a path of T alone", _POINT,
    ),
    Observable.TIR: Truth(
        "total where n_i sin(theta_i) >= n_t", f"{HECHT}, section 4.7",
        "rays farther from the limit than the probe resolves", _DIRECTION,
    ),
    Observable.CRITICAL_ANGLE: Truth(
        "asin(n_t / n_i)", f"{HECHT}, section 4.7", "n_i > n_t", "angle",
    ),
    Observable.DEVIATION: Truth(
        "theta_i + asin(sin A sqrt(n^2 - sin^2(theta_i)) - cos A sin(theta_i)) - A",
        f"{BORN_WOLF}, section 4.7.2", "rays in the principal plane that leave by the second face",
        _DIRECTION,
    ),
    Observable.MINIMUM_DEVIATION: Truth(
        "2 asin(n sin(A / 2)) - A", f"{BORN_WOLF}, section 4.7.2", "n sin(A / 2) < 1", _DIRECTION,
    ),
    Observable.FIRST_TRANSMITTING_ANGLE: Truth(
        "asin(n sin(A - asin(1 / n)))",
        f"{HECHT}, section 5.5.1: the exit face at its critical angle",
        "0 <= A - asin(1 / n), in the principal plane", "angle",
    ),
    Observable.INVERSION: Truth(
        "slope of the true landing points over the undeviated ones, by the same fit",
        _VECTOR, "the middle of the view through one lens or ball", _POINT,
    ),
    Observable.BREWSTER_ANGLE: Truth(
        "atan(n_t / n_i)", f"{HECHT}, section 4.6.3", "real indices", _POINT,
    ),
    Observable.BREWSTER_REFLECTANCE: Truth(
        "((1 - n^2) / (1 + n^2))^2 / 2", f"{HECHT}, section 4.6.3: R_p = 0",
        "one interface, unpolarised light", _LEVEL,
    ),
    Observable.FOLDED_DIRECTION: Truth(
        "the incident direction mirrored in the faces that reflect it",
        "W. J. Smith, Modern Optical Engineering, 4th ed., chapter 7: tunnel diagrams",
        "prisms that unfold to a plate with parallel faces", _DIRECTION,
    ),
    Observable.RETURN_ERROR: Truth(
        "2 asin(sin(e) sin(angle to the edge)) in the glass, refracted; for small e, at right "
        "angles to the front, 2 sqrt(2 / 3) n e",
        "P. R. Yoder, J. Opt. Soc. Am. 48, 496 (1958); expected_systems.corner_cube_return",
        "corner cubes with one angle off by e", _DIRECTION,
    ),
    Observable.SKEWNESS: Truth(
        "n (r x d) . a, the same before and behind",
        "Snell's law in vector form along a normal that meets the axis: expected_systems.skewness",
        "solids that are round about one axis", _DIRECTION,
    ),
    Observable.REVERSIBILITY: Truth(
        "the reversed ray leaves as the first one came",
        f"{BORN_WOLF}, section 3.1.2: rays do not know their sense",
        "rays transmitted by a prism both ways", _DIRECTION,
    ),
    Observable.SAGITTAL_DEPTH: Truth(
        "d cos(theta) / sqrt(n^2 - sin^2(theta))",
        "from d tan(theta_t) = d_s tan(theta): expected_systems.sagittal_depth",
        "a flat surface, seen from air", _POINT,
    ),
    Observable.TANGENTIAL_DEPTH: Truth(
        "d n^2 cos^3(theta) / (n^2 - sin^2(theta))^(3/2)",
        "Snell's law differentiated: expected_systems.tangential_depth",
        "a flat surface, seen from air", _POINT,
    ),
    Observable.FOCUS: Truth(
        "h / sin 2 (asin(h / R) - asin(h / (n R))) for a ball; else the chain of Snell's laws",
        "symmetry of the ray in a ball: expected_systems.ball_crossing",
        "rays parallel to the axis, 0 < h < R, h < n R", _POINT,
    ),
    Observable.FOCAL_LENGTH: Truth(
        "1 / f = (n - 1) (1/R1 - 1/R2 + (n - 1) d / (n R1 R2))", f"{HECHT}, section 6.1",
        "one lens or ball in one medium, rays near the axis", _DIRECTION,
    ),
    Observable.BACK_FOCAL_LENGTH: Truth(
        "f (1 - (n - 1) d / (n R1))", f"{HECHT}, section 6.1",
        "one lens or ball in one medium, rays near the axis", _POINT,
    ),
    Observable.SPHERICAL_ABERRATION: Truth(
        "crossing of the highest ray less the paraxial focus", f"{HECHT}, section 6.3.1",
        "one lens or ball in one medium", _POINT,
    ),
    Observable.APLANATIC_IMAGE: Truth(
        "n R", f"{BORN_WOLF}, section 4.2.3: similar triangles (Weierstrass)",
        "a point at R / n from the centre, rays of any height", _POINT,
    ),
    Observable.CARTESIAN_FOCUS: Truth(
        "n R / (n - 1) in an ellipsoid of conic -1 / n^2, R / (n - 1) behind a hyperboloid of -n^2",
        f"{BORN_WOLF}, section 4.2.2: equal optical paths", "parallel rays of any height", _POINT,
    ),
    Observable.RAINBOW_ANGLE: Truth(
        "180 deg - |2 i - 2 (k + 1) r + k pi| at cos^2 i = (n^2 - 1) / (k (k + 2))",
        f"{BORN_WOLF}, section 4.7 (Descartes 1637)", "n^2 - 1 < k (k + 2)", _DIRECTION,
    ),
    Observable.OPTICAL_LENGTH: Truth(
        "sum of index x way along the true path", f"{BORN_WOLF}, section 3.3.2 (Fermat)", _ANY,
        _POINT,
    ),
    Observable.VARIANT_AGREEMENT: Truth(
        "0: one geometry in two forms", "rays do not know how a shape was described or turned",
        "variants of a case", _POINT,
    ),
    Observable.RAY_AGREEMENT: Truth(
        "0: one ray measured in two ways", "the ray API and the coded image are of one renderer",
        "renderers with a ray API", _POINT,
    ),
    Observable.REFLECTANCE: Truth(_ONE_PATH, f"{HECHT}, sections 4.6.2 and 4.8.1", _ANY, _LEVEL),
    Observable.TRANSMITTANCE: Truth(_ONE_PATH, f"{HECHT}, sections 4.6.2 and 4.8.1", _ANY, _LEVEL),
    Observable.TOTAL_REFLECTANCE: Truth(
        "sum over the tree of all paths; of a slab R (1 + a T)",
        f"{HECHT}, section 9.6.1, in powers", "to the scene's depth and least weight", _LEVEL,
    ),
    Observable.TOTAL_TRANSMITTANCE: Truth(
        "sum over the tree of all paths; of a slab (1 - R)^2 a / (1 - R^2 a^2)",
        f"{HECHT}, section 9.6.1, in powers", "to the scene's depth and least weight", _LEVEL,
    ),
    Observable.RADIANCE: Truth(
        "the background's in a furnace; of open faces emission, filter x colour + transmit, "
        "and E rho / pi",
        "R + T = 1 at every face; J. H. Lambert, Photometria (1760)",
        "solids before a background alone, or open faces without solids", _LEVEL,
    ),
    Observable.TESSELLATION_ERROR: Truth(
        "RMS angle between the true rays through the polygons and through the sphere",
        _VECTOR, "a ball of triangles with its vertices on one sphere", _DIRECTION,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Quantity:
    """A quantity of ray optics: by which observable it is asked for, in which scenes."""

    name: str
    observable: Observable
    scenes: tuple[str, ...]
    remark: str = ""


QUANTITIES = (
    Quantity("angle of refraction (Snell)", Observable.INTERNAL_ANGLE, ("snell-sweep",)),
    Quantity("refraction of a vector", Observable.EXIT_POINT, ("ball-checkerboard", "cone-side"),
             "skew rays, out of every plane of symmetry"),
    Quantity("critical angle", Observable.CRITICAL_ANGLE, ("tir-critical-angle", "tir-limit")),
    Quantity("total internal reflection", Observable.TIR, ("tir-critical-angle",)),
    Quantity("Fresnel's R and T", Observable.REFLECTANCE,
             ("fresnel-outside", "fresnel-inside", "fresnel-indices"),
             "unpolarised, as renderers claim; that of polarised light is told beside it"),
    Quantity("R_s alone", Observable.BREWSTER_REFLECTANCE, ("brewster-angle",),
             "at Brewster's angle R_p is 0, and R is R_s / 2"),
    Quantity("Brewster's angle", Observable.BREWSTER_ANGLE, ("brewster-angle",)),
    Quantity("sideways shift of a slab", Observable.SLAB_OFFSET,
             ("slab-offset", "slab-thin", "thin-face-offset", "immersed-slab")),
    Quantity("axial shift of a slab", Observable.SLAB_OFFSET, ("slab-offset",),
             "the sideways shift over sin(theta_i), which is the camera's and known exactly"),
    Quantity("shift of a stack", Observable.STACK_OFFSET, ("stack-panes", "stack-cemented")),
    Quantity("R of a slab, all reflections", Observable.TOTAL_REFLECTANCE, ("slab-all-light",)),
    Quantity("T of a slab, all reflections", Observable.TOTAL_TRANSMITTANCE,
             ("slab-all-light", "absorption-all-light", "recursion-depth"),
             "per polarisation and then averaged: the distance to nature, told beside it"),
    Quantity("absorption", Observable.TRANSMITTANCE,
             ("absorption-beer-lambert", "absorption-ball", "tir-prism-coloured")),
    Quantity("deviation of a prism", Observable.DEVIATION, ("prism-deviation", "polygon-prism")),
    Quantity("minimum deviation", Observable.MINIMUM_DEVIATION, ("prism-deviation",)),
    Quantity("first transmitting angle", Observable.FIRST_TRANSMITTING_ANGLE,
             ("prism-deviation",)),
    Quantity("deviation of a wedge", Observable.DEVIATION, ("wedge-thin",)),
    Quantity("focal length of a ball", Observable.FOCAL_LENGTH, ("ball-focus",)),
    Quantity("back focal length of a ball", Observable.BACK_FOCAL_LENGTH, ("ball-focus",)),
    Quantity("real focus of a ball", Observable.FOCUS, ("ball-focus", "immersed-ball")),
    Quantity("view through a ball: inversion, magnification", Observable.INVERSION,
             ("ball-magnification", "ball-sand-meets-sea")),
    Quantity("focal length of a thick lens", Observable.FOCAL_LENGTH,
             ("lens-biconvex", "lens-biconcave", "lens-meniscus", "immersed-air-lens")),
    Quantity("back focal length of a thick lens", Observable.BACK_FOCAL_LENGTH,
             ("lens-plano-convex", "lens-plano-convex-turned"),
             "the turned lens has the front focal length of the other"),
    Quantity("spherical aberration", Observable.SPHERICAL_ABERRATION,
             ("ball-focus", "lens-plano-convex", "lens-plano-convex-turned")),
    Quantity("rainbows", Observable.RAINBOW_ANGLE, ("rainbow-primary", "rainbow-secondary")),
    Quantity("n_F, n_d, n_C by Sellmeier", Observable.MINIMUM_DEVIATION,
             ("dispersion-n-bk7", "dispersion-sf11"),
             "a case per line; V_d = (n_d - 1) / (n_F - n_C) is made of the three"),
    Quantity("chromatic shift", Observable.FOCAL_LENGTH,
             ("dispersion-lens-shift", "dispersion-ball-shift")),
    Quantity("apparent depth, tangential", Observable.TANGENTIAL_DEPTH, ("apparent-depth-pool",)),
    Quantity("apparent depth, sagittal", Observable.SAGITTAL_DEPTH, ("apparent-depth-pool",)),
    Quantity("corner cube", Observable.FOLDED_DIRECTION, ("retroreflector-corner-cube",)),
    Quantity("corner cube with a wrong angle", Observable.RETURN_ERROR,
             ("retroreflector-wrong-angle",)),
    Quantity("TIR prisms", Observable.FOLDED_DIRECTION,
             ("tir-prism-right-angle", "tir-prism-porro", "light-pipe-rod")),
    Quantity("n^2 law of radiance", Observable.TRANSMITTANCE, ("n2-camera-in-glass",)),
    Quantity("etendue", Observable.TRANSMITTANCE, ("n2-camera-in-glass",),
             "n^2 dA cos(theta) dOmega is kept where radiance / n^2 is, as some renderers claim"),
    Quantity("etendue of skew rays", Observable.SKEWNESS, ("cylinder-skew",),
             "what is round about an axis keeps etendue for each skewness by itself"),
    Quantity("optical path length (Fermat)", Observable.OPTICAL_LENGTH,
             ("fermat-slab", "lens-biconvex", "cartesian-ellipsoid")),
    Quantity("aplanatic points of a sphere", Observable.APLANATIC_IMAGE, ("aplanatic-sphere",)),
    Quantity("Cartesian surfaces", Observable.CARTESIAN_FOCUS,
             ("cartesian-ellipsoid", "cartesian-hyperboloid")),
    Quantity("reversibility", Observable.REVERSIBILITY, ("reversibility-prism",)),
    Quantity("energy: R + T + A = 1", Observable.RADIANCE, ("furnace-ball", "furnace-prism")),
    Quantity("convergence of polygons", Observable.TESSELLATION_ERROR, ("polygon-icosphere",)),
)  # fmt: skip


def page() -> str:
    """docs/truths.md: all of them."""
    lines = [
        "# What checks are held against",
        "",
        "Each observable that is compared with the truth, its closed form, where that is derived",
        "and where it holds; a scene's own formula and sources stand in its file and on its page.",
        "Of each check the record tells how sensitive it is: `condition_…` in its detail is the",
        "derivative of what the last column names with respect to a relative change of all",
        "indices, at the ray for which it is largest. Made from `harness/measure/truths.py`, which",
        "a test holds it to.",
        "",
        "Observables of two pictures have no closed form: their truth is the other renderer, by",
        "the name and version that the record tells.",
        "",
        "| observable | closed form | derived in | holds for | condition of |",
        "|--|--|--|--|--|",
    ]
    for observable, truth in TRUTHS.items():
        cells = (f"`{observable}`", truth.form, truth.derived, truth.domain, truth.condition)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    lines += [
        "",
        "## Where each quantity is asked for",
        "",
        "What ray optics has closed forms of, and the scenes that measure it.",
        "",
        "| quantity | observable | scenes | |",
        "|--|--|--|--|",
    ]
    for quantity in QUANTITIES:
        scenes = ", ".join(f"`{name}`" for name in quantity.scenes)
        lines.append(
            f"| {quantity.name} | `{quantity.observable}` | {scenes} | {quantity.remark} |"
        )
    return "\n".join(lines) + "\n"
