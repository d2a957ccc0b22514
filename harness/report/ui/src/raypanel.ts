// The ray of the pinned pixel: its section, its landing points magnified, its figures.

import type { FirstRay } from "./case";
import { h } from "./dom";
import { number } from "./format";
import type { Silent } from "./pack";
import type { Ray, Rays } from "./rays";
import { landingOf, sectionOf } from "./section";
import type { Pixel } from "./state";
import { solidView } from "./solidview";
import { dot, length, minus, unit } from "./vector";

const STATUS = ["landed", "missed", "totally reflected", "met another interface first"];
// A ray on its main way takes what comes, so that nothing can be missed.
const STATUS_OF_WAY = ["landed", "left the scene", "went no further", "was followed no further"];

export class RayPanel {
  readonly element: HTMLElement;
  private readonly body = h("div", { class: "ray-body" });
  private readonly rays: readonly Rays[];
  private readonly chooser = h("select", { "aria-label": "Probe" });
  private pixel: Pixel | null = null;
  private shownFor = "";

  constructor(
    probes: readonly Rays[],
    ways: readonly Rays[],
    private readonly silent: readonly Silent[],
    private readonly colours: Readonly<Record<string, string>>,
    private readonly first: FirstRay | null,
  ) {
    this.rays = [...probes, ...ways];
    this.rays.forEach((one, k) => this.chooser.append(h("option", { value: k }, one.teller
      ? `picture, as ${one.teller} tells` : `probe ${one.probe.name}, path ${one.probe.path || "direct"}`)));
    const chosen = probes.findIndex((one) => one.probe.name === first?.probe);
    this.chooser.value = String(Math.max(0, chosen));
    this.chooser.addEventListener("change", () => this.draw());
    this.element = h("section", { id: "ray", class: "ray-panel", "aria-labelledby": "h-ray", hidden: !this.rays.length && !silent.length },
      h("div", { class: "section-head" }, h("h2", { id: "h-ray" }, "The ray of a pixel"), this.rays.length > 0 && this.chooser),
      this.body);
    this.draw();
  }

  show(pixel: Pixel | null): void {
    this.pixel = pixel;
    this.draw();
  }

  private draw(): void {
    const rays = this.rays[Number(this.chooser.value) || 0];
    if (!rays) {
      this.body.replaceChildren(untold(this.silent));
      return;
    }
    const { width, height } = rays.probe;
    const first = rays.probe.name === this.first?.probe ? this.first : null;
    const ray = rays.nearest(
      this.pixel?.x ?? first?.pixel[0] ?? width * 0.68, this.pixel?.y ?? first?.pixel[1] ?? height / 2);
    const key = `${this.chooser.value} ${ray.x} ${ray.y} ${this.pixel !== null}`;
    if (key === this.shownFor) return;
    this.shownFor = key;
    this.body.replaceChildren(
      h("figure", { class: "card" }, sectionOf(rays, ray, this.colours)),
      h("div", { class: "ray-facts" },
        h("p", {}, h("b", {}, `Ray of pixel (${ray.x}, ${ray.y})`),
          ` ${(rays.teller ? STATUS_OF_WAY : STATUS)[ray.status] ?? ""}`, this.besides(rays, ray),
          !this.pixel && h("span", { class: "muted" }, first && `, where ${first.renderer} is furthest off`,
            "; click a pixel above for another")),
        rays.teller && h("p", { class: "muted" }, mainWay(rays, ray)),
        interfaceTable(ray), rendererTable(ray, this.colours),
        captioned("Landings around the true one", landingOf(rays, ray, this.colours)),
        captioned("In space; drag to turn", solidView(rays, ray)),
        rays.teller && this.silent.length > 0 && untold(this.silent)));
  }

  /** How far away the ray is that stands for the pinned pixel. */
  private besides(rays: Rays, ray: Ray): string {
    if (!this.pixel) return "";
    const [dx, dy] = [ray.x - this.pixel.x, ray.y - this.pixel.y];
    if (!dx && !dy) return "";
    const away = Math.hypot(dx, dy);
    return `; of those that were followed, every ${rays.probe.step} pixels, it is the nearest to ` +
      `(${this.pixel.x}, ${this.pixel.y}), ${number(away, 2)} ${away === 1 ? "pixel" : "pixels"} away`;
  }
}

function mainWay(rays: Rays, ray: Ray): string {
  const share = `${number(100 * ray.weight, 3)} % of the light`;
  const nm = "nm" in rays.probe && rays.probe.nm;
  const light = nm ? `, at ${number(nm, 5)} nm` : "";
  return `The main way${light}, as ${rays.teller} followed it: through what transmits, back from what does not. ` +
    `By Fresnel ${share} takes it; what is reflected on the way is not drawn.`;
}

function untold(silent: readonly Silent[]): HTMLElement {
  return h("dl", { class: "muted small" }, h("dt", {}, "Whose rays are not known"),
    ...silent.map((one) => h("dd", {}, `${one.name}: ${one.reason}`)));
}

function captioned(text: string, drawing: SVGElement | HTMLElement | null): HTMLElement | null {
  return drawing && h("figure", {}, drawing, h("figcaption", { class: "muted small" }, text));
}

const HAPPENS: Readonly<Record<string, string>> = { T: "transmitted", R: "reflected", M: "mirrored" };

function interfaceTable(ray: Ray): HTMLElement | null {
  if (!ray.letters) return null;
  const angle = (value: number | undefined): string =>
    value === undefined || !Number.isFinite(value) ? "–" : `${value.toFixed(4)}°`;
  return h("table", { class: "mini-table" },
    h("thead", {}, h("tr", {}, ...["interface", "", "θᵢ", "θₜ"].map((t) => h("th", { scope: "col" }, t)))),
    h("tbody", {}, ...[...ray.letters].map((letter, k) => h("tr", {},
      h("th", { scope: "row" }, String(k + 1)),
      h("td", {}, HAPPENS[letter] ?? ""),
      h("td", { class: "num" }, angle(ray.thetaI[k])),
      h("td", { class: "num" }, letter === "T" ? angle(ray.thetaT[k]) : angle(ray.thetaI[k]))))));
}

function rendererTable(ray: Ray, colours: Readonly<Record<string, string>>): HTMLElement | null {
  if (ray.status !== 0 || !ray.renderers.length) return null;
  const last = ray.vertices[ray.vertices.length - 1];
  const before = ray.vertices[ray.vertices.length - 2];
  const direction = last && before ? unit(minus(last, before)) : null;
  return h("table", { class: "mini-table" },
    h("thead", {}, h("tr", {}, ...["renderer", "landed off by", "direction off by"].map((t) =>
      h("th", { scope: "col" }, t)))),
    h("tbody", {}, ...ray.renderers.map((r) => {
      const seen = r.shift.every(Number.isFinite);
      const across = direction
        ? length(minus(r.turn, [0, 1, 2].map((k) => dot(r.turn, direction) * (direction[k] ?? 0)) as unknown as typeof r.turn))
        : Number.NaN;
      return h("tr", {},
        h("th", { scope: "row" }, h("span", { class: `renderer ${colours[r.name] ?? "c7"}` },
          h("i", { class: "dot", "aria-hidden": "true" }), r.name)),
        h("td", { class: "num" }, seen ? `${number(length(r.shift), 3)} units` : "not seen"),
        h("td", { class: "num" }, Number.isFinite(across) ? `${number(across * 1e6, 3)} µrad` : "–"));
    })));
}
