// What is said of pictures: what a pane shows, and why there is nothing to compare.

import { MAPS } from "./maps";
import type { Image } from "./pack";
import type { Mode, ViewState } from "./state";

const ALONE: Partial<Record<Mode, true>> = { side: true, rays: true, a: true, b: true };

export function paneLabel({ mode, b }: ViewState, subject: string): string {
  if (mode === "rays") return `Ray error of ${subject}`;
  if (MAPS[mode]) return `${MAPS[mode].title} of A ${subject} and B ${b}`;
  return mode === "swipe" || mode === "blink" ? `${subject} and ${b}` : subject;
}

export function problemOf(
  state: ViewState, images: ReadonlyMap<string, Image>, hasRays: boolean,
): string {
  const { mode, a, b, every } = state;
  if (mode === "rays") return hasRays ? "" : "No rays were measured in this case.";
  if (!images.size) return "No renderer delivered a picture.";
  if (ALONE[mode]) return "";
  const [one, two] = [images.get(a), images.get(b)];
  if (one && two && (one.width !== two.width || one.height !== two.height)) {
    return `Sizes differ: ${a} is ${one.width} × ${one.height}, ` +
      `${b} is ${two.width} × ${two.height}. There is nothing to compare pixel by pixel.`;
  }
  return a === b && !(MAPS[mode] && every) ? "A and B are the same picture." : "";
}
