"""A suite in parts: every machine divides it alike, and only a whole can be put together."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness import record
from harness.archive import folder_name
from harness.cli.shards import divided
from harness.errors import InputError, RendererMissing
from harness.record import CaseRecord, Summary, Verdict
from harness.renderers.base import Renderer
from harness.run import run
from harness.running.merge import merge
from harness.running.shard import Shard, ShardNote, divide, read_times, write_note
from tests.fakes.student import student
from tests.harness.test_run import Absent
from tests.harness.tiny import checks_of, prepared

COSTS = st.dictionaries(st.text("abcdef", min_size=1, max_size=4), st.floats(0, 1e4), min_size=1)


@pytest.mark.parametrize("text", ["", "1", "0/3", "4/3", "-1/3", "1/0", "a/b", "1/3/5", "1.0/3"])
def test_what_is_no_shard(text: str) -> None:
    with pytest.raises(InputError, match="i/n with 1 <= i <= n"):
        Shard.parse(text)


def test_a_shard() -> None:
    assert Shard.parse(" 2/3 ") == Shard(2, 3)
    assert str(Shard(2, 3)) == "2/3"


@given(COSTS, st.integers(1, 6))
def test_every_case_is_in_one_shard_and_none_does_much_more_than_its_part(
    costs: dict[str, float], count: int
) -> None:
    cases = list(costs)
    shards = divide(cases, costs, count)
    assert len(shards) == count
    assert sorted(case for shard in shards for case in shard) == sorted(cases)
    for shard in shards:
        assert shard == [case for case in cases if case in shard]
    # Graham 1969: LPT is at most 4/3 - 1/(3n) of the best, which is at least this.
    best = max(sum(costs.values()) / count, *costs.values(), 0.0)
    longest = max(sum(costs[case] for case in shard) for shard in shards)
    assert longest <= sum(costs.values()) / count + max(costs.values()) * (1 + 1e-9)
    if len(cases) <= count:
        assert longest == pytest.approx(best)


def test_the_division_does_not_depend_on_the_order_of_the_times() -> None:
    cases = ["a", "b", "c", "d", "e"]
    times = {"a": 5.0, "b": 3.0, "c": 3.0, "x": 9.0}
    backwards = dict(reversed(times.items()))
    assert divide(cases, times, 2) == divide(cases, backwards, 2)
    assert divide(cases, {"a": 10.0}, 2) != divide(cases, {"e": 100.0, "a": 1.0}, 2)


@pytest.mark.parametrize("content", ["", "[]", "{", '{"a": "x"}', '{"a": [1]}'])
def test_what_are_no_times(content: str, tmp_path: Path) -> None:
    (tmp_path / "times.json").write_text(content)
    with pytest.raises(InputError, match=r"times\.json"):
        read_times(tmp_path / "times.json")


def test_times_that_are_not_there_or_no_numbers(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_times(tmp_path / "none.json")
    (tmp_path / "times.json").write_text('{"a": 1.5, "b": -1}')
    assert read_times(tmp_path / "times.json") == {"a": 1.5}


# --- whole suites ---------------------------------------------------------------------------------


def shards(
    folder: Path, count: int, *renderers: Renderer, times: Path | None = None, settings: str = ""
) -> list[Path]:
    """A run of the tiny suite in `count` shards."""
    folders = []
    for index in range(1, count + 1):
        out = folder / f"shard-{index}"
        chosen = list(renderers) or [student(), student(name="other")]
        names = [one.name for one in chosen]
        cases, note = divided(f"{index}/{count}", prepared(), names, settings, times, folder)
        run(cases, chosen, student(name="helper"), out)
        write_note(out, note)
        folders.append(out)
    return folders


def timeless(path: Path) -> list[CaseRecord]:
    found = [record.read_case(file) for file in sorted((path / "records").glob("*.json"))]
    return [
        one.model_copy(
            update={
                "started": "", "wall_s": 0.0,
                "runs": [r.model_copy(update={"render_s": 0.0}) for r in one.runs],
            }
        )
        for one in found
    ]  # fmt: skip


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Summary]:
    out = tmp_path_factory.mktemp("whole")
    return out, run(prepared(), [student(), student(name="other")], student(name="helper"), out)


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return shards(tmp_path_factory.mktemp("three"), 3)


def test_shards_make_the_run_that_they_are_parts_of(
    whole: tuple[Path, Summary], three: list[Path], tmp_path: Path
) -> None:
    out, summary = whole
    merged = merge([three[2], three[0], three[1]], tmp_path, prepared(), "snellcheck merge")
    assert record.read_summary(tmp_path / "summary.json") == merged
    assert merged.cases == summary.cases
    assert merged.counts == summary.counts
    assert merged.exit_code == summary.exit_code == 0
    assert {n: r.cases for n, r in merged.renderers.items()} == {
        n: r.cases for n, r in summary.renderers.items()
    }
    assert merged.effort.rendered == summary.effort.rendered
    assert timeless(tmp_path) == timeless(out)
    assert set(read_times(tmp_path / "times.json")) == {case.id for case in summary.cases}
    for path in out.rglob("*.webp"):
        assert (tmp_path / path.relative_to(out)).read_bytes() == path.read_bytes()


def refused(folders: list[Path], out: Path) -> str:
    with pytest.raises(InputError) as caught:
        merge(folders, out, prepared())
    assert not list(out.rglob("*"))
    return str(caught.value)


def copies(three: list[Path], folder: Path) -> list[Path]:
    return [shutil.copytree(shard, folder / shard.name) for shard in three]


def test_a_missing_shard_is_refused(three: list[Path], tmp_path: Path) -> None:
    assert "shard 2/3 is missing" in refused([three[0], three[2]], tmp_path)
    assert "no shard to merge" in refused([], tmp_path)


def test_a_shard_that_is_there_twice_is_refused(three: list[Path], tmp_path: Path) -> None:
    said = refused([*three, three[1]], tmp_path)
    assert "shard 2/3 is there twice" in said
    assert "missing" not in said


def test_a_run_that_is_no_shard_is_refused(
    whole: tuple[Path, Summary], three: list[Path], tmp_path: Path
) -> None:
    assert "expected the folder of a run with --shard" in refused([*three[:2], whole[0]], tmp_path)


def test_shards_of_other_settings_or_another_division_are_refused(
    three: list[Path], tmp_path: Path
) -> None:
    other = shards(tmp_path / "other", 3, settings="other")
    out = tmp_path / "out"
    assert "of another suite" in refused([*three[:2], other[2]], out)
    times = tmp_path / "times.json"
    times.write_text('{"snell-sweep": 100}')
    others = shards(tmp_path / "times", 3, times=times)
    assert "of another suite" in refused([*three[:2], others[2]], out)
    two = shards(tmp_path / "two", 2)
    assert "of another suite" in refused([three[0], two[1]], out)


def test_other_renderers_are_refused(three: list[Path], tmp_path: Path) -> None:
    folders = copies(three, tmp_path / "copy")
    summary = record.read_summary(folders[1] / "summary.json")
    changed = summary.renderers["other"].model_copy(update={"version": "2.0"})
    renderers = {**summary.renderers, "other": changed}
    record.write(
        summary.model_copy(update={"renderers": renderers}), folders[1] / "summary.json"
    )  # fmt: skip
    said = refused(folders, tmp_path / "out")
    assert "another other; got 2.0 (ok); expected 1.0 (ok)" in said


def test_an_interrupted_shard_is_refused(three: list[Path], tmp_path: Path) -> None:
    folders = copies(three, tmp_path / "copy")
    summary = record.read_summary(folders[1] / "summary.json")
    record.write(summary.model_copy(update={"interrupted": True}), folders[1] / "summary.json")
    assert "this shard was interrupted" in refused(folders, tmp_path / "out")


@pytest.mark.parametrize("damage", ["removed", "cut", "another case"])
def test_a_shard_that_is_not_whole_is_refused(
    damage: str, three: list[Path], tmp_path: Path
) -> None:
    folders = copies(three, tmp_path / "copy")
    case = record.read_summary(folders[1] / "summary.json").cases[0]
    file = folders[1] / "records" / f"{folder_name(case.id)}.json"
    if damage == "removed":
        file.unlink()
    elif damage == "cut":
        file.write_text(file.read_text()[:100])
    else:
        file.write_bytes(next(p for p in file.parent.glob("*.json") if p != file).read_bytes())
    assert refused(folders, tmp_path / "out")


def test_a_note_that_claims_too_little_is_refused(three: list[Path], tmp_path: Path) -> None:
    folders = copies(three, tmp_path / "copy")
    note = ShardNote.model_validate_json((folders[1] / "shard.json").read_text())
    write_note(folders[1], note.model_copy(update={"mine": note.mine[1:]}))
    assert "does not have the cases of its shard" in refused(folders, tmp_path / "out")


def test_the_exit_code_is_that_of_the_whole(tmp_path: Path) -> None:
    absent = Absent(RendererMissing("absent is not here"))
    merged = merge(shards(tmp_path / "a", 3, student(), absent), tmp_path / "out", prepared())
    assert merged.exit_code == 3
    wrong = student(("mu = ior_i / ior_t", "mu = ior_t / ior_i"), name="wrong")
    merged = merge(shards(tmp_path / "b", 3, wrong), tmp_path / "out", prepared())
    assert merged.exit_code == 1
    assert merged.diagnoses
    assert Verdict.FAIL in {check.status for check in checks_of(merged)}


def test_more_shards_than_cases_are_bad_input(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at most 7"):
        divided("1/8", prepared(), [], "", None, tmp_path)
