// A ray's way through the solids, in the plane in which it is refracted first.

import { svg } from "./dom";
import { number } from "./format";
import type { Vec3 } from "./pack";
import type { Ray, Rays, Solid } from "./rays";
import { add, cross, dot, length, minus, times, unit } from "./vector";

type Point = readonly [number, number];

const WIDTH = 640;
const HEIGHT = 380;
const MARGIN = 34;
const LETTER = 6.6; // width of one in a label of an angle
const LINE = 15;

/** A plane with two axes in it. */
interface Plane {
  readonly origin: Vec3;
  readonly x: Vec3;
  readonly y: Vec3;
  readonly n: Vec3;
}

function planeOf(ray: Ray): Plane {
  const [start, first, second] = ray.vertices as [Vec3, Vec3?, Vec3?];
  const d = first ? unit(minus(first, start)) : ([0, 0, -1] as Vec3);
  const bent = first && second ? cross(d, unit(minus(second, first))) : ([0, 0, 0] as Vec3);
  // A ray that is not bent lies in many planes; then the one that holds "up", or else "aside".
  const helper: Vec3 = Math.abs(d[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0];
  const n = unit(length(bent) > 1e-6 ? bent : cross(d, helper));
  const x = d;
  return { origin: first ?? start, x, y: cross(n, x), n };
}

function project(plane: Plane, p: Vec3): Point {
  const local = minus(p, plane.origin);
  return [dot(local, plane.x), dot(local, plane.y)];
}

/** Where a plane cuts a solid: a circle, or pieces of straight lines. */
function outline(solid: Solid, plane: Plane): { circle?: [Point, number]; lines: [Point, Point][] } {
  if (solid.center) {
    const away = dot(minus(solid.center, plane.origin), plane.n);
    const r2 = solid.radius ** 2 - away ** 2;
    return r2 > 0 ? { circle: [project(plane, solid.center), Math.sqrt(r2)], lines: [] } : { lines: [] };
  }
  const lines: [Point, Point][] = [];
  const corners = solid.corners;
  if (!corners) return { lines };
  const corner = (k: number): Vec3 =>
    [corners[3 * k] ?? 0, corners[3 * k + 1] ?? 0, corners[3 * k + 2] ?? 0];
  for (let t = 0; t < solid.triangles.length; t += 3) {
    const points = [0, 1, 2].map((k) => corner(solid.triangles[t + k] as number));
    // A hair aside, lest a face that lies in the plane be drawn as its diagonals.
    const sides = points.map((p) => dot(minus(p, plane.origin), plane.n) + 1e-7);
    const cut: Point[] = [];
    for (const [i, j] of [[0, 1], [1, 2], [2, 0]] as const) {
      const [a, b] = [sides[i] as number, sides[j] as number];
      if (a > 0 === b > 0) continue;
      const way = minus(points[j] as Vec3, points[i] as Vec3);
      cut.push(project(plane, add(points[i] as Vec3, times(a / (a - b), way))));
    }
    if (cut.length === 2) lines.push([cut[0] as Point, cut[1] as Point]);
  }
  return { lines };
}

/** Joins pieces end to end into one path, so that it can be filled. */
function joined(lines: readonly [Point, Point][]): Point[][] {
  const close = (a: Point, b: Point): boolean => Math.hypot(a[0] - b[0], a[1] - b[1]) < 1e-5;
  const left = [...lines];
  const loops: Point[][] = [];
  while (left.length) {
    const loop = [...(left.pop() as [Point, Point])];
    for (;;) {
      const end = loop[loop.length - 1] as Point;
      const at = left.findIndex(([a, b]) => close(a, end) || close(b, end));
      if (at < 0) break;
      const [a, b] = left.splice(at, 1)[0] as [Point, Point];
      loop.push(close(a, end) ? b : a);
    }
    loops.push(loop);
  }
  return loops;
}

interface Frame {
  readonly place: (p: Point) => Point;
  readonly scale: number;
}

/** Shows the whole bend, but not all of a long way to the camera or the backdrop. */
function frameOf(points: readonly Point[], bends: readonly Point[]): Frame {
  const box = (list: readonly Point[]): [number, number, number, number] => [
    Math.min(...list.map((p) => p[0])), Math.max(...list.map((p) => p[0])),
    Math.min(...list.map((p) => p[1])), Math.max(...list.map((p) => p[1])),
  ];
  const whole = box(points);
  const [bx0, bx1, by0, by1] = box(bends.length ? bends : points);
  const reach = Math.max(bx1 - bx0, by1 - by0, 0.12 * (whole[1] - whole[0])) * 1.1;
  const x0 = Math.max(whole[0], bx0 - reach);
  const x1 = Math.min(whole[1], bx1 + reach);
  const clipped = points.filter((p) => p[0] >= x0 - 1e-9 && p[0] <= x1 + 1e-9);
  const [, , y0, y1] = box([...clipped, ...bends, [x0, 0]]);
  const scale = Math.min(
    (WIDTH - 2 * MARGIN) / (x1 - x0 || 1), (HEIGHT - 2 * MARGIN) / Math.max(y1 - y0, (x1 - x0) / 3));
  const [cx, cy] = [(x0 + x1) / 2, (y0 + y1) / 2];
  return {
    place: (p) => [WIDTH / 2 + (p[0] - cx) * scale, HEIGHT / 2 - (p[1] - cy) * scale],
    scale,
  };
}

const path = (points: readonly Point[]): string =>
  "M" + points.map((p) => `${p[0].toFixed(2)} ${p[1].toFixed(2)}`).join("L");

/** The diagram; colours are left to the stylesheet. */
export function sectionOf(rays: Rays, ray: Ray, colours: Readonly<Record<string, string>>): SVGSVGElement {
  const plane = planeOf(ray);
  const way = ray.vertices.map((v) => project(plane, v));
  const met = ray.letters.length;
  const frame = frameOf(way, way.slice(1, 1 + met));
  const { place } = frame;
  const title = `Section through the plane of incidence of the ray of pixel (${ray.x}, ${ray.y})`;
  const drawing = svg("svg", {
    class: "section", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": title,
  });
  const clip = svg("g", {});
  drawing.append(clip);
  for (const solid of rays.solids) clip.append(...solidShapes(solid, plane, frame, rays));
  clip.append(...rays.probe.planes.map((p) => planeLine(p, plane, frame)).filter((e) => e !== null));
  clip.append(...renderedEnds(ray, plane, frame, colours));
  clip.append(svg("path", { class: "true-ray", d: path(way.map(place)) }));
  const room = freeRoom();
  for (let k = 0; k < met; k++) clip.append(...interfaceMarks(ray, way, k, frame, room));
  const last = way[way.length - 1];
  if (last && ray.status === 0) {
    const [x, y] = place(last);
    clip.append(svg("circle", { class: "landing", cx: x, cy: y, r: 3.5 }));
  }
  drawing.append(scaleBar(frame));
  return drawing;
}

function solidShapes(solid: Solid, plane: Plane, frame: Frame, rays: Rays): SVGElement[] {
  const { circle, lines } = outline(solid, plane);
  const medium = rays.probe.media[solid.medium];
  const text = `${solid.name}: ${medium?.name ?? "?"}, n = ${medium ? number(medium.ior, 6) : "?"}`;
  const title = (): SVGTitleElement => svg("title", {}, text);
  if (circle) {
    const [x, y] = frame.place(circle[0]);
    return [svg("circle", { class: "solid", cx: x, cy: y, r: circle[1] * frame.scale }, title())];
  }
  const loops = joined(lines).map((loop) => path(loop.map(frame.place)) + "z");
  return loops.length ? [svg("path", { class: "solid", d: loops.join("") }, title())] : [];
}

function planeLine(
  stored: { origin: Vec3; x: Vec3; y: Vec3; size: readonly [number, number] },
  plane: Plane, frame: Frame,
): SVGElement | null {
  // The line in which both planes meet, as far as the rectangle goes.
  const n = cross(stored.x, stored.y);
  const direction = cross(n, plane.n);
  if (length(direction) < 1e-9) return null;
  const along = unit(direction);
  const off = dot(minus(plane.origin, stored.origin), n);
  const inPlane = unit(cross(plane.n, along));
  const foot = add(plane.origin, times(-off / dot(inPlane, n), inPlane));
  const local = minus(foot, stored.origin);
  let [low, high] = [-1e6, 1e6];
  for (const [axis, size] of [[stored.x, stored.size[0]], [stored.y, stored.size[1]]] as const) {
    const [p, d] = [dot(local, axis), dot(along, axis)];
    if (Math.abs(d) < 1e-9) continue;
    const ends = [(-size / 2 - p) / d, (size / 2 - p) / d].sort((a, b) => a - b) as [number, number];
    [low, high] = [Math.max(low, ends[0]), Math.min(high, ends[1])];
  }
  if (!(low < high)) return null;
  const ends = [low, high].map((t) => frame.place(project(plane, add(foot, times(t, along)))));
  return svg("path", { class: "probe-plane", d: path(ends) });
}

/** From the last interface to where each renderer's ray landed. */
function renderedEnds(
  ray: Ray, plane: Plane, frame: Frame, colours: Readonly<Record<string, string>>,
): SVGElement[] {
  const last = ray.vertices[ray.vertices.length - 1];
  const before = ray.vertices[ray.vertices.length - 2];
  if (!last || !before || ray.status !== 0) return [];
  return ray.renderers.flatMap((renderer) => {
    if (!renderer.shift.every(Number.isFinite)) return [];
    const ends = [before, add(last, renderer.shift)].map((p) => frame.place(project(plane, p)));
    return [svg("path", { class: `measured ${colours[renderer.name] ?? "c7"}`, d: path(ends) },
      svg("title", {}, renderer.name))];
  });
}

/** Finds labels a place in the drawing where no other is, beside the one they would rather have. */
type Room = (wished: Point, text: string) => Point | null;

function freeRoom(): Room {
  const taken: (readonly [Point, number])[] = []; // centre and half the width
  return (wished, text) => {
    const half = (text.length * LETTER) / 2;
    const x = within(wished[0], half + 4, WIDTH - half - 4);
    for (const step of [0, -1, 1, -2, 2, -3, 3]) {
      const place: Point = [x, within(wished[1] + step * LINE, LINE, HEIGHT - LINE)];
      const free = taken.every(([other, wide]) =>
        Math.abs(other[0] - place[0]) > half + wide || Math.abs(other[1] - place[1]) >= LINE);
      if (!free) continue;
      taken.push([place, half]);
      return place;
    }
    return null; // the table beside the diagram has the angle
  };
}

function within(value: number, low: number, high: number): number {
  return Math.min(high, Math.max(low, value));
}

function interfaceMarks(
  ray: Ray, way: readonly Point[], k: number, frame: Frame, room: Room,
): SVGElement[] {
  if (!Number.isFinite(ray.thetaI[k])) return []; // where a thin slab is left, nobody says
  const here = way[k + 1] as Point;
  const from = way[k] as Point;
  const next = way[k + 2];
  const thetaI = (ray.thetaI[k] ?? 0) * Math.PI / 180;
  const back = Math.atan2(from[1] - here[1], from[0] - here[0]);
  // The normal lies θᵢ from the way back, on the side that θₜ confirms.
  let normal = back + thetaI;
  if (next) {
    const onward = Math.atan2(next[1] - here[1], next[0] - here[0]);
    const transmitted = ray.letters[k] === "T";
    const thetaT = (transmitted ? ray.thetaT[k] ?? 0 : ray.thetaI[k] ?? 0) * Math.PI / 180;
    const misfit = (n: number): number => {
      const target = transmitted ? n + Math.PI : n;
      const gap = Math.abs(Math.atan2(Math.sin(onward - target), Math.cos(onward - target)));
      return Math.abs(gap - thetaT);
    };
    if (misfit(back - thetaI) < misfit(back + thetaI)) normal = back - thetaI;
  }
  const centre = frame.place(here);
  const at = (angle: number, r: number): Point =>
    [centre[0] + r * Math.cos(angle), centre[1] - r * Math.sin(angle)];
  const parts: SVGElement[] = [
    svg("path", { class: "normal", d: path([at(normal, 62), at(normal + Math.PI, 62)]) }),
    arc(centre, back, normal, 26),
  ];
  const label = (angle: number, text: string): void => {
    const place = room(at(angle, 44), text);
    if (place) parts.push(svg("text", { class: "angle", x: place[0], y: place[1] + 4 }, text));
  };
  label(middle(back, normal), `θᵢ ${degrees(ray.thetaI[k])}`);
  if (next && ray.letters[k] === "T") {
    const onward = Math.atan2(next[1] - here[1], next[0] - here[0]);
    parts.push(arc(centre, onward, normal + Math.PI, 26));
    if (Number.isFinite(ray.thetaT[k])) label(middle(onward, normal + Math.PI), `θₜ ${degrees(ray.thetaT[k])}`);
  } else if (ray.letters[k] === "M") {
    label(normal + Math.PI, "mirror");
  } else if (!Number.isFinite(ray.thetaT[k] ?? Number.NaN)) {
    label(normal + Math.PI, "total reflection");
  }
  return parts;
}

const degrees = (value: number | undefined): string =>
  value === undefined || !Number.isFinite(value) ? "" : `${value.toFixed(3)}°`;

function middle(a: number, b: number): number {
  return a + Math.atan2(Math.sin(b - a), Math.cos(b - a)) / 2;
}

function arc(centre: Point, a: number, b: number, r: number): SVGElement {
  const turn = Math.atan2(Math.sin(b - a), Math.cos(b - a));
  const at = (angle: number): Point =>
    [centre[0] + r * Math.cos(angle), centre[1] - r * Math.sin(angle)];
  const points = Array.from({ length: 17 }, (_, k) => at(a + (turn * k) / 16));
  return svg("path", { class: "arc", d: path(points) });
}

function scaleBar(frame: Frame): SVGElement {
  const rough = 90 / frame.scale;
  const power = 10 ** Math.floor(Math.log10(rough));
  const size = [5, 2, 1].map((k) => k * power).find((v) => v <= rough) ?? power;
  const x = WIDTH - MARGIN / 2 - size * frame.scale;
  const y = HEIGHT - 12;
  return svg("g", { class: "scale-bar" },
    svg("path", { d: `M${x} ${y - 4}v4h${size * frame.scale}v-4` }),
    svg("text", { x: x + (size * frame.scale) / 2, y: y - 6 }, `${number(size, 2)} units`));
}

// --- where the ray landed, magnified --------------------------------------------------------------

/** Landing points around the true one in the plane of the first backdrop. */
export function landingOf(rays: Rays, ray: Ray, colours: Readonly<Record<string, string>>): SVGSVGElement | null {
  const plane = rays.probe.planes[0];
  const seen = ray.renderers.filter((r) => r.shift.every(Number.isFinite));
  if (!plane || ray.status !== 0 || !seen.length) return null;
  const points = seen.map((r) => ({
    name: r.name, x: dot(r.shift, plane.x), y: dot(r.shift, plane.y),
  }));
  const largest = Math.max(...points.map((p) => Math.hypot(p.x, p.y)));
  const reach = largest > 0 ? largest * 1.35 : 1;
  const [side, half] = [220, 110];
  const drawing = svg("svg", {
    class: "landings", viewBox: `0 0 ${side} ${side}`, role: "img",
    "aria-label": "Measured landing points around the true one",
  });
  const scale = (half - 8) / reach;
  drawing.append(
    svg("path", { class: "grid", d: `M0 ${half}H${side}M${half} 0V${side}` }),
    svg("circle", { class: "grid", cx: half, cy: half, r: (half - 8) / 1.35 }));
  for (const p of points) {
    drawing.append(svg("circle", {
      class: `landed ${colours[p.name] ?? "c7"}`,
      cx: half + p.x * scale, cy: half - p.y * scale, r: 4.5,
    }, svg("title", {}, `${p.name}: ${number(Math.hypot(p.x, p.y), 3)} units`)));
  }
  drawing.append(svg("text", { x: side - 6, y: side - 8, class: "end" },
    largest > 0 ? `circle: ${number(largest, 2)} units` : "no difference"));
  return drawing;
}
