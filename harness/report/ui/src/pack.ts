// Pixel packs, as harness/report/pack.py writes them.

export interface StoredImage {
  readonly name: string;
  readonly role: string;
  readonly width: number;
  readonly height: number;
  readonly like?: number;
  readonly data: string;
}

export interface StoredArray {
  readonly shape: readonly number[];
  readonly data: string;
}

export interface StoredSolid {
  readonly name: string;
  readonly medium: number;
  readonly center?: Vec3;
  readonly radius?: number;
  readonly corners?: StoredArray;
  readonly triangles?: readonly number[];
}

export interface StoredProbe {
  readonly name: string;
  readonly path: string;
  readonly width: number;
  readonly height: number;
  readonly step: number;
  readonly errorStep: number;
  readonly media: readonly { readonly name: string; readonly ior: number }[];
  readonly solids: readonly StoredSolid[];
  readonly planes: readonly { origin: Vec3; x: Vec3; y: Vec3; size: readonly [number, number] }[];
  readonly vertices: StoredArray;
  readonly thetaI: StoredArray;
  readonly thetaT: StoredArray;
  readonly status: StoredArray;
  readonly weight: StoredArray;
  readonly renderers: readonly {
    readonly name: string;
    readonly method: string;
    readonly error: StoredArray;
    readonly shift: StoredArray;
    readonly turn: StoredArray;
  }[];
}

/** The ways of a picture's rays: like a probe's, but each ray has a path of its own. */
export interface StoredWays extends StoredProbe {
  readonly nm: number | null; // the wavelength whose indices they have seen, where that matters
  readonly events: StoredArray; // 0 transmitted, 1 totally reflected, 2 reflected by a mirror
}

/** A renderer whose rays are not known, and why. */
export interface Silent {
  readonly name: string;
  readonly reason: string;
}

export interface StoredPack {
  readonly schema: string;
  readonly case: string;
  readonly images: readonly StoredImage[];
  readonly probes: readonly StoredProbe[];
  readonly ways?: { readonly rays: readonly StoredWays[]; readonly silent: readonly Silent[] };
}

export type Vec3 = readonly [number, number, number];

/** Linear radiance, three planes one after the other. */
export interface Image {
  readonly name: string;
  readonly role: string;
  readonly width: number;
  readonly height: number;
  readonly planes: Float32Array;
}

export const SCHEMA = "snellcheck-pack/1";

async function inflate(data: string): Promise<Uint8Array> {
  const text = atob(data);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function words(data: string): Promise<Uint32Array> {
  const shuffled = await inflate(data);
  const count = shuffled.length / 4;
  const found = new Uint32Array(count);
  for (let k = 0; k < count; k++) {
    found[k] =
      (shuffled[k] ?? 0) |
      ((shuffled[k + count] ?? 0) << 8) |
      ((shuffled[k + 2 * count] ?? 0) << 16) |
      ((shuffled[k + 3 * count] ?? 0) << 24);
  }
  return found;
}

export async function floats(stored: StoredArray): Promise<Float32Array> {
  return new Float32Array((await words(stored.data)).buffer);
}

export async function decodeImages(pack: StoredPack): Promise<Image[]> {
  const bits = await Promise.all(pack.images.map((image) => words(image.data)));
  return pack.images.map((image, index) => {
    const own = bits[index] as Uint32Array;
    const other = image.like === undefined ? undefined : bits[image.like];
    // Only images that stand for themselves are ever differed from, so `other` is whole.
    if (other) for (let k = 0; k < own.length; k++) own[k] = (own[k] ?? 0) ^ (other[k] ?? 0);
    const { name, role, width, height } = image;
    return { name, role, width, height, planes: new Float32Array(own.buffer) };
  });
}
