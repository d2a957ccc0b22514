// What the viewer shows, and the same as the text after "#" in the address.

import type { Encoding } from "./colour";

export const MODES = {
  side: { label: "Side by side", key: "", hint: "all pictures, one zoom" },
  swipe: { label: "Swipe", key: "s", hint: "A left of the line, B right of it" },
  blink: { label: "Blink", key: "b", hint: "A and B in turn" },
  a: { label: "A", key: "a", hint: "A alone" },
  b: { label: "B", key: "", hint: "B alone; also while Shift is held" },
  diff: { label: "|A − B|", key: "d", hint: "largest difference of the three channels" },
  relative: { label: "Signed", key: "", hint: "(A − B) / max(|A|, |B|)" },
  ssim: { label: "SSIM", key: "", hint: "1 − structural similarity" },
  deltae: { label: "ΔE", key: "", hint: "colour difference CIEDE2000" },
  flip: { label: "FLIP", key: "", hint: "what one notices who flips between A and B at 67 pixels per degree" },
  rays: { label: "Ray error", key: "y", hint: "angle between measured and true ray" },
} as const;

export type Mode = keyof typeof MODES;
export const MODE_NAMES = Object.keys(MODES) as Mode[];

export interface Pixel {
  readonly x: number;
  readonly y: number;
}

/** Centre of the view in pixels of the image, and screen pixels per pixel. */
export interface Camera {
  readonly x: number;
  readonly y: number;
  readonly scale: number;
}

export interface ViewState {
  mode: Mode;
  a: string;
  b: string;
  every: boolean; // maps of every picture against B, not of A alone
  exposure: number;
  encoding: Encoding;
  camera: Camera | null; // null fits the picture into its pane
  pins: Pixel[];
}

const round = (value: number): number => Number(value.toPrecision(6));

export function toHash(state: ViewState, initial: ViewState): string {
  const hash = new URLSearchParams();
  if (state.mode !== initial.mode) hash.set("mode", state.mode);
  if (state.a !== initial.a) hash.set("a", state.a);
  if (state.b !== initial.b) hash.set("b", state.b);
  if (state.every !== initial.every) hash.set("every", String(Number(state.every)));
  if (state.exposure) hash.set("ev", String(state.exposure));
  if (state.encoding !== "srgb") hash.set("enc", state.encoding);
  const { camera } = state;
  if (camera) hash.set("view", [camera.x, camera.y, camera.scale].map(round).join(","));
  if (state.pins.length) hash.set("pin", state.pins.map((p) => `${p.x},${p.y}`).join(";"));
  return hash.toString();
}

/** `initial` with what the address says; what makes no sense is left out. */
export function fromHash(text: string, initial: ViewState, names: readonly string[]): ViewState {
  const hash = new URLSearchParams(text.replace(/^#/, ""));
  const state: ViewState = { ...initial, pins: [] };
  const mode = hash.get("mode");
  if (mode !== null && Object.hasOwn(MODES, mode)) state.mode = mode as Mode;
  for (const which of ["a", "b"] as const) {
    const name = hash.get(which);
    if (name !== null && names.includes(name)) state[which] = name;
  }
  if (hash.has("every")) state.every = hash.get("every") === "1";
  const exposure = Number(hash.get("ev"));
  if (Number.isFinite(exposure)) state.exposure = Math.min(30, Math.max(-30, exposure));
  if (hash.get("enc") === "gamma") state.encoding = "gamma";
  const [x, y, scale] = numbers(hash.get("view"));
  if (x !== undefined && y !== undefined && scale !== undefined && scale > 0) {
    state.camera = { x, y, scale: Math.min(256, Math.max(1 / 64, scale)) };
  }
  for (const pair of (hash.get("pin") ?? "").split(";").slice(0, 20)) {
    const [px, py] = numbers(pair);
    if (px !== undefined && py !== undefined) {
      state.pins.push({ x: Math.floor(px), y: Math.floor(py) });
    }
  }
  return state;
}

function numbers(text: string | null): number[] {
  return text ? text.split(",").map(Number).filter(Number.isFinite) : [];
}
