// A report in one file: its pages are templates, and links between them stay inside.

import { currentPage, openPage } from "./address";

const isSingle = (): boolean => document.documentElement.hasAttribute("data-single");

/** Puts the page that the address names in the index's place, and keeps links inside the file. */
export function startSingle(): void {
  if (!isSingle()) return;
  const page = currentPage();
  const pages = [...document.querySelectorAll<HTMLTemplateElement>("template[data-page]")];
  const template = pages.find((t) => t.dataset["page"] === page);
  if (template) {
    document.querySelector("header.top")?.remove();
    document.querySelector("main")?.remove();
    document.querySelector(".skip-link")?.after(template.content.cloneNode(true));
    document.title = template.dataset["title"] ?? document.title;
  }
  addEventListener("click", (event) => {
    const link = (event.target as Element | null)?.closest?.("a[href]");
    const target = link?.getAttribute("href") ?? "";
    if (!link || target.startsWith("#")) return;
    event.preventDefault();
    openPage(resolved(target, page));
  });
  addEventListener("popstate", () => {
    if (currentPage() !== page) location.reload();
  });
}

function resolved(target: string, page: string): string {
  const name = target.replace(/#.*/, "").replace(/^\.\.\//, "");
  if (name === "index.html" || name === "") return "";
  return name.startsWith("cases/") || !page ? name : `cases/${name}`;
}
