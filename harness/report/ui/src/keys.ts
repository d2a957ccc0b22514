// One table of keys for the whole report; the help is made from it, so it cannot lie.

import { h } from "./dom";

export interface Binding {
  readonly keys: readonly string[]; // KeyboardEvent.key, or "Digit" for 1 to 9 with and without Shift
  readonly shown: string;
  readonly does: string;
  readonly group: string;
  readonly run: (event: KeyboardEvent) => void;
}

const bindings: Binding[] = [];

export function bind(group: string, shown: string, does: string, keys: readonly string[],
  run: (event: KeyboardEvent) => void): void {
  bindings.push({ keys, shown, does, group, run });
}

function typing(event: KeyboardEvent): boolean {
  const target = event.composedPath()[0];
  return target instanceof HTMLElement &&
    (target.matches("input:not([type=range], [type=checkbox]), textarea, select") ||
      target.isContentEditable);
}

/** Keys that a focused slider, dialog or scrolled list needs itself. */
function claimed(event: KeyboardEvent): boolean {
  const target = event.composedPath()[0];
  return event.key.startsWith("Arrow") && target instanceof HTMLElement &&
    target.matches("input, [role=slider], [role=radio]");
}

export function listen(): void {
  addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
    if (typing(event) || claimed(event)) return;
    const open = document.querySelector("dialog[open]");
    const digit = /^Digit[1-9]$/.test(event.code) ? "Digit" : event.key;
    for (const binding of bindings) {
      if (binding.keys.includes(digit)) {
        if (open && digit !== "?") return;
        event.preventDefault();
        binding.run(event);
        return;
      }
    }
  });
}

export function helpDialog(): HTMLDialogElement {
  const groups = new Map<string, Binding[]>();
  for (const binding of bindings) {
    groups.set(binding.group, [...(groups.get(binding.group) ?? []), binding]);
  }
  const close = h("button", { type: "button", class: "close", "aria-label": "Close" }, "×");
  const dialog = h("dialog", { class: "help", "aria-labelledby": "help-title" },
    h("h2", { id: "help-title" }, "Keys"), close,
    h("div", { class: "help-groups" }, ...[...groups].map(([name, items]) =>
      h("section", {}, h("h3", {}, name), h("dl", {}, ...items.map((item) =>
        h("div", {},
          h("dt", {}, ...item.shown.split(" ").map((key) => h("kbd", {}, key))),
          h("dd", {}, item.does))))))));
  close.addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  document.body.append(dialog);
  return dialog;
}
