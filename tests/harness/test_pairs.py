"""Pictures of two renderers against each other: who is compared with whom, and what is seen."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from harness import plan
from harness.errors import RendererFailed, RendererUnsupported
from harness.judging.judge import CaseJudge
from harness.judging.pairs import camera_shift
from harness.judging.results import Contender, Result, Results
from harness.measure.images import box_downsample
from harness.measure.observables import Observable
from harness.measure.pictures import GRAZING, SQUARE, PicturePair, contrast, largest_square
from harness.plan import PreparedCase
from harness.record import Check, Verdict
from harness.renderers.base import Capability, Image, Renderer, RenderSettings
from harness.running.lanes import calibrate, perform
from harness.scene.model import CheckSpec
from harness.scene.resolved import Film, ResolvedScene
from tests.fakes import FakeRenderer
from tests.fakes.student import CAPABILITIES, module, student
from tests.harness.tiny import prepared

SETTINGS = RenderSettings()
HELPER = "helper"
Pixels = np.ndarray


def asking(*specs: CheckSpec) -> PreparedCase:
    """The tiny picture of a ball with other checks."""
    (case,) = prepared("ball")
    model = case.loaded.model.model_copy(update={"checks": specs})
    loaded = type(case.loaded)(
        case.loaded.id, case.loaded.case, case.loaded.file, case.loaded.parameters, model
    )
    return PreparedCase(loaded, case.scene)


def spec(observable: str, against: str = "renderers", **more: object) -> CheckSpec:
    return CheckSpec.model_validate({"observable": observable, "against": against, **more})


def judged(case: PreparedCase, *renderers: Renderer) -> list[Check]:
    """All checks of a run of `case`, in this thread."""
    contenders = [calibrate(renderer, SETTINGS) for renderer in renderers]
    by_role: dict[tuple[str, str], Result] = {}
    for renderer, contender in zip(renderers, contenders, strict=True):
        if contender.preflight is not None:
            jobs = plan.jobs_of(
                case, renderer.name, contender.capabilities, contender.preflight, SETTINGS
            )
            by_role |= {(renderer.name, job.role): perform(renderer, job) for job in jobs}
    helper = student(name=HELPER)
    for job in plan.auxiliary_jobs(case, HELPER, camera_shift(case.scene), True, SETTINGS):
        by_role[HELPER, job.role] = perform(helper, job)
    film = case.scene.film
    results = Results(by_role, film.width, film.height)
    return CaseJudge(case, contenders, results, HELPER).judge().checks


def in_glass(change: Callable[[Pixels], Pixels], name: str = "odd") -> FakeRenderer:
    """A student whose pictures of the ball are changed, and not those of its preflight."""
    render = module().render

    def picture(scene: ResolvedScene) -> Pixels:
        pixels = render(scene.model_dump(mode="json"))
        return change(pixels) if scene.solids else pixels

    return FakeRenderer(name, picture, capabilities=CAPABILITIES)


def verdicts(checks: list[Check]) -> dict[str, str]:
    return {check.id: check.status.value for check in checks}


# --- who is compared with whom --------------------------------------------------------------------


def test_every_pair_is_compared_once() -> None:
    checks = judged(asking(spec("ssim")), *(student(name=n) for n in "abc"))
    assert verdicts(checks) == {"ssim/a/b": "pass", "ssim/a/c": "pass", "ssim/b/c": "pass"}


@pytest.mark.parametrize("against", "abc")
def test_a_named_opponent_is_compared_with_all_others(against: str) -> None:
    """Named "a" the way it would be registered; here any name of the run will do."""
    checks = judged(asking(spec("ssim", against)), *(student(name=n) for n in "abc"))
    others = set("abc") - {against}
    assert verdicts(checks) == {f"ssim/{other}/{against}": "pass" for other in others}


def test_an_opponent_that_is_not_there_leaves_nothing_uncounted() -> None:
    checks = judged(asking(spec("ssim", "c")), *(student(name=n) for n in "ab"))
    assert verdicts(checks) == {"ssim/a/c": "skip", "ssim/b/c": "skip"}
    assert "c" in checks[0].reason


def test_an_opponent_that_crashed_leaves_nothing_uncounted() -> None:
    def crash(_: Pixels) -> Pixels:
        raise RendererFailed("boom")

    checks = judged(asking(spec("ssim", "c")), student(name="a"), in_glass(crash, "c"))
    assert {(c.renderer, c.status) for c in checks} == {
        ("a", Verdict.SKIP), ("c", Verdict.ERROR)
    }  # fmt: skip


def test_an_opponent_need_not_be_among_those_that_the_check_is_for() -> None:
    only = spec("ssim", "c", renderers=("a",))
    checks = judged(asking(only), *(student(name=n) for n in "abc"))
    assert verdicts(checks) == {"ssim/a/c": "pass"}


def test_one_renderer_alone_is_a_skip_with_its_reason() -> None:
    (check,) = judged(asking(spec("rmse")), student())
    assert check.status is Verdict.SKIP
    assert "no other renderer" in check.reason


def test_a_renderer_that_does_not_deliver_is_named_and_the_others_stand() -> None:
    def refuse(_: Pixels) -> Pixels:
        raise RendererUnsupported("no balls here")

    checks = judged(
        asking(spec("rmse")), student(name="a"), in_glass(refuse, "b"), student(name="c")
    )
    assert verdicts(checks) == {"rmse/a/c": "pass", "rmse/b/renderers": "skip"}


# --- what is seen ---------------------------------------------------------------------------------


def changed(x: int, y: int, by: float) -> Callable[[Pixels], Pixels]:
    def change(pixels: Pixels) -> Pixels:
        pixels = pixels.copy()
        pixels[y, x, 1] += by
        return pixels

    return change


def test_one_pixel_that_is_off_is_found_and_named() -> None:
    case = asking(spec("max_difference"), spec("rmse"), spec("ssim"))
    checks = {c.observable: c for c in judged(case, in_glass(changed(12, 11, 1e-3)), student())}
    worst = checks["max_difference"]
    assert worst.status is Verdict.FAIL
    assert (worst.detail["worst_pixel_x"], worst.detail["worst_pixel_y"]) == (12, 11)
    assert worst.value == pytest.approx(1e-3, rel=1e-3)
    # The means hardly notice: RMSE is 1e-3 / sqrt(3 * 576) = 2.4e-5.
    assert checks["rmse"].value == pytest.approx(1e-3 / np.sqrt(3 * 576), rel=1e-3)


def test_a_pixel_that_is_off_by_a_rounding_passes() -> None:
    checks = judged(
        asking(spec("max_difference"), spec("rmse"), spec("ssim")),
        in_glass(changed(12, 11, 5e-8)), student(),
    )  # fmt: skip
    assert {c.status for c in checks} == {Verdict.PASS}


@pytest.mark.parametrize("observable", ["ssim", "rmse", "max_difference", "p999_difference"])
@pytest.mark.parametrize(
    "change",
    [
        lambda p: p[:, ::-1],
        lambda p: p[::-1],
        lambda p: p * 0.98,
        lambda p: np.roll(p, 1, axis=1),
        np.zeros_like,
    ],
    ids=["mirrored", "upside down", "darker", "shifted", "black"],
)
def test_pictures_that_differ_fail(observable: str, change: Callable[[Pixels], Pixels]) -> None:
    (check,) = judged(asking(spec(observable)), in_glass(change), student())
    # SSIM asks for structure: a picture 2% darker costs it less than a tenth of a percent.
    dim = observable == "ssim" and np.allclose(change(np.ones((2, 2, 3))), 0.98)
    if not dim:
        assert check.status is Verdict.FAIL


@pytest.mark.parametrize(
    ("observable", "ior"),
    [("max_difference", 1.501), ("rmse", 1.52), ("ssim", 1.55), ("delta_e", 1.52)],
)
def test_another_index_of_refraction_shows(observable: str, ior: float) -> None:
    """The pixel that oversteps its own tolerance by most sees more than any mean."""

    def denser(scene: ResolvedScene) -> ResolvedScene:
        glass = scene.media[-1].model_copy(update={"ior": ior})
        return scene.model_copy(update={"media": (*scene.media[:-1], glass)})

    (check,) = judged(asking(spec(observable)), student(name="odd", sees=denser), student())
    assert check.status is Verdict.FAIL


def test_two_black_pictures_are_no_agreement_in_structure() -> None:
    (check,) = judged(
        asking(spec("ssim")), in_glass(np.zeros_like, "a"), in_glass(np.zeros_like, "b")
    )
    assert check.status in (Verdict.FAIL, Verdict.ERROR)


# --- pixels that graze an edge --------------------------------------------------------------------


def pair(grazing: Pixels, wrong: Pixels, size: int = 20) -> PicturePair:
    ramp = np.linspace(0.2, 0.8, size * size * 3).reshape(size, size, 3).astype(np.float32)
    other = ramp + np.float32(0.1) * wrong[..., None].astype(np.float32)
    around = np.full((size, size), 0.2)
    return PicturePair(ramp, other, np.full((size, size), 1e-6), grazing, around)


@pytest.mark.parametrize("count", [0, 1, 19])
def test_what_grazes_an_edge_is_counted_and_left_out(count: int) -> None:
    grazing = np.zeros((20, 20), bool)
    grazing.flat[:count] = True
    found = pair(grazing, grazing).compare(Observable.MAX_DIFFERENCE)
    assert found.within
    assert not found.fault
    assert found.detail["grazing_pixels"] == count
    if count:
        assert found.detail["max_at_grazing"] == pytest.approx(0.1, rel=1e-5)
    beside = np.zeros((20, 20), bool)
    beside.flat[count] = True
    assert not pair(grazing, beside).compare(Observable.MAX_DIFFERENCE).within


@pytest.mark.parametrize(
    "observable", [Observable.SSIM, Observable.RMSE, Observable.MAX_DIFFERENCE]
)
def test_a_square_of_nothing_but_edges_is_a_fault(observable: Observable) -> None:
    """Wherever it lies; a pixel within it that is compared lifts that."""
    grazing, right = np.zeros((20, 20), bool), np.zeros((20, 20), bool)
    grazing[6 : 6 + SQUARE, 13 : 13 + SQUARE] = True
    assert "a square of 4 x 4" in pair(grazing, right).compare(observable).fault
    grazing[7, 14] = False
    assert pair(grazing, right).compare(observable).fault == ""


def test_a_pixel_at_an_edge_may_show_what_is_around_it_and_nothing_else() -> None:
    grazing = np.zeros((20, 20), bool)
    grazing[3, 5] = True
    seen = pair(grazing, 2 * grazing.astype(float)).compare(Observable.MAX_DIFFERENCE)
    assert seen.fault == ""
    odd = pair(grazing, 2.1 * grazing.astype(float)).compare(Observable.MAX_DIFFERENCE)
    assert odd.fault.startswith("at (5, 3), which grazes an edge, they differ by 0.21")


def test_contrast_is_that_of_neighbours_in_any_picture() -> None:
    flat = np.zeros((5, 6, 3), np.float32)
    bright = flat.copy()
    bright[2, 2, 1] = 0.7
    found = contrast([flat, bright])
    assert found.shape == (5, 6, 3)
    assert found[1:4, 1:4, 1] == pytest.approx(0.7)
    assert found.sum() == pytest.approx(9 * 0.7)


@pytest.mark.parametrize("side", [0, 1, 2, 3, 5])
def test_the_largest_square_of_a_mask(side: int) -> None:
    mask = np.random.default_rng(side).random((9, 8)) < 0.0
    mask[8 - side : 8, 3 : 3 + side] = True
    mask[0, ::2] = side > 0
    assert largest_square(mask) == side
    assert largest_square(np.ones((3, 4), bool)) == 3


def test_the_share_of_grazing_pixels_is_that_of_the_true_picture() -> None:
    """A renderer whose own picture is all edges does not get them left out."""
    chequered = np.indices((24, 24)).sum(axis=0)[..., None] % 2 * np.ones(3)
    (check,) = judged(asking(spec("max_difference")), in_glass(lambda _: chequered), student())
    assert check.status is Verdict.FAIL
    assert check.detail["grazing_share"] < 0.1
    assert GRAZING == 1e-3


# --- renderers that sample ------------------------------------------------------------------------


class Sampling(FakeRenderer):
    """Averages over pixel areas, with noise that depends on the seed; `bias` multiplies it all.

    Its position codes are sampled at pixel centres, as a sampling renderer's must be.
    """

    def __init__(self, bias: float = 1.0, noise: float = 0.02) -> None:
        super().__init__("noisy", capabilities=CAPABILITIES - {Capability.PIXEL_CENTRES})
        self._bias, self._noise = bias, noise

    def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
        render = module().render
        if not scene.solids:
            return Image(render(scene.model_dump(mode="json")).astype(np.float32))
        film = Film(width=8 * scene.film.width, height=8 * scene.film.height)
        fine = render(scene.model_copy(update={"film": film}).model_dump(mode="json"))
        rng = np.random.default_rng(settings.seed)
        mean = self._bias * box_downsample(fine, 8)
        return Image((mean + rng.normal(0, self._noise, mean.shape)).astype(np.float32))


def test_a_sampling_renderer_is_judged_by_its_own_noise() -> None:
    checks = judged(asking(spec("ssim"), spec("rmse")), Sampling(), student())
    noisy = [c for c in checks if c.renderer == "noisy"]
    assert {c.id: c.status for c in noisy} == {
        "ssim/noisy/helper": Verdict.PASS, "rmse/noisy/helper": Verdict.PASS
    }  # fmt: skip
    rmse = next(c for c in noisy if c.observable == "rmse")
    assert rmse.value == pytest.approx(0.02, rel=0.05)
    assert rmse.detail["own_sampling_rmse"] == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize("bias", [1.05])
def test_a_bias_that_noise_cannot_explain_fails(bias: float) -> None:
    checks = judged(asking(spec("rmse")), Sampling(bias, noise=0.01), student())
    assert {c.status for c in checks if c.renderer == "noisy"} == {Verdict.FAIL}


def test_the_same_picture_for_both_seeds_hides_no_noise() -> None:
    """A renderer that ignores the seed shows no sampling error of its own, and none is allowed."""

    class Stubborn(Sampling):
        def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
            return super().render(scene, RenderSettings())

    checks = judged(asking(spec("rmse"), spec("ssim")), Stubborn(noise=0.05), student())
    assert {c.status for c in checks if c.renderer == "noisy"} == {Verdict.FAIL}


def test_contenders_say_who_they_are(tmp_path: Path) -> None:
    contender = calibrate(student(), SETTINGS)
    assert isinstance(contender, Contender)
    assert (contender.name, contender.version, contender.absent) == ("student", "1.0", None)
