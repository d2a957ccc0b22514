// A case's page: loads its pack, puts the viewer in place, or says why there is none.

import type { CaseData } from "./case";
import { readCharts } from "./charts";
import { h } from "./dom";
import { bind } from "./keys";
import { loadPack } from "./load";
import { MAPS } from "./maps";
import { decodeImages, type Image, type Silent } from "./pack";
import { RayPanel } from "./raypanel";
import { Rays } from "./rays";
import { Viewer } from "./viewer";

export function bindCaseKeys(data: CaseData | null, here: ParentNode): void {
  const go = (selector: string): void => here.querySelector<HTMLAnchorElement>(selector)?.click();
  bind("Cases", "j k", "next, previous case", ["j", "k"], (event) =>
    go(event.key === "j" ? 'a[rel="next"]' : 'a[rel="prev"]'));
  bind("Cases", "n", "next case that fails", ["n"], () => go("a[data-next-failure]"));
  if (data) bind("Cases", "u", "up to the index", ["u"], () => go("a.brand"));
}

export async function startCase(data: CaseData, here: ParentNode): Promise<void> {
  const place = here.querySelector<HTMLElement>("#viewer");
  if (!place) return;
  if (!data.packs.length) {
    say(place, "Pixel data not included", "This report holds pictures only; run the case again, or open the report of the run itself, for values, maps and rays.");
    readCharts(data.curves, data.colours, null);
    place.dataset["ready"] = "true";
    return;
  }
  say(place, "Loading pixels …", "");
  try {
    const images: Image[] = [];
    const rays: Rays[] = [];
    const ways: Rays[] = [];
    const silent: Silent[] = [];
    for (const source of data.packs) {
      const pack = await loadPack(source.href);
      images.push(...(await decodeImages(pack)).map((i) => ({ ...i, name: source.prefix + i.name })));
      rays.push(...await Promise.all(pack.probes.map((probe) => Rays.decode(probe, source.prefix))));
      ways.push(...await Promise.all((pack.ways?.rays ?? []).map((one) => Rays.decode(one, source.prefix))));
      silent.push(...(pack.ways?.silent ?? []).map((one) => ({ ...one, name: source.prefix + one.name })));
    }
    const viewer = new Viewer(data, images, rays, new RayPanel(rays, ways, silent, data.colours, data.ray), place);
    exposeMaps(images);
    (here.querySelector("#pictures") as HTMLElement | null)?.classList.add("viewing");
    readCharts(data.curves, data.colours, rays.length ? (degrees) => viewer.showRay(degrees) : null);
  } catch (error) {
    say(place, "Pixel data could not be shown", error instanceof Error ? error.message : String(error));
    readCharts(data.curves, data.colours, null);
  }
  place.dataset["ready"] = "true";
}

declare global {
  interface Window {
    /** Maps of two pictures by name, as the viewer shows them: for tests and curious consoles. */
    snellcheckMaps?: (a: string, b: string) => Record<string, number[]>;
  }
}

function exposeMaps(images: readonly Image[]): void {
  window.snellcheckMaps = (a, b) => {
    const [one, two] = [a, b].map((name) => images.find((image) => image.name === name)) as
      [Image, Image];
    return Object.fromEntries(Object.entries(MAPS).flatMap(([mode, map]) =>
      map.figures ? [[mode, [...map.figures(one, two)]]] : []));
  };
}

function say(place: HTMLElement, title: string, text: string): void {
  place.replaceChildren(h("div", { class: "viewer-state", role: "status" },
    h("b", {}, title), text && h("span", {}, text)));
}
