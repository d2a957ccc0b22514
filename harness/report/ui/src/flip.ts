// LDR-FLIP: what somebody notices who flips between two pictures on a screen.
//
// P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild: "FLIP: A
// Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020.
// Numbers of equations are those of that paper. Pictures are taken as shown at white = 1.

import type { Image } from "./pack";

// 0.7 m from a screen that is 0.7 m wide with 3840 pixels across, as the paper's authors assume.
export const PIXELS_PER_DEGREE = (3840 * Math.PI) / 180;

type Planes = readonly [Float64Array, Float64Array, Float64Array];
type Triple = readonly [number, number, number];

// Linear Rec. 709 to XYZ, from its primaries; a white has the sums of the rows.
const XYZ = [
  0.4123908, 0.3575843, 0.1804808,
  0.2126390, 0.7151687, 0.0721923,
  0.0193308, 0.1191948, 0.9505322,
] as const;
const WHITE: Triple = [
  XYZ[0] + XYZ[1] + XYZ[2], XYZ[3] + XYZ[4] + XYZ[5], XYZ[6] + XYZ[7] + XYZ[8],
];
const RGB = [
  3.2409699, -1.5373832, -0.4986108,
  -0.9692436, 1.8759675, 0.0415551,
  0.0556301, -0.2039770, 1.0569715,
] as const;

// Eye's sensitivity to contrast, equation 4: sums of Gaussians a sqrt(π/b) exp(−π² x² / b), x in
// degrees, for the achromatic, the red-green and the blue-yellow channel.
const SENSITIVITY: readonly (readonly (readonly [number, number])[])[] = [
  [[1, 0.0047]], [[1, 0.0053]], [[34.1, 0.04], [13.5, 0.025]],
];
const WIDEST = 0.04;

const EXPONENT = 0.7; // q_c, equation 8
const KNEE = 0.4; // p_c: this share of the largest colour difference …
const AT_KNEE = 0.95; // p_t: … is this much of an error
const FEATURE_WIDTH = 0.082; // degrees that a detector of edges and points is wide
const FEATURE_EXPONENT = 0.5; // q_f, equation 11

/** Convolves rows with one kernel and columns with another; pixels of the rim are repeated. */
function filtered(values: Float64Array, width: number, height: number,
  rows: Float64Array, columns: Float64Array): Float64Array {
  const radius = (rows.length - 1) / 2;
  const across = new Float64Array(values.length);
  const out = new Float64Array(values.length);
  const padded = new Float64Array(Math.max(width, height) + 2 * radius);
  const line = (from: Float64Array, to: Float64Array, kernel: Float64Array,
    start: number, stride: number, count: number): void => {
    for (let k = 0; k < count + 2 * radius; k++) {
      const at = Math.min(count - 1, Math.max(0, k - radius));
      padded[k] = from[start + at * stride] as number;
    }
    for (let k = 0; k < count; k++) {
      let sum = 0;
      for (let j = 0; j < kernel.length; j++) sum += (kernel[j] as number) * (padded[k + j] as number);
      to[start + k * stride] = sum;
    }
  };
  for (let y = 0; y < height; y++) line(values, across, rows, y * width, 1, width);
  for (let x = 0; x < width; x++) line(across, out, columns, x, width, height);
  return out;
}

const sampled = (radius: number, f: (x: number) => number): Float64Array =>
  Float64Array.from({ length: 2 * radius + 1 }, (_, k) => f(k - radius));
const sum = (values: Float64Array): number => values.reduce((total, v) => total + v, 0);

/** What the eye resolves of each opponent channel. */
function seen(channels: Planes, width: number, height: number): Planes {
  const radius = Math.ceil(3 * Math.sqrt(WIDEST / (2 * Math.PI ** 2)) * PIXELS_PER_DEGREE);
  return channels.map((channel, c) => {
    const parts = (SENSITIVITY[c] ?? []).map(([a, b]) => {
      const kernel = sampled(radius, (x) => Math.exp(-(((Math.PI * x) / PIXELS_PER_DEGREE) ** 2) / b));
      return { kernel, weight: a * Math.sqrt(Math.PI / b) };
    });
    const total = parts.reduce((so, { kernel, weight }) => so + weight * sum(kernel) ** 2, 0);
    const out = new Float64Array(channel.length);
    for (const { kernel, weight } of parts) {
      const part = filtered(channel, width, height, kernel, kernel);
      for (let k = 0; k < out.length; k++) out[k] = (out[k] as number) + (weight / total) * (part[k] as number);
    }
    return out;
  }) as unknown as Planes;
}

/** YCxCz, a linear form of CIELAB in which light may be averaged (equation 3). */
function opponent(image: Image): Planes {
  const count = image.width * image.height;
  const out: Planes = [new Float64Array(count), new Float64Array(count), new Float64Array(count)];
  const { planes } = image;
  for (let k = 0; k < count; k++) {
    const r = clamped(planes[k] as number);
    const g = clamped(planes[k + count] as number);
    const b = clamped(planes[k + 2 * count] as number);
    const x = (XYZ[0] * r + XYZ[1] * g + XYZ[2] * b) / WHITE[0];
    const y = (XYZ[3] * r + XYZ[4] * g + XYZ[5] * b) / WHITE[1];
    const z = (XYZ[6] * r + XYZ[7] * g + XYZ[8] * b) / WHITE[2];
    out[0][k] = 116 * y - 16;
    out[1][k] = 500 * (x - y);
    out[2][k] = 200 * (y - z);
  }
  return out;
}

const lightness = (t: number): number =>
  t > 216 / 24389 ? Math.cbrt(t) : ((24389 / 27) * t + 16) / 116;

/** CIELAB with Hunt's effect, what is dark is less colourful (equation 5), of linear light. */
function hunt(r: number, g: number, b: number): Triple {
  const x = lightness((XYZ[0] * r + XYZ[1] * g + XYZ[2] * b) / WHITE[0]);
  const y = lightness((XYZ[3] * r + XYZ[4] * g + XYZ[5] * b) / WHITE[1]);
  const z = lightness((XYZ[6] * r + XYZ[7] * g + XYZ[8] * b) / WHITE[2]);
  const L = 116 * y - 16;
  return [L, 0.01 * L * 500 * (x - y), 0.01 * L * 200 * (y - z)];
}

const clamped = (v: number): number => Math.min(1, Math.max(0, v));

function perceived([Y, Cx, Cz]: Planes, k: number): Triple {
  const y = ((Y[k] as number) + 16) / 116;
  const X = WHITE[0] * (y + (Cx[k] as number) / 500);
  const Z = WHITE[2] * (y - (Cz[k] as number) / 200);
  const YY = WHITE[1] * y;
  return hunt(
    clamped(RGB[0] * X + RGB[1] * YY + RGB[2] * Z),
    clamped(RGB[3] * X + RGB[4] * YY + RGB[5] * Z),
    clamped(RGB[6] * X + RGB[7] * YY + RGB[8] * Z),
  );
}

const apart = (p: Triple, q: Triple): number =>
  Math.abs(p[0] - q[0]) + Math.hypot(p[1] - q[1], p[2] - q[2]); // HyAB, equation 6

const LARGEST = apart(hunt(0, 1, 0), hunt(0, 0, 1)) ** EXPONENT;

/** Of a distance in colour: an error of 0 to 1, large ones compressed (equation 8). */
function colourError(distance: number): number {
  const error = distance ** EXPONENT;
  const knee = KNEE * LARGEST;
  return error < knee ? (AT_KNEE / knee) * error
    : AT_KNEE + ((error - knee) / (LARGEST - knee)) * (1 - AT_KNEE);
}

interface Features {
  readonly edges: Float64Array;
  readonly points: Float64Array;
}

/** How strong edges and points are in each pixel (equations 9 and 10). */
function features(luminance: Float64Array, width: number, height: number): Features {
  const deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
  const radius = Math.ceil(3 * deviation);
  const bell = sampled(radius, (x) => Math.exp(-(x * x) / (2 * deviation * deviation)));
  const norm = sum(bell);
  const even = bell.map((v) => v / norm);
  // Positive and negative weights each sum to one in size.
  const balanced = (kernel: Float64Array): Float64Array => {
    const above = sum(kernel.map((v) => Math.max(0, v)));
    const below = -sum(kernel.map((v) => Math.min(0, v)));
    return kernel.map((v) => v / (v > 0 ? above : below));
  };
  const slope = balanced(bell.map((v, k) => -(k - radius) * v));
  const bend = balanced(bell.map((v, k) => (((k - radius) / deviation) ** 2 - 1) * v));
  const strength = (kernel: Float64Array): Float64Array => {
    const across = filtered(luminance, width, height, kernel, even);
    const down = filtered(luminance, width, height, even, kernel);
    for (let k = 0; k < across.length; k++) {
      across[k] = Math.sqrt((across[k] as number) ** 2 + (down[k] as number) ** 2);
    }
    return across;
  };
  return { edges: strength(slope), points: strength(bend) };
}

/** The error per pixel, 0 to 1; NaN where a picture is not finite. */
export function flip(a: Image, b: Image): Float32Array {
  const { width, height } = a;
  const channels = [opponent(a), opponent(b)] as const;
  const [one, two] = channels.map((planes) => seen(planes, width, height)) as [Planes, Planes];
  const [p, q] = channels.map(([y]) => features(y.map((v) => (v + 16) / 116), width, height)) as
    [Features, Features];
  const out = new Float32Array(width * height);
  for (let k = 0; k < out.length; k++) {
    const colour = colourError(apart(perceived(one, k), perceived(two, k)));
    const edge = Math.abs((p.edges[k] as number) - (q.edges[k] as number));
    const point = Math.abs((p.points[k] as number) - (q.points[k] as number));
    const feature = (Math.SQRT1_2 * Math.max(edge, point)) ** FEATURE_EXPONENT;
    out[k] = colour ** (1 - feature); // equation 12
  }
  return out;
}
