"""The parts of the report: numbers, formulas, axes, charts and pictures."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from harness.errors import InputError
from harness.record import Check, Curve, Series, Verdict
from harness.report import pictures
from harness.report.axis import Axis, for_residuals, spanning
from harness.report.chart import MOST_POINTS, draw, sparkline
from harness.report.checks import check_view
from harness.report.colours import BEYOND, NOT_FINITE, SCALE, colour_classes
from harness.report.mathml import typeset
from harness.report.quantity import number, seconds, share, with_unit

FINITE = st.floats(allow_nan=False, allow_infinity=False, width=32)


# --- numbers --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (0.0, "0"),
        (math.nan, "NaN"),
        (-math.inf, "−∞"),
        (1.5, "1.5"),
        (-0.25, "−0.25"),
        (12345.678, "12346"),
        (9.9999, "10"),
        (99999.96, "100000"),
        (3.2e-7, "3.2\u202f×\u202f10⁻⁷"),
        (-1.23456e12, "−1.235\u202f×\u202f10¹²"),
    ],
)
def test_numbers(value: float | None, text: str) -> None:
    assert number(value) == text


@given(st.floats(0.5, 1.0), st.sampled_from([1e-2, 1e-4, 1e-6, 1e-9]))
def test_a_number_shows_enough_digits_to_judge_it_by(value: float, tolerance: float) -> None:
    assert abs(float(number(value, tolerance)) - value) < tolerance / 10


@pytest.mark.parametrize(
    ("ratio", "text"),
    [
        (None, ""),
        (0.0, "0\u202f%"),
        (1e-7, "<0.01\u202f%"),
        (0.31, "31\u202f%"),
        (1.0, "100\u202f%"),
        (1.004, "1.00×"),
        (3.216, "3.22×"),
        (480.3, "480×"),
        (60321.0, "60\u202f000×"),
        (math.inf, "∞"),
        (math.nan, "NaN"),
    ],
)
def test_shares_of_a_tolerance(ratio: float | None, text: str) -> None:
    assert share(ratio) == text


def test_a_degree_sign_cannot_be_read_as_an_exponent() -> None:
    assert with_unit(number(12.5), "°") == "12.5°"
    assert with_unit(number(1e-5), "°").endswith("⁵\u202f°")
    assert with_unit(number(math.nan), "°") == "NaN"
    assert with_unit("0.5", "1") == "0.5"


def test_expectations_known_to_many_digits_are_told_by_their_error() -> None:
    view = check_view(
        Check(
            id="internal_angle(in)/tracer/truth", renderer="tracer", against="truth", unit="deg",
            observable="internal_angle", value=35.264389682, expected=35.264389681,
            tolerance=1e-10, status=Verdict.FAIL, reason="",
        )
    )  # fmt: skip
    assert view.label == "probe in"
    assert view.value == view.expected == "35.2644°"
    assert view.main == "off by 10⁻⁹\u202f°"
    assert view.limit == "≤\u202f10⁻¹⁰\u202f°"
    assert view.used == "10×"


def test_durations() -> None:
    assert [seconds(s) for s in (0.0834, 4.21, 125.0)] == [
        "83.4\u202fms",
        "4.21\u202fs",
        "2\u202fmin 5\u202fs",
    ]


# --- formulas -------------------------------------------------------------------------------------


def letters(formula: str) -> str:
    markup = typeset(formula)
    assert markup is not None
    root = ET.fromstring(f"<all>{markup}</all>".replace("&#x2061;", "").replace("&#x2062;", ""))
    return "".join(root.itertext()).replace("\n", "")


@pytest.mark.parametrize(
    ("formula", "shown"),
    [
        ("sin(theta_t) = mu sin(theta_i)", "sinθt=μsinθi"),
        ("d = t sin(theta_i) (1 - cos(theta_i) / sqrt(n^2 - sin(theta_i)^2))",
         "d=tsinθi(1−cosθin2−sin2θi)"),
        ("f = n R / (2 (n - 1))", "f=nR2(n−1)"),
        ("L = L0 exp(-sigma d)", "L=L0e−σd"),
        ("delta = theta_1 + theta_2' - A", "δ=θ1+θ2′−A"),
        ("theta_c = asin(n_t / n_i), theta_i > theta_c", "θc=arcsin(ntni),θi>θc"),
        ("R = |r_s|^2; x <= 2e-6", "R=|rs|2x≤2×10−6"),
        ("D - 2 (D . N) N; sin(45°)", "D−2(D⋅N)Nsin45°"),
        ("sum_(j<=k) x^j = sum_j x_j", "∑j≤kxj=∑jxj"),
    ],
)  # fmt: skip
def test_formulas(formula: str, shown: str) -> None:
    assert letters(formula) == shown


def test_a_product_is_the_numerator_and_only_a_factor_the_denominator() -> None:
    fraction = ET.fromstring(str(typeset("a b / c d"))).find(".//mfrac")
    assert fraction is not None
    assert ["".join(part.itertext()).replace("\u2062", "") for part in fraction] == ["ab", "c"]


def test_the_sign_of_a_sum_stands_before_its_fraction() -> None:
    markup = typeset("1 + sum_k B_k / C_k")
    fraction = ET.fromstring(str(markup)).find(".//mfrac")
    assert fraction is not None
    assert "".join(fraction[0].itertext()) == "Bk"
    assert typeset("sum_k") is None
    assert typeset("sum_k / 2") is None


@pytest.mark.parametrize(
    ("text", "below"),
    [
        ("x / n(lambda) b", "n(λ)"),
        ("x / e(e(theta)) b", "e(e(θ))"),
        ("x / n(lambda)^2 b", "n(λ)2"),
        ("x / n (lambda) b", "n"),
        ("x / n(a + b) b", "n"),
        ("2 sum_k x_k / n b", "n"),
    ],
)
def test_the_value_of_what_depends_on_a_name_stays_together(text: str, below: str) -> None:
    fraction = ET.fromstring(str(typeset(text))).find(".//mfrac")
    assert fraction is not None
    assert "".join(fraction[1].itertext()).replace("\u2061", "") == below


@pytest.mark.parametrize("text", ["", "a $ b", "((((", "sin(", "a ^", "<b>", "1 +", ")", "|a", "€"])
def test_what_is_no_formula_is_left_alone(text: str) -> None:
    assert typeset(text) is None


@given(st.text(alphabet="abn_θ ()^/*+-=<>&\"'|,;1.e°sum\n", max_size=40) | st.text(max_size=600))
def test_any_text_gives_well_formed_markup_or_none(text: str) -> None:
    markup = typeset(text)
    if markup is not None:
        ET.fromstring(f"<all>{markup}</all>")


def test_deep_nesting_is_refused() -> None:
    assert typeset("(" * 240 + "x" + ")" * 240) is None


# --- axes -----------------------------------------------------------------------------------------


@given(st.lists(FINITE, min_size=1, max_size=5))
def test_an_axis_holds_its_values_and_has_ticks_within_it(values: list[float]) -> None:
    axis = spanning(values, 100.0, 0.0)
    assert all(axis.holds(v) and 0 <= axis.place(v) <= 100 for v in values)
    ticks = [value for value, _ in axis.ticks()]
    assert ticks == sorted(ticks)
    assert 2 <= len(ticks) <= 12
    slack = 1e-9 * (axis.high - axis.low)
    assert all(axis.low - slack <= v <= axis.high + slack for v in ticks)


@given(st.lists(FINITE, max_size=5), st.floats(0, 1e3))
def test_residual_axis_shows_zero_band_and_residuals_in_order(
    residuals: list[float], band: float
) -> None:
    axis = for_residuals(residuals, band, 100.0, 0.0)
    assert axis.place(0.0) == pytest.approx(50.0)
    shown = sorted({*residuals, band, -band})
    places = [axis.place(v) for v in shown]
    assert places == sorted(places, reverse=True)
    assert all(axis.holds(v) for v in shown)
    assert axis.ticks()


def test_tick_labels_leave_out_a_common_power() -> None:
    axis = Axis(-2e-7, 2e-7, 100.0, 0.0)
    assert axis.caption("residual") == "residual  × 10⁻⁷"
    assert [label for _, label in axis.ticks()] == ["−2", "−1", "0", "1", "2"]


def test_far_residuals_make_the_axis_logarithmic_beyond_the_band() -> None:
    axis = for_residuals([1e-2], 1e-6, 100.0, 0.0)
    labels = [label for _, label in axis.ticks()]
    assert labels[len(labels) // 2] == "0"
    assert "0.01" in labels
    assert 50 - axis.place(1e-6) > 10  # the band stays wide enough to see


# --- charts ---------------------------------------------------------------------------------------

COLOURS = colour_classes(["tracer", "povray"])


def a_curve(y: list[float], residual: list[float] | None = None, **changes: object) -> Curve:
    x = [float(k) for k in range(len(y))]
    series = [Series(renderer="tracer", x=x, y=y)]
    residuals = [] if residual is None else [Series(renderer="tracer", x=x, y=residual)]
    fields = {"id": "c", "title": "t", "x_label": "x", "y_label": "y", "series": series,
              "residuals": residuals, **changes}  # fmt: skip
    return Curve.model_validate(fields)


def lines(svg: str, kind: str = "line") -> list[str]:
    return [e.attrib["d"] for e in ET.fromstring(svg).iter("path") if e.attrib["class"] == kind]


def test_a_gap_stands_where_a_value_is_not_finite() -> None:
    chart = draw(a_curve([0.0, 1.0, math.nan, math.inf, 2.0, 3.0]), COLOURS)
    (line,) = lines(chart.svg)
    assert line.count("M") == 2
    (lost,) = lines(chart.svg, "lost")
    assert lost.count("M") == 2
    assert chart.legend[0].note == "2 of 6 values not finite"


def test_thinning_keeps_a_single_outlier() -> None:
    y = [0.0] * 5000
    y[2345] = 1.0
    (line,) = lines(draw(a_curve(y), COLOURS).svg)
    heights = [float(point.split()[1]) for point in line.removeprefix("M").split("L")]
    assert len(heights) <= MOST_POINTS
    assert min(heights) < max(heights) - 100


def test_legend_states_the_worst_residual_and_its_share_of_the_tolerance_there() -> None:
    curve = a_curve([0.0, 0.0], [2e-6, -3e-6], tolerance=[1e-6, 1e-5])
    (entry,) = draw(curve, COLOURS).legend
    assert entry.worst == "3\u202f×\u202f10⁻⁶"
    assert entry.used == "2.00×"  # the first, where the tolerance is smaller
    assert entry.over


def test_a_renderer_is_measured_by_its_own_tolerance() -> None:
    """The band is the widest, in which a coarse renderer and a fine one both have room."""
    x, off = [0.0, 1.0], [2e-6, 2e-6]
    fine = Series(renderer="tracer", x=x, y=off, tolerance=[1e-8, 1e-8])
    coarse = Series(renderer="povray", x=x, y=off, tolerance=[1e-5, 1e-5])
    both = [Series(renderer=s.renderer, x=x, y=[0.0, 0.0]) for s in (fine, coarse)]
    curve = a_curve([], tolerance=[1e-5, 1e-5], series=both, residuals=[fine, coarse])
    chart = draw(curve, COLOURS)
    assert [entry.over for entry in chart.legend] == [True, False]
    assert chart.legend[0].used == "200×"
    assert chart.widest
    assert not draw(a_curve([0.0], [0.0], tolerance=[1.0]), COLOURS).widest


def test_a_wild_renderer_does_not_flatten_the_truth() -> None:
    x = [0.0, 1.0, 2.0]
    truth = Series(renderer="truth", x=x, y=[0.0, 0.5, 1.0])
    wild = Series(renderer="povray", x=x, y=[0.0, 1e30, 1.0])
    first = lines(draw(a_curve([0.0], series=[wild, truth]), COLOURS).svg)[0]
    heights = [float(point.split()[1]) for point in first.removeprefix("M").split("L")]
    assert max(heights) - min(heights) > 100


@pytest.mark.parametrize("y", [[], [math.nan], [1.0], [1e308, -1e308], [5.0, 5.0]])
def test_charts_of_odd_data_are_well_formed(y: list[float]) -> None:
    for residual in (None, y):
        curve = a_curve(y, residual, tolerance=[math.nan] * len(y))
        svg = draw(curve, COLOURS).svg
        ET.fromstring(svg)
        assert "nan" not in svg
        assert "inf" not in svg
        spark = sparkline(curve, "tracer", COLOURS)
        assert (spark is None) == (not residual)
        if spark:
            ET.fromstring(spark)
            assert "nan" not in spark


# --- pictures -------------------------------------------------------------------------------------


def grey(*values: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """One row of grey pixels."""
    return np.repeat(np.array(values)[None, :, None], 3, axis=2)


def test_display_follows_the_srgb_standard() -> None:
    # Values of IEC 61966-2-1: 18 % grey is 118 of 255, 50 % is 188, 0.002 lies on the linear part.
    shown = pictures.display(grey(-1.0, 0.0, 0.002, 0.18, 0.5, 1.0, 7.0))
    assert shown[0, :, 0].tolist() == [0, 0, 7, 118, 188, 255, 255]


def test_display_marks_what_is_not_finite() -> None:
    pixels = grey(0.5, 0.5, 0.5)
    pixels[0, 1, 2] = math.nan
    pixels[0, 2, 0] = -math.inf
    shown = pictures.display(pixels)
    assert shown[0, 0].tolist() == [188, 188, 188]
    assert shown[0, 1].tolist() == list(NOT_FINITE) == shown[0, 2].tolist()


def test_shrinking_averages_light() -> None:
    checks = np.indices((8, 8)).sum(axis=0) % 2
    pixels = np.repeat(checks[..., None].astype(float), 3, axis=2)
    small = pictures.shrink(pixels, 4)
    assert small.shape == (4, 4, 3)
    assert_allclose(small, 0.5)
    assert pictures.shrink(pixels, 8) is pixels


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 12))
def test_shrinking_fits_and_keeps_a_constant(height: int, width: int, longest: int) -> None:
    small = pictures.shrink(np.full((height, width, 3), 0.25), longest)
    assert max(small.shape[:2]) <= longest
    assert_allclose(small, 0.25)


def test_shrinking_does_not_hide_nan() -> None:
    pixels = np.zeros((9, 9, 3))
    pixels[4, 4] = math.nan
    assert np.isnan(pictures.shrink(pixels, 3)).any()


def test_difference_colours() -> None:
    a = grey(0.0, 0.05, 0.1, 0.1001, math.nan)
    a[0, 1] = [0.0, -0.05, 0.01]  # the largest channel counts, by size
    shown = pictures.difference_colours(a, np.zeros_like(a), 0.1)[0]
    assert [tuple(pixel) for pixel in shown.tolist()] == [
        SCALE[0],
        SCALE[len(SCALE) // 2],
        SCALE[-1],
        BEYOND,
        NOT_FINITE,
    ]


def test_logarithmic_difference_colours() -> None:
    """Nine decades: each takes the same share of the scale, and zero is as dark as can be."""
    a = grey(0.0, 1e-10, 1e-9, 10**-4.5, 1.0, 1.001)
    shown = pictures.difference_colours(a, np.zeros_like(a), 1.0, low=1e-9)[0]
    middle = SCALE[len(SCALE) // 2]
    expected = [SCALE[0], SCALE[0], SCALE[0], middle, SCALE[-1], BEYOND]
    assert [tuple(pixel) for pixel in shown.tolist()] == expected
    with pytest.raises(InputError, match="least difference"):
        pictures.difference_colours(a, a, 1.0, low=1.0)


def test_infinity_minus_infinity_is_no_agreement() -> None:
    both = grey(math.inf)
    assert pictures.difference_colours(both, both, 1.0)[0, 0].tolist() == list(NOT_FINITE)


def test_differences_of_unlike_images_are_refused() -> None:
    with pytest.raises(InputError, match="different size"):
        pictures.difference_colours(grey(1.0), grey(1.0, 1.0), 0.1)
    with pytest.raises(InputError, match="limit"):
        pictures.difference_colours(grey(1.0), grey(1.0), 0.0)


def test_the_scale_is_inferno() -> None:
    colormaps = pytest.importorskip("matplotlib").colormaps
    inferno = 255 * colormaps["inferno"](np.arange(256))[:, :3]
    values = np.arange(256) / 255
    shown = pictures.difference_colours(grey(*values), grey(*np.zeros(256)), 1.0)[0]
    assert np.abs(shown.astype(float) - inferno).max() < 2.5


@pytest.mark.parametrize("suffix", [".png", ".webp"])
def test_files_hold_what_was_shown(tmp_path: Path, suffix: str) -> None:
    imagecodecs = pytest.importorskip("imagecodecs")
    pixels = np.random.default_rng(0).random((5, 7, 3))
    path = pictures.write_picture(pixels, tmp_path / "deep" / f"a{suffix}")
    assert (imagecodecs.imread(path) == pictures.display(pixels)).all()
    pictures.write_thumbnail(pixels, path, longest=4)
    assert imagecodecs.imread(path).shape == (3, 4, 3)
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.png or \.webp"):
        pictures.write_picture(grey(1.0), tmp_path / "a.jpg")
