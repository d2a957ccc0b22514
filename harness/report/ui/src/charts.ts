// Reading values off the curves: the charts are drawn without a script, this lies on top of them.

import type { CurveData } from "./case";
import { h, svg } from "./dom";
import { number } from "./format";

export type ShowRay = (degrees: number) => void;

export function readCharts(
  curves: readonly CurveData[], colours: Readonly<Record<string, string>>, showRay: ShowRay | null,
): void {
  document.querySelectorAll<SVGSVGElement>("svg.chart").forEach((chart, k) => {
    const curve = curves[k];
    if (curve) attach(chart, curve, colours, showRay);
  });
}

function attach(
  chart: SVGSVGElement, curve: CurveData, colours: Readonly<Record<string, string>>,
  showRay: ShowRay | null,
): void {
  const line = svg("path", { class: "cursor" });
  chart.append(line);
  const readout = h("div", { class: "readout", hidden: true });
  const holder = chart.parentElement as HTMLElement;
  holder.classList.add("has-readout");
  holder.append(readout);
  const clickable = showRay !== null && curve.byIncidence;
  if (clickable) chart.classList.add("clickable");
  const valueAt = (event: MouseEvent): number => {
    const box = chart.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * chart.viewBox.baseVal.width;
    const part = (x - curve.left) / (curve.right - curve.left);
    return curve.low + Math.min(1, Math.max(0, part)) * (curve.high - curve.low);
  };
  chart.addEventListener("pointermove", (event) => {
    const wanted = valueAt(event);
    const rows = curve.lines.map((one) => ({ one, k: nearest(one.x, wanted) })).filter((r) => r.k >= 0);
    const x = rows[0]?.one.x[rows[0].k];
    if (x === undefined || x === null) return;
    const at = curve.left + ((x - curve.low) / (curve.high - curve.low)) * (curve.right - curve.left);
    line.setAttribute("d", `M${at.toFixed(1)} 24V${chart.viewBox.baseVal.height - 44}`);
    readout.hidden = false;
    readout.classList.toggle("flipped", at > (curve.left + curve.right) / 2);
    readout.replaceChildren(
      h("b", {}, `${number(x, 5)}${curve.unit}`),
      h("table", {}, ...rows.map(({ one, k }) => h("tr", {},
        h("th", { scope: "row", class: `renderer ${colours[one.renderer] ?? "c7"}` },
          h("i", { class: "dot", "aria-hidden": "true" }), one.renderer),
        h("td", {}, text(one.y[k])),
        h("td", { class: "muted" }, one.residual.length ? text(one.residual[k]) : "")))),
      clickable ? h("small", { class: "muted" }, "click for this ray") : "");
  });
  chart.addEventListener("pointerleave", () => {
    readout.hidden = true;
    line.removeAttribute("d");
  });
  if (clickable) chart.addEventListener("click", (event) => showRay(valueAt(event)));
}

function nearest(xs: readonly (number | null)[], wanted: number): number {
  let best = -1;
  xs.forEach((x, k) => {
    const gap = (i: number): number => Math.abs((xs[i] ?? Infinity) - wanted);
    if (x !== null && (best < 0 || gap(k) < gap(best))) best = k;
  });
  return best;
}

const text = (value: number | null | undefined): string =>
  value === null || value === undefined ? "not finite" : number(value, 5);
