/** Why something cannot be done. */
export interface Problem {
  /**
   * What was asked makes no sense (`usage`), a file is invalid (`input`) or missing (`files`), it would take more memory than there is
   * (`limit`), or the module stopped and is of no use any more (`crash`).
   */
  kind: "usage" | "input" | "files" | "limit" | "crash";
  /** What is wrong, with its place in front: what the program `lumbre` says. */
  message: string;
  /** The file at fault. */
  file?: string;
  /** The line in it, from 1. */
  line?: number;
  /** The column, from 1, in characters. */
  column?: number;
}

/** What this package throws. */
export class LumbreError extends Error {
  readonly problem: Problem;
  constructor(problem: Problem) {
    super(problem.message);
    this.name = "LumbreError";
    this.problem = problem;
  }
}

/** The files of a scene, by relative paths. A scene reads no other file. */
export type SceneFiles = Record<string, Uint8Array | string>;

/** What a picture is to be, where not all of it is as the scene says. */
export interface Wanted {
  /** Width and height in pixels. */
  size?: [number, number];
  /** Samples per pixel. */
  spp?: number;
  /** The name of an integrator, such as `path`, `ao` or `normals`. */
  integrator?: string;
  /** The seed of the random numbers. */
  seed?: number;
}

/** How far a picture is. */
export interface Pass {
  /** Width and height in pixels. */
  size: [number, number];
  /** The part of it that is rendered: the first column and row, and those beyond the last. */
  bounds: [number, number, number, number];
  /** Samples of each pixel. */
  spp: number;
  /** Those that there will be. */
  target: number;
  /** Every so many pixels along a side has a sample: 1 where every pixel has. */
  stride: number;
  /** All samples taken so far. */
  samples: number;
  /** Whether it is the picture that the program makes, to the bit. */
  done: boolean;
}

/** What is asked of rays (`closest`, `any`, `all`, `count`) or of points. */
export type Query = "closest" | "any" | "all" | "count" | "closest-point" | "distance" | "inside" | "winding";

/** What is to be explained: the options of `lumbre explain`. */
export interface Explained {
  /** The pixel, from 0, 0 in the upper left corner. */
  pixel?: [number, number];
  /** A ray instead: origin and direction, six numbers; then, where it is not 0 to infinity, its range of t. */
  ray?: number[];
  format?: "text" | "markdown" | "html" | "json";
  lang?: "en" | "es";
  /** The crossings of so many of the rays that follow, too. */
  depth?: number;
  /** The number of the sample. */
  sample?: number;
  /** Only the surface that is seen. */
  nearest?: boolean;
  /** This shape, whether the ray meets it or not: its number, its kind, or the name of its material. */
  shape?: string;
  /** All shapes. */
  all_shapes?: boolean;
  /** Only the sections with these keys. */
  only?: string[];
}
