// The same ray in space: edges of the solids and the way through them, turned by dragging.

import { h, svg } from "./dom";
import type { Vec3 } from "./pack";
import type { Ray, Rays, Solid } from "./rays";
import { add, cross, dot, minus, times, unit } from "./vector";

const SIDE = 300;

/** A line of a solid. One between faces that meet smoothly is drawn where it is the outline. */
interface Edge {
  readonly ends: readonly [Vec3, Vec3];
  readonly faces?: readonly [Vec3, Vec3]; // normals
}

const SHARP = Math.cos((15 * Math.PI) / 180);
const MOST_EDGES = 20000;

/** The edges of a solid; of a sphere three great circles. */
function edges(solid: Solid): Edge[] {
  if (solid.center) return circles(solid.center, solid.radius);
  const { corners, triangles } = solid;
  if (!corners) return [];
  const corner = (k: number): Vec3 =>
    [corners[3 * k] ?? 0, corners[3 * k + 1] ?? 0, corners[3 * k + 2] ?? 0];
  const normals = new Map<string, Vec3>();
  const found: Edge[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const index = [0, 1, 2].map((k) => triangles[t + k] as number);
    const [a, b, c] = index.map(corner) as [Vec3, Vec3, Vec3];
    const n = unit(cross(minus(b, a), minus(c, a)));
    for (const [i, j] of [[0, 1], [1, 2], [2, 0]] as const) {
      const ends = [index[i] as number, index[j] as number].sort((p, q) => p - q);
      const key = ends.join(" ");
      const other = normals.get(key);
      if (!other) normals.set(key, n);
      else if (dot(other, n) < 1 - 1e-9) {
        const line = [corner(ends[0] as number), corner(ends[1] as number)] as const;
        found.push(dot(other, n) < SHARP ? { ends: line } : { ends: line, faces: [other, n] });
      }
    }
  }
  const every = Math.ceil(found.length / MOST_EDGES);
  return every > 1 ? found.filter((_, k) => k % every === 0) : found;
}

function circles(center: Vec3, radius: number): Edge[] {
  const axes: Vec3[] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  return axes.flatMap((u, k) => {
    const v = axes[(k + 1) % 3] as Vec3;
    const at = (turn: number): Vec3 => add(center,
      add(times(radius * Math.cos(turn), u), times(radius * Math.sin(turn), v)));
    return Array.from({ length: 48 }, (_, n): Edge =>
      ({ ends: [at((2 * Math.PI * n) / 48), at((2 * Math.PI * (n + 1)) / 48)] }));
  });
}

/** What the ray's bend says of the normal: n_i d_i − n_t d_t is parallel to it, as is d_r − d_i. */
function normalAt(ray: Ray, k: number): Vec3 {
  const [before, here, next] = [ray.vertices[k], ray.vertices[k + 1], ray.vertices[k + 2]];
  if (!before || !here) return [0, 1, 0];
  const d = unit(minus(here, before));
  if (!next) return d;
  const onward = unit(minus(next, here));
  if (ray.letters[k] !== "T") return unit(minus(onward, d));
  const [i, t] = [ray.thetaI[k] ?? 0, ray.thetaT[k] ?? 0].map((a) => Math.sin((a * Math.PI) / 180)) as [number, number];
  return i > 1e-4 ? unit(minus(times(t / i, d), onward)) : d;
}

function ring(at: Vec3, n: Vec3, radius: number): Vec3[] {
  const u = unit(cross(n, Math.abs(n[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0]));
  const v = cross(n, u);
  return Array.from({ length: 40 }, (_, k) => add(at, add(
    times(radius * Math.cos((k * Math.PI) / 20), u), times(radius * Math.sin((k * Math.PI) / 20), v))));
}

export function solidView(rays: Rays, ray: Ray): HTMLElement {
  const met = ray.vertices.slice(1, 1 + Math.max(1, ray.letters.length));
  const centre = times(1 / met.length, met.reduce(add, [0, 0, 0] as Vec3));
  const lines = rays.solids.flatMap(edges);
  const reach = Math.max(0.5, ...met.map((p) => Math.hypot(...minus(p, centre)))) * 2.6;
  const rings = met.map((p, k) => ring(p, normalAt(ray, k), 0.3 * reach));
  const near = lines.filter(({ ends }) => ends.some((p) => Math.hypot(...minus(p, centre)) < 3 * reach));
  const drawing = svg("svg", { class: "solid-view", viewBox: `0 0 ${SIDE} ${SIDE}`, role: "img", tabindex: 0,
    "aria-label": "The ray in space; drag, or use the arrow keys, to turn it" });
  let [azimuth, height] = [0.6, 0.35];
  const draw = (): void => {
    const [ca, sa, ch, sh] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(height), Math.sin(height)];
    const place = (p: Vec3): string => {
      const [x, y, z] = minus(p, centre);
      const side = ca * x - sa * z;
      const away = sa * x + ca * z;
      const up = ch * y - sh * away;
      return `${(SIDE / 2 + (side / reach) * (SIDE / 2)).toFixed(1)} ${(SIDE / 2 - (up / reach) * (SIDE / 2)).toFixed(1)}`;
    };
    const view: Vec3 = [-sa * ch, -sh, -ca * ch]; // away from the eye
    const seen = near.filter(({ faces }) => !faces || dot(faces[0], view) > 0 !== dot(faces[1], view) > 0);
    drawing.replaceChildren(
      svg("path", { class: "wire", d: seen.map(({ ends: [a, b] }) => `M${place(a)}L${place(b)}`).join("") }),
      ...rings.map((points) => svg("path", { class: "facet", d: `M${points.map(place).join("L")}z` })),
      svg("path", { class: "true-ray", d: "M" + ray.vertices.map(place).join("L") }),
      ...met.map((p) => {
        const [cx = 0, cy = 0] = place(p).split(" ").map(Number);
        return svg("circle", { class: "landing", cx, cy, r: 3 });
      }));
  };
  drawing.addEventListener("pointerdown", (event) => drawing.setPointerCapture(event.pointerId));
  drawing.addEventListener("pointermove", (event) => {
    if (!drawing.hasPointerCapture(event.pointerId)) return;
    azimuth += event.movementX / 90;
    height = Math.min(1.5, Math.max(-1.5, height + event.movementY / 90));
    draw();
  });
  drawing.addEventListener("keydown", (event) => {
    const turn = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (!turn) return;
    event.preventDefault();
    azimuth += turn[0] as number;
    height = Math.min(1.5, Math.max(-1.5, height + (turn[1] as number)));
    draw();
  });
  draw();
  return h("figure", { class: "space" }, drawing);
}
