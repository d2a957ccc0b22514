// Numbers for reading; the same conventions as harness/report/quantity.py.

const SUPERSCRIPT: Record<string, string> = {
  "-": "⁻", ".": "·", "0": "⁰", "1": "¹", "2": "²", "3": "³", "4": "⁴",
  "5": "⁵", "6": "⁶", "7": "⁷", "8": "⁸", "9": "⁹",
};

export function superscript(power: number): string {
  return [...String(power)].map((c) => SUPERSCRIPT[c] ?? c).join("");
}

export function number(value: number, digits = 4): string {
  if (Number.isNaN(value)) return "NaN";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent >= -4 && exponent <= 5) {
    const text = value.toFixed(Math.min(20, Math.max(0, digits - 1 - exponent)));
    return trim(text).replace("-", "−");
  }
  const [mantissa = "", power = "0"] = value.toExponential(digits - 1).split("e");
  if (Number(mantissa) === 1) return `10${superscript(Number(power))}`;
  return `${trim(mantissa).replace("-", "−")}\u202f×\u202f10${superscript(Number(power))}`;
}

function trim(text: string): string {
  return text.includes(".") ? text.replace(/0+$/, "").replace(/\.$/, "") : text;
}

/** A float32 with all the digits that it has and no more. */
export function exact(value: number): string {
  if (!Number.isFinite(value)) return number(value);
  for (let digits = 6; digits < 10; digits++) {
    if (Math.fround(Number(value.toPrecision(digits))) === value) {
      return plain(value, digits);
    }
  }
  return plain(value, 9);
}

function plain(value: number, digits: number): string {
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-5 || size >= 1e7)
    ? value.toExponential(digits - 1).replace(/\.?0+e/, "e")
    : trim(value.toPrecision(digits));
  return text.replace("-", "−");
}
