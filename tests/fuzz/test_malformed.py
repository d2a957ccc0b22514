"""Malformed files of every kind: 1,350 in each test run, 27,000 by `make fuzz`."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.errors import InputError, Problem
from harness.scene.load import load_cases
from harness.scene.schema import case_schema
from tests.fuzz.campaign import Outcome, campaign, in_child
from tests.fuzz.mutation import MUTATIONS, mutate
from tests.fuzz.targets import Kind, kinds
from tests.stress import figures

# By kind of file: in a test run, and by `make fuzz`.
COUNTS = {
    "scene": (450, 9000), "mesh (OBJ)": (120, 2500), "mesh (PLY)": (120, 2500),
    "mesh (STL)": (110, 2000), "baseline": (150, 3000), "record": (150, 3000),
    "summary": (100, 2000), "choices": (50, 1000), "renderer config": (100, 2000),
}  # fmt: skip
SEED = 7


@pytest.mark.slow
@pytest.mark.parametrize("names", [["scene"], [name for name in COUNTS if name != "scene"]])
def test_malformed_files_are_refused_with_a_message(names: list[str], tmp_path: Path) -> None:
    counts = {name: figures.count(*COUNTS[name]) for name in names}
    outcomes = in_child(counts, SEED, tmp_path, timeout=3600)
    assert [fault for outcome in outcomes for fault in outcome.faults] == []
    for outcome in outcomes:
        assert outcome.read == counts[outcome.kind]
        assert outcome.refused > outcome.read / 2  # else the mutations do nothing
        said = (
            f"{outcome.refused:,} refused with file and place, {outcome.accepted:,} still valid; "
        )
        said += f"at most {outcome.slowest_s:.2f} s and {outcome.most_mb:.0f} MB"
        figures.note("Malformed files", outcome.kind, outcome.read, said)


@pytest.mark.parametrize("kind", kinds(), ids=lambda kind: kind.name)
def test_the_examples_are_whole(kind: Kind, tmp_path: Path) -> None:
    assert campaign(kind, 0, 0, tmp_path) == Outcome(kind.name, most_mb=pytest.approx(0, abs=9999))


@pytest.mark.parametrize("content", [b"1", b"null", b"[]", b'""'])
@pytest.mark.parametrize("name", ["baseline", "record", "summary", "choices"])
def test_something_else_altogether_is_told_with_its_place(
    name: str, content: bytes, tmp_path: Path
) -> None:
    """Found by guided fuzzing: what is wrong with all of a document has no key."""
    kind = next(kind for kind in kinds() if kind.name == name)
    (tmp_path / kind.file).write_bytes(content)
    with pytest.raises(InputError, match=rf"{kind.file}:1: not a valid "):
        kind.read(tmp_path / kind.file)


def raising(error: BaseException) -> Any:
    def read(_: Path) -> None:
        raise error

    return read


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ValueError("oops"), "Traceback"),
        (InputError([]), "without a message"),
        (InputError([Problem("bad")]), "no file"),
        (InputError([Problem("bad", file=Path("x"))]), "no place"),
        (InputError([Problem("bad\n", file=Path("x"), line=1)]), "one line"),
    ],
)
def test_the_campaign_sees_faults(error: Exception, said: str, tmp_path: Path) -> None:
    def read(path: Path) -> None:
        if path.read_bytes() != b"whole":
            raise error

    outcome = campaign(Kind("faulty", "f", (b"whole",), read), 30, 0, tmp_path)
    assert outcome.faults
    assert said in outcome.faults[0]


def test_a_crash_of_the_child_is_a_fault(tmp_path: Path) -> None:
    (outcome,) = in_child({"no such kind": 1}, 0, tmp_path, timeout=60)
    assert "ended with" in outcome.faults[0]


def test_mutations_follow_from_their_seed() -> None:
    data = b'{"a": 1, "b": "text"}\nline = 2\n'
    for mutation in MUTATIONS:
        assert mutation(data, random.Random(3)) == mutation(data, random.Random(3))
    assert mutate(data, random.Random(3)) == mutate(data, random.Random(3))


# --- documents that no example resembles ----------------------------------------------------------


def words(schema: Any) -> set[str]:
    """All property names and enumerated values of the format."""
    found: set[str] = set()
    if isinstance(schema, dict):
        found |= {str(key) for key in schema.get("properties", {})}
        found |= {value for value in schema.get("enum", []) if isinstance(value, str)}
        for value in schema.values():
            found |= words(value)
    elif isinstance(schema, list):
        for value in schema:
            found |= words(value)
    return found


WORDS = sorted(words(case_schema()))
KEYS = st.sampled_from(WORDS)
SCALARS = st.one_of(
    st.sampled_from(WORDS), st.integers(-(2**70), 2**70), st.floats(), st.booleans(),
    st.text(max_size=20), st.sampled_from(["=1/0", "=ior", "=sind(30)", "=[1]"]),
)  # fmt: skip
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=5),
    max_leaves=25,
)
DOCUMENTS = st.dictionaries(KEYS, VALUES, min_size=1, max_size=8)


def toml(value: Any) -> str:
    """A value as inline TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(c):08x}" if not c.isalnum() else c for c in value) + '"'
    return repr(value)


@given(DOCUMENTS)
@settings(max_examples=figures.count(150, 3000))
def test_documents_of_the_right_words_in_the_wrong_places(document: dict[str, Any]) -> None:
    path = Path("scene.toml")
    text = "\n".join(f"{toml(key)} = {toml(value)}" for key, value in document.items())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("harness.scene.load.read_source", lambda _: text.encode())
        problems: list[Problem] | None = None
        try:
            load_cases(path)
        except InputError as error:
            problems = error.problems
    assert problems is None or problems
    for problem in problems or []:
        assert problem.file == path
        assert problem.line is not None or "more than" in problem.message
