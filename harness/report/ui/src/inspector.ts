// What a pixel holds in every picture, where pictures differ most, and how values are spread.

import { h, svg } from "./dom";
import { exact, number } from "./format";
import { worstPixels } from "./maps";
import type { Image } from "./pack";
import type { Pixel } from "./state";

export interface ErrorMap {
  readonly name: string;
  readonly figures: Float32Array;
  readonly width: number;
  readonly step: number;
}

const BINS = 64;

export class Inspector {
  readonly element: HTMLElement;
  private readonly heading = h("h3", {}, "Pixel");
  private readonly table = h("div", { class: "values scroll", tabindex: 0, role: "region", "aria-label": "Pixel values" });
  private readonly worst = h("div", { class: "worst-pixels" });
  private readonly spread = h("div", { class: "histogram" });
  private readonly clear: HTMLButtonElement;
  private readonly counted = new WeakMap<Image, Counts>();
  private spreadOf: readonly (Image | null)[] = [];
  private shown: { title: string; figures: Float32Array | undefined } | null = null;

  constructor(private readonly jump: (pixel: Pixel) => void, unpin: () => void) {
    this.clear = h("button", { type: "button", class: "plain small", click: unpin }, "unpin");
    this.element = h("aside", { class: "inspector", "aria-label": "Inspector" },
      h("div", { class: "inspector-head" }, this.heading, this.clear), this.table,
      h("h3", {}, "Worst pixels"), this.worst, h("h3", {}, "Histogram"), this.spread);
  }

  values(
    pixel: Pixel | null, pins: number, pinned: boolean,
    rows: readonly { name: HTMLElement; image: Image }[], reference: Image | undefined,
    errors: readonly ErrorMap[],
  ): void {
    this.clear.hidden = pins === 0;
    if (!pixel) {
      this.heading.textContent = "Pixel";
      this.table.replaceChildren(h("p", { class: "muted small" },
        "Point at a pixel for its values; click to pin it" + (errors.length ? " and to see its ray."
          : ". No rays were measured in this case.")));
      return;
    }
    this.heading.textContent = `Pixel (${pixel.x}, ${pixel.y})${pinned ? ", pinned" : ""}`;
    const at = (image: Image): number[] | null => {
      if (pixel.x >= image.width || pixel.y >= image.height) return null;
      const count = image.width * image.height;
      return [0, 1, 2].map((c) => image.planes[c * count + pixel.y * image.width + pixel.x] as number);
    };
    const base = reference ? at(reference) : null;
    const off = new Map<string, string>();
    const body = rows.map(({ name, image }) => {
      const rgb = at(image);
      if (rgb && base && image !== reference) {
        off.set(image.name, number(Math.max(...rgb.map((v, c) => Math.abs(v - (base[c] as number)))), 3));
      }
      return h("tr", { "data-image": image.name },
        h("th", { scope: "row" }, name.cloneNode(true)),
        ...(rgb ?? [null, null, null]).map((v) =>
          h("td", { class: v !== null && !Number.isFinite(v) ? "bad" : null },
            v === null ? "–" : exact(v))));
    });
    const turned = new Map(errors.map((error) => {
      const k = Math.floor(pixel.y / error.step) * error.width + Math.floor(pixel.x / error.step);
      const value = error.figures[k] ?? Number.NaN;
      return [error.name, Number.isNaN(value) ? "not measured" : number(value, 3)];
    }));
    const names = [...new Set([...off.keys(), ...turned.keys()])];
    this.table.replaceChildren(
      rows.length > 0 ? table(["picture", "R", "G", "B"], body) : "",
      names.length > 0 ? table(["picture", reference ? `|A − ${reference.name}|` : "", turned.size ? "ray error, µrad" : ""],
        names.map((name) => h("tr", { "data-off": name }, h("th", { scope: "row" }, name),
          h("td", {}, off.get(name) ?? ""), h("td", {}, turned.get(name) ?? "")))) : "");
  }

  /** Lists the worst of `figures`, first those that are `lost`; where there are none, `problem` says why. */
  figures(
    title: string, unit: string, figures: Float32Array | undefined, width: number, step: number,
    { problem = "", lost = (_: number): boolean => false } = {},
  ): void {
    const key = title || problem;
    if (key === this.shown?.title && figures === this.shown.figures) return;
    this.shown = { title: key, figures };
    const list = figures ? worstPixels(figures, width, lost) : [];
    if (!list.length) {
      this.worst.replaceChildren(h("p", { class: "muted small" },
        figures ? "No pixel differs." : problem || "Choose two pictures to compare."));
      return;
    }
    const buttons = list.map((one) => {
      const pixel = { x: one.x * step, y: one.y * step };
      const text = `(${pixel.x}, ${pixel.y})`;
      const figure = Number.isFinite(one.value)
        ? number(one.value, 3) + (unit ? `\u202f${unit}` : "") : "not finite";
      return h("li", {}, h("button", { type: "button", class: "jump", click: () => this.jump(pixel) },
        h("span", {}, text), h("b", { class: "num" }, figure)));
    });
    this.worst.replaceChildren(h("p", { class: "muted small" }, title), h("ol", {}, ...buttons));
  }

  /** Of the luminance of two pictures, over stops; black and what is not finite are counted apart. */
  histogram(a: Image | null, b: Image | null): void {
    if (this.spreadOf[0] === a && this.spreadOf[1] === b) return;
    this.spreadOf = [a, b];
    const shown = [a, b].filter((image, k, all) => image !== null && all.indexOf(image) === k);
    (this.spread.previousElementSibling as HTMLElement).hidden = !a;
    if (!a) {
      this.spread.replaceChildren();
      return;
    }
    const [low, high] = [-12, 4];
    const counted = shown.map((image) => this.counts(image as Image, low, high));
    const most = Math.max(1, ...counted.flatMap((c) => [...c.bins]));
    const drawing = svg("svg", { viewBox: "0 0 256 76", role: "img",
      "aria-label": "Histogram of luminance in stops", preserveAspectRatio: "none" });
    counted.forEach((one, k) => {
      const points = [...one.bins].map((n, i) =>
        `${(i * 256) / BINS} ${(74 - (70 * Math.log1p(n)) / Math.log1p(most)).toFixed(1)}H${((i + 1) * 256) / BINS}`);
      drawing.append(svg("path", { class: k ? "spread-b" : "spread-a", d: `M0 74L${points.join("L")}L256 74` }));
    });
    const white = ((0 - low) / (high - low)) * 256;
    drawing.append(svg("path", { class: "white", d: `M${white} 0V74` }));
    this.spread.replaceChildren(drawing,
      h("p", { class: "muted small ends" }, h("span", {}, "2⁻¹²"), h("span", {}, "white = 1"), h("span", {}, "2⁴")),
      h("p", { class: "muted small" }, ...counted.map((one, k) =>
        `${k ? "; B" : "A"}: ${one.black} black, ${one.bad} not finite`)));
  }

  private counts(image: Image, low: number, high: number): Counts {
    let found = this.counted.get(image);
    if (!found) this.counted.set(image, (found = counts(image, low, high)));
    return found;
  }
}

interface Counts {
  readonly bins: Uint32Array;
  readonly black: number;
  readonly bad: number;
}

function counts(image: Image, low: number, high: number): Counts {
  const bins = new Uint32Array(BINS);
  const count = image.width * image.height;
  let [black, bad] = [0, 0];
  for (let k = 0; k < count; k++) {
    const y = 0.2126 * (image.planes[k] as number) + 0.7152 * (image.planes[k + count] as number) +
      0.0722 * (image.planes[k + 2 * count] as number);
    if (!Number.isFinite(y)) bad++;
    else if (y <= 0) black++;
    else {
      const bin = Math.floor(((Math.log2(y) - low) / (high - low)) * BINS);
      const at = Math.min(BINS - 1, Math.max(0, bin));
      bins[at] = (bins[at] ?? 0) + 1;
    }
  }
  return { bins, black, bad };
}

function table(heads: readonly string[], rows: readonly HTMLElement[]): HTMLElement {
  return h("table", {},
    h("thead", {}, h("tr", {}, ...heads.map((text, k) =>
      h("th", { scope: "col" }, k ? text : h("span", { class: "hidden" }, text))))),
    h("tbody", {}, ...rows));
}
