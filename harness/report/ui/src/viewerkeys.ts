// The viewer's keys: those of tev where it has them.

import type { Encoding } from "./colour";
import { bind } from "./keys";
import { type Mode, MODE_NAMES, MODES, type ViewState } from "./state";

/** What keys can do to a viewer. */
export interface Keyed {
  readonly names: readonly string[];
  readonly hasRays: boolean;
  readonly state: () => ViewState;
  readonly focused: () => boolean;
  readonly update: (change: Partial<ViewState>) => void;
  readonly choose: (which: "a" | "b", name: string) => void;
  readonly zoom: (factor: number) => void;
  readonly trueSize: () => void;
  readonly hold: (down: boolean) => void;
  readonly unpin: () => void;
}

const GROUP = "Pictures";

export function bindViewerKeys(viewer: Keyed): void {
  bindChoice(viewer);
  bindModes(viewer);
  const { update, state } = viewer;
  bind(GROUP, "e E", "exposure up, down by half a stop; in maps the end of the scale", ["e", "E"],
    (event) => update({ exposure: state().exposure + (event.key === "E" ? -0.5 : 0.5) }));
  bind(GROUP, "g", "sRGB or gamma 2.2", ["g"], () =>
    update({ encoding: (state().encoding === "srgb" ? "gamma" : "srgb") as Encoding }));
  bind(GROUP, "r", "reset exposure and encoding", ["r"], () =>
    update({ exposure: 0, encoding: "srgb" }));
  bind(GROUP, "+ −", "zoom in, out", ["+", "=", "-"], (event) =>
    viewer.zoom(event.key === "-" ? 0.5 : 2));
  bind(GROUP, "0", "one pixel per pixel", ["0"], viewer.trueSize);
  bind(GROUP, "f", "fit", ["f"], () => update({ camera: null }));
  bind(GROUP, "Esc", "take all pins away", ["Escape"], viewer.unpin);
}

function bindChoice({ names, state, choose, hold }: Keyed): void {
  bind(GROUP, "1 … 9", "picture A", ["Digit"], (event) => {
    const name = names[Number(event.code.slice(-1)) - 1];
    if (name !== undefined) choose(event.shiftKey ? "b" : "a", name);
  });
  bind(GROUP, "Shift 1 … 9", "picture B, the reference", [], () => undefined);
  bind(GROUP, "← →", "previous, next picture A; with Shift B", ["ArrowLeft", "ArrowRight"], (event) => {
    const which = event.shiftKey ? "b" : "a";
    const by = event.key === "ArrowLeft" ? -1 : 1;
    const next = names[(names.indexOf(state()[which]) + by + names.length) % names.length];
    if (next !== undefined) choose(which, next);
  });
  bind(GROUP, "Shift", "hold: B in place of A", ["Shift"], () => hold(true));
  addEventListener("keyup", (event) => event.key === "Shift" && hold(false));
  addEventListener("blur", () => hold(false));
}

function bindModes({ hasRays, state, update, focused }: Keyed): void {
  const modes = MODE_NAMES.filter((mode) => mode !== "rays" || hasRays);
  bind(GROUP, "↑ ↓", "previous, next mode, where the viewer has the focus", ["ArrowUp", "ArrowDown"],
    (event) => {
      const by = event.key === "ArrowUp" ? -1 : 1;
      if (!focused()) scrollBy({ top: 80 * by });
      else {
        const at = modes.indexOf(state().mode) + by;
        update({ mode: modes[(at + modes.length) % modes.length] as Mode });
      }
    });
  for (const mode of modes) {
    const { key, label, hint } = MODES[mode];
    if (key) {
      bind(GROUP, key, `${label}: ${hint}`, [key], () =>
        update({ mode: state().mode === mode ? "side" : mode }));
    }
  }
  bind(GROUP, "m", "maps of A alone, or of every picture against B", ["m"], () =>
    update({ every: !state().every }));
}
