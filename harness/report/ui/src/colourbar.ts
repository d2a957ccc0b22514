// The bar that says what the colours of a map mean.

import { type Scale, share, strip } from "./colour";
import { h, svg } from "./dom";
import { number } from "./format";

export function colourBar(scale: Scale, title: string, unit: string): HTMLElement {
  const canvas = h("canvas", { width: 512, height: 1, "aria-hidden": "true" });
  const pixels = new ImageData(512, 1);
  const colours = strip(scale.colours);
  for (let k = 0; k < 512; k++) {
    const at = 3 * Math.round((k / 511) * (colours.length / 3 - 1));
    pixels.data.set([colours[at] ?? 0, colours[at + 1] ?? 0, colours[at + 2] ?? 0, 255], 4 * k);
  }
  canvas.getContext("2d")?.putImageData(pixels, 0, 0);
  const ticks: number[] = [];
  if (scale.log) {
    for (let p = Math.ceil(Math.log10(scale.low)); p <= Math.log10(scale.high) + 1e-9; p += 2) {
      ticks.push(10 ** p);
    }
  } else ticks.push(scale.low, (scale.low + scale.high) / 2, scale.high);
  const marks = svg("svg", { viewBox: "0 0 512 16", preserveAspectRatio: "none", "aria-hidden": "true" });
  for (const tick of ticks) {
    marks.append(svg("path", { d: `M${(share(scale, tick) * 510 + 1).toFixed(1)} 0v6` }));
  }
  const labels = h("div", { class: "bar-labels" }, ...ticks.map((tick) => {
    const label = h("span", {}, number(tick, 3));
    label.style.left = `${100 * share(scale, tick)}%`;
    return label;
  }));
  return h("div", { class: "colour-scale" },
    h("p", { class: "small" }, h("b", {}, title), unit && ` in ${unit}`,
      h("span", { class: "muted" }, scale.log ? ", logarithmic; e and E move its end" : "; e and E move its end")),
    h("div", { class: "bar-body" }, canvas, marks, labels),
    h("p", { class: "muted small" }, h("b", { class: "swatch beyond" }, "more"), " ",
      scale.gaps ? h("b", { class: "swatch not-measured" }, "not measured")
        : h("b", { class: "swatch not-finite" }, "not finite")));
}
