// The buttons and sliders above the pictures: another way to what the keys do.

import type { Encoding } from "./colour";
import { h } from "./dom";
import { number } from "./format";
import { MAPS } from "./maps";
import { type Mode, MODE_NAMES, MODES, type ViewState } from "./state";

export interface Actions {
  set: (change: Partial<ViewState>) => void;
  fit: () => void;
  reset: () => void;
  swipe: (at: number) => void;
}

export class Controls {
  readonly element: HTMLElement;
  readonly slider: HTMLInputElement;
  private readonly modes = new Map<Mode, HTMLButtonElement>();
  private readonly pickers = new Map<"a" | "b", HTMLSelectElement>();
  private readonly every: HTMLInputElement;
  private readonly exposure: HTMLInputElement;
  private readonly reading = h("output", { class: "num" });
  private readonly encoding: HTMLSelectElement;
  private readonly everyLabel: HTMLElement;

  constructor(names: readonly string[], hasRays: boolean, actions: Actions) {
    for (const mode of MODE_NAMES) {
      if (mode === "rays" && !hasRays) continue;
      const key = MODES[mode].key;
      this.modes.set(mode, h("button", {
        type: "button", "aria-pressed": "false", title: MODES[mode].hint + (key ? ` (${key})` : ""),
        click: () => actions.set({ mode }),
      }, MODES[mode].label));
    }
    for (const which of ["a", "b"] as const) {
      const select = h("select", { "aria-label": `Picture ${which.toUpperCase()}` },
        ...names.map((name, k) => h("option", { value: name }, `${k + 1}  ${name}`)));
      select.addEventListener("change", () => actions.set({ [which]: select.value }));
      this.pickers.set(which, select);
    }
    this.every = h("input", { type: "checkbox" });
    this.every.addEventListener("change", () => actions.set({ every: this.every.checked }));
    this.everyLabel = h("label", { class: "tick", title: "Every picture against B (m)" },
      this.every, "all against B");
    this.exposure = h("input", { type: "range", min: -10, max: 10, step: 0.5, "aria-label": "Exposure" });
    this.exposure.addEventListener("input", () => actions.set({ exposure: this.exposure.valueAsNumber }));
    this.encoding = h("select", { "aria-label": "Encoding" },
      h("option", { value: "srgb" }, "sRGB"), h("option", { value: "gamma" }, "γ 2.2"));
    this.encoding.addEventListener("change", () =>
      actions.set({ encoding: this.encoding.value as Encoding }));
    this.slider = h("input", {
      type: "range", min: 0, max: 1, step: 0.005, value: 0.5, class: "swiper", "aria-label": "Line between A and B",
    });
    this.slider.addEventListener("input", () => actions.swipe(this.slider.valueAsNumber));
    this.element = h("div", { class: "controls" },
      h("div", { class: "segments", role: "group", "aria-label": "Mode" }, ...this.modes.values()),
      h("label", {}, "A ", this.pickers.get("a")), h("label", {}, "B ", this.pickers.get("b")),
      h("label", { class: "exposure" }, "EV ", this.exposure, this.reading),
      // Either in a place of one width, so that the line breaks alike and pictures stay put.
      h("span", { class: "either" }, this.encoding, this.everyLabel),
      h("button", { type: "button", class: "small-button", title: "Fit (f)", click: actions.fit }, "Fit"),
      h("button", { type: "button", class: "small-button", title: "Reset exposure (r)", click: actions.reset }, "Reset"));
  }

  show(state: ViewState, hasRays: boolean): void {
    for (const [mode, button] of this.modes) {
      button.setAttribute("aria-pressed", String(mode === state.mode));
      button.hidden = mode === "rays" && !hasRays;
    }
    for (const [which, select] of this.pickers) select.value = state[which];
    this.every.checked = state.every;
    this.everyLabel.hidden = !MAPS[state.mode];
    this.exposure.value = String(state.exposure);
    this.reading.value = `${state.exposure > 0 ? "+" : ""}${number(state.exposure, 3)}`;
    this.encoding.value = state.encoding;
    this.encoding.hidden = Boolean(MAPS[state.mode]);
    this.slider.hidden = state.mode !== "swipe";
  }
}
