// One canvas of the viewer: a shaded picture under the shared camera, with pins and values on top.

import { h } from "./dom";
import type { Camera, Pixel } from "./state";

/** Where a picture's upper left corner is on a canvas of this size, and how large its pixels are. */
export interface View {
  readonly left: number;
  readonly top: number;
  readonly scale: number;
  readonly width: number;
  readonly height: number;
}

/**
 * A picture or map. `paint` draws it, stretched to `width` by `height` of its pane's pixels, which
 * `view` places; `text` gives a pixel's figures, to be written where there is room.
 */
export interface Sheet {
  readonly paint: (context: CanvasRenderingContext2D, view: View, width: number, height: number) => void;
  readonly text: (x: number, y: number) => readonly string[];
}

export interface Layer {
  readonly sheet: Sheet;
  readonly from: number; // share of the pane's width, for swiping
}

export interface PaneEvents {
  hover: (pixel: Pixel | null) => void;
  click: (pixel: Pixel) => void;
  pan: (dx: number, dy: number) => void;
  zoom: (factor: number, at: { x: number; y: number }, pane: Pane) => void;
}

const ROOM_FOR_TEXT = 54; // screen pixels per pixel

export class Pane {
  readonly element: HTMLElement;
  readonly canvas = h("canvas", { tabindex: -1 });
  private readonly caption = h("figcaption", {});
  private layers: readonly Layer[] = [];
  private size = { width: 1, height: 1 };

  constructor(private readonly events: PaneEvents) {
    this.element = h("figure", { class: "pane" }, this.caption, this.canvas);
    this.listen();
  }

  show(label: string, caption: readonly (Node | string)[], layers: readonly Layer[],
    width: number, height: number): void {
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", label);
    this.caption.replaceChildren(...caption);
    this.layers = layers;
    this.size = { width, height };
  }

  /** Gives the canvas the size of its place in the page; `room` is the largest height. */
  fit(room: number): void {
    const width = this.element.clientWidth;
    const height = Math.min(room, (width * this.size.height) / this.size.width);
    const ratio = devicePixelRatio || 1;
    this.canvas.style.height = `${Math.round(height)}px`;
    const [w, hh] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
    if (this.canvas.width !== w) this.canvas.width = w;
    if (this.canvas.height !== hh) this.canvas.height = hh;
  }

  /** Screen pixels per pixel at which all of the picture is just seen. */
  get fitting(): number {
    const ratio = devicePixelRatio || 1;
    return Math.min(
      this.canvas.width / ratio / this.size.width, this.canvas.height / ratio / this.size.height);
  }

  private cameraOr(camera: Camera | null): Camera {
    return camera ?? { x: this.size.width / 2, y: this.size.height / 2, scale: this.fitting };
  }

  draw(shared: Camera | null, pins: readonly Pixel[], hovered: Pixel | null): void {
    const context = this.canvas.getContext("2d");
    if (!context) return;
    const ratio = devicePixelRatio || 1;
    const { width, height } = this.canvas;
    const camera = this.cameraOr(shared);
    const scale = camera.scale * ratio;
    const left = width / 2 - camera.x * scale;
    const top = height / 2 - camera.y * scale;
    context.clearRect(0, 0, width, height);
    context.imageSmoothingEnabled = scale < 1;
    for (const layer of this.layers) {
      context.save();
      context.beginPath();
      context.rect(layer.from * width, 0, width, height);
      context.clip();
      context.clearRect(layer.from * width, 0, width, height);
      layer.sheet.paint(context, { left, top, scale, width, height }, this.size.width, this.size.height);
      if (camera.scale >= ROOM_FOR_TEXT) this.write(context, layer.sheet, left, top, scale, ratio);
      context.restore();
      if (layer.from > 0) this.line(context, layer.from * width, ratio);
    }
    const box = (pixel: Pixel, colour: string, label: string): void => {
      const x = left + pixel.x * scale;
      const y = top + pixel.y * scale;
      const side = Math.max(scale, 7 * ratio);
      const [bx, by] = [x + scale / 2 - side / 2, y + scale / 2 - side / 2];
      context.lineWidth = 3 * ratio;
      context.strokeStyle = "rgba(0,0,0,0.75)";
      context.strokeRect(bx, by, side, side);
      context.lineWidth = 1.4 * ratio;
      context.strokeStyle = colour;
      context.strokeRect(bx, by, side, side);
      if (!label) return;
      context.font = `600 ${12 * ratio}px system-ui, sans-serif`;
      context.lineWidth = 3 * ratio;
      context.strokeStyle = "rgba(0,0,0,0.75)";
      context.strokeText(label, bx + side + 4 * ratio, by + 6 * ratio);
      context.fillStyle = colour;
      context.fillText(label, bx + side + 4 * ratio, by + 6 * ratio);
    };
    if (hovered) box(hovered, "#ffffff", "");
    pins.forEach((pin, k) => box(pin, "#ffd84d", pins.length > 1 ? String(k + 1) : ""));
  }

  private write(context: CanvasRenderingContext2D, sheet: Sheet, left: number, top: number,
    scale: number, ratio: number): void {
    const size = Math.min(scale / 5, 13 * ratio);
    context.font = `${size}px ui-monospace, monospace`;
    context.textAlign = "center";
    const first = { x: Math.max(0, Math.floor(-left / scale)), y: Math.max(0, Math.floor(-top / scale)) };
    const last = {
      x: Math.min(this.size.width, Math.ceil((this.canvas.width - left) / scale)),
      y: Math.min(this.size.height, Math.ceil((this.canvas.height - top) / scale)),
    };
    for (let y = first.y; y < last.y; y++) {
      for (let x = first.x; x < last.x; x++) {
        sheet.text(x, y).forEach((line, k, lines) => {
          const at = top + (y + 0.5) * scale + (k - (lines.length - 1) / 2) * size * 1.25 + size / 3;
          context.lineWidth = size / 5;
          context.strokeStyle = "rgba(0,0,0,0.8)";
          context.strokeText(line, left + (x + 0.5) * scale, at);
          context.fillStyle = "#fff";
          context.fillText(line, left + (x + 0.5) * scale, at);
        });
      }
    }
    context.textAlign = "start";
  }

  private line(context: CanvasRenderingContext2D, x: number, ratio: number): void {
    context.fillStyle = "rgba(0,0,0,0.55)";
    context.fillRect(x - 2 * ratio, 0, 4 * ratio, this.canvas.height);
    context.fillStyle = "#fff";
    context.fillRect(x - ratio / 2, 0, ratio, this.canvas.height);
  }

  /** The pixel under a pointer; null beside the picture. */
  pixelAt(event: { clientX: number; clientY: number }, shared: Camera | null): Pixel | null {
    const box = this.canvas.getBoundingClientRect();
    const camera = this.cameraOr(shared);
    const x = Math.floor((event.clientX - box.left - box.width / 2) / camera.scale + camera.x);
    const y = Math.floor((event.clientY - box.top - box.height / 2) / camera.scale + camera.y);
    return x >= 0 && y >= 0 && x < this.size.width && y < this.size.height ? { x, y } : null;
  }

  camera: () => Camera | null = () => null;

  private listen(): void {
    const { canvas, events } = this;
    let last: { x: number; y: number } | null = null;
    let moved = 0;
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      last = { x: event.clientX, y: event.clientY };
      moved = 0;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      events.hover(this.pixelAt(event, this.camera()));
      if (!last) return;
      const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
      moved += Math.abs(dx) + Math.abs(dy);
      last = { x: event.clientX, y: event.clientY };
      if (moved > 4) events.pan(dx, dy);
    });
    canvas.addEventListener("pointerup", (event) => {
      const pixel = this.pixelAt(event, this.camera());
      if (last && moved <= 4 && pixel) events.click(pixel);
      last = null;
    });
    canvas.addEventListener("pointercancel", () => (last = null));
    canvas.addEventListener("pointerleave", () => events.hover(null));
    canvas.addEventListener("wheel", (event) => {
      // The page scrolls until the viewer was touched, or with the pinch of a track pad.
      if (!event.ctrlKey && !canvas.closest(".viewer")?.contains(document.activeElement)) return;
      event.preventDefault();
      const box = canvas.getBoundingClientRect();
      const at = {
        x: event.clientX - box.left - box.width / 2, y: event.clientY - box.top - box.height / 2,
      };
      events.zoom(2 ** (-event.deltaY / (event.ctrlKey ? 60 : 240)), at, this);
    }, { passive: false });
  }
}
