"""Numbers as text: as many digits as their tolerance gives meaning to, powers of ten set out."""

from __future__ import annotations

import math

SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
NARROW_SPACE = "\u202f"
MINUS = "\u2212"


def number(value: float | None, resolution: float | None = None, digits: int = 4) -> str:
    """`value` for reading. None is a dash.

    With `resolution` (a tolerance) two digits beyond it are shown, so that what passes and what
    fails can be told apart; without, `digits` significant ones. Very large and small numbers are
    written with a power of ten.
    """
    if value is None:
        return "–"
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else "∞" if value > 0 else f"{MINUS}∞"
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(value)))
    if resolution is not None and 0 < resolution < math.inf:
        digits = max(digits, exponent - math.floor(math.log10(resolution)) + 3)
    digits = min(digits, 17)
    if -4 <= exponent <= 5:
        text = f"{value:.{max(0, digits - 1 - exponent)}f}"
        return _trim(text).replace("-", MINUS)
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    ten = f"10{str(int(power)).translate(SUPERSCRIPT)}"
    times = f"{NARROW_SPACE}×{NARROW_SPACE}{ten}"
    return ten if float(mantissa) == 1 else _trim(mantissa).replace("-", MINUS) + times


def _trim(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def with_unit(text: str, unit: str) -> str:
    """Degrees stand close to digits, other units after a narrow space; "1" and "" are no unit."""
    unit = {"deg": "°", "1": ""}.get(unit, unit)
    if not unit or not text[-1:].isdigit():
        return text
    close = unit == "°" and text[-1] in "0123456789"  # after a power of ten ° would look like one
    return text + ("" if close else NARROW_SPACE) + unit


def share(ratio: float | None) -> str:
    """How much of its tolerance an error uses: "3.1 %" below it, "12×" above."""
    if ratio is None:
        return ""
    if not math.isfinite(ratio):
        return "∞" if ratio > 0 else "NaN"
    if ratio >= 1e6:
        return number(ratio, digits=2) + "×"
    if ratio > 9.95:
        return f"{float(f'{ratio:.2g}'):,.0f}×".replace(",", NARROW_SPACE)
    if ratio > 1:
        return f"{ratio:.2f}×"
    percent = 100 * ratio
    if percent == 0:
        return f"0{NARROW_SPACE}%"
    text = "<0.01" if percent < 0.01 else f"{percent:.0f}" if percent >= 10 else f"{percent:.2g}"
    return f"{text}{NARROW_SPACE}%"


def seconds(value: float) -> str:
    """A duration: "83 ms", "4.2 s", "2 min 5 s"."""
    if not math.isfinite(value):
        return number(value)
    if value < 0.9995:
        return f"{1000 * value:.3g}{NARROW_SPACE}ms"
    if value < 119.5:
        return f"{value:.3g}{NARROW_SPACE}s"
    minutes, rest = divmod(round(value), 60)
    return f"{minutes}{NARROW_SPACE}min {rest}{NARROW_SPACE}s"


def count(n: int, one: str, many: str = "") -> str:
    """A number with its noun: "1 check", "7 checks"."""
    return f"{n:,}".replace(",", NARROW_SPACE) + " " + (one if n == 1 else many or one + "s")


def size(octets: int) -> str:
    """The size of a file: "812 bytes", "3.4 kB", "12 MB"."""
    if octets < 1000:
        return count(octets, "byte")
    power, unit = (1e3, "kB") if octets < 999_500 else (1e6, "MB")
    return f"{octets / power:.3g}{NARROW_SPACE}{unit}"
