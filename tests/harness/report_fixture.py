"""A plausible run to make reports of: all verdicts, real small images, curves from closed forms.

`make_run` writes records, summary, pictures and difference maps as a run does. What each renderer
"delivers" is the closed form with the errors typical of its kind: `povray` quantises, `mitsuba` is
noisy, `mytracer` has bugs, `mitsuba-exact` is not installed.
"""

from __future__ import annotations

import hashlib
import itertools
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harness import record as records
from harness.record import (
    CaseRecord,
    Check,
    Counts,
    Curve,
    DifferenceMap,
    ImageFile,
    RendererRun,
    RendererSummary,
    Series,
    Summary,
    SummaryCase,
    Table,
    Verdict,
    worst,
)
from harness.report import pictures
from harness.report.links import page_name

Floats = NDArray[np.float64]

PRESENT = ("tracer", "povray", "mitsuba", "mytracer")
MISSING = "mitsuba-exact"
VERSIONS = {"tracer": "0.1.0", "povray": "3.7.0.10", "mitsuba": "3.9.1", "mytracer": "?"}
SECONDS = {"tracer": 0.084, "povray": 1.31, "mitsuba": 2.62, "mytracer": 0.31}
COMMANDS = {
    "tracer": "snellcheck worker harness.renderers.tracer:TracerEngine",
    "povray": "povray +Iscene.pov +Oimage.png +W256 +H256 +FN16 File_Gamma=1.0 -D -GA +WT1",
    "mitsuba": "mitsuba -m llvm_ad_rgb -s 0 scene.xml",
    "mytracer": "./mytracer scene.json image.png",
}
STARTED = "2026-03-14T09:26:53+00:00"

CRASH_LOG = """\
2026-03-14 09:27:31 INFO  [PluginManager] Loading plugin "plugins/dielectric.so" ..
2026-03-14 09:27:31 INFO  [SceneParser] complete-package.xml: 9 shapes, 5 bsdfs
2026-03-14 09:27:32 WARN  [Scene] Shape "prism": degenerate triangle 7
Caught signal 6 (SIGABRT): jit_llvm_compile(): cannot allocate 268435456 bytes
Aborted (core dumped)"""


# --- closed forms ---------------------------------------------------------------------------------


def snell(theta_i: Floats, ior: float) -> Floats:
    """Angle inside, in degrees."""
    return np.asarray(np.degrees(np.arcsin(np.sin(np.radians(theta_i)) / ior)))


def slab_offset(theta_i: Floats, ior: float, thickness: float) -> Floats:
    """Hecht, Optics, 5th ed., problem 4.16."""
    sine, cosine = np.sin(np.radians(theta_i)), np.cos(np.radians(theta_i))
    return np.asarray(thickness * sine * (1 - cosine / np.sqrt(ior**2 - sine**2)))


def prism_deviation(theta_i: Floats, ior: float, apex: float) -> Floats:
    """NaN where the ray is totally reflected at the second face."""
    inside = np.radians(apex) - np.radians(snell(theta_i, ior))
    with np.errstate(invalid="ignore"):
        leaving = np.degrees(np.arcsin(ior * np.sin(inside)))
    return np.asarray(theta_i + leaving - apex)


def reflectance(theta_i: Floats, ior: float) -> Floats:
    """Unpolarised Fresnel reflectance from air."""
    ci, ct = np.cos(np.radians(theta_i)), np.cos(np.radians(snell(theta_i, ior)))
    s = (ci - ior * ct) / (ci + ior * ct)
    p = (ior * ci - ct) / (ior * ci + ct)
    return np.asarray((s**2 + p**2) / 2)


def beach(x: Floats, y: Floats) -> Floats:
    """Sky above, sea, and sand: radiance at points of a backdrop."""
    haze = np.exp(-3 * np.maximum(y, 0))
    sky = np.stack([0.25 + 0.3 * haze, 0.5 + 0.2 * haze, 0.95 + 0 * y], -1)
    sea = np.stack([0.02 + 0 * x, 0.22 + 0.05 * np.sin(24 * y), 0.32 + 0.05 * np.sin(24 * y)], -1)
    grain = 0.06 * np.sin(37 * x) * np.sin(41 * y)
    sand = np.stack([0.75 + grain, 0.56 + grain, 0.32 + grain], -1)
    image = np.where((y > 0)[..., None], sky, sea)
    return np.where((y < -0.45 + 0.05 * np.sin(2 * x))[..., None], sand, image)


def checkerboard(x: Floats, y: Floats) -> Floats:
    odd = (np.floor(2 * x) + np.floor(2 * y)) % 2 == 1
    return np.where(odd[..., None], (0.9, 0.6, 0.2), (0.1, 0.3, 0.9))


def ball_view(scene: str, size: int, ior: float, shift: float = 0.0) -> Floats:
    """A glass ball of radius 1 before a backdrop at z = -3, seen along -z, orthographic.

    With sin i = h and sin r = h / ior, a ray at height h leaves the ball at the polar angle
    pi + i - 2 r from +z, turned towards the axis by 2 (i - r).
    """
    backdrop = {"beach": beach, "checkerboard": checkerboard}[scene]
    at = (np.arange(size) + 0.5 + shift) / size * 3.2 - 1.6
    x, y = np.meshgrid(at, -at)
    h = np.hypot(x, y)
    inside = h < 1
    i = np.arcsin(np.where(inside, h, 0.0))
    r = np.arcsin(np.where(inside, h, 0.0) / ior)
    leaves_h, leaves_z = -np.sin(i - 2 * r), -np.cos(i - 2 * r)
    slope = np.tan(2 * (i - r))
    landed = np.where(inside, leaves_h - (3 + leaves_z) * slope, h)
    scale = np.where(h > 0, landed / np.maximum(h, 1e-12), 0.0)
    light = backdrop(x * np.where(inside, scale, 1.0), y * np.where(inside, scale, 1.0))
    fresnel = 1 - reflectance(np.degrees(i), ior)
    return np.asarray(light * np.where(inside, fresnel**2, 1.0)[..., None])


# --- what the renderers deliver -------------------------------------------------------------------


def delivered(renderer: str, image: Floats, rng: np.random.Generator) -> Floats:
    if renderer == "povray":
        return np.asarray(np.rint(image * 65535) / 65535)
    if renderer == "mitsuba":
        return np.asarray(image * (1 + rng.normal(0, 0.01, image.shape)))
    return image


def measured(renderer: str, truth: Floats, size: float, rng: np.random.Generator) -> Floats:
    """`truth` with errors of the renderer's kind, `size` being the tolerance."""
    share = {"tracer": 1e-9, "povray": 0.18, "mitsuba": 0.34, "mytracer": 0.5}[renderer]
    return np.asarray(truth + rng.normal(0, share * size / 3, truth.shape))


def curve(
    name: str,
    title: str,
    y_label: str,
    x: Floats,
    truth: Floats,
    lines: dict[str, Floats],
    tolerance: Floats,
    residual_label: str,
) -> Curve:
    def series(renderer: str, y: Floats) -> Series:
        return Series(renderer=renderer, x=x.tolist(), y=y.tolist())

    return Curve(
        id=name,
        title=title,
        x_label="angle of incidence θᵢ [°]",
        y_label=y_label,
        series=[series("truth", truth), *(series(r, y) for r, y in lines.items())],
        residual_label=residual_label,
        residuals=[series(r, y - truth) for r, y in lines.items()],
        tolerance=tolerance.tolist(),
    )


def check(
    observable: str,
    renderer: str,
    value: float | None,
    expected: float | None,
    tolerance: float | None,
    unit: str,
    *,
    against: str = "truth",
    reason: str = "",
    derivation: str = "",
    status: Verdict | None = None,
    **detail: float | int | str,
) -> Check:
    """A check, judged here as the harness judges unless `status` is given."""
    if status is None:
        inside = (
            value is not None
            and expected is not None
            and tolerance is not None
            and abs(value - expected) <= tolerance
        )
        status = Verdict.PASS if inside else Verdict.FAIL
    return Check(
        id=observable if against == "truth" else f"{observable}.{against}",
        renderer=renderer,
        against=against,
        observable=observable,
        value=value,
        expected=expected,
        tolerance=tolerance,
        unit=unit,
        status=status,
        reason=reason or ("within tolerance" if status == Verdict.PASS else "beyond tolerance"),
        derivation=derivation,
        detail=detail,
    )


@dataclass
class Draft:
    """A case in the making."""

    id: str
    title: str
    family: str
    description: str = ""
    formula: str = ""
    lecture: str = ""
    sources: list[str] = field(default_factory=list)
    parameters: dict[str, float | int | str] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)
    runs: list[RendererRun] = field(default_factory=list)
    curves: list[Curve] = field(default_factory=list)
    differences: list[DifferenceMap] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)

    @property
    def stem(self) -> str:
        return page_name(self.id).removesuffix(".html")

    def finished(self) -> CaseRecord:
        return CaseRecord(
            id=self.id,
            case=self.id.partition("[")[0],
            family=self.family,
            title=self.title,
            description=self.description,
            lecture=self.lecture,
            sources=self.sources,
            formula=self.formula,
            parameters=self.parameters,
            scene_sha256=hashlib.sha256(self.id.encode()).hexdigest(),
            scene_file=f"scenes/{self.family}/{self.id.partition('[')[0]}.toml",
            quality="normal",
            snellcheck_version="0.1.0",
            started=STARTED,
            wall_s=3.42,
            status=worst([c.status for c in self.checks] + [r.status for r in self.runs]),
            runs=self.runs,
            checks=self.checks,
            curves=self.curves,
            differences=self.differences,
            tables=self.tables,
            files=self.files,
        )


def run_of(renderer: str, status: Verdict, **fields: object) -> RendererRun:
    return RendererRun.model_validate(
        {
            "name": renderer,
            "version": VERSIONS.get(renderer, ""),
            "status": status,
            "render_s": SECONDS.get(renderer, 0.0),
            "renders": 0 if status in (Verdict.SKIP, Verdict.ERROR) else 4,
            "command": COMMANDS.get(renderer, ""),
            **fields,
        }
    )


def skip_missing(draft: Draft, observable: str, unit: str) -> None:
    reason = "mitsuba-exact is not installed: .venv/bin/uv pip install 'snellcheck[mitsuba]'"
    draft.runs.append(run_of(MISSING, Verdict.SKIP, reason=reason))
    draft.checks.append(
        check(observable, MISSING, None, None, None, unit, status=Verdict.SKIP, reason=reason)
    )


# --- cases ----------------------------------------------------------------------------------------


def curve_case(
    draft: Draft,
    observable: str,
    y_label: str,
    unit: str,
    truth: Floats,
    x: Floats,
    tolerance: float,
    wrong: Floats | None = None,
) -> Draft:
    """A swept case; `wrong` is what `mytracer` delivers instead of the truth."""
    rng = np.random.default_rng(len(draft.id))
    growing = tolerance * (0.4 + 0.6 * (x / x.max()) ** 4)
    lines = {r: measured(r, truth, tolerance * 0.4, rng) for r in PRESENT}
    if wrong is not None:
        lines["mytracer"] = wrong
    draft.curves.append(
        curve(
            observable,
            y_label.split(" [")[0].capitalize(),
            y_label,
            x,
            truth,
            lines,
            growing,
            f"measured − truth [{unit}]",
        )
    )
    for renderer, y in lines.items():
        error = np.abs(y - truth)
        k = int(np.nanargmax(error))
        draft.checks.append(
            check(
                observable,
                renderer,
                float(error[k]),
                0.0,
                tolerance,
                unit,
                derivation="Probe resolution of the renderer, measured without glass, "
                "times the condition number of the map at the grazing end.",
                rms=float(np.sqrt(np.nanmean(error**2))),
                p999=float(np.nanquantile(error, 0.999)),
                rays=65536,
                worst_ray=f"θᵢ = {x[k]:.2f}°, pixel (201, 17)",
            )
        )
        draft.runs.append(
            run_of(renderer, draft.checks[-1].status, settings={"samples": 16, "seed": 0})
        )
    skip_missing(draft, observable, unit)
    return draft


def lecture_snell(x: Floats) -> Draft:
    """The lecture's printed table is (2/3) theta, which `mytracer` follows."""
    printed = x * 2 / 3
    draft = Draft(
        "snell-lecture[mu=0.67]",
        "Snell's law with the lecture's ratio",
        "snell",
        "The angle inside the glass, measured by a backdrop immersed in the medium.\n\n"
        "The table printed in the lecture is not the formula printed beside it.",
        "sin(theta_t) = mu sin(theta_i)",
        "Practical Refraction: Solids",
        ["Lecture 20: All Together with Refraction", "E. Hecht, Optics, 5th ed., section 4.4"],
        {"mu": 0.67},
    )
    truth = snell(x, 1 / 0.67)
    curve_case(draft, "internal_angle", "angle inside θₜ [°]", "°", truth, x, 2e-4, printed)
    angles = np.arange(0.0, 91.0, 10.0)
    draft.tables.append(
        Table(
            title="Erratum of the lecture's table",
            columns=["θᵢ [°]", "printed θₜ [°]", "arcsin(0.67 sin θᵢ) [°]", "error [°]"],
            rows=[
                [f"{a:.0f}", f"{a * 2 / 3:.2f}", f"{t:.6f}", f"{a * 2 / 3 - t:+.3f}"]
                for a, t in zip(angles, snell(angles, 1 / 0.67), strict=True)
            ],
            note="The printed values are (2/3) θᵢ, rounded. A renderer that follows them fails.",
        )
    )
    return draft


def slab(x: Floats, thickness: float, ior: float) -> Draft:
    draft = Draft(
        f"slab-offset[thickness={thickness},ior={ior}]",
        "A slab only shifts the ray",
        "slab",
        "A ray through a slab with parallel faces leaves in the direction in which it came, "
        "shifted sideways.",
        "d = t sin(theta_i) (1 - cos(theta_i) / sqrt(n^2 - sin(theta_i)^2))",
        "Practical Refraction: Surfaces; Special Case: Thin Faces",
        ["E. Hecht, Optics, 5th ed., section 4.4, problem 4.16: lateral displacement of a slab"],
        {"thickness": thickness, "ior": ior},
    )
    truth = slab_offset(x, ior, thickness)
    wrong = slab_offset(x, ior * 1.004, thickness) if ior > 2 else None
    return curve_case(
        draft, "slab_offset", "lateral offset d [units]", "units", truth, x, 2e-6, wrong
    )


def prism(x: Floats) -> Draft:
    """One renderer's deviation is NaN below the first transmitting angle, and beyond it."""
    draft = Draft(
        "prism-deviation[apex=60]",
        "Deviation by a prism, and its minimum",
        "prism",
        "Below 27.92° the ray is totally reflected inside.",
        "delta = theta_1 + theta_2' - A; delta_min = 2 asin(n sin(A / 2)) - A",
        parameters={"apex": 60, "ior": 1.5},
    )
    truth = prism_deviation(x, 1.5, 60.0)
    curve_case(draft, "exit_direction", "deviation δ [°]", "°", truth, x, 6e-5)
    broken = draft.curves[0].series[2].y[:]
    broken[40:46] = [math.nan] * 6
    series = [
        s.model_copy(update={"y": broken}) if s.renderer == "povray" else s
        for s in draft.curves[0].series
    ]
    draft.curves[0] = draft.curves[0].model_copy(update={"series": series})
    draft.checks[1] = check(
        "exit_direction",
        "povray",
        math.nan,
        0.0,
        6e-5,
        "°",
        status=Verdict.ERROR,
        reason="6 of 80 rays delivered NaN; NaN never equals anything",
        lost=6,
    )
    draft.runs[1] = run_of(
        "povray",
        Verdict.ERROR,
        renders=4,
        reason="NaN in 6 pixels",
        log_tail="Parse Warning: Texture has no pigment.",
    )
    return draft


def fresnel(x: Floats) -> Draft:
    draft = Draft(
        "fresnel-outside[ior=1.5]",
        "Reflectance of glass from outside",
        "fresnel",
        formula="R = (R_s + R_p) / 2; R_s = ((n_i cos(theta_i) - n_t cos(theta_t)) / "
        "(n_i cos(theta_i) + n_t cos(theta_t)))^2",
        parameters={"ior": 1.5},
        sources=["M. Born and E. Wolf, Principles of Optics, 7th ed., section 1.5.2"],
    )
    schlick = 0.04 + 0.96 * (1 - np.cos(np.radians(x))) ** 5
    return curve_case(
        draft, "reflectance", "reflectance R", "", reflectance(x, 1.5), x, 5e-4, schlick
    )


def tir() -> Draft:
    draft = Draft(
        "tir-critical-angle[ior=1.5]",
        "Total internal reflection",
        "tir",
        formula="theta_c = asin(n_t / n_i)",
        parameters={"ior": 1.5},
    )
    for renderer in PRESENT:
        confused = 12 if renderer == "mitsuba" else 0
        status = Verdict.KNOWN if confused else None
        draft.checks.append(
            check(
                "tir",
                renderer,
                confused,
                0.0,
                0.0,
                "rays",
                status=status,
                reason="single precision near the critical angle, as documented: 12 of 65 536 rays"
                if confused
                else "",
                rays=65536,
            )
        )
        draft.runs.append(run_of(renderer, draft.checks[-1].status))
    skip_missing(draft, "tir", "rays")
    return draft


def thin_face() -> Draft:
    draft = Draft(
        "slab-thin-face",
        "The lecture's thin face",
        "slab",
        lecture="Special Case: Thin Faces",
        description="One face that offsets the ray, against a real slab.",
    )
    for renderer in ("tracer", "povray"):
        draft.checks.append(check("exit_point", renderer, 3.1e-8, 0.0, 2e-6, "units"))
        draft.runs.append(run_of(renderer, Verdict.PASS))
    for renderer in ("mitsuba", "mytracer"):
        reason = f"{renderer} does not claim thin-slab"
        draft.checks.append(
            check(
                "exit_point",
                renderer,
                None,
                None,
                None,
                "units",
                status=Verdict.SKIP,
                reason=reason,
            )
        )
        draft.runs.append(run_of(renderer, Verdict.SKIP, reason=reason))
    skip_missing(draft, "exit_point", "units")
    return draft


def ball(root: Path, scene: str, size: int, *, crash: str = "") -> Draft:
    title = {"beach": "Where sand meets sea", "checkerboard": "A glass ball before a checkerboard"}
    draft = Draft(
        f"ball-{scene}" if not crash else "package-complete",
        title[scene],
        "ball",
        "A ball lens turns the backdrop upside down beyond its focus.",
        "f = n R / (2 (n - 1))",
        "A Wonderful Real Example",
        ["Closed form of a ray through a sphere: E. Hecht, Optics, 5th ed., chapter 6"],
        {"ior": 1.5, "distance": 3},
    )
    if crash:
        draft.title, draft.family = "The complete package", "package"
    rng = np.random.default_rng(7)
    images: dict[str, Floats] = {}
    for renderer in PRESENT:
        if renderer == crash:
            draft.runs.append(
                run_of(
                    renderer,
                    Verdict.ERROR,
                    log_tail=CRASH_LOG,
                    reason="ended by signal 6 (SIGABRT) after 1.2 s",
                )
            )
            continue
        ior = 1.5 if renderer != "mytracer" else 1.44
        image = delivered(renderer, ball_view(scene, size, ior), rng)
        if renderer == "mytracer" and crash:
            image[size // 2, size // 3 : size // 2] = np.nan
        images[renderer] = image
        draft.runs.append(stored(root, draft, renderer, image))
    compare(root, draft, images)
    if crash:
        draft.checks.append(
            check(
                "ssim",
                crash,
                None,
                None,
                None,
                "",
                against="tracer",
                status=Verdict.ERROR,
                reason="ended by signal 6 (SIGABRT) after 1.2 s",
            )
        )
    skip_missing(draft, "ssim", "")
    scene_file = f"scenes/{draft.stem}/scene.json"
    records.write_text(root / scene_file, "{}\n")
    draft.files["scene.json"] = scene_file
    given = {
        "ball.ply": "ply\n",
        "scene.pov": "sphere { <0, 0, 0>, 1 } // </pre><script>\n" + "// long\n" * 2000,
    }
    paths = {name: f"scenes/{draft.stem}/povray/{name}" for name in given}
    for name, text in given.items():
        records.write_text(root / paths[name], text)
    draft.runs[:] = [
        r.model_copy(update={"files": paths}) if r.name == "povray" else r for r in draft.runs
    ]
    return draft


def stored(root: Path, draft: Draft, renderer: str, image: Floats) -> RendererRun:
    base = f"images/{draft.stem}/{renderer}"
    data = image.astype(np.float32).tobytes()
    records.write_bytes(root / f"{base}.raw", data)
    pictures.write_picture(image, root / f"{base}.png")
    pictures.write_thumbnail(image, root / f"{base}.thumb.png", longest=96)
    stored_image = ImageFile(
        role="image",
        path=f"{base}.raw",
        picture=f"{base}.png",
        thumbnail=f"{base}.thumb.png",
        sha256=hashlib.sha256(data).hexdigest(),
        width=image.shape[1],
        height=image.shape[0],
    )
    return run_of(renderer, Verdict.PASS, images=[stored_image], settings={"samples": 64})


def compare(root: Path, draft: Draft, images: dict[str, Floats], limit: float = 1.0) -> None:
    for a, b in itertools.combinations(images, 2):
        path = f"images/{draft.stem}/{a}-{b}.png"
        pictures.write_difference(images[a], images[b], limit, root / path, low=1e-9)
        draft.differences.append(DifferenceMap(a=a, b=b, path=path, limit=limit, unit="", low=1e-9))
        off = np.abs(images[a] - images[b])
        noisy = "mitsuba" in (a, b)
        ssim = 1 - float(np.nanmean(off)) * (0.02 if noisy else 1.5)
        tolerance = 2e-3 if noisy else 1e-4
        derivation = "Wang's setting: gaussian weights, σ 1.5, data range 1."
        draft.checks += [
            check("ssim", b, ssim, 1.0, tolerance, "", against=a, derivation=derivation),
            check("rmse", b, float(np.sqrt(np.nanmean(off**2))), 0.0, 0.02, "", against=a),
        ]


# --- the run --------------------------------------------------------------------------------------


def drafts(root: Path, size: int = 96) -> list[Draft]:
    """A dozen cases."""
    x = np.linspace(0.0, 80.0, 81)
    steep = np.linspace(28.0, 89.0, 80)
    smooth = Draft(
        "snell-sweep[ior=1.5]",
        "Snell's law",
        "snell",
        parameters={"ior": 1.5},
        formula="n_i sin(theta_i) = n_t sin(theta_t)",
    )
    return [
        curve_case(smooth, "internal_angle", "angle inside θₜ [°]", "°", snell(x, 1.5), x, 2e-4),
        lecture_snell(x),
        slab(x, 0.25, 1.5),
        slab(x, 1.0, 1.5),
        slab(x, 1.0, 2.417),
        thin_face(),
        tir(),
        prism(steep),
        fresnel(x),
        ball(root, "checkerboard", size),
        ball(root, "beach", size),
        ball(root, "beach", size, crash="mitsuba"),
    ]


def summary_of(cases: list[CaseRecord], *, exit_code: int = 1) -> Summary:
    checks = [check for case in cases for check in case.checks]
    counts = {v.value: sum(c.status == v for c in checks) for v in Verdict}
    renderers = {
        name: RendererSummary(
            version=VERSIONS[name],
            status="ok",
            cases=len(cases),
            render_s=SECONDS[name] * len(cases),
            facts={
                "probe resolution [units]": {
                    "tracer": 1.1e-16,
                    "povray": 1.2e-6,
                    "mitsuba": 4.8e-6,
                    "mytracer": 3.9e-3,
                }[name],
                "pixel centres": "exact" if name != "mitsuba" else "box filter",
            },
        )
        for name in PRESENT
    }
    renderers[MISSING] = RendererSummary(
        version="",
        status="missing",
        cases=0,
        render_s=0.0,
        reason="Mitsuba was found, but no LLVM ≥ 17 that it could load",
        remedy="sudo apt-get install libllvm19",
    )
    return Summary(
        snellcheck_version="0.1.0",
        started=STARTED,
        wall_s=74.2,
        quality="normal",
        command="snellcheck run --quality normal --out reports/latest",
        exit_code=exit_code,
        renderers=renderers,
        counts=Counts.model_validate(counts),
        cases=[
            SummaryCase(id=c.id, family=c.family, status=c.status, checks=c.checks) for c in cases
        ],
    )


def write_run(root: Path, cases: list[CaseRecord], summary: Summary | None = None) -> Path:
    for case in cases:
        stem = page_name(case.id).removesuffix(".html")
        records.write(case, root / "records" / f"{stem}.json")
    records.write(summary or summary_of(cases), root / "summary.json")
    return root


def make_run(root: Path, size: int = 96) -> Path:
    """Writes the run into `root`, without a report. Returns `root`."""
    return write_run(root, [draft.finished() for draft in drafts(root, size)])
