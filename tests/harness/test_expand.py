"""Parameters, axes and expressions."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from harness.scene import degrees
from harness.scene.expand import Expansion, expand
from harness.scene.expressions import Calculator, ExpressionError, format_value

Data = dict[str, object]


def evaluated(text: str, **names: float | str) -> float | int | str:
    calculator = Calculator()
    return calculator.value(calculator.parse(text), {"pi": math.pi, **names})


def messages(expansion: Expansion) -> list[str]:
    return [finding.message for finding in expansion.findings]


# --- expressions ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("=1 + 2 * 3", 7),
        ("=2 ** -1", 0.5),
        ("=-(3 - 1) / 4", -0.5),
        ("= a * 2", 5),
        ("=sind(30)", 0.5),
        ("=cosd(60) + cosd(90)", 0.5),
        ("=tand(45)", 1),
        ("=asind(0.5)", 30),
        ("=acosd(-0.5)", 120),
        ("=atand(1)", 45),
        ("=sqrt(9)", 3),
        ("=abs(-2)", 2),
        ("=min(3, a, 7)", 2.5),
        ("=max(3, a)", 3),
        ("=pi", math.pi),
        ("=word", "glass"),
    ],
)
def test_expressions_have_their_value(text: str, value: float | str) -> None:
    assert evaluated(text, a=2.5, word="glass") == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("=", "empty"),
        ("=1 +", "not an expression"),
        ("=b", "unknown name b"),
        ("=sinus(3)", "unknown function sinus"),
        ("=1 / 0", "division by zero"),
        ("=10 ** 400", "too large"),
        ("=9 ** 9 ** 9 ** 9", "too large"),
        ("=(-8) ** 0.5", "not a real number"),
        ("=sqrt(-1)", "math domain error"),
        ("=tand(90)", "infinite"),
        ("=1e308 * 10", "not a finite number"),
        ("=sqrt()", "cannot be evaluated"),
        ("=word + 1", "cannot calculate with the text"),
        ("=a.real", "not plain arithmetic"),
        ("=[1][0]", "not plain arithmetic"),
        ("=a if a else 1", "not plain arithmetic"),
        ("='x' * 9", "not plain arithmetic"),
        ("=True", "not plain arithmetic"),
        ("=1j", "not plain arithmetic"),
        ("=a < 3", "not plain arithmetic"),
        ("=7 // 2", "not plain arithmetic"),
        ("=7 % 2", "not plain arithmetic"),
        ("=1 << 99", "not plain arithmetic"),
        ("=min(*[1, 2])", "not plain arithmetic"),
        ("=min(a, key=1)", "not plain arithmetic"),
        ("=sqrt", "not plain arithmetic"),
        ("=__import__('os').getcwd()", "not plain arithmetic"),
        ("=(lambda: 1)()", "not plain arithmetic"),
        ("=" + "(" * 300 + "1" + ")" * 300, "more than 500 characters"),
        ("=" + "(" * 240 + "1" + ")" * 240, "not an expression"),
        ("=" + "-" * 50 + "1", None),
        ("=0x10 + 1_000", None),
        ("=a := 3", "not an expression"),
        ("=1\0", "not an expression"),
        ("=" + "9" * 480, "too large"),
    ],
)
def test_what_is_not_plain_arithmetic_is_refused(text: str, message: str | None) -> None:
    if message is None:
        assert isinstance(evaluated(text, a=2.5), int)
        return
    with pytest.raises(ExpressionError) as caught:
        evaluated(text, a=2.5, word="glass")
    assert message in str(caught.value)


def test_a_misspelt_name_is_recognised() -> None:
    with pytest.raises(ExpressionError) as caught:
        evaluated("=thicknes / 2", thickness=1)
    assert caught.value.suggestion == "thickness"


@given(st.text(alphabet="=+-*/()., 0123456789eabmixnsqrtπ\"'[]{}:%<>_", max_size=40))
def test_any_text_has_a_finite_value_or_a_reason(text: str) -> None:
    try:
        value = evaluated("=" + text, a=2.5)
    except ExpressionError:
        return
    assert isinstance(value, int | float)
    assert math.isfinite(value)


# --- degrees --------------------------------------------------------------------------------------


@given(st.floats(-1e6, 1e6))
def test_degrees_agree_with_radians(angle: float) -> None:
    # The argument reduction in radians loses |angle| * 2^-52 * pi/180, which exact degrees do not.
    tolerance = 4e-16 * (1 + abs(angle))
    assert degrees.sind(angle) == pytest.approx(math.sin(math.radians(angle)), abs=tolerance)
    assert degrees.cosd(angle) == pytest.approx(math.cos(math.radians(angle)), abs=tolerance)
    assert degrees.sind(angle) ** 2 + degrees.cosd(angle) ** 2 == pytest.approx(1, abs=4e-16)


@given(st.integers(-50, 50))
def test_degrees_are_exact_where_the_value_is_simple(turns: int) -> None:
    sines = {0: 0.0, 30: 0.5, 90: 1.0, 150: 0.5, 180: 0.0, 210: -0.5, 270: -1.0, 330: -0.5}
    for angle, sine in sines.items():
        assert degrees.sind(angle + 360 * turns) == sine
        assert degrees.cosd(angle - 90 + 360 * turns) == sine


# --- axes -----------------------------------------------------------------------------------------


def axis(values: object) -> list[object]:
    expansion = expand({"axes": {"x": values}, "a": "=x"})
    assert messages(expansion) == []
    return [permutation.data["a"] for permutation in expansion.permutations]


def test_ranges_hold_both_ends_and_decimals_as_written() -> None:
    assert axis({"start": 0, "stop": 1, "step": 0.1}) == [
        0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1,
    ]  # fmt: skip
    assert axis({"start": 0, "stop": 89, "count": 90}) == list(range(90))
    assert axis({"start": 3, "stop": 1, "step": -1}) == [3, 2, 1]
    assert axis({"start": 0, "stop": 1, "step": 0.4}) == [0, 0.4, 0.8]
    assert axis(["=sqrt(4)", 1.5]) == [2, 1.5]
    assert axis(["glass", "water"]) == ["glass", "water"]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([], "not an axis"),
        (3, "not an axis"),
        ([1] * 10_001, "10001 values"),
        ([1, "two words"], "not a word"),
        ([1, 1.0], "value repeated"),
        ([float("nan")], "wrong type"),
        ([True], "wrong type"),
        ([10**400], "too large"),
        (["=1/0"], "division by zero"),
        (["=y"], "unknown name y"),
        ({"start": 0, "stop": 1}, "not a range"),
        ({"start": 0, "stop": 1, "count": 2, "step": 1}, "not a range"),
        ({"start": 0, "stop": 1, "cuont": 2}, "unknown key"),
        ({"start": 0, "stop": 1, "count": 1}, "not a count"),
        ({"start": 0, "stop": 1, "count": 2.5}, "not a count"),
        ({"start": 0, "stop": 1, "count": 1e300}, "more than 10000 values"),
        ({"start": 0, "stop": 1e300, "step": 1e-300}, "more than 10000 values"),
        ({"start": 0, "stop": 1, "step": -1}, "does not lead"),
        ({"start": 0, "stop": 1, "step": 0}, "does not lead"),
        ({"start": 1, "stop": 1, "count": 2}, "the same"),
    ],
)
def test_bad_axes_are_findings(values: object, message: str) -> None:
    expansion = expand({"axes": {"x": values}, "a": "=x"})
    assert message in messages(expansion)[0]
    # The uses of a broken axis are not reported on top.
    assert {finding.path[:2] for finding in expansion.findings} == {("axes", "x")}
    assert len(expansion.permutations) == 1


def test_too_many_combinations_are_refused_with_their_axes() -> None:
    many: dict[str, object] = {"start": 0, "stop": 999, "step": 1}
    expansion = expand({"axes": {"a": many, "b": many}, "x": "=a + b"})
    assert messages(expansion) == ["a (1000) × b (1000) are 1000000 combinations"]
    assert len(expansion.permutations) == 1


def test_a_million_axes_are_refused_before_they_are_combined() -> None:
    expansion = expand({"axes": {f"a{k}": [1, 2] for k in range(1000)}})
    assert len(expansion.findings) == 1
    assert len(expansion.permutations) == 1


# --- permutations ---------------------------------------------------------------------------------


def test_every_combination_is_a_permutation() -> None:
    expansion = expand(
        {
            "axes": {"t": [0.25, 1.0], "n": [1.5, 2]},
            "parameters": {"half": "=t / 2"},
            "x": "=half*n",
        }
    )
    assert [p.suffix for p in expansion.permutations] == [
        "[t=0.25,n=1.5]",
        "[t=0.25,n=2]",
        "[t=1,n=1.5]",
        "[t=1,n=2]",
    ]
    assert [p.data["x"] for p in expansion.permutations] == [0.1875, 0.25, 0.75, 1]
    assert [p.parameters["half"] for p in expansion.permutations] == [0.125, 0.125, 0.5, 0.5]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.0, "1"),
        (-0.0, "0"),
        (0.1 + 0.2, "0.3"),
        (1e-9, "1e-9"),
        (2.5e20, "2.5e20"),
        ("bk7", "bk7"),
    ],
)
def test_ids_show_short_numbers(value: float | str, text: str) -> None:
    assert format_value(value) == text


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"parameters": {"a": "x"}}, "wrong type"),
        ({"parameters": {"a": float("inf")}}, "wrong type"),
        ({"parameters": {"pi": 3}}, "pi is built in"),
        ({"parameters": {"sind": 3}}, "sind is built in"),
        ({"parameters": {"a b": 3}}, "not a valid name"),
        ({"parameters": {"a": 1}, "axes": {"a": [1]}}, "an axis has this name"),
        ({"parameters": {"a": "=b", "b": 1}}, "unknown name b"),
        ({"parameters": [1]}, "wrong type"),
    ],
)
def test_bad_parameters_are_findings(document: Data, message: str) -> None:
    (found,) = messages(expand(document))
    assert message in found


def test_problems_are_not_repeated_for_each_permutation() -> None:
    expansion = expand({"axes": {"a": [0, 1, 2]}, "x": "=sqrt(a - 5)", "y": "=b"})
    assert messages(expansion) == [
        "cannot be evaluated: math domain error (at a = 0)",
        "unknown name b",
    ]


def test_uses_of_broken_parameters_are_not_reported() -> None:
    expansion = expand({"parameters": {"a": "=1/0", "b": "=a"}, "x": "=b", "y": "=b + c"})
    assert messages(expansion) == ["division by zero", "unknown name c"]


def test_prose_is_no_expression() -> None:
    document: Data = {"title": "= 3", "description": "=a", "tags": ["=b"]}
    assert expand(document).permutations[0].data == {
        "title": "= 3",
        "description": "=a",
        "tags": ("=b",),
    }
