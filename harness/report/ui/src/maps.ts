// The modes that show a figure per pixel: what it is, in which unit, on which scale.

import type { Scale } from "./colour";
import { flip } from "./flip";
import { deltaE, difference, dissimilarity, relative } from "./metrics";
import type { Image } from "./pack";
import type { Mode } from "./state";

export interface MapMode {
  readonly title: string;
  readonly unit: string;
  /** Exposure moves the end of the scale, as it does in tev; each stop halves it. */
  readonly scale: (exposure: number) => Scale;
  readonly figures: ((a: Image, b: Image) => Float32Array) | null; // null: comes with the rays
}

const up = (high: number, decades: number) => (exposure: number): Scale => {
  const end = high * 2 ** -exposure;
  return { colours: "inferno", low: end / 10 ** decades, high: end, log: true };
};

export const MAPS: Partial<Record<Mode, MapMode>> = {
  diff: { title: "|A − B|", unit: "radiance", scale: up(1, 9), figures: difference },
  relative: {
    title: "(A − B) / max(|A|, |B|)",
    unit: "",
    scale: (exposure) => {
      const end = 0.1 * 2 ** -exposure;
      return { colours: "signed", low: -end, high: end, log: false };
    },
    figures: relative,
  },
  ssim: { title: "1 − SSIM", unit: "", scale: up(1, 6), figures: dissimilarity },
  deltae: {
    title: "ΔE₀₀",
    unit: "",
    scale: (exposure) => ({ colours: "inferno", low: 0, high: 10 * 2 ** -exposure, log: false }),
    figures: deltaE,
  },
  flip: {
    title: "FLIP",
    unit: "",
    scale: (exposure) => ({ colours: "inferno", low: 0, high: 2 ** -exposure, log: false }),
    figures: flip,
  },
  rays: { title: "ray error", unit: "µrad", scale: (exposure) => ({ ...up(1e5, 9)(exposure), gaps: true }), figures: null },
};

/**
 * Of figures (W × H): the largest that are not neighbours of a larger one, with their places; those
 * that are `lost` count as larger than any number. Looks for one after the other: that is exact, and
 * sorting millions of figures is not to be waited for.
 */
export function worstPixels(
  figures: Float32Array, width: number, lost: (k: number) => boolean, most = 8,
): { x: number; y: number; value: number }[] {
  const near = Math.max(2, Math.round(width / 48)) ** 2;
  const found: { x: number; y: number; value: number }[] = [];
  const taken = (k: number): boolean => {
    const [x, y] = [k % width, Math.floor(k / width)];
    return found.some((f) => (f.x - x) ** 2 + (f.y - y) ** 2 <= near);
  };
  while (found.length < most) {
    let [best, at] = [0, -1];
    for (let k = 0; k < figures.length && best < Infinity; k++) {
      const figure = figures[k] as number;
      const size = Number.isNaN(figure) && lost(k) ? Infinity : Math.abs(figure); // NaN is never larger
      if (size > best && !taken(k)) [best, at] = [size, k];
    }
    if (at < 0) break;
    found.push({ x: at % width, y: Math.floor(at / width), value: figures[at] as number });
  }
  return found;
}

/** Whether only one of two pictures of the same size is finite at pixel k; both are not where a view has none. */
export function lostIn(one: Image, two: Image): (k: number) => boolean {
  const finite = ({ planes, width, height }: Image, k: number): boolean =>
    [0, 1, 2].every((c) => Number.isFinite(planes[c * width * height + k]));
  return (k) => finite(one, k) !== finite(two, k);
}
