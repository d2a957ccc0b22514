// Large pictures in fewer pixels, so that shading costs what is seen and not what there is.

export interface Planes {
  readonly data: Float32Array; // planes of width × height, one after the other
  readonly width: number;
  readonly height: number;
}

export interface Part {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

/** What becomes of four pixels: of light its mean; of figures the one furthest from zero. */
export type Pool = (a: number, b: number, c: number, d: number) => number;

export const mean: Pool = (a, b, c, d) => (a + b + c + d) / 4;

const further = (a: number, b: number): number =>
  Math.abs(a) >= Math.abs(b) || Number.isNaN(a) ? a : b;

/** A map that is shown small must not lose the one pixel that is wrong; NaN is the worst of all. */
export const worst: Pool = (a, b, c, d) => further(further(a, b), further(c, d));

/** Half as wide and half as high, rounded up; at the rim the last pixels count twice. */
export function halved({ data, width, height }: Planes, pool: Pool): Planes {
  const [w, h] = [Math.ceil(width / 2), Math.ceil(height / 2)];
  const layers = data.length / (width * height);
  const out = new Float32Array(w * h * layers);
  for (let layer = 0; layer < layers; layer++) {
    const start = layer * width * height;
    for (let y = 0; y < h; y++) {
      const one = start + 2 * y * width;
      const two = 2 * y + 1 < height ? one + width : one;
      for (let x = 0; x < w; x++) {
        const [left, right] = [2 * x, Math.min(2 * x + 1, width - 1)];
        out[layer * w * h + y * w + x] = pool(
          data[one + left] as number, data[one + right] as number,
          data[two + left] as number, data[two + right] as number);
      }
    }
  }
  return { data: out, width: w, height: h };
}

/** The pixels of a part alone. */
export function cropped({ data, width, height }: Planes, part: Part): Planes {
  const layers = data.length / (width * height);
  const out = new Float32Array(part.width * part.height * layers);
  for (let layer = 0; layer < layers; layer++) {
    for (let y = 0; y < part.height; y++) {
      const from = layer * width * height + (part.y + y) * width + part.x;
      out.set(data.subarray(from, from + part.width), (layer * part.height + y) * part.width);
    }
  }
  return { data: out, width: part.width, height: part.height };
}
