"""Whole runs with renderers that are right, missing, broken or wrong: nothing bad ends in green."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from harness import imagefile, record
from harness.errors import (
    ImageNotFinite,
    InputError,
    RendererFailed,
    RendererMissing,
    RendererUnsupported,
)
from harness.record import Verdict, worst
from harness.renderers.base import (
    Capability,
    Health,
    Image,
    RayPaths,
    Rays,
    Renderer,
    RenderSettings,
    Status,
)
from harness.renderers.confinement import described
from harness.renderers.registry import create
from harness.report import write_report
from harness.report.links import page_name
from harness.run import Progress, run
from harness.scene.resolved import ResolvedScene
from tests.fakes import FakeRenderer, grey
from tests.fakes.student import CAPABILITIES, student
from tests.harness.tiny import checks_of, prepared, run_tiny

SLABS = ["slab-offset[thickness=0.25]", "slab-offset[thickness=1]"]
Picture = Callable[[ResolvedScene], np.ndarray]


class Given(FakeRenderer):
    """A student whose `picture` is replaced where `when` says so of a scene."""

    def __init__(
        self, picture: Picture, when: Callable[[ResolvedScene], bool], name: str = "odd"
    ) -> None:
        right = student()
        super().__init__(
            name,
            lambda scene: (
                picture(scene) if when(scene) else right.render(scene, RenderSettings()).pixels
            ),
            capabilities=CAPABILITIES,
        )


def in_glass(scene: ResolvedScene) -> bool:
    """Whether it is a case and not the preflight."""
    return bool(scene.solids)


def raising(error: BaseException) -> Picture:
    def picture(_: ResolvedScene) -> np.ndarray:
        raise error

    return picture


class Absent(FakeRenderer):
    """Does not even tell its version."""

    def __init__(self, error: BaseException, name: str = "absent") -> None:
        super().__init__(name)
        self._reason = error

    def version(self) -> str:
        raise self._reason

    def health(self) -> Health:
        return Health(self.name, usable=False, remedy="apt-get install absent")


# --- what is right --------------------------------------------------------------------------------


def test_right_renderers_pass_everything(tmp_path: Path) -> None:
    summary = run_tiny(tmp_path, student(), student(name="other"))
    checks = checks_of(summary)
    assert {check.status for check in checks} == {Verdict.PASS}
    assert summary.exit_code == 0
    # 12 checks against truth by each of the two, and 3 of the two against each other.
    assert len(checks) == 2 * 12 + 3
    assert [case.id for case in summary.cases] == [
        "ball-picture", "fresnel-outside", *SLABS, "snell-sweep", "thin-face-offset", "tir-critical"
    ]  # fmt: skip


def test_the_summary_holds_what_scripts_rely_on(tmp_path: Path) -> None:
    run_tiny(tmp_path, student(), cases=["slab"])
    data = json.loads((tmp_path / "summary.json").read_text())
    assert data["schema"] == "snellcheck-summary/1"
    assert data["wall_s"] > 0
    assert data["started"].endswith("+00:00")
    assert data["snellcheck_version"]
    assert data["confinement"] == described()
    assert data["exit_code"] == 0
    renderer = data["renderers"]["student"]
    assert (renderer["version"], renderer["status"], renderer["cases"]) == ("1.0", "ok", 2)
    assert renderer["render_s"] > 0
    # The student works in this process, so all of the processor time is ours.
    effort = data["effort"]
    assert effort["own_cpu_s"] > 0
    assert effort["own_cpu_s"] > effort["renderers_cpu_s"] >= 0
    assert effort["memory_mb"] > 20  # numpy alone
    assert data["counts"] == {"pass": 6, "fail": 0, "skip": 0, "error": 0, "known": 0}
    assert [case["id"] for case in data["cases"]] == SLABS
    case = data["cases"][0]
    assert (case["family"], case["status"]) == ("slab", "pass")
    keys = {"id", "renderer", "against", "observable", "value", "expected", "tolerance", "unit"}
    for check in case["checks"]:
        assert keys | {"status", "reason"} <= set(check)
        assert check["renderer"] == "student"
        assert check["against"] == "truth"
    assert [c["observable"] for c in case["checks"]] == [
        "slab_offset", "exit_direction", "exit_point"
    ]  # fmt: skip


def test_the_summary_and_the_records_agree(tmp_path: Path) -> None:
    summary = run_tiny(tmp_path, student(), student(name="other"))
    assert record.read_summary(tmp_path / "summary.json") == summary
    records = [record.read_case(path) for path in (tmp_path / "records").iterdir()]
    assert {r.id: r.checks for r in records} == {c.id: c.checks for c in summary.cases}
    for written in records:
        assert written.status == worst([check.status for check in written.checks])
        for run_ in written.runs:
            for image in run_.images:
                for name in (image.path, image.picture, image.thumbnail):
                    assert name is not None
                    assert (tmp_path / name).is_file()
        for path in written.files.values():
            assert (tmp_path / path).is_file()
    verdicts = [check.status for check in checks_of(summary)]
    counts = summary.counts.model_dump(by_alias=True)
    assert counts == {v.value: verdicts.count(v) for v in Verdict}


def test_ids_of_checks_are_unique_within_a_case(tmp_path: Path) -> None:
    for case in run_tiny(tmp_path, student(), student(name="other")).cases:
        ids = [check.id for check in case.checks]
        assert len(ids) == len(set(ids))


def test_progress_reaches_its_total(tmp_path: Path) -> None:
    seen: list[Progress] = []
    run(
        prepared("snell"), [student()], student(name="helper"), tmp_path, report=seen.append
    )  # fmt: skip
    assert seen[-1].done == seen[-1].total > 0
    assert [p.done for p in seen] == sorted(p.done for p in seen)


def test_the_same_run_twice_says_the_same(tmp_path: Path) -> None:
    first, second = (
        run_tiny(tmp_path / name, student(), student(name="other")) for name in ("a", "b")
    )
    assert checks_of(first) == checks_of(second)


# --- what is not there ----------------------------------------------------------------------------


def test_a_missing_renderer_is_skipped_with_the_command_that_installs_it(tmp_path: Path) -> None:
    absent = Absent(RendererMissing("absent is not here: apt-get install absent"))
    summary = run_tiny(tmp_path, student(), absent, cases=["slab", "ball"])
    assert summary.exit_code == 3
    assert {c.status for c in checks_of(summary, "absent")} == {Verdict.SKIP}
    assert len(checks_of(summary, "absent")) == 6 + 3
    assert "apt-get install absent" in checks_of(summary, "absent")[0].reason
    assert {c.status for c in checks_of(summary, "student") if c.against == "truth"} == {
        Verdict.PASS
    }
    of_absent = summary.renderers["absent"]
    assert (of_absent.status, of_absent.cases) == ("missing", 0)
    assert of_absent.remedy == "apt-get install absent"


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (RendererFailed("it does not start", log="Segmentation fault"), "failed"),
        (ZeroDivisionError("by nothing"), "failed"),
        (SystemExit("bye"), "failed"),
    ],
)
def test_a_renderer_that_does_not_start_is_an_error(
    error: BaseException, status: str, tmp_path: Path
) -> None:
    summary = run_tiny(tmp_path, student(), Absent(error), cases=["snell"])
    assert summary.exit_code == 3
    (check,) = checks_of(summary, "absent")
    assert check.status is Verdict.ERROR
    assert str(error) in check.reason
    assert summary.renderers["absent"].status == status
    assert {c.status for c in checks_of(summary, "student")} == {Verdict.PASS}


@pytest.mark.parametrize(
    "error", [RendererFailed("it crashed", log="boom\nat line 3"), RuntimeError("oops")]
)
def test_a_renderer_that_crashes_in_its_preflight_is_an_error(
    error: Exception, tmp_path: Path
) -> None:
    odd = FakeRenderer("odd", error=error, capabilities=CAPABILITIES)
    summary = run_tiny(tmp_path, odd, student(), cases=["snell"])
    assert summary.exit_code == 3
    (check,) = checks_of(summary, "odd")
    assert check.status is Verdict.ERROR
    assert str(error) in check.reason
    assert {c.status for c in checks_of(summary, "student")} == {Verdict.PASS}


def test_a_renderer_that_fails_its_preflight_is_one_finding_and_not_many_fails(
    tmp_path: Path,
) -> None:
    mirrored = student(name="odd", shows=lambda pixels: pixels[:, ::-1])
    summary = run_tiny(tmp_path, mirrored, student())
    assert summary.exit_code == 3
    assert {c.status for c in checks_of(summary, "odd")} == {Verdict.ERROR}
    assert summary.renderers["odd"].status == "failed preflight"
    assert "mirrored in x" in summary.renderers["odd"].reason
    assert len(mirrored.rendered) == 2  # the two ramps, and then no more


def test_nothing_to_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no case"):
        run([], [student()], student(name="helper"), tmp_path)
    with pytest.raises(InputError, match="no renderer"):
        run(prepared("snell"), [], student(name="helper"), tmp_path)


def test_two_renderers_of_one_name_are_refused(tmp_path: Path) -> None:
    """Their checks could not be told apart."""
    with pytest.raises(InputError, match="two renderers") as caught:
        run_tiny(tmp_path, student(), student(), cases=["snell"])
    assert "student" in str(caught.value)


def test_a_run_without_a_single_check_fails(tmp_path: Path) -> None:
    scenes = tmp_path / "scenes" / "slab"
    scenes.mkdir(parents=True)
    text = (Path(prepared("snell")[0].loaded.file)).read_text()
    (scenes / "none.toml").write_text(text + 'renderers = ["povray"]\n')
    cases = prepared(root=scenes.parent)
    summary = run(cases, [student()], student(name="helper"), tmp_path / "out")
    assert checks_of(summary) == []
    assert summary.exit_code == 1
    assert summary.cases[0].status is Verdict.ERROR
    # Beside a case that passes, too, it is not green.
    both = [*cases, *prepared("slab")]
    assert run(both, [student()], student(name="helper"), tmp_path / "out").exit_code != 0


def test_what_is_all_skipped_has_not_run(tmp_path: Path) -> None:
    """A renderer that claims nothing of what is asked shows nothing."""
    modest = FakeRenderer(
        "odd", Given(raising(RendererUnsupported("no glass here")), in_glass)._picture,
        capabilities=CAPABILITIES,
    )  # fmt: skip
    summary = run_tiny(tmp_path, modest, cases=["snell"])
    (check,) = checks_of(summary)
    assert (check.status, check.reason) == (Verdict.SKIP, "no glass here")
    assert summary.exit_code == 3
    # Beside what passes, what a renderer does not claim is no failure.
    assert run_tiny(tmp_path, modest, student(), cases=["snell"]).exit_code == 0


# --- what breaks on the way -----------------------------------------------------------------------


def thick(scene: ResolvedScene) -> bool:
    """Whether it is the slab of thickness 1."""
    return in_glass(scene) and scene.solids[0].shape.planes != thin_slab_planes()  # type: ignore[union-attr]


def thin_slab_planes() -> tuple[tuple[float, float, float, float], ...]:
    return prepared(SLABS[0])[0].scene.solids[0].shape.planes  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "error",
    [
        RendererFailed("it ran out of memory", log="line 1\nstd::bad_alloc"),
        MemoryError("all of it"),
        ValueError("not mine"),
        SystemExit("bye"),
    ],
)
def test_what_crashes_in_one_case_costs_that_case(error: BaseException, tmp_path: Path) -> None:
    summary = run_tiny(tmp_path, Given(raising(error), thick), student(), cases=["slab"])
    assert summary.exit_code == 3
    by_case = {case.id: case for case in summary.cases}
    assert by_case[SLABS[0]].status is Verdict.PASS
    broken = [c for c in by_case[SLABS[1]].checks if c.renderer == "odd"]
    assert {c.status for c in broken} == {Verdict.ERROR}
    assert str(error) in broken[0].reason
    others = [c for c in by_case[SLABS[1]].checks if c.renderer == "student"]
    assert {c.status for c in others} == {Verdict.PASS}
    (written,) = [
        r
        for r in map(record.read_case, (tmp_path / "records").iterdir())
        if r.id == SLABS[1]
    ]  # fmt: skip
    odd = next(r for r in written.runs if r.name == "odd")
    assert odd.status is Verdict.ERROR
    if isinstance(error, RendererFailed):
        assert odd.log_tail == "line 1\nstd::bad_alloc"


def test_a_picture_that_is_not_finite_can_still_be_looked_at(tmp_path: Path) -> None:
    seen = np.full((48, 48, 3), 0.5, np.float32)
    seen[3, 5] = np.nan
    error = ImageNotFinite([3 * 48 + 5], width=48, image=seen)
    run_tiny(tmp_path, Given(raising(error), in_glass), student(), cases=["ball"])
    (written,) = map(record.read_case, (tmp_path / "records").iterdir())
    odd = next(r for r in written.runs if r.name == "odd")
    assert odd.status is Verdict.ERROR
    (kept,) = odd.images
    pixels, info = imagefile.read(tmp_path / kept.path)
    assert info.nonfinite == 1
    assert np.isnan(pixels[3, 5]).all()
    assert kept.mean == []


def test_a_fail_outweighs_what_could_not_run(tmp_path: Path) -> None:
    wrong = student(("mu = ior_i / ior_t", "mu = ior_t / ior_i"), name="wrong")
    absent = Absent(RendererMissing("not here"))
    summary = run_tiny(tmp_path, wrong, absent, student(), cases=["snell"])
    assert {c.status for c in checks_of(summary, "wrong")} == {Verdict.FAIL}
    assert summary.exit_code == 1


@pytest.mark.parametrize("case", ["snell", "slab", "fresnel", "tir", "ball", "thin-face"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
def test_not_a_number_and_black_never_pass(case: str, value: float, tmp_path: Path) -> None:
    def picture(scene: ResolvedScene) -> np.ndarray:
        return np.full((scene.film.height, scene.film.width, 3), value)

    summary = run_tiny(tmp_path, Given(picture, in_glass), student(), cases=[case])
    odd = [c for c in checks_of(summary) if "odd" in (c.renderer, c.against)]
    assert odd
    assert {c.status for c in odd} <= {Verdict.FAIL, Verdict.ERROR}
    assert summary.exit_code in (1, 3)
    assert all(c.reason for c in odd)


def test_one_pixel_that_is_not_a_number_is_enough(tmp_path: Path) -> None:
    right = student()

    def picture(scene: ResolvedScene) -> np.ndarray:
        pixels = right.render(scene, RenderSettings()).pixels.copy()
        pixels[0, 3] = np.nan
        return pixels

    summary = run_tiny(tmp_path, Given(picture, in_glass), student())
    odd = [c for c in checks_of(summary) if "odd" in (c.renderer, c.against)]
    assert {c.status for c in odd} <= {Verdict.FAIL, Verdict.ERROR}
    assert len(odd) == 12 + 3


@pytest.mark.parametrize("case", ["snell", "fresnel", "ball"])
def test_an_image_of_the_wrong_size_is_an_error(case: str, tmp_path: Path) -> None:
    right = student()

    def picture(scene: ResolvedScene) -> np.ndarray:
        return right.render(scene, RenderSettings()).pixels[:, :-1]

    summary = run_tiny(tmp_path, Given(picture, in_glass), student(), cases=[case])
    odd = checks_of(summary, "odd")
    assert odd
    assert {c.status for c in odd} == {Verdict.ERROR}
    assert "no image of the film's size" in odd[0].reason


def test_the_image_of_another_case_fails(tmp_path: Path) -> None:
    """As a cache would deliver it whose key forgets the geometry."""
    right = student()
    kept: list[np.ndarray] = []
    asked = iter(range(100))

    def picture(scene: ResolvedScene) -> np.ndarray:
        """Of both cases the same number of images is asked for, in the same order."""
        index = next(asked)
        if index < per_case:
            kept.append(right.render(scene, RenderSettings()).pixels)
        return kept[index % per_case]

    counted = student()
    run_tiny(tmp_path / "counted", counted, cases=[SLABS[0]])
    per_case = sum(in_glass(scene) for scene, _ in counted.rendered)
    summary = run_tiny(tmp_path, Given(picture, in_glass), cases=["slab"])
    by_case = {case.id: case.status for case in summary.cases}
    assert by_case == {SLABS[0]: Verdict.PASS, SLABS[1]: Verdict.FAIL}
    assert summary.exit_code == 1


def test_the_preflight_does_not_vouch_for_the_cases(tmp_path: Path) -> None:
    """An image that is right without glass and without refraction with it."""
    right = student()

    def picture(scene: ResolvedScene) -> np.ndarray:
        bare = scene.model_copy(update={"solids": ()})
        return right.render(bare, RenderSettings()).pixels

    summary = run_tiny(tmp_path, Given(picture, in_glass), cases=["snell", "slab", "thin-face"])
    assert {case.status for case in summary.cases} == {Verdict.FAIL}
    passed = {c.observable for c in checks_of(summary) if c.status is Verdict.PASS}
    assert passed == {"exit_direction"}  # which a slab does not change


# --- the helper -----------------------------------------------------------------------------------


def test_without_its_helper_only_pictures_cannot_be_judged(tmp_path: Path) -> None:
    broken = FakeRenderer("helper", error=RendererFailed("no compiler"), capabilities=CAPABILITIES)
    summary = run_tiny(
        tmp_path, student(), student(name="other"), cases=["ball", "snell"], helper=broken
    )
    assert {c.status for c in checks_of(summary) if c.against == "truth"} == {Verdict.PASS}
    pictures = [c for c in checks_of(summary) if c.against != "truth"]
    assert {c.status for c in pictures} == {Verdict.ERROR}
    assert "helper" in pictures[0].reason
    assert summary.exit_code == 3


def test_a_helper_that_is_not_asked_for_is_not_judged(tmp_path: Path) -> None:
    summary = run_tiny(tmp_path, student(), cases=["snell"])
    assert set(summary.renderers) == {"student"}


# --- renderers with a ray API ---------------------------------------------------------------------


class Tracing(FakeRenderer):
    """A student with a ray API that answers as `answer` says."""

    def __init__(self, answer: Callable[[int], RayPaths]) -> None:
        right = student()
        super().__init__(
            "odd", lambda scene: right.render(scene, RenderSettings()).pixels,
            capabilities=CAPABILITIES | {Capability.RAYS},
        )  # fmt: skip
        self._answer = answer

    def trace(
        self, scene: ResolvedScene, rays: Rays, path: str, settings: RenderSettings
    ) -> RayPaths:
        return self._answer(len(rays.origins))


def ray_paths(n: int, status: int, point: float = 0.0) -> RayPaths:
    return RayPaths(
        status=np.full(n, status, np.int8), surface=np.zeros(n, np.int32),
        point=np.full((n, 3), point), direction=np.full((n, 3), point),
        weight=np.ones(n), optical_length=np.ones(n),
    )  # fmt: skip


ANSWERS: dict[str, Callable[[int], RayPaths]] = {
    "none arrived": lambda n: ray_paths(n, Status.MISS),
    "arrived nowhere": lambda n: ray_paths(n, Status.HIT, np.nan),
    "arrived elsewhere": lambda n: ray_paths(n, Status.HIT, 1.0),
    "one too few": lambda n: ray_paths(n - 1, Status.HIT),
    "none at all": lambda n: ray_paths(0, Status.HIT),
    "unheard-of status": lambda n: ray_paths(n, 77),
}


@pytest.mark.parametrize("answer", ANSWERS)
def test_odd_answers_of_a_ray_api_never_pass(answer: str, tmp_path: Path) -> None:
    summary = run_tiny(
        tmp_path, Tracing(ANSWERS[answer]), student(), cases=["snell", "slab", "tir"]
    )
    rays = [c for c in checks_of(summary, "odd") if c.observable != "critical_angle"]
    assert {c.status for c in rays} <= {Verdict.FAIL, Verdict.ERROR}
    assert len(rays) == 1 + 6 + 1
    assert summary.exit_code in (1, 3)
    assert {c.status for c in checks_of(summary, "student")} == {Verdict.PASS}
    if answer in ("one too few", "none at all"):
        assert all("the trace delivered" in c.reason for c in rays)


def test_a_ray_api_that_is_claimed_must_be_there(tmp_path: Path) -> None:
    odd = student(name="odd", capabilities=CAPABILITIES | {Capability.RAYS})
    summary = run_tiny(tmp_path, odd, cases=["snell"])
    (check,) = checks_of(summary)
    assert check.status is Verdict.ERROR
    assert "claims to trace rays but cannot" in check.reason


def test_a_ray_api_that_answers_with_an_image_is_an_error(tmp_path: Path) -> None:
    odd = Tracing(lambda n: Image(np.zeros((1, 1, 3), np.float32)))  # type: ignore[arg-type,return-value]
    (check,) = checks_of(run_tiny(tmp_path, odd, cases=["snell"]))
    assert check.status is Verdict.ERROR


def test_renderers_are_closed(tmp_path: Path) -> None:
    closed = []

    class Closing(FakeRenderer):
        def close(self) -> None:
            closed.append(self.name)

    fakes: list[Renderer] = [Closing("a"), Closing("b")]
    run_tiny(tmp_path, *fakes, cases=["snell"], helper=Closing("helper"))
    assert sorted(closed) == ["a", "b", "helper"]


def test_light_that_was_not_followed_is_recorded_and_shown(tmp_path: Path) -> None:
    """At most what the weight limit lets go at each of the ball's interfaces."""
    tracer = create("tracer")
    run_tiny(tmp_path, tracer, student(), cases=["ball*"], helper=tracer)
    (file,) = (tmp_path / "records").glob("*.json")
    case = record.read_case(file)
    cut = {r.name: [i.cut for i in r.images if i.role == "image"] for r in case.runs}
    (found,) = cut["tracer"]
    limits = prepared("ball*")[0].scene.transport
    assert found is not None
    assert 0 < found < 2 * limits.min_weight * limits.max_depth
    write_report(tmp_path)
    (page,) = tmp_path.rglob(page_name(case.id))
    assert page.read_text("utf-8").count("light not followed") == 1


class Translating(Given):
    """A student that is given scenes in a language of its own, and cannot say some of them."""

    translates = True
    mute = False

    def emit(self, scene: ResolvedScene, folder: Path) -> Path:
        if self.mute:
            raise RendererUnsupported("has no word for it")
        folder.mkdir(parents=True)
        (folder / "parts").mkdir()
        (folder / "parts" / "ball.ply").write_bytes(b"ply\n")
        (folder / "scene.odd").write_text(f"{len(scene.solids)} solids")
        return folder / "scene.odd"


def test_what_renderers_were_given_is_kept_beside_the_record(tmp_path: Path) -> None:
    odd = Translating(grey, lambda _: False)
    run_tiny(tmp_path, odd, student(), cases=["ball*"])
    (path,) = (tmp_path / "records").glob("*.json")
    files = {r.name: r.files for r in record.read_case(path).runs}
    assert files["student"] == {}
    assert set(files["odd"]) == {"scene.odd", "parts/ball.ply"}
    assert (tmp_path / files["odd"]["scene.odd"]).read_text() == "1 solids"
    odd.mute = True
    run_tiny(tmp_path, odd, student(), cases=["ball*"])
    assert {r.name: r.files for r in record.read_case(path).runs} == {"student": {}, "odd": {}}
