// Shaded pixels, kept until what they show changes.

import { type Encoding, type Scale, shadeFigures, shadeRadiance } from "./colour";
import { h } from "./dom";
import { number } from "./format";
import type { Image } from "./pack";
import type { Sheet } from "./pane";

export class Sheets {
  private readonly known = new Map<string, { key: string; sheet: Sheet }>();

  picture(image: Image, exposure: number, encoding: Encoding): Sheet {
    const count = image.width * image.height;
    return this.sheet(`picture ${image.name}`, `${exposure} ${encoding}`, image.width, image.height,
      (out) => shadeRadiance(image.planes, exposure, encoding, out),
      (x, y) => [0, 1, 2].map((c) =>
        number(image.planes[c * count + y * image.width + x] as number, 3)));
  }

  figures(id: string, figures: Float32Array, width: number, height: number, scale: Scale): Sheet {
    return this.sheet(id, `${scale.low} ${scale.high}`, width, height,
      (out) => shadeFigures(figures, scale, out),
      (x, y) => [number(figures[y * width + x] as number, 3)]);
  }

  private sheet(id: string, key: string, width: number, height: number,
    shade: (out: Uint8ClampedArray) => void, text: Sheet["text"]): Sheet {
    const known = this.known.get(id);
    if (known?.key === key) return known.sheet;
    const canvas = known?.sheet.canvas ?? h("canvas", { width, height });
    const pixels = new ImageData(width, height);
    shade(pixels.data);
    canvas.getContext("2d")?.putImageData(pixels, 0, 0);
    const sheet = { canvas, text };
    this.known.set(id, { key, sheet });
    return sheet;
  }
}
