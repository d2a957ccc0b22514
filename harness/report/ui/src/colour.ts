// From linear radiance and from figures to colours.

export type Rgb = readonly [number, number, number];

export const NOT_FINITE: Rgb = [255, 0, 255]; // NaN and infinities, everywhere
export const NOT_MEASURED: Rgb = [142, 146, 152]; // where a map has no figure, and needs none
export const BEYOND: Rgb = [125, 249, 255]; // past the end of a map's scale

// Inferno (CC0), as in harness/report/colours.py.
const INFERNO =
  "0000040403120b0724150b37210c4a2f0a5b3d09654a0c6b57106e64156e71196e" +
  "7d1e6d8a226a972766a32c61b0315bbc3754c63d4dd04545da4e3ce35933eb6429" +
  "f1711ff67e14f98c0afb9b06fcaa0ffbba1ff9c932f5d949f2e865f3f586fcffa4";
// From blue through a neutral grey to red, ends of equal lightness, for signed figures.
const SIGNED = "1b4fa03d74bd7aa3d4b9cfe4e9ebecebcdb9dfa07bc4683f9c2f16";

function table(hex: string): Rgb[] {
  const digits = hex.replaceAll(" ", "");
  const byte = (at: number): number => Number.parseInt(digits.slice(at, at + 2), 16);
  return Array.from({ length: digits.length / 6 }, (_, k) => [
    byte(6 * k), byte(6 * k + 2), byte(6 * k + 4),
  ]);
}

function interpolated(knots: readonly Rgb[], size = 1024): Uint8ClampedArray {
  const out = new Uint8ClampedArray(3 * size);
  for (let k = 0; k < size; k++) {
    const at = (k / (size - 1)) * (knots.length - 1);
    const low = Math.min(knots.length - 2, Math.floor(at));
    const a = knots[low] as Rgb;
    const b = knots[low + 1] as Rgb;
    for (let c = 0; c < 3; c++) {
      out[3 * k + c] = (a[c] as number) + (at - low) * ((b[c] as number) - (a[c] as number));
    }
  }
  return out;
}

const SCALES = { inferno: interpolated(table(INFERNO)), signed: interpolated(table(SIGNED)) };
export type ScaleName = keyof typeof SCALES;

/**
 * A scale from `low` to `high`; a logarithmic one shows what is below `low` as its first colour.
 * With `gaps` NaN means that nothing was measured there.
 */
export interface Scale {
  readonly colours: ScaleName;
  readonly low: number;
  readonly high: number;
  readonly log: boolean;
  readonly gaps?: boolean;
}

export function share(scale: Scale, value: number): number {
  if (!scale.log) return (value - scale.low) / (scale.high - scale.low);
  if (value <= scale.low) return 0;
  return Math.log(value / scale.low) / Math.log(scale.high / scale.low);
}

/** Figures (H × W, NaN where there is none) as opaque pixels. */
export function shadeFigures(values: Float32Array, scale: Scale, out: Uint8ClampedArray): void {
  const colours = SCALES[scale.colours];
  const last = colours.length / 3 - 1;
  for (let k = 0; k < values.length; k++) {
    const value = values[k] as number;
    const at = 4 * k;
    out[at + 3] = 255;
    if (!Number.isFinite(value)) {
      [out[at], out[at + 1], out[at + 2]] = scale.gaps && Number.isNaN(value) ? NOT_MEASURED : NOT_FINITE;
      continue;
    }
    const part = share(scale, value);
    if (part > 1 || (part < 0 && scale.colours === "signed")) {
      [out[at], out[at + 1], out[at + 2]] = BEYOND;
      continue;
    }
    const entry = 3 * Math.round(Math.max(0, part) * last);
    out[at] = colours[entry] as number;
    out[at + 1] = colours[entry + 1] as number;
    out[at + 2] = colours[entry + 2] as number;
  }
}

/** The scale's colours as a strip of pixels, for the colour bar. */
export function strip(scale: ScaleName): Uint8ClampedArray {
  return SCALES[scale];
}

export type Encoding = "srgb" | "gamma";

// A float's exponent and the first eleven bits of its mantissa tell its byte to a twentieth of a
// step, so that a table can give it without a root or a power per pixel.
const DROPPED = 12; // bits
const NOT_FINITE_BITS = 0x7f800000; // the exponent of NaN and infinities
const word = new Int32Array(1);
const float = new Float32Array(word.buffer);

/** Bytes of all floats from black, which is entry 0, to white, by their first bits less `base`. */
interface Bytes {
  readonly base: number;
  readonly table: Uint8Array;
}

function bytesOf(exposure: number, encoding: Encoding): Bytes {
  const gain = 2 ** exposure;
  const first = (value: number): number => {
    float[0] = value;
    return (word[0] as number) >> DROPPED;
  };
  const base = first(2 ** -24 / gain); // a seventh of a byte where the curve is a power
  const table = new Uint8Array(first(1 / gain) - base + 2);
  for (let k = 1; k < table.length; k++) {
    word[0] = ((base + k) << DROPPED) | (1 << (DROPPED - 1));
    table[k] = Math.round(255 * encoded((float[0] as number) * gain, encoding));
  }
  return { base, table };
}

function encoded(linear: number, encoding: Encoding): number {
  if (linear >= 1) return 1;
  if (encoding === "gamma") return linear ** (1 / 2.2);
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055;
}

/** Linear radiance times 2^exposure, encoded; pixels that are not finite are magenta. */
export function shadeRadiance(
  planes: Float32Array, exposure: number, encoding: Encoding, out: Uint8ClampedArray,
): void {
  const count = planes.length / 3;
  const { base, table } = bytesOf(exposure, encoding);
  const last = table.length - 1;
  const bits = new Int32Array(planes.buffer, planes.byteOffset, planes.length);
  const pixels = new Uint32Array(out.buffer, out.byteOffset, count); // red first, as all browsers have
  const magenta = 0xff000000 | (NOT_FINITE[2] << 16) | (NOT_FINITE[1] << 8) | NOT_FINITE[0];
  const byte = (float: number): number => { // negative ones are below `base` and black
    const k = (float >> DROPPED) - base;
    return table[k < 0 ? 0 : k > last ? last : k] as number;
  };
  for (let k = 0; k < count; k++) {
    const r = bits[k] as number;
    const g = bits[k + count] as number;
    const b = bits[k + 2 * count] as number;
    pixels[k] = notFinite(r) || notFinite(g) || notFinite(b) ? magenta
      : 0xff000000 | (byte(b) << 16) | (byte(g) << 8) | byte(r);
  }
}

const notFinite = (float: number): boolean => (float & NOT_FINITE_BITS) === NOT_FINITE_BITS;
