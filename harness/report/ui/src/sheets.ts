// Pictures and maps, ready to be drawn under a camera. What has been shaded is kept until what it
// shows changes. Of large pictures no more is shaded than is seen: from afar a smaller one, from
// near the part in view. Why not on the graphics card: docs/decisions/0014-the-pages-script.md.

import { type Encoding, type Scale, shadeFigures, shadeRadiance } from "./colour";
import { h } from "./dom";
import { number } from "./format";
import type { Image } from "./pack";
import type { Sheet, View } from "./pane";
import { cropped, halved, mean, type Part, type Planes, worst } from "./pyramid";

const LARGE = 512 * 512; // pixels; what is smaller is shaded as a whole, and then moves for nothing
const IN_HURRY = 1 << 20; // pixels of all pictures together that are shaded while a slider is dragged

interface Source {
  readonly id: string;
  readonly how: string; // what is shaded differs where this does
  readonly planes: Planes;
  readonly light: boolean; // may be averaged; of figures none may be lost
  readonly shade: (data: Float32Array, out: Uint8ClampedArray) => void;
}

export class Sheets {
  /** While set, large pictures are shaded coarser than the screen, `shares` of them at once. */
  hurry = false;
  shares = 1;
  private readonly known = new Map<string, { key: string; canvas: HTMLCanvasElement }>();
  private readonly smaller = new Map<Float32Array, Planes>();

  picture(image: Image, exposure: number, encoding: Encoding): Sheet {
    const { planes: data, width, height } = image;
    const count = width * height;
    return this.sheet({
      id: `picture ${image.name}`, how: `${exposure} ${encoding}`, planes: { data, width, height },
      light: true, shade: (some, out) => shadeRadiance(some, exposure, encoding, out),
    }, (x, y) => [0, 1, 2].map((c) => number(data[c * count + y * width + x] as number, 3)));
  }

  figures(id: string, figures: Float32Array, width: number, height: number, scale: Scale): Sheet {
    return this.sheet({
      id, how: `${scale.low} ${scale.high}`, planes: { data: figures, width, height },
      light: false, shade: (some, out) => shadeFigures(some, scale, out),
    }, (x, y) => [number(figures[y * width + x] as number, 3)]);
  }

  private sheet(source: Source, text: Sheet["text"]): Sheet {
    return {
      text,
      paint: (context, view, width, height) => {
        const { planes } = source;
        const [across, down] = [(width / planes.width) * view.scale, (height / planes.height) * view.scale];
        const seen = Math.min(planes.width, view.width / across) * Math.min(planes.height, view.height / down);
        const { level, factor } = this.level(source, Math.max(across, down), seen);
        const part = inView(level, view, across * factor, down * factor);
        if (!part) return;
        const canvas = this.shaded(source, level, part);
        if (!source.light) context.imageSmoothingEnabled = false;
        // The last cells of a smaller one may reach beyond the picture; that much is left out.
        const [right, bottom] = [
          Math.min(part.x + part.width, planes.width / factor) - part.x,
          Math.min(part.y + part.height, planes.height / factor) - part.y,
        ];
        context.drawImage(canvas, 0, 0, right, bottom,
          view.left + part.x * across * factor, view.top + part.y * down * factor,
          right * across * factor, bottom * down * factor);
      },
    };
  }

  /**
   * Of a large picture a form that has about a pixel for each of the screen's, of any map one that
   * has no more; `seen` is how many of its own pixels are in view.
   */
  private level({ planes, light }: Source, scale: number, seen: number): { level: Planes; factor: number } {
    let [level, factor] = [planes, 1];
    const pool = light ? mean : worst;
    const wanted = (): boolean => {
      const size = level.width * level.height;
      const room = IN_HURRY / this.shares / (light ? 1 : 4); // figures take a logarithm each
      if (size > LARGE && this.hurry && seen / factor ** 2 > room) return true;
      return light ? size > LARGE && scale * factor <= Math.SQRT1_2 : size > 1 && scale * factor < 1;
    };
    while (wanted()) {
      let next = this.smaller.get(level.data);
      if (!next) this.smaller.set(level.data, (next = halved(level, pool)));
      [level, factor] = [next, 2 * factor];
    }
    return { level, factor };
  }

  private shaded({ id, how, shade }: Source, level: Planes, part: Part): HTMLCanvasElement {
    const key = [how, level.width, part.x, part.y, part.width, part.height].join();
    const known = this.known.get(id);
    if (known?.key === key) return known.canvas;
    const { width, height } = part;
    const canvas = known?.canvas ?? h("canvas", {});
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    const whole = width === level.width && height === level.height;
    const pixels = new ImageData(width, height);
    shade((whole ? level : cropped(level, part)).data, pixels.data);
    canvas.getContext("2d")?.putImageData(pixels, 0, 0);
    this.known.set(id, { key, canvas });
    return canvas;
  }
}

/** The part of a picture that a view shows, all of one that is not large; null where none is. */
function inView(level: Planes, view: View, across: number, down: number): Part | null {
  const { width, height } = level;
  if (width * height <= LARGE) return { x: 0, y: 0, width, height };
  const x = Math.max(0, Math.floor(-view.left / across));
  const y = Math.max(0, Math.floor(-view.top / down));
  const part = {
    x, y,
    width: Math.min(width, Math.ceil((view.width - view.left) / across)) - x,
    height: Math.min(height, Math.ceil((view.height - view.top) / down)) - y,
  };
  return part.width > 0 && part.height > 0 ? part : null;
}
