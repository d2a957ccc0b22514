// Maps of how two images differ. What counts is judged in harness/measure/images.py; these show
// where it comes from, in the same settings, and a test holds them against it.

import type { Image } from "./pack";

/** Largest |a − b| of the three channels. */
export function difference(a: Image, b: Image): Float32Array {
  const count = a.width * a.height;
  const out = new Float32Array(count);
  for (let k = 0; k < count; k++) {
    let most = 0;
    for (let c = 0; c < 3; c++) {
      const off = Math.abs((a.planes[k + c * count] as number) - (b.planes[k + c * count] as number));
      most = off > most || Number.isNaN(off) ? off : most;
      if (Number.isNaN(off)) break;
    }
    out[k] = most;
  }
  return out;
}

/** (a − b) / max(|a|, |b|) of the channel that differs by most; 0 where both are black. */
export function relative(a: Image, b: Image): Float32Array {
  const count = a.width * a.height;
  const out = new Float32Array(count);
  for (let k = 0; k < count; k++) {
    let most = 0;
    for (let c = 0; c < 3; c++) {
      const x = a.planes[k + c * count] as number;
      const y = b.planes[k + c * count] as number;
      const off = x === y ? 0 : (x - y) / Math.max(Math.abs(x), Math.abs(y));
      if (Number.isNaN(off)) { most = Number.NaN; break; }
      if (Math.abs(off) > Math.abs(most)) most = off;
    }
    out[k] = most;
  }
  return out;
}

// --- structural similarity ---------------------------------------------------------------------

const RADIUS = 5; // truncated at 3.5 sigma, as scikit-image does
const KERNEL = (() => {
  const weights = Array.from({ length: 2 * RADIUS + 1 }, (_, k) =>
    Math.exp(-((k - RADIUS) ** 2) / (2 * 1.5 ** 2)));
  const total = weights.reduce((sum, w) => sum + w, 0);
  return weights.map((w) => w / total);
})();

function blurred(values: Float64Array, width: number, height: number): Float64Array {
  const mirror = (k: number, n: number): number => {
    const period = 2 * n;
    const at = ((k % period) + period) % period;
    return at < n ? at : period - 1 - at;
  };
  const across = new Float64Array(values.length);
  const out = new Float64Array(values.length);
  const columns = Array.from({ length: width + 2 * RADIUS }, (_, k) => mirror(k - RADIUS, width));
  const rows = Array.from({ length: height + 2 * RADIUS }, (_, k) => mirror(k - RADIUS, height));
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      let sum = 0;
      for (let k = 0; k <= 2 * RADIUS; k++) {
        sum += (KERNEL[k] as number) * (values[y * width + (columns[x + k] as number)] as number);
      }
      across[y * width + x] = sum;
    }
  }
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      let sum = 0;
      for (let k = 0; k <= 2 * RADIUS; k++) {
        sum += (KERNEL[k] as number) * (across[(rows[y + k] as number) * width + x] as number);
      }
      out[y * width + x] = sum;
    }
  }
  return out;
}

/** 1 − SSIM per pixel, the mean of the channels: Gaussian weights of sigma 1.5 (Wang et al. 2004). */
export function dissimilarity(a: Image, b: Image): Float32Array {
  const { width, height } = a;
  const count = width * height;
  let range = 0;
  for (const planes of [a.planes, b.planes]) for (const v of planes) if (v > range) range = v;
  const c1 = (0.01 * range) ** 2;
  const c2 = (0.03 * range) ** 2;
  const out = new Float32Array(count);
  for (let channel = 0; channel < 3; channel++) {
    const x = Float64Array.from(a.planes.subarray(channel * count, (channel + 1) * count));
    const y = Float64Array.from(b.planes.subarray(channel * count, (channel + 1) * count));
    const blur = (f: (p: number, q: number) => number): Float64Array =>
      blurred(x.map((p, k) => f(p, y[k] as number)), width, height);
    const mx = blur((p) => p);
    const my = blur((_, q) => q);
    const xx = blur((p) => p * p);
    const yy = blur((_, q) => q * q);
    const xy = blur((p, q) => p * q);
    for (let k = 0; k < count; k++) {
      const u = mx[k] as number;
      const v = my[k] as number;
      const top = (2 * u * v + c1) * (2 * ((xy[k] as number) - u * v) + c2);
      const vx = (xx[k] as number) - u * u;
      const vy = (yy[k] as number) - v * v;
      const below = (u * u + v * v + c1) * (vx + vy + c2);
      out[k] = (out[k] as number) + (1 - top / below) / 3;
    }
  }
  return out;
}

// --- CIEDE2000 ---------------------------------------------------------------------------------

type Lab = [number, number, number];
const WHITE: Lab = [0.95045593, 1, 1.08905775]; // of D65, x 0.3127, y 0.3290

function lab(r: number, g: number, b: number): Lab {
  const [R, G, B] = [Math.max(r, 0), Math.max(g, 0), Math.max(b, 0)];
  const xyz: Lab = [
    0.4124 * R + 0.3576 * G + 0.1805 * B,
    0.2126 * R + 0.7152 * G + 0.0722 * B,
    0.0193 * R + 0.1192 * G + 0.9505 * B,
  ];
  const f = xyz.map((v, k) => {
    const t = v / (WHITE[k] as number);
    return t > 216 / 24389 ? Math.cbrt(t) : ((24389 / 27) * t + 16) / 116;
  }) as Lab;
  return [116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])];
}

/** Sharma, Wu, Dalal 2005, equations 2 to 22. */
export function ciede2000(one: Lab, two: Lab): number {
  const [L1, a1, b1] = one;
  const [L2, a2, b2] = two;
  const radians = Math.PI / 180;
  const mean7 = ((Math.hypot(a1, b1) + Math.hypot(a2, b2)) / 2) ** 7;
  const G = 0.5 * (1 - Math.sqrt(mean7 / (mean7 + 25 ** 7)));
  const p1 = (1 + G) * a1;
  const p2 = (1 + G) * a2;
  const C1 = Math.hypot(p1, b1);
  const C2 = Math.hypot(p2, b2);
  const hue = (p: number, b: number): number =>
    p === 0 && b === 0 ? 0 : (Math.atan2(b, p) / radians + 360) % 360;
  const h1 = hue(p1, b1);
  const h2 = hue(p2, b2);
  const grey = C1 * C2 === 0;
  let dh = grey ? 0 : h2 - h1;
  if (dh > 180) dh -= 360;
  if (dh < -180) dh += 360;
  let hm = h1 + h2;
  if (!grey) {
    if (Math.abs(h1 - h2) <= 180) hm /= 2;
    else hm = hm < 360 ? (hm + 360) / 2 : (hm - 360) / 2;
  }
  const dL = L2 - L1;
  const dC = C2 - C1;
  const dH = 2 * Math.sqrt(C1 * C2) * Math.sin((dh / 2) * radians);
  const Lm = (L1 + L2) / 2;
  const Cm = (C1 + C2) / 2;
  const T = 1 - 0.17 * Math.cos((hm - 30) * radians) + 0.24 * Math.cos(2 * hm * radians)
    + 0.32 * Math.cos((3 * hm + 6) * radians) - 0.2 * Math.cos((4 * hm - 63) * radians);
  const SL = 1 + (0.015 * (Lm - 50) ** 2) / Math.sqrt(20 + (Lm - 50) ** 2);
  const SC = 1 + 0.045 * Cm;
  const SH = 1 + 0.015 * Cm * T;
  const RC = 2 * Math.sqrt(Cm ** 7 / (Cm ** 7 + 25 ** 7));
  const RT = -Math.sin(60 * Math.exp(-(((hm - 275) / 25) ** 2)) * radians) * RC;
  const [l, c, hh] = [dL / SL, dC / SC, dH / SH];
  return Math.sqrt(Math.max(0, l * l + c * c + hh * hh + RT * c * hh));
}

export function deltaE(a: Image, b: Image): Float32Array {
  const count = a.width * a.height;
  const at = (image: Image, k: number): Lab => lab(
    image.planes[k] as number,
    image.planes[k + count] as number,
    image.planes[k + 2 * count] as number,
  );
  return Float32Array.from({ length: count }, (_, k) => ciede2000(at(a, k), at(b, k)));
}
