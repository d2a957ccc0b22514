// The viewer of a case: pictures under one camera, in the mode that the state names.

import type { CaseData } from "./case";
import { type Encoding, type Scale, shadeFigures, shadeRadiance } from "./colour";
import { colourBar } from "./colourbar";
import { Controls } from "./controls";
import { h, reducedMotion } from "./dom";
import { number } from "./format";
import { Inspector } from "./inspector";
import { bind } from "./keys";
import { MAPS } from "./maps";
import type { Image } from "./pack";
import { type Layer, Pane, type Sheet } from "./pane";
import { RayPanel } from "./raypanel";
import type { Rays } from "./rays";
import { fromHash, type Mode, MODE_NAMES, MODES, type Pixel, toHash, type ViewState } from "./state";

const BLINK = 650; // ms
const BARE: Partial<Record<Mode, true>> = { side: true, rays: true }; // look at no pair

export class Viewer {
  readonly element: HTMLElement;
  private readonly images: ReadonlyMap<string, Image>;
  private readonly names: readonly string[];
  private readonly initial: ViewState;
  private state: ViewState;
  private readonly figuresCache = new Map<string, Float32Array>();
  private readonly sheets = new Map<string, { key: string; sheet: Sheet }>();
  private panes: Pane[] = [];
  private readonly stage = h("div", { class: "stage" });
  private readonly bar = h("div", { class: "bar-row" });
  private readonly notice = h("p", { class: "notice", role: "status" });
  private readonly inspector: Inspector;
  private readonly rayPanel: RayPanel;
  private readonly controls: Controls;
  private hovered: Pixel | null = null;
  private swipe = 0.5;
  private showsB = false; // blinking, or Shift held
  private held = false;
  private timer = 0;
  private scheduled = false;

  constructor(
    private readonly data: CaseData, images: readonly Image[], private readonly rays: readonly Rays[],
    place: HTMLElement,
  ) {
    this.images = new Map(images.map((image) => [image.name, image]));
    this.names = [...this.images.keys()];
    const [first = "", second = first] = this.preferred();
    this.initial = {
      mode: "side", a: second, b: first, every: true, exposure: 0, encoding: "srgb",
      camera: null, pins: [],
    };
    this.state = fromHash(location.hash, this.initial, this.names);
    this.inspector = new Inspector((pixel) => this.jump(pixel), () => this.unpin());
    this.rayPanel = new RayPanel(rays, data.colours);
    this.controls = new Controls(this.names, rays.length > 0, {
      set: (change) => this.update(change),
      fit: () => this.update({ camera: null }),
      reset: () => this.update({ exposure: 0, encoding: "srgb" }),
      swipe: (at) => { this.swipe = at; this.schedule(); },
    });
    this.element = h("div", { class: "viewer", tabindex: 0, role: "group",
      "aria-label": "Picture viewer; press ? for its keys" },
      this.controls.element,
      h("div", { class: "viewer-body" },
        h("div", { class: "stage-column" }, this.stage, this.controls.slider, this.bar, this.notice),
        this.inspector.element),
    );
    place.replaceChildren(this.element);
    place.after(this.rayPanel.element);
    new ResizeObserver(() => this.layout()).observe(this.stage);
    this.bindKeys();
    addEventListener("hashchange", () => {
      if (location.hash.includes("=") || location.hash === "") this.restore();
    });
    this.rebuild();
  }

  /** The tracer, if it took part, is what others are compared with at first; the worst is A. */
  private preferred(): string[] {
    const rank = (name: string): number =>
      ({ fail: 0, error: 1, known: 2 })[this.data.verdicts[name] ?? ""] ?? 3;
    const base = this.names.find((n) => n === "tracer") ?? this.names[0] ?? "";
    const others = this.names.filter((n) => n !== base).sort((p, q) => rank(p) - rank(q));
    return [base, ...others];
  }

  private restore(): void {
    this.state = fromHash(location.hash, this.initial, this.names);
    this.rebuild();
  }

  private update(change: Partial<ViewState>): void {
    const structural = ["mode", "a", "b", "every"].some((key) => key in change);
    Object.assign(this.state, change);
    if (structural) this.rebuild();
    else this.refresh();
    this.remember();
  }

  private remember(): void {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      const text = toHash(this.state, this.initial);
      if (!text && !location.hash.includes("=")) return;
      history.replaceState(null, "", text ? `#${text}` : location.pathname + location.search);
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
        h("div", { class: `frame none s-${one.word === "crashed" ? "error" : "skip"}` },
          h("span", {}, one.word), one.reason && h("small", {}, one.reason)))) : [];
    this.stage.replaceChildren(...this.panes.map((pane) => pane.element), ...missing);
    this.places = this.panes.length + missing.length;
    this.notice.textContent = this.problem();
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

  private blinking = 0;
  private places = 1; // panes, and those that say why there is none

  /** The names of the pictures that have a pane of their own. */
  private subjects(): string[] {
    const { mode, a, b, every } = this.state;
    if (mode === "side") return [...this.names];
    if (mode === "rays") {
      const names = [...new Set(this.rays.flatMap((r) => [...r.errors.keys()]))];
      return every || !names.includes(a) ? names : [a];
    }
    if (MAPS[mode] && every) return this.names.filter((n) => n !== b && this.fits(n));
    return a ? [a] : [];
  }

  private fits(name: string): boolean {
    const [one, two] = [this.images.get(name), this.images.get(this.state.b)];
    return one?.width === two?.width && one?.height === two?.height;
  }

  private problem(): string {
    const { mode, a, b } = this.state;
    if (!this.names.length && mode !== "rays") return "No renderer delivered a picture.";
    if (mode === "rays" && !this.rays.length) return "No rays were measured in this case.";
    if (BARE[mode] || mode === "a" || mode === "b") return "";
    const [one, two] = [this.images.get(a), this.images.get(b)];
    if (one && two && !this.fits(a)) {
      return `Sizes differ: ${a} is ${one.width} × ${one.height}, ` +
        `${b} is ${two.width} × ${two.height}. There is nothing to compare pixel by pixel.`;
    }
    if (a === b && !(MAPS[mode] && this.state.every)) return "A and B are the same picture.";
    return "";
  }

  private name(text: string): HTMLElement {
    return h("span", { class: `renderer ${this.data.colours[text.split(": ").pop() ?? ""] ?? "c7"}` },
      h("i", { class: "dot", "aria-hidden": "true" }), text);
  }

  private layersOf(subject: string): { layers: Layer[]; image: { width: number; height: number } } {
    const { mode, b } = this.state;
    if (mode === "rays") {
      const rays = this.rays.find((r) => r.errors.has(subject));
      const step = rays?.probe.errorStep ?? 1;
      const width = Math.ceil((rays?.probe.width ?? 1) / step);
      const height = Math.ceil((rays?.probe.height ?? 1) / step);
      const figures = rays?.errors.get(subject) ?? new Float32Array(1);
      const sheet = this.figureSheet(`rays ${subject}`, figures, width, height);
      return { layers: [{ sheet, from: 0 }], image: { width: width * step, height: height * step } };
    }
    const map = MAPS[mode];
    const image = this.images.get(subject) as Image;
    if (map) {
      if (!this.fits(subject)) return { layers: [], image };
      const figures = this.figures(mode, subject, b);
      const sheet = this.figureSheet(`${mode} ${subject} ${b}`, figures, image.width, image.height);
      return { layers: [{ sheet, from: 0 }], image };
    }
    const other = this.images.get(b) ?? image;
    const flip = mode === "b" || this.held || (mode === "blink" && this.showsB);
    if (mode === "side") return { layers: [{ sheet: this.pictureSheet(image), from: 0 }], image };
    if (mode === "swipe") {
      return { layers: [
        { sheet: this.pictureSheet(image), from: 0 },
        { sheet: this.pictureSheet(other), from: this.swipe },
      ], image };
    }
    const shown = flip ? other : image;
    return { layers: [{ sheet: this.pictureSheet(shown), from: 0 }], image: shown };
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

  private sheet(id: string, key: string, width: number, height: number,
    shade: (out: Uint8ClampedArray) => void, text: Sheet["text"]): Sheet {
    const known = this.sheets.get(id);
    if (known?.key === key) return known.sheet;
    const canvas = known?.sheet.canvas ?? h("canvas", { width, height });
    const context = canvas.getContext("2d");
    const pixels = new ImageData(width, height);
    shade(pixels.data);
    context?.putImageData(pixels, 0, 0);
    const sheet = { canvas, text };
    this.sheets.set(id, { key, sheet });
    return sheet;
  }

  private pictureSheet(image: Image): Sheet {
    const { exposure, encoding } = this.state;
    const count = image.width * image.height;
    return this.sheet(`picture ${image.name}`, `${exposure} ${encoding}`, image.width, image.height,
      (out) => shadeRadiance(image.planes, exposure, encoding, out),
      (x, y) => [0, 1, 2].map((c) =>
        number(image.planes[c * count + y * image.width + x] as number, 3)));
  }

  private figureSheet(id: string, figures: Float32Array, width: number, height: number): Sheet {
    const scale = this.scale() as Scale;
    return this.sheet(id, `${scale.low} ${scale.high}`, width, height,
      (out) => shadeFigures(figures, scale, out),
      (x, y) => [number(figures[y * width + x] as number, 3)]);
  }

  private scale(): Scale | null {
    return MAPS[this.state.mode]?.scale(this.state.exposure) ?? null;
  }

  // --- drawing -------------------------------------------------------------------------------

  private layout(): void {
    const shape = this.shape();
    const { columns, room } = arranged(this.places, this.stage.clientWidth, shape);
    this.stage.style.setProperty("--panes", String(columns));
    this.subjects().forEach((subject, k) => {
      const { layers, image } = this.layersOf(subject);
      const pane = this.panes[k];
      pane?.show(this.paneLabel(subject), this.caption(subject), layers, image.width, image.height);
      pane?.fit(room);
    });
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
      this.subjects().forEach((subject, k) => {
        const { layers, image } = this.layersOf(subject);
        const pane = this.panes[k];
        pane?.show(this.paneLabel(subject), this.caption(subject), layers, image.width, image.height);
        pane?.draw(this.state.camera, this.state.pins, this.hovered);
      });
    });
  }

  private paneLabel(subject: string): string {
    const { mode, b } = this.state;
    if (mode === "rays") return `Ray error of ${subject}`;
    if (MAPS[mode]) return `${MAPS[mode].title} of A ${subject} and B ${b}`;
    return mode === "swipe" || mode === "blink" ? `${subject} and ${b}` : subject;
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
        `Linear radiance × 2^${number(exposure, 3)}, ` +
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
    const errors = this.rays.flatMap((rays) => [...rays.errors].map(([name, figures]) => ({
      name, figures, width: Math.ceil(rays.probe.width / rays.probe.errorStep),
      step: rays.probe.errorStep,
    })));
    this.inspector.values(pixel, pins.length, this.hovered === null, rows, this.images.get(b), errors);
    const subject = this.subjects()[0] ?? a;
    const focus = mode === "rays" || !MAPS[mode] || !this.state.every ? a : this.images.has(a) && a !== b ? a : subject;
    if (mode === "rays") {
      const one = errors.find((e) => e.name === a) ?? errors[0];
      this.inspector.figures(one ? `ray error of ${one.name}` : "", "µrad",
        one?.figures, one?.width ?? 1, one?.step ?? 1);
    } else if (this.images.has(focus) && focus !== b && this.fits(focus)) {
      const by: Mode = MAPS[mode] ? mode : "diff";
      this.inspector.figures(`${MAPS[by]?.title ?? ""}, A ${focus}, B ${b}`, MAPS[by]?.unit ?? "",
        this.figures(by, focus, b), (this.images.get(focus) as Image).width, 1);
    } else {
      this.inspector.figures("", "", undefined, 1, 1);
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
    const fitting = this.panes[0]?.fitting ?? 1;
    const scale = Math.max(this.state.camera?.scale ?? 0, fitting * 4);
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

  private setMode(mode: Mode): void {
    this.update({ mode: this.state.mode === mode ? "side" : mode });
  }

  private step(which: "a" | "b", by: number): void {
    const at = this.names.indexOf(this.state[which]);
    const next = this.names[(at + by + this.names.length) % this.names.length];
    if (next !== undefined) this.choose(which, next);
  }

  private choose(which: "a" | "b", name: string): void {
    const shows = this.state.mode === "side" ? { mode: which as Mode } : {};
    this.update({ [which]: name, ...shows });
  }

  private bindKeys(): void {
    const group = "Pictures";
    const nth = (event: KeyboardEvent): void => {
      const name = this.names[Number(event.code.slice(-1)) - 1];
      if (name !== undefined) this.choose(event.shiftKey ? "b" : "a", name);
    };
    bind(group, "1 … 9", "picture A", ["Digit"], nth);
    bind(group, "Shift 1 … 9", "picture B, the reference", [], nth);
    bind(group, "← →", "previous, next picture A; with Shift B", ["ArrowLeft", "ArrowRight"], (e) =>
      this.step(e.shiftKey ? "b" : "a", e.key === "ArrowLeft" ? -1 : 1));
    bind(group, "↑ ↓", "previous, next mode, where the viewer has the focus", ["ArrowUp", "ArrowDown"],
      (e) => {
        if (!this.element.contains(document.activeElement)) {
          scrollBy({ top: e.key === "ArrowUp" ? -80 : 80 });
          return;
        }
        const modes = MODE_NAMES.filter((m) => m !== "rays" || this.rays.length);
        const at = modes.indexOf(this.state.mode) + (e.key === "ArrowUp" ? -1 : 1);
        this.update({ mode: modes[(at + modes.length) % modes.length] as Mode });
      });
    for (const mode of MODE_NAMES) {
      if (MODES[mode].key) {
        bind(group, MODES[mode].key, `${MODES[mode].label}: ${MODES[mode].hint}`, [MODES[mode].key],
          () => this.setMode(mode));
      }
    }
    bind(group, "Shift", "hold: B in place of A", ["Shift"], () => this.hold(true));
    addEventListener("keyup", (event) => event.key === "Shift" && this.hold(false));
    addEventListener("blur", () => this.hold(false));
    bind(group, "m", "maps of A alone, or of every picture against B", ["m"], () =>
      this.update({ every: !this.state.every }));
    bind(group, "e E", "exposure up, down by half a stop; in maps the end of the scale", ["e", "E"], (e) =>
      this.update({ exposure: this.state.exposure + (e.key === "E" ? -0.5 : 0.5) }));
    bind(group, "g", "sRGB or gamma 2.2", ["g"], () => this.update({
      encoding: (this.state.encoding === "srgb" ? "gamma" : "srgb") as Encoding }));
    bind(group, "r", "reset exposure and encoding", ["r"], () =>
      this.update({ exposure: 0, encoding: "srgb" }));
    bind(group, "+ −", "zoom in, out", ["+", "=", "-"], (e) => this.zoom(e.key === "-" ? 0.5 : 2));
    bind(group, "0", "one pixel per pixel", ["0"], () =>
      this.update({ camera: { ...this.current(this.panes[0]), scale: 1 } }));
    bind(group, "f", "fit", ["f"], () => this.update({ camera: null }));
    bind(group, "Esc", "take all pins away", ["Escape"], () => this.unpin());
  }

  private hold(down: boolean): void {
    if (this.held === down) return;
    this.held = down;
    this.schedule();
  }
}

/** As many columns as make the panes largest, and the height that each may have. */
function arranged(panes: number, width: number, shape: number): { columns: number; room: number } {
  const height = Math.max(300, Math.min(innerHeight, 1200) * 0.72);
  let best = { columns: 1, room: height };
  let widest = 0;
  for (let columns = 1; columns <= Math.min(panes, 4); columns++) {
    const rows = Math.ceil(panes / columns);
    const room = height / rows - 40;
    const side = Math.min(width / columns - 10, room / shape);
    if (side > widest * 1.02) [widest, best] = [side, { columns, room }];
  }
  return best;
}
