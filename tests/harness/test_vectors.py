"""Dot products of scene geometry are exact until they are rounded, once."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from harness.scene.vectors import dot, exact_dot

NUMBERS = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e150, max_value=1e150)
SIMPLE = st.sampled_from([0.0, -0.0, 1.0, -1.0, 0.5, 1 / 3, 1e-200, 5e-324])
PAIRS = st.lists(st.tuples(NUMBERS | SIMPLE, NUMBERS | SIMPLE), max_size=5)


@given(PAIRS)
@example([(1.0, 0.0), (1.0 + 2**-52, 1.0 - 2**-53)])
@example([(1.0, 0.0), (2.0**-537, 2.0**-530 / 3)])
@example([(1.0, 0.0), (1e150 / 3, 1e150 / 7)])
def test_it_is_the_exact_sum_rounded_once(pairs: list[tuple[float, float]]) -> None:
    # Without their rounded values, what is left of products is what rounding has lost.
    pairs = [*pairs, *((x * y, -1.0) for x, y in pairs[1:])]
    a, b = [x for x, _ in pairs], [y for _, y in pairs]
    exact = float(exact_dot(a, b))
    assert dot(a, b) == exact
    assert math.copysign(1.0, dot(a, b)) == math.copysign(1.0, exact)


def test_vectors_of_different_lengths_have_none() -> None:
    with pytest.raises(ValueError, match="zip"):
        dot((1.0, 2.0), (1.0,))
