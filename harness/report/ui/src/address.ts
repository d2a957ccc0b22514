// The part of the address after "#". In a single file it also says which page is open.

const PAGE = "page";

function parsed(): URLSearchParams {
  return new URLSearchParams(location.hash.includes("=") ? location.hash.slice(1) : "");
}

export function currentPage(): string {
  return parsed().get(PAGE) ?? "";
}

/** What the address says beside the page. */
export function readAddress(): string {
  const hash = parsed();
  hash.delete(PAGE);
  return hash.toString();
}

/** Replaces what the address says, without a step in the browser's history. */
export function writeAddress(text: string): void {
  if (!text && !location.hash.includes("=")) return;
  history.replaceState(null, "", addressOf(text) || location.pathname + location.search);
}

function addressOf(text: string, page = currentPage()): string {
  const hash = new URLSearchParams(text);
  const parts = [...(page ? [[PAGE, page]] : []), ...hash] as [string, string][];
  const whole = new URLSearchParams(parts).toString();
  return whole && `#${whole}`;
}

/** Opens a page of a single file; "" is the index. A fresh load is what another file would be. */
export function openPage(page: string): void {
  if (page === currentPage()) return;
  history.pushState(null, "", addressOf("", page) || location.pathname + location.search);
  location.reload();
}
