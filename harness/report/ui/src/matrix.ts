// The index: filter chips, search, sorting, and where all of that stands in the address.

import { readAddress, writeAddress } from "./address";
import { bind } from "./keys";

interface Row {
  readonly element: HTMLElement;
  readonly name: string;
  readonly family: string;
  readonly status: string;
  readonly change: string;
  readonly cells: readonly string[];
  readonly order: number;
  readonly ratios: readonly number[];
}

const SEVERITY = ["error", "fail", "skip", "known", "pass"];
const FILTERS = ["status", "family", "renderer", "change"] as const;

export function startMatrix(): void {
  const search = document.getElementById("search") as HTMLInputElement | null;
  const list = document.querySelector<HTMLElement>(".matrix .rows");
  if (!search || !list) return;
  const rows = [...list.querySelectorAll<HTMLElement>(":scope > .row")].map(readRow);
  const chips = [...document.querySelectorAll<HTMLElement>(".chip")];
  const heads = [...document.querySelectorAll<HTMLButtonElement>("button[data-sort]")];
  const found = document.getElementById("found") as HTMLElement;
  const clear = document.getElementById("clear") as HTMLElement;
  const noneFound = document.getElementById("none-found") as HTMLElement;
  const matrix = document.querySelector(".matrix") as HTMLElement;
  let sorted = { by: "", down: false };

  const texts = new Map<Row, string>(); // read when they are first searched
  const textOf = (row: Row): string => {
    let text = texts.get(row);
    if (text === undefined) texts.set(row, (text = (row.element.textContent ?? "").toLowerCase()));
    return text;
  };

  const chosen = (filter: string): string[] => chips
    .filter((c) => c.dataset["filter"] === filter && c.getAttribute("aria-pressed") === "true")
    .map((c) => c.dataset["value"] ?? "");

  function apply(): void {
    const words = search!.value.toLowerCase().split(/\s+/).filter(Boolean);
    const [statuses, families, renderers, changes] = FILTERS.map(chosen) as
      [string[], string[], string[], string[]];
    let shown = 0;
    for (const row of rows) {
      // With renderers chosen, a status means theirs; otherwise anybody's, but a case in which
      // anything is off does not pass because some renderer does.
      const own = renderers.length ? renderers.map((k) => row.cells[Number(k)] ?? "-")
        : [row.status, ...row.cells.filter((status) => status !== "pass")];
      const visible = words.every((word) => textOf(row).includes(word)) &&
        (!families.length || families.includes(row.family)) &&
        (!changes.length || changes.includes(row.change)) &&
        (!statuses.length || own.some((status) => statuses.includes(status)));
      if (row.element.hidden === visible) row.element.hidden = !visible;
      shown += Number(visible);
    }
    for (const cell of matrix.querySelectorAll<HTMLElement>("[data-column]")) {
      const hide = renderers.length > 0 && !renderers.includes(cell.dataset["column"] ?? "");
      if (cell.hidden !== hide) cell.hidden = hide;
    }
    const columns = renderers.length || matrix.dataset["columns"];
    matrix.style.setProperty("--columns", String(columns));
    const filtered = words.length + statuses.length + families.length + renderers.length + changes.length > 0;
    const all = rows.length === 1 ? "1 case" : `${rows.length} cases`;
    found.textContent = filtered ? `${shown} of ${all}` : all;
    clear.hidden = !filtered;
    noneFound.hidden = shown > 0;
    remember({ q: [search!.value.trim()], status: statuses, family: families, renderer: renderers,
      change: changes, sort: sorted.by ? [sorted.down ? `-${sorted.by}` : sorted.by] : [] });
  }

  function order(by: string, down: boolean): void {
    sorted = { by, down };
    const value = (row: Row): string | number => {
      if (by === "case") return row.name;
      if (by === "status") return SEVERITY.indexOf(row.status);
      if (by === "worst") return Math.max(...row.ratios);
      return by ? row.ratios[Number(by.slice(1))] ?? -1 : -row.order;
    };
    const ordered = [...rows].sort((p, q) => {
      const [a, b] = [value(p), value(q)];
      // Of figures the largest come first; of names the first.
      const sign = typeof a === "number" && typeof b === "number" ? (by === "status" ? a - b : b - a) : String(a).localeCompare(String(b), "en", { numeric: true });
      return (down ? -sign : sign) || p.order - q.order;
    });
    list!.replaceChildren(...ordered.map((row) => row.element));
    for (const head of heads) {
      head.toggleAttribute("data-active", by !== "" && head.dataset["sort"] === by);
      head.closest("[role=columnheader]")?.removeAttribute("aria-sort");
    }
    const active = heads.find((head) => head.hasAttribute("data-active"));
    active?.closest("[role=columnheader]")?.setAttribute("aria-sort", down ? "descending" : "ascending");
  }

  function recall(): void {
    const hash = new URLSearchParams(readAddress());
    if (!hash.size) return;
    search!.value = hash.get("q") ?? "";
    for (const chip of chips) {
      const on = hash.getAll(chip.dataset["filter"] ?? "").includes(chip.dataset["value"] ?? "");
      chip.setAttribute("aria-pressed", String(on));
    }
    const by = hash.get("sort");
    if (by) order(by.replace(/^-/, ""), by.startsWith("-"));
  }

  for (const chip of chips) {
    chip.addEventListener("click", () => {
      chip.setAttribute("aria-pressed", String(chip.getAttribute("aria-pressed") !== "true"));
      apply();
    });
  }
  for (const head of heads) {
    head.addEventListener("click", () => {
      const by = head.dataset["sort"] ?? "";
      if (sorted.by !== by) order(by, false);
      else if (!sorted.down) order(by, true);
      else order("", false);
      apply();
    });
  }
  search.addEventListener("input", apply);
  clear.addEventListener("click", () => {
    search.value = "";
    for (const chip of chips) chip.setAttribute("aria-pressed", "false");
    apply();
    search.focus();
  });
  search.addEventListener("keydown", (event) => {
    if (event.key === "Escape") search.blur();
  });
  addEventListener("hashchange", () => {
    if (location.hash.includes("=")) { recall(); apply(); }
  });
  bind("Cases", "/", "search", ["/"], () => { search.focus(); search.select(); });
  const step = (by: number, wanted: (row: HTMLElement) => boolean): void => {
    const links = [...list.querySelectorAll<HTMLElement>(".row:not([hidden])")].filter(wanted);
    const at = links.findIndex((row) => row.contains(document.activeElement));
    const next = links[at < 0 ? (by > 0 ? 0 : links.length - 1) : at + by];
    next?.querySelector<HTMLElement>(".name a")?.focus();
  };
  bind("Cases", "j k", "next, previous case; Enter opens it", ["j", "k"], (event) =>
    step(event.key === "j" ? 1 : -1, (row) => row.querySelector(".name a") !== null));
  bind("Cases", "n", "next case that fails", ["n"], () =>
    step(1, (row) => /fail|error/.test(row.dataset["status"] ?? "") && row.querySelector(".name a") !== null));
  recall();
  apply();
}

function readRow(element: HTMLElement, order: number): Row {
  const { family = "", status = "", cells = "", change = "", sort = "" } = element.dataset;
  return {
    element, order, family, status, change,
    name: element.querySelector(".case")?.querySelector(".name")?.textContent ?? "",
    cells: cells.trim().split(" "),
    ratios: sort.split(" ").map(Number),
  };
}

function remember(state: Record<string, string[]>): void {
  const hash = new URLSearchParams();
  for (const [key, values] of Object.entries(state)) {
    for (const value of values) if (value) hash.append(key, value);
  }
  writeAddress(hash.toString());
}
