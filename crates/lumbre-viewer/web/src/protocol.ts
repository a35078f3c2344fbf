// What the viewer and the page say to each other.
import type { Vector } from "./vectors";

export interface Placement { eye: Vector; target: Vector; up: Vector }

export interface Parameter {
  path: string; owner: string; name: string; kind: "number" | "colour" | "light" | "point" | "factor";
  value: number[] | null; low: number | null; high: number | null;
}

export interface Scene {
  cameras: { name: string; kind: string; mirrored: boolean; fov: number | null }[];
  up: Vector;
  bounds: [Vector, Vector] | null;
  shapes: Record<string, number>;
  materials: Record<string, number>;
  lights: Record<string, number>;
  /** An infinite plane below everything. */
  ground: { point: Vector; normal: Vector } | null;
  tree: { groups: { name: string | null; shapes: Thing[] }[]; left_out: number };
  triangles: number; instances: number; memory: number; build_seconds: number;
  animations: { name: string | null; end: number | null }[];
  variants: string[];
  parameters: Parameter[];
  /** Those in which pixels are explained: their codes and their own names. */
  languages: [string, string][];
  warnings: string[];
}

export interface State {
  name: string; has_scene: boolean; error: string | null; edit_error: string | null;
  camera: number; sequence: number; moved: boolean; placement: Placement | null; fov: number | null; zoom: number;
  size: [number, number] | null;
  channel: string; scale: number; spp: number | null; noise: number | null; denoise: boolean | null; paused: boolean;
  exposure: number | null; tone_map: string | null; false_colour: boolean;
  map: "automatic" | "grey" | "rainbow" | "viridis"; range: [number, number] | null;
  hidden: Hidden; section: { point: Vector; normal: Vector } | null;
  time: number | null; variant: string | null; settings: [string, string][];
}

export interface Progress {
  doing: "reading" | "building" | "rendering" | "done" | "waiting" | "nothing";
  spp?: number; target?: number; noise?: number | null; rays_per_second?: number; seconds?: number; dropped?: number;
  /** How much of the way to the end is gone, in [0, 1], and the seconds that are left; `null` where it is not known yet. */
  share?: number; left?: number | null;
  noise_target?: number | null;
}

/** A shape of the file, or the ground; `owner` is that of the parameters of its material. */
export interface Thing {
  shape: number; kind: string; name: string | null; material: string | null; owner: string | null; shines: boolean;
}

/** Shapes that are not in the picture; with `others` all but these. */
export interface Hidden { shapes: number[]; others: boolean }

/** Where a ray meets it; a page at rest knows no more than how far away. */
export interface Hit extends Thing {
  distance: number;
  point?: Vector; normal?: Vector; uv?: [number, number]; front?: boolean; primitive?: number; instance?: number | null;
}

export type Value = number | string;

export type Message =
  | ({ type: "state" } & State)
  | { type: "scene"; scene: Scene }
  | ({ type: "progress" } & Progress)
  | { type: "picked"; request: number; x: number; y: number; ray: { origin?: Vector; direction?: Vector; hits: Hit[] } }
  | { type: "values"; request: number; x: number; y: number; width: number; height: number; values: [Value, Value, Value][] }
  | { type: "ticket"; request: number; address: string }
  | { type: "wrong"; what: string };

/** A picture with its size, that of the whole one, and what it shows. */
export interface Frame {
  width: number; height: number; fullWidth: number; fullHeight: number;
  spp: number; sequence: number; isFull: boolean; isDone: boolean; isDenoised: boolean;
  /** The numbers at both ends of the colours of its scale; 0 where there is none. */
  low: number; high: number; pixels: ImageData;
}

const HEADER = 40;
const MAGIC = 0x324d554c;

/** The frame of a packet. */
export function decoded(packet: ArrayBuffer): Frame {
  const numbers = new Uint32Array(packet, 0, HEADER / 4);
  const [magic = 0, width = 0, height = 0, fullWidth = 0, fullHeight = 0, spp = 0, sequence = 0, flags = 0] = numbers;
  if (magic !== MAGIC || packet.byteLength !== HEADER + 4 * width * height) throw new Error("no frame");
  const pixels = new ImageData(new Uint8ClampedArray(packet, HEADER), width, height);
  const [low = 0, high = 0] = new Float32Array(packet, 32, 2);
  const [isFull, isDone, isDenoised] = [1, 2, 4].map((bit) => (flags & bit) !== 0) as [boolean, boolean, boolean];
  return { width, height, fullWidth, fullHeight, spp, sequence, isFull, isDone, isDenoised, low, high, pixels };
}
