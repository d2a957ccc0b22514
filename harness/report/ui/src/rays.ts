// The rays of a probe, decoded: which one a pixel has, where it went, by how much renderers are off.

import { floats, type StoredProbe, type StoredSolid, type StoredWays, type Vec3 } from "./pack";

export interface Solid {
  readonly name: string;
  readonly medium: number;
  readonly center: Vec3 | null;
  readonly radius: number;
  readonly corners: Float32Array | null;
  readonly triangles: readonly number[];
}

/** One ray: the true way, and how each renderer's differs from it. */
export interface Ray {
  readonly x: number; // its pixel
  readonly y: number;
  readonly vertices: readonly Vec3[]; // camera, interfaces, landing, as far as it came
  readonly letters: string; // T transmitted, R reflected, M reflected by a mirror
  readonly thetaI: readonly number[]; // degrees, one per interface that was met
  readonly thetaT: readonly number[];
  readonly weight: number;
  readonly status: number; // 0 landed, 1 missed, 2 totally reflected, 3 cut
  readonly renderers: readonly {
    readonly name: string;
    readonly shift: Vec3; // measured minus true landing point; NaN where it was not seen
    readonly turn: Vec3; // measured minus true direction
  }[];
}

export class Rays {
  private constructor(
    readonly probe: StoredProbe | StoredWays,
    readonly solids: readonly Solid[],
    readonly errors: ReadonlyMap<string, Float32Array>,
    private readonly arrays: Readonly<Record<string, Float32Array>>,
    private readonly perRenderer: readonly { name: string; shift: Float32Array; turn: Float32Array }[],
    readonly teller: string, // the renderer whose ways these are; "" for the true ones of a probe
  ) {}

  static async decode(probe: StoredProbe | StoredWays, prefix = ""): Promise<Rays> {
    const [vertices, thetaI, thetaT, status, weight] = await Promise.all(
      [probe.vertices, probe.thetaI, probe.thetaT, probe.status, probe.weight].map(floats));
    const renderers = await Promise.all(probe.renderers.map(async (r) => ({
      name: prefix + r.name,
      error: await floats(r.error),
      shift: await floats(r.shift),
      turn: await floats(r.turn),
    })));
    const arrays = { vertices, thetaI, thetaT, status, weight } as Record<string, Float32Array>;
    const told = "events" in probe;
    if (told) arrays["events"] = await floats(probe.events);
    const errors = new Map(renderers.map((r) => [r.name, r.error]));
    const solids = await Promise.all(probe.solids.map(decodeSolid));
    return new Rays(probe, solids, errors, arrays, renderers, told ? prefix + probe.name : "");
  }

  private get columns(): number {
    return Math.ceil(this.probe.width / this.probe.step);
  }

  private get count(): number {
    return this.columns * Math.ceil(this.probe.height / this.probe.step);
  }

  private at(name: string, row: number, k: number): number {
    return this.arrays[name]?.[row * this.count + k] ?? Number.NaN;
  }

  /** The stored ray nearest to a pixel. */
  nearest(x: number, y: number): Ray {
    const { probe, columns } = this;
    const rows = Math.ceil(probe.height / probe.step);
    const column = Math.min(columns - 1, Math.round(x / probe.step));
    const row = Math.min(rows - 1, Math.round(y / probe.step));
    return this.ray(column, row);
  }

  /** The ray of the middle row whose first angle of incidence comes nearest to `degrees`. */
  withIncidence(degrees: number): Ray | null {
    const row = Math.round(Math.floor(this.probe.height / 2) / this.probe.step);
    let best: { k: number; gap: number } | null = null;
    for (let k = 0; k < this.columns; k++) {
      const gap = Math.abs(this.at("thetaI", 0, row * this.columns + k) - degrees);
      if (gap < (best?.gap ?? Infinity)) best = { k, gap };
    }
    return best ? this.ray(best.k, row) : null;
  }

  private ray(column: number, row: number): Ray {
    const { probe } = this;
    const k = row * this.columns + column;
    const triple = (array: Float32Array, first: number): Vec3 =>
      [0, 1, 2].map((axis) => array[(first + axis) * this.count + k] ?? Number.NaN) as unknown as Vec3;
    const vertices: Vec3[] = [];
    for (let n = 0; n < probe.path.length + 2; n++) {
      const vertex = triple(this.arrays["vertices"] as Float32Array, 3 * n);
      if (vertex.every(Number.isFinite)) vertices.push(vertex);
    }
    const angles = (name: string): number[] =>
      [...probe.path].map((_, n) => this.at(name, n, k));
    const known = this.teller ? "events" : "thetaI";
    const met = angles(known).filter(Number.isFinite).length;
    return {
      x: column * probe.step,
      y: row * probe.step,
      vertices,
      letters: this.teller
        ? angles("events").slice(0, met).map((event) => "TRM"[event] ?? "T").join("")
        : probe.path.slice(0, met),
      thetaI: angles("thetaI").slice(0, met),
      thetaT: angles("thetaT").slice(0, met),
      weight: this.at("weight", 0, k),
      status: this.at("status", 0, k),
      renderers: this.perRenderer.map((r) => ({
        name: r.name, shift: triple(r.shift, 0), turn: triple(r.turn, 0),
      })),
    };
  }
}

async function decodeSolid(stored: StoredSolid): Promise<Solid> {
  return {
    name: stored.name,
    medium: stored.medium,
    center: stored.center ?? null,
    radius: stored.radius ?? 0,
    corners: stored.corners ? await floats(stored.corners) : null,
    triangles: stored.triangles ?? [],
  };
}
