// Packs arrive as scripts that call `snellcheckPack`, or stand in the page itself.

import { SCHEMA, type StoredPack } from "./pack";

declare global {
  interface Window {
    snellcheckPack?: (pack: StoredPack) => void;
  }
}

let waiting: ((pack: StoredPack) => void) | null = null;
let queue: Promise<unknown> = Promise.resolve();

function checked(pack: StoredPack): StoredPack {
  if (pack.schema !== SCHEMA) throw new Error(`is of another version: ${pack.schema}`);
  return pack;
}

function embedded(source: string): StoredPack | null {
  for (const block of document.querySelectorAll<HTMLScriptElement>("script[data-pack]")) {
    if (block.dataset["pack"] === source) return JSON.parse(block.textContent ?? "") as StoredPack;
  }
  return null;
}

function fromScript(source: string): Promise<StoredPack> {
  return new Promise((resolve, reject) => {
    const script = document.createElement("script");
    let found: StoredPack | null = null;
    waiting = (pack) => (found = pack);
    script.onload = () => (found ? resolve(found) : reject(new Error("holds no pack")));
    script.onerror = () => reject(new Error("could not be loaded"));
    script.src = source;
    document.head.append(script);
  });
}

/** Loads the pack at a relative URL; one at a time, since scripts do not say who they are. */
export function loadPack(source: string): Promise<StoredPack> {
  const inside = embedded(source);
  if (inside) return Promise.resolve(checked(inside));
  if (document.documentElement.hasAttribute("data-single")) {
    return Promise.reject(new Error("there was no room for them in this single file"));
  }
  window.snellcheckPack = (pack) => waiting?.(pack);
  const mine = queue.then(() => fromScript(source)).then(checked);
  queue = mine.catch(() => undefined);
  return mine;
}
