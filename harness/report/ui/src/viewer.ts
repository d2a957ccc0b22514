// The viewer of a case: pictures under one camera, in the mode that the state names.

import { readAddress, writeAddress } from "./address";
import type { CaseData } from "./case";
import type { Scale } from "./colour";
import { paneLabel, problemOf } from "./captions";
import { colourBar } from "./colourbar";
import { Controls } from "./controls";
import { h, reducedMotion } from "./dom";
import { superscript } from "./format";
import { firstPair } from "./firstpair";
import { Inspector } from "./inspector";
import { arranged } from "./layout";
import { lostIn, MAPS } from "./maps";
import type { Image } from "./pack";
import { type Layer, Pane, type Sheet } from "./pane";
import type { RayPanel } from "./raypanel";
import type { Rays } from "./rays";
import { Sheets } from "./sheets";
import { fromHash, type Mode, type Pixel, toHash, type ViewState } from "./state";
import { bindViewerKeys } from "./viewerkeys";

const BLINK = 650; // ms
const AT_REST = 150; // ms after the last change of exposure

export class Viewer {
  readonly element: HTMLElement;
  private readonly images: ReadonlyMap<string, Image>;
  private readonly names: readonly string[];
  private readonly own: readonly string[]; // those that are shown without being chosen
  private readonly initial: ViewState;
  private state: ViewState;
  private readonly figuresCache = new Map<string, Float32Array>();
  private readonly sheets = new Sheets();
  private panes: Pane[] = [];
  private readonly stage = h("div", { class: "stage" });
  private readonly bar = h("div", { class: "bar-row" });
  private readonly notice = h("p", { class: "notice", role: "status" });
  private readonly inspector: Inspector;
  private readonly controls: Controls;
  private hovered: Pixel | null = null;
  private swipe = 0.5;
  private showsB = false; // blinking, or Shift held
  private held = false;
  private timer = 0;
  private resting = 0;
  private scheduled = false;
  private blinking = 0;
  private places = 1; // panes, and those that say why there is none

  constructor(
    private readonly data: CaseData, images: readonly Image[], private readonly rays: readonly Rays[],
    private readonly rayPanel: RayPanel, place: HTMLElement,
  ) {
    this.images = new Map(images.map((image) => [image.name, image]));
    this.names = [...this.images.keys()];
    const aside = data.packs.filter((pack) => pack.aside).map((pack) => pack.prefix);
    this.own = this.names.filter((name) => !aside.some((prefix) => name.startsWith(prefix)));
    this.initial = {
      mode: "side", ...firstPair(data, this.own), every: true, exposure: 0, encoding: "srgb",
      camera: null, pins: [],
    };
    this.state = fromHash(readAddress(), this.initial, this.names);
    this.inspector = new Inspector((pixel) => this.jump(pixel), () => this.unpin());
    this.controls = new Controls(this.names, rays.length > 0, {
      set: (change) => this.update(change),
      fit: () => this.update({ camera: null }),
      reset: () => this.update({ exposure: 0, encoding: "srgb" }),
      swipe: (at) => { this.swipe = at; this.schedule(); },
    });
    this.element = h("div", { class: "viewer", tabindex: 0, role: "group",
      "aria-label": "Picture viewer; press ? for its keys" },
      h("h2", { class: "hidden" }, "Viewer"),
      this.controls.element,
      h("div", { class: "viewer-body" },
        h("div", { class: "stage-column" }, this.stage, this.controls.slider, this.bar, this.notice),
        this.inspector.element),
    );
    place.replaceChildren(this.element);
    place.after(this.rayPanel.element);
    new ResizeObserver(() => this.layout()).observe(this.stage);
    bindViewerKeys({
      names: this.names,
      hasRays: this.rays.length > 0,
      state: () => this.state,
      focused: () => this.element.contains(document.activeElement),
      update: (change) => this.update(change),
      choose: (which, name) => this.choose(which, name),
      zoom: (factor) => this.zoom(factor),
      trueSize: () => this.update({ camera: { ...this.current(this.panes[0]), scale: 1 } }),
      hold: (down) => this.hold(down),
      unpin: () => this.unpin(),
    });
    addEventListener("hashchange", () => {
      if (location.hash.includes("=") || location.hash === "") this.restore();
    });
    this.rebuild();
  }

  private restore(): void {
    this.state = fromHash(readAddress(), this.initial, this.names);
    this.rebuild();
  }

  private update(change: Partial<ViewState>): void {
    const structural = ["mode", "a", "b", "every"].some((key) => key in change);
    Object.assign(this.state, change);
    if ("exposure" in change) this.hurry();
    if (structural) this.rebuild();
    else this.refresh();
    this.remember();
  }

  /** While exposure is dragged, frames matter more than pixels; they come when it rests. */
  private hurry(): void {
    this.sheets.hurry = true;
    this.sheets.shares = this.panes.length;
    clearTimeout(this.resting);
    this.resting = setTimeout(() => {
      this.sheets.hurry = false;
      this.schedule();
    }, AT_REST);
  }

  private remember(): void {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      writeAddress(toHash(this.state, this.initial));
    }, 150);
  }

  // --- what is shown -------------------------------------------------------------------------

  private rebuild(): void {
    const { mode } = this.state;
    const shown = this.subjects();
    this.panes = shown.map(() => new Pane({
      hover: (pixel) => this.hover(pixel),
      click: (pixel) => this.pin(pixel),
      pan: (dx, dy) => this.pan(dx, dy),
      zoom: (factor, at, pane) => this.zoom(factor, at, pane),
    }));
    for (const pane of this.panes) pane.camera = () => this.state.camera;
    const missing = mode === "side" ? this.data.absent.map((one) =>
      h("figure", { class: "pane missing" },
        h("figcaption", {}, this.name(one.name)),
        h("div", { class: `frame none s-${one.word === "failed" ? "error" : "skip"}` },
          h("span", {}, one.word), one.reason && h("small", {}, one.reason)))) : [];
    this.stage.replaceChildren(...this.panes.map((pane) => pane.element), ...missing);
    this.places = this.panes.length + missing.length;
    this.notice.textContent = problemOf(this.state, this.images, this.rays.length > 0);
    this.controls.show(this.state, this.rays.length > 0);
    this.layout();
    clearInterval(this.blinking);
    this.showsB = false;
    if (mode === "blink" && !reducedMotion()) {
      this.blinking = setInterval(() => {
        this.showsB = !this.showsB;
        this.schedule();
      }, BLINK);
    }
  }

  /** The names of the pictures that have a pane of their own. */
  private subjects(): string[] {
    const { mode, a, b, every } = this.state;
    if (mode === "side") return [...this.own];
    if (mode === "rays") {
      const names = [...new Set(this.rays.flatMap((r) => [...r.errors.keys()]))];
      return every || !names.includes(a) ? names : [a];
    }
    if (MAPS[mode] && every) return this.own.filter((n) => n !== b && this.fits(n));
    return a ? [a] : [];
  }

  private fits(name: string): boolean {
    const [one, two] = [this.images.get(name), this.images.get(this.state.b)];
    return one?.width === two?.width && one?.height === two?.height;
  }

  private name(text: string): HTMLElement {
    return h("span", { class: `renderer ${this.data.colours[text.split(": ").pop() ?? ""] ?? "c7"}` },
      h("i", { class: "dot", "aria-hidden": "true" }), text);
  }

  private layersOf(subject: string): { layers: Layer[]; image: { width: number; height: number } } {
    const { mode, b, exposure, encoding } = this.state;
    const picture = (image: Image): Sheet => this.sheets.picture(image, exposure, encoding);
    if (mode === "rays") {
      const rays = this.rays.find((r) => r.errors.has(subject));
      const step = rays?.probe.errorStep ?? 1;
      const width = Math.ceil((rays?.probe.width ?? 1) / step);
      const height = Math.ceil((rays?.probe.height ?? 1) / step);
      const figures = rays?.errors.get(subject) ?? new Float32Array(1);
      const sheet = this.sheets.figures(`rays ${subject}`, figures, width, height, this.scale() as Scale);
      return { layers: [{ sheet, from: 0 }], image: { width: width * step, height: height * step } };
    }
    const map = MAPS[mode];
    const image = this.images.get(subject) as Image;
    if (map) {
      if (!this.fits(subject)) return { layers: [], image };
      const figures = this.figures(mode, subject, b);
      const sheet = this.sheets.figures(`${mode} ${subject} ${b}`, figures, image.width, image.height,
        this.scale() as Scale);
      return { layers: [{ sheet, from: 0 }], image };
    }
    const other = this.images.get(b) ?? image;
    const flip = mode === "b" || this.held || (mode === "blink" && this.showsB);
    if (mode === "side") return { layers: [{ sheet: picture(image), from: 0 }], image };
    if (mode === "swipe") {
      return { layers: [
        { sheet: picture(image), from: 0 },
        { sheet: picture(other), from: this.swipe },
      ], image };
    }
    const shown = flip ? other : image;
    return { layers: [{ sheet: picture(shown), from: 0 }], image: shown };
  }

  private figures(mode: Mode, a: string, b: string): Float32Array {
    const key = `${mode} ${a} ${b}`;
    let found = this.figuresCache.get(key);
    if (!found) {
      const [one, two] = [this.images.get(a) as Image, this.images.get(b) as Image];
      found = MAPS[mode]?.figures?.(one, two) ?? new Float32Array(one.width * one.height);
      this.figuresCache.set(key, found);
    }
    return found;
  }

  private scale(): Scale | null {
    return MAPS[this.state.mode]?.scale(this.state.exposure) ?? null;
  }

  // --- drawing -------------------------------------------------------------------------------

  private layout(): void {
    const shape = this.shape();
    const { columns, room } = arranged(this.places, this.stage.clientWidth, shape);
    this.stage.style.setProperty("--panes", String(columns));
    this.eachPane((pane) => pane.fit(room));
    this.refresh();
  }

  private refresh(): void {
    this.controls.show(this.state, this.rays.length > 0);
    this.drawBar();
    this.inspect();
    this.schedule();
  }

  private schedule(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      this.eachPane((pane) => pane.draw(this.state.camera, this.state.pins, this.hovered));
    });
  }

  /** Gives every pane what it shows now, then does `then` with it. */
  private eachPane(then: (pane: Pane) => void): void {
    this.subjects().forEach((subject, k) => {
      const pane = this.panes[k];
      if (!pane) return;
      const { layers, image } = this.layersOf(subject);
      pane.show(paneLabel(this.state, subject), this.caption(subject), layers, image.width, image.height);
      then(pane);
    });
  }

  private caption(subject: string): (Node | string)[] {
    const { mode, b } = this.state;
    if (mode === "side" || mode === "rays") return [this.name(subject)];
    if (MAPS[mode]) return [this.name(subject), h("span", { class: "muted" }, "against"), this.name(b)];
    if (mode === "swipe") return [this.name(subject), h("span", { class: "muted" }, "|"), this.name(b)];
    const flip = mode === "b" || this.held || (mode === "blink" && this.showsB);
    return [h("b", { class: "which" }, flip ? "B" : "A"), this.name(flip ? b : subject)];
  }

  private drawBar(): void {
    const map = MAPS[this.state.mode];
    const scale = this.scale();
    if (!map || !scale) {
      const { exposure, encoding } = this.state;
      this.bar.replaceChildren(h("p", { class: "muted small" },
        `Linear radiance${exposure ? ` × 2${superscript(exposure)}` : ""}, ` +
        `${encoding === "srgb" ? "sRGB" : "gamma 2.2"}; `,
        h("b", { class: "swatch not-finite" }, "magenta"), " is not finite."));
      return;
    }
    this.bar.replaceChildren(colourBar(scale, map.title, map.unit));
  }

  private inspect(): void {
    const { pins, mode, a, b } = this.state;
    const pixel = this.hovered ?? pins[pins.length - 1] ?? null;
    const rows = [...this.images.values()].map((image) => ({ name: this.name(image.name), image }));
    const errors = this.rays.flatMap(({ errors: each, probe }) => [...each].map(([name, figures]) => (
      { name, figures, width: Math.ceil(probe.width / probe.errorStep), step: probe.errorStep })));
    this.inspector.values(pixel, pins.length, this.hovered === null, rows, this.images.get(b), errors);
    const subject = this.subjects()[0] ?? a;
    const focus = mode === "rays" || !MAPS[mode] || !this.state.every ? a : this.images.has(a) && a !== b ? a : subject;
    if (mode === "rays") {
      const one = errors.find((e) => e.name === a) ?? errors[0];
      this.inspector.figures(one ? `ray error of ${one.name}` : "", "µrad",
        one?.figures, one?.width ?? 1, one?.step ?? 1);
    } else if (this.images.has(focus) && focus !== b && this.fits(focus)) {
      const [one, two] = [this.images.get(focus) as Image, this.images.get(b) as Image];
      const by: Mode = MAPS[mode] ? mode : "diff";
      this.inspector.figures(`${MAPS[by]?.title ?? ""}, A ${focus}, B ${b}`, MAPS[by]?.unit ?? "",
        this.figures(by, focus, b), one.width, 1, { lost: lostIn(one, two) });
    } else {
      const problem = problemOf({ ...this.state, mode: "diff", a: focus }, this.images, true);
      this.inspector.figures("", "", undefined, 1, 1, { problem });
    }
    this.inspector.histogram(MAPS[mode] ? null : this.images.get(a) ?? null, this.images.get(b) ?? null);
    this.rayPanel.show(pins[pins.length - 1] ?? null);
  }

  // --- what people do ------------------------------------------------------------------------

  private hover(pixel: Pixel | null): void {
    if (pixel?.x === this.hovered?.x && pixel?.y === this.hovered?.y) return;
    this.hovered = pixel;
    this.inspect();
    this.schedule();
  }

  private pin(pixel: Pixel): void {
    const others = this.state.pins.filter((p) => p.x !== pixel.x || p.y !== pixel.y);
    const fresh = others.length === this.state.pins.length;
    this.update({ pins: fresh ? [...others, pixel].slice(-9) : others });
  }

  private unpin(): void {
    this.hovered = null;
    this.update({ pins: [] });
  }

  /** Pins a pixel and brings it into view. */
  jump(pixel: Pixel): void {
    const others = this.state.pins.filter((p) => p.x !== pixel.x || p.y !== pixel.y);
    const scale = Math.max(this.state.camera?.scale ?? 0, 4 * (this.panes[0]?.fitting ?? 1));
    this.hovered = null;
    this.update({
      pins: [...others, pixel].slice(-9),
      camera: { x: pixel.x + 0.5, y: pixel.y + 0.5, scale },
    });
  }

  /** Pins the ray of the middle row that comes in at this angle. */
  showRay(degrees: number): void {
    const ray = this.rays.map((rays) => rays.withIncidence(degrees)).find((found) => found !== null);
    if (!ray) return;
    this.update({ pins: [{ x: ray.x, y: ray.y }] });
    this.rayPanel.element.scrollIntoView({ block: "nearest" });
  }

  /** Height over width of what is shown. */
  private shape(): number {
    const first = this.subjects()[0];
    if (first === undefined) return 1;
    const { image } = this.layersOf(first);
    return image.height / image.width;
  }

  private current(pane: Pane | undefined): { x: number; y: number; scale: number } {
    const image = this.images.get(this.names[0] ?? "");
    const probe = this.rays[0]?.probe;
    const [width, height] = [image?.width ?? probe?.width ?? 1, image?.height ?? probe?.height ?? 1];
    return this.state.camera ?? { x: width / 2, y: height / 2, scale: pane?.fitting ?? 1 };
  }

  private pan(dx: number, dy: number): void {
    const { x, y, scale } = this.current(this.panes[0]);
    this.update({ camera: { x: x - dx / scale, y: y - dy / scale, scale } });
  }

  private zoom(factor: number, at = { x: 0, y: 0 }, pane = this.panes[0]): void {
    const { x, y, scale } = this.current(pane);
    const next = Math.min(256, Math.max(1 / 16, scale * factor));
    this.update({ camera: {
      x: x + at.x / scale - at.x / next, y: y + at.y / scale - at.y / next, scale: next,
    } });
  }

  private choose(which: "a" | "b", name: string): void {
    this.update({ [which]: name, ...(this.state.mode === "side" ? { mode: which as Mode } : {}) });
  }

  private hold(down: boolean): void {
    if (this.held === down) return;
    this.held = down;
    this.schedule();
  }
}
