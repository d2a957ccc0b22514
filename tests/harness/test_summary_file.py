"""`summary.json` read case by case is what it is read as a whole."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from harness import record, summary_file
from harness.errors import InputError
from harness.summary_file import SummaryFile
from tests.harness.report_fixture import make_run


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("run")) / "summary.json"


def assert_same(path: Path) -> None:
    expected = record.read_summary(path)
    file = SummaryFile(path)
    head = expected.model_copy(update={"cases": []})
    cases = [case.model_dump_json() for case in expected.cases]  # as text, since NaN equals nothing
    assert file.head.model_dump_json() == head.model_dump_json()
    assert [case.model_dump_json() for case in file.cases()] == cases
    assert [file.case(span).model_dump_json() for span in reversed(file.spans)] == cases[::-1]


@pytest.mark.parametrize("piece", [1, 7, 1000, 1 << 16])
def test_cases_are_the_same_wherever_pieces_end(
    whole: Path, piece: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(summary_file, "PIECE", piece)
    assert_same(whole)


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.randoms(use_true_random=False), st.sampled_from([None, 0, 3]), st.text(), st.booleans())
def test_order_of_keys_spaces_and_letters_do_not_matter(
    whole: Path, tmp_path: Path, random: object, indent: int | None, text: str, plain: bool
) -> None:
    document = json.loads(whole.read_text("utf-8"))
    document["cases"][0]["checks"][0]["reason"] = text + '"]},{["cases":'
    pairs = list(document.items())
    random.shuffle(pairs)  # type: ignore[attr-defined]
    path = tmp_path / "summary.json"
    path.write_text(json.dumps(dict(pairs), indent=indent, ensure_ascii=plain), "utf-8")
    try:
        record.read_summary(path)
    except InputError:  # a text that is no Unicode
        with pytest.raises(InputError):
            list(SummaryFile(path).cases())
        return
    assert_same(path)


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("cut", lambda text: text[: len(text) // 2]),
        ("empty", lambda text: ""),
        ("list", lambda text: "[]"),
        ("no cases", lambda text: text.replace('"cases": [', '"cases": null, "x": [', 1)),
        ("cases are a number", lambda text: '{"cases": 12}'),
        ("deep", lambda text: '{"cases": ' + "[" * 100_000),
        ("wrong verdict", lambda text: text.replace('"status": "pass"', '"status": "fine"', 1)),
        ("more after it", lambda text: text + "}"),
        ("not UTF-8", lambda text: text.replace("a", "\udcff", 20)),
    ],
)
def test_what_is_wrong_is_told_as_it_is_of_the_whole(
    whole: Path, tmp_path: Path, name: str, damage: object
) -> None:
    path = tmp_path / "summary.json"
    text = damage(whole.read_text("utf-8"))  # type: ignore[operator]
    path.write_text(text, "utf-8", errors="surrogateescape")
    with pytest.raises(InputError) as expected:
        record.read_summary(path)
    with pytest.raises(InputError) as found:
        list(SummaryFile(path).cases())
    assert str(found.value) == str(expected.value)


def test_a_file_that_is_not_there_is_told() -> None:
    with pytest.raises(InputError, match="cannot be read"):
        SummaryFile(Path("nowhere/summary.json"))
