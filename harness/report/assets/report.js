// What the report can do beyond what it shows: filter the matrix, find, and step through cases.
// A classic script, so that it runs from file://. Everything is readable without it.
"use strict";

(() => {
  document.documentElement.classList.add("scripted");

  const typing = (event) =>
    event.target instanceof HTMLElement && event.target.matches("input, textarea, select");

  function stepThroughCases() {
    const go = (rel) => document.querySelector(`a[rel="${rel}"]`)?.click();
    addEventListener("keydown", (event) => {
      if (typing(event) || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "j") go("next");
      if (event.key === "k") go("prev");
    });
  }

  function filterMatrix() {
    const search = document.getElementById("search");
    if (!search) return;
    const rows = [...document.querySelectorAll(".matrix .row")].map((element) => ({
      element,
      text: element.textContent.toLowerCase(),
      family: element.dataset.family,
      status: element.dataset.status,
      cells: element.dataset.cells.trim().split(" "),
    }));
    const columns = [...document.querySelectorAll(".matrix [data-column]")];
    const chips = [...document.querySelectorAll(".chip")];
    const found = document.getElementById("found");
    const clear = document.getElementById("clear");
    const noneFound = document.getElementById("none-found");

    const chosen = (filter) =>
      chips
        .filter((c) => c.dataset.filter === filter && c.getAttribute("aria-pressed") === "true")
        .map((c) => c.dataset.value);

    // With renderers chosen, a status means theirs; otherwise that of the case as a whole.
    function matches(row, words, statuses, families, renderers) {
      const own = renderers.length ? renderers.map((column) => row.cells[column]) : [row.status];
      return (
        words.every((word) => row.text.includes(word)) &&
        (!families.length || families.includes(row.family)) &&
        (!statuses.length || own.some((status) => statuses.includes(status)))
      );
    }

    function apply() {
      const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
      const [statuses, families, renderers] = ["status", "family", "renderer"].map(chosen);
      let shown = 0;
      for (const row of rows) {
        const visible = matches(row, words, statuses, families, renderers);
        row.element.hidden = !visible;
        shown += visible;
      }
      for (const cell of columns) {
        cell.hidden = renderers.length > 0 && !renderers.includes(cell.dataset.column);
      }
      const filtered = words.length + statuses.length + families.length + renderers.length > 0;
      const all = rows.length === 1 ? "1 case" : `${rows.length} cases`;
      found.textContent = filtered ? `${shown} of ${all}` : all;
      clear.hidden = !filtered;
      noneFound.hidden = shown > 0;
      remember({ q: search.value.trim(), status: statuses, family: families, renderer: renderers });
    }

    function remember(state) {
      const hash = new URLSearchParams();
      for (const [key, value] of Object.entries(state)) {
        for (const item of [value].flat()) if (item) hash.append(key, item);
      }
      const text = hash.toString();
      if (text || location.hash.includes("=")) {
        history.replaceState(null, "", text ? `#${text}` : location.pathname);
      }
    }

    function recall() {
      if (!location.hash.includes("=")) return;
      const hash = new URLSearchParams(location.hash.slice(1));
      search.value = hash.get("q") ?? "";
      for (const chip of chips) {
        const on = hash.getAll(chip.dataset.filter).includes(chip.dataset.value);
        chip.setAttribute("aria-pressed", String(on));
      }
    }

    for (const chip of chips) {
      chip.addEventListener("click", () => {
        chip.setAttribute("aria-pressed", String(chip.getAttribute("aria-pressed") !== "true"));
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
    addEventListener("keydown", (event) => {
      if (event.key === "/" && !typing(event) && !event.ctrlKey && !event.metaKey) {
        event.preventDefault();
        search.focus();
        search.select();
      }
      if (event.key === "Escape" && event.target === search) search.blur();
    });
    recall();
    apply();
  }

  stepThroughCases();
  filterMatrix();
})();
