// Results marked for approval: kept by the browser, and exported as the file that
// `snellcheck approve --from` reads. Nothing is approved here.

import { h } from "./dom";

const SCHEMA = "snellcheck-approvals/1";

interface Choice {
  readonly case: string;
  readonly renderer: string;
  readonly reason: string;
}

/** One list per run, so that two reports do not mix. */
export class Approvals {
  private readonly key: string;

  constructor(run: string) {
    this.key = `snellcheck approvals ${run}`;
  }

  all(): Choice[] {
    try {
      const found: unknown = JSON.parse(localStorage.getItem(this.key) ?? "[]");
      return Array.isArray(found) ? found.filter(isChoice) : [];
    } catch {
      return []; // storage is switched off, or someone else wrote there
    }
  }

  private keep(choices: readonly Choice[]): void {
    try {
      localStorage.setItem(this.key, JSON.stringify(choices));
    } catch {
      // Without storage, marks last as long as nothing else is opened: there are none.
    }
  }

  find(id: string, renderer: string): Choice | undefined {
    return this.all().find((c) => c.case === id && c.renderer === renderer);
  }

  set(choice: Choice, marked: boolean): void {
    const others = this.all().filter((c) => c.case !== choice.case || c.renderer !== choice.renderer);
    this.keep(marked ? [...others, choice] : others);
  }

  clear(): void {
    this.keep([]);
  }

  file(): string {
    return JSON.stringify({ schema: SCHEMA, approve: this.all() }, null, 1) + "\n";
  }
}

function isChoice(value: unknown): value is Choice {
  const choice = value as Partial<Choice> | null;
  return typeof choice?.case === "string" && typeof choice.renderer === "string" &&
    typeof choice.reason === "string";
}

/** A tick and a reason below each renderer of a case that has something to approve. */
export function offerApproval(run: string, id: string, here: ParentNode): void {
  const approvals = new Approvals(run);
  for (const card of here.querySelectorAll<HTMLElement>(".score[data-renderer]")) {
    const renderer = card.dataset["renderer"] ?? "";
    if (/\bs-(skip|error|None)\b/.test(card.className)) continue;
    const known = approvals.find(id, renderer);
    const tick = h("input", { type: "checkbox" });
    tick.checked = known !== undefined;
    const reason = h("input", { type: "text", placeholder: "reason", "aria-label": `Reason to approve ${renderer}` });
    reason.value = known?.reason ?? "";
    reason.hidden = !tick.checked;
    const save = (): void => {
      reason.hidden = !tick.checked;
      approvals.set({ case: id, renderer, reason: reason.value }, tick.checked);
    };
    tick.addEventListener("change", save);
    reason.addEventListener("input", save);
    card.append(h("div", { class: "approve" }, h("label", {}, tick, " approve as baseline"), reason));
  }
}

/** How many are marked, and the file of them. */
export function showApprovals(run: string): void {
  const place = document.getElementById("approvals");
  if (!place) return;
  const approvals = new Approvals(run);
  const show = (): void => {
    const { length } = approvals.all();
    place.hidden = length === 0;
    place.replaceChildren(
      h("span", {}, `${length} marked for approval`),
      h("button", { type: "button", class: "small-button chip", click: () => save(approvals.file()) }, "Export"),
      h("button", { type: "button", class: "plain", click: () => { approvals.clear(); show(); } }, "forget"));
  };
  show();
  addEventListener("pageshow", show);
}

function save(text: string): void {
  const address = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  const link = h("a", { href: address, download: "approvals.json" });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}
