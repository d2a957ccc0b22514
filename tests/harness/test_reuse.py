"""Runs that use what earlier ones did: nothing twice, nothing stale, nothing half."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from harness import documents, record
from harness.archive import Archive, folder_name
from harness.cache.cache import Cache, open_cache
from harness.errors import InputError, RendererFailed
from harness.record import CaseRecord, Effort, Summary, Verdict
from harness.renderers.base import Image, RenderSettings
from harness.run import EXIT_INTERRUPTED, UNFINISHED, Progress, run
from harness.running import bundle
from harness.scene.resolved import ResolvedScene
from tests.fakes import FakeRenderer
from tests.fakes.student import CAPABILITIES, student
from tests.harness.tiny import checks_of, prepared

CASES = ["snell", "slab", "ball"]
Report = Callable[[Progress], None]


class Remembered(FakeRenderer):
    """A student with a fingerprint."""

    def __init__(self, name: str = "student", print_: str = "1") -> None:
        right = student()
        super().__init__(
            name, lambda scene: right.render(scene, RenderSettings()).pixels,
            capabilities=CAPABILITIES,
        )  # fmt: skip
        self.print = print_

    def fingerprint(self) -> str | None:
        return self.print


class Forgotten(Remembered):
    """One whose images may change without notice."""

    def fingerprint(self) -> None:
        return None


@pytest.fixture
def cache(tmp_path: Path) -> Cache:
    return open_cache(str(tmp_path / "cache"))


def go(
    out: Path,
    cache: Cache | None,
    *renderers: FakeRenderer,
    cases: Sequence[str] = CASES,
    report: Report = lambda _: None,
) -> tuple[Summary, int]:
    """A run with students unless told otherwise, and how many images all renderers made."""
    chosen = renderers or (Remembered(), Remembered("other"))
    helper = Remembered("helper")
    summary = run(prepared(*cases), chosen, helper, out, cache=cache, report=report)
    return summary, sum(len(one.rendered) for one in (*chosen, helper))


def files(out: Path) -> dict[str, bytes]:
    paths = sorted(p for p in out.rglob("*") if p.is_file() and p.name != "summary.json")
    return {p.relative_to(out).as_posix(): p.read_bytes() for p in paths}


def without_times(written: CaseRecord) -> CaseRecord:
    runs = [r.model_copy(update={"render_s": 0.0}) for r in written.runs]
    return written.model_copy(update={"started": "", "wall_s": 0.0, "runs": runs})


def records(out: Path) -> list[CaseRecord]:
    return [without_times(record.read_case(p)) for p in sorted((out / "records").glob("*.json"))]


def results(effort: Effort) -> Effort:
    """What became of the jobs, without the processor time and memory that they took."""
    costs = {"own_cpu_s": 0.0, "renderers_cpu_s": 0.0, "memory_mb": 0.0}
    return effort.model_copy(update=costs)


# --- unchanged ------------------------------------------------------------------------------------


def test_an_unchanged_run_renders_nothing_and_leaves_the_same(cache: Cache, tmp_path: Path) -> None:
    first, made = go(tmp_path / "a", cache)
    assert made > 0
    assert results(first.effort) == Effort(rendered=first.effort.rendered)
    second, again = go(tmp_path / "b", cache)
    assert again == 0
    assert results(second.effort) == Effort(reused=first.effort.rendered)
    assert second.cases == first.cases
    assert second.counts == first.counts
    assert second.exit_code == first.exit_code == 0
    for name, known in first.renderers.items():
        assert second.renderers[name].cases == known.cases
        assert second.renderers[name].render_s == pytest.approx(known.render_s)
    assert files(tmp_path / "a") == files(tmp_path / "b")


def test_an_unchanged_run_into_the_same_folder_touches_no_file(
    cache: Cache, tmp_path: Path
) -> None:
    go(tmp_path / "a", cache)
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "a").rglob("*.webp")}
    assert before
    go(tmp_path / "a", cache)
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "a").rglob("*.webp")} == before


def test_without_a_cache_everything_is_done_again_and_nothing_is_left_behind(
    tmp_path: Path,
) -> None:
    _, first = go(tmp_path / "a", None)
    _, second = go(tmp_path / "a", None)
    assert first == second > 0
    assert not (tmp_path / "a" / UNFINISHED).exists()


def test_renderers_without_a_fingerprint_are_rendered_anew_in_each_run(
    cache: Cache, tmp_path: Path
) -> None:
    first, forgotten = go(tmp_path / "a", cache, Remembered(), Forgotten("own"))
    own = Forgotten("own")
    second, again = go(tmp_path / "a", cache, Remembered(), own)
    assert len(own.rendered) == again > 0
    assert forgotten > again
    assert checks_of(second) == checks_of(first)


# --- changed --------------------------------------------------------------------------------------


def test_a_changed_scene_is_rendered_and_no_other(cache: Cache, tmp_path: Path) -> None:
    go(tmp_path / "a", cache)
    cases = prepared(*CASES)
    changed = cases[0]
    moved = changed.scene.media[-1].model_copy(update={"ior": 1.4})
    scene = changed.scene.model_copy(update={"media": (*changed.scene.media[:-1], moved)})
    cases[0] = replace(changed, scene=scene)
    own, helper = Remembered(), Remembered("helper")
    summary = run(cases, [own, Remembered("other")], helper, tmp_path / "a", cache=cache)
    assert own.rendered
    assert {scene.media[-1].ior for scene, _ in own.rendered} == {1.4}
    assert summary.effort.reused > 0


def test_a_changed_metric_measures_again_without_rendering(
    cache: Cache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, _ = go(tmp_path / "a", cache)
    monkeypatch.setattr(bundle, "code_digest", lambda *_: "of other code")
    judged: list[str] = []
    write = Archive.write_case

    def counted(self: Archive, case, *args, **more):  # type: ignore[no-untyped-def]
        judged.append(case.loaded.id)
        return write(self, case, *args, **more)

    monkeypatch.setattr(Archive, "write_case", counted)
    second, made = go(tmp_path / "b", cache)
    assert made == 0
    assert sorted(judged) == sorted(case.id for case in second.cases)
    assert checks_of(second) == checks_of(first)
    assert second.effort.reused == first.effort.rendered
    assert records(tmp_path / "a") == records(tmp_path / "b")


def test_a_changed_renderer_is_rendered_and_no_other(cache: Cache, tmp_path: Path) -> None:
    go(tmp_path / "a", cache)
    changed, other = Remembered(print_="2"), Remembered("other")
    go(tmp_path / "a", cache, changed, other)
    assert changed.rendered
    assert not other.rendered


@pytest.mark.parametrize("change", [{"seed": 1}, {"quality": "draft"}])
def test_other_settings_are_another_run(
    change: dict[str, object], cache: Cache, tmp_path: Path
) -> None:
    go(tmp_path / "a", cache)
    own = Remembered()
    run(prepared(*CASES), [own], Remembered("helper"), tmp_path / "a", cache=cache, **change)  # type: ignore[arg-type]
    assert own.rendered


def test_failures_are_not_kept(cache: Cache, tmp_path: Path) -> None:
    class Shaky(Remembered):
        def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
            image = super().render(scene, settings)
            if scene.solids and not mended:
                raise RendererFailed("out of luck")
            return image

    mended = False
    summary, _ = go(tmp_path / "a", cache, Shaky())
    assert {check.status for check in checks_of(summary)} == {Verdict.ERROR}
    mended = True
    summary, made = go(tmp_path / "a", cache, Shaky())
    assert made > 0
    assert {check.status for check in checks_of(summary)} <= {Verdict.PASS, Verdict.SKIP}


# --- damage ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("damage", ["flip", "cut", "swap"])
def test_a_damaged_cache_is_never_used(damage: str, cache: Cache, tmp_path: Path) -> None:
    first, made = go(tmp_path / "a", cache)
    paths = sorted((tmp_path / "cache").rglob("*.entry"))
    contents = [path.read_bytes() for path in paths]
    for k, path in enumerate(paths):
        data = bytearray(contents[k])
        if damage == "flip":
            data[len(data) // 2] ^= 1
        path.write_bytes({"cut": data[:-7], "swap": contents[k - 1]}.get(damage, data))
    second, again = go(tmp_path / "b", open_cache(str(tmp_path / "cache")))
    assert again == made
    # Where a renderer is not known, all get to work without looking for judged cases.
    assert second.effort.damaged == len(paths) - len(first.cases)
    assert checks_of(second) == checks_of(first)
    assert records(tmp_path / "a") == records(tmp_path / "b")


def test_a_damaged_case_is_judged_again_from_its_results(cache: Cache, tmp_path: Path) -> None:
    first, _ = go(tmp_path / "a", cache)
    judged = [p for p in (tmp_path / "cache").rglob("*.entry") if b'"records/' in p.read_bytes()]
    assert len(judged) == len(first.cases)
    for path in judged:
        path.write_bytes(path.read_bytes()[:-1])
    second, again = go(tmp_path / "b", open_cache(str(tmp_path / "cache")))
    assert again == 0
    assert second.effort.damaged == len(judged)
    assert records(tmp_path / "a") == records(tmp_path / "b")


def test_an_entry_cannot_write_outside_the_runs_folder(cache: Cache, tmp_path: Path) -> None:
    (case,) = prepared("snell")
    name = folder_name(case.loaded.id)
    evil = {
        "../evil": b"", "/tmp/evil": b"", f"images/{name}/../../../evil": b"",
        "summary.json": b"", "records/another.json": b"", f"cases/{name}.html": b"",
    }  # fmt: skip
    cache.put("ab" * 32, {"results": 1}, evil)
    (tmp_path / "out").mkdir()
    assert bundle.restore(cache, "ab" * 32, Archive(tmp_path / "out"), case) is None
    assert [p for p in tmp_path.rglob("*") if p.is_file() and "cache" not in p.parts] == []


# --- interruptions --------------------------------------------------------------------------------


def interrupt_after(count: int) -> Report:
    def report(progress: Progress) -> None:
        if progress.done >= count:
            raise KeyboardInterrupt

    return report


@pytest.mark.parametrize("kept", [True, False])
def test_after_ctrl_c_there_is_a_valid_partial_run_that_goes_on(
    kept: bool, cache: Cache, tmp_path: Path
) -> None:
    kind = Remembered if kept else Forgotten
    whole, made = go(tmp_path / "whole", None, kind())
    partial, first = go(tmp_path / "a", cache, kind(), report=interrupt_after(8))
    assert partial.interrupted
    assert partial.exit_code == EXIT_INTERRUPTED
    assert record.read_summary(tmp_path / "a" / "summary.json") == partial
    assert [case.id for case in partial.cases] == [case.id for case in whole.cases]
    reasons = {c.reason for c in checks_of(partial) if c.status is Verdict.ERROR}
    assert reasons == {"the run was interrupted before this was judged"}
    for path in (tmp_path / "a" / "records").glob("*.json"):
        record.read_case(path)
    resumed, rest = go(tmp_path / "a", cache, kind())
    assert checks_of(resumed) == checks_of(whole)
    assert not resumed.interrupted
    assert 0 < rest < made
    # What was under way when Ctrl-C came, one job per renderer, may be done again.
    assert first + rest <= made + 2
    assert not (tmp_path / "a" / UNFINISHED).exists()
    assert records(tmp_path / "a") == records(tmp_path / "whole")


def test_an_interruption_while_renderers_get_ready(tmp_path: Path) -> None:
    summary, _ = go(tmp_path / "a", None, report=interrupt_after(0))
    assert summary.exit_code == EXIT_INTERRUPTED
    assert {check.status for check in checks_of(summary)} == {Verdict.ERROR}


def test_a_second_run_is_kept_out_of_the_folder(tmp_path: Path) -> None:
    seen: list[str] = []

    def second(_: Progress) -> None:
        with pytest.raises(InputError, match="another run is writing") as caught:
            go(tmp_path / "a", None)
        seen.append(str(caught.value))

    go(tmp_path / "a", None, cases=["snell"], report=second)
    assert seen
    go(tmp_path / "a", None, cases=["snell"])


def test_what_a_killed_run_was_writing_is_swept_away(tmp_path: Path) -> None:
    half = tmp_path / "a" / "records" / ".snell.json.abcd1234"
    whole = tmp_path / "a" / ".summary.json.abcd1234"
    mine = tmp_path / "a" / "records" / ".gitignore"
    half.parent.mkdir(parents=True)
    half.write_text("{")
    whole.write_text("{}")
    mine.write_text("*")
    go(tmp_path / "a", None, cases=["snell"])
    assert not half.exists()
    assert not whole.exists()
    assert mine.exists()


# --- a full disk ----------------------------------------------------------------------------------


def test_a_full_disk_is_one_error_and_not_a_failure_of_every_renderer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, data: bytes) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(documents, "write_bytes", full)
    with pytest.raises(OSError, match="No space left"):
        go(tmp_path / "a", None)
    assert not (tmp_path / "a" / "summary.json").exists()


def test_a_renderer_without_room_for_its_files_is_not_to_blame(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Cramped(Remembered):
        def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
            if scene.solids:
                raise RendererFailed("it crashed", log="write: No space left on device")
            return super().render(scene, settings)

    summary, _ = go(tmp_path / "a", None, Cramped())  # it says so, but there is room
    assert {check.status for check in checks_of(summary)} == {Verdict.ERROR}
    monkeypatch.setattr("harness.running.lanes.SPARE_BYTES", 2**62)
    with pytest.raises(OSError, match="No space left"):
        go(tmp_path / "a", None, Cramped())


@pytest.mark.parametrize("calibrates", [False, True])
def test_with_hardly_any_room_nobody_needs_to_say_so(
    calibrates: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Cramped(Remembered):
        def render(self, scene: ResolvedScene, settings: RenderSettings) -> Image:
            if calibrates or scene.solids:
                raise RendererFailed("it crashed", log="24576 requested and 15328 written")
            return super().render(scene, settings)

    monkeypatch.setattr("harness.running.lanes.HARDLY_ANY_BYTES", 2**62)
    with pytest.raises(OSError, match="No space left"):
        go(tmp_path / "a", None, Cramped())
