// What a page and its worker say to each other.
import type { Explained, Pass, Problem, Query, SceneFiles, Wanted } from "./types.js";

/** What a worker says of a scene that it opened. */
export interface Opening {
  width: number;
  height: number;
  /** What is rendered of the picture: the first column and row, and those beyond the last. */
  bounds: [number, number, number, number];
  warnings: string[];
  /** Whether workers may share the picture. */
  isDivisible: boolean;
}

export type ToWorker =
  | { type: "load"; wasm: ArrayBuffer | WebAssembly.Module }
  | { type: "open"; id: number; files: SceneFiles; name: string; wanted: Wanted; share: Share }
  /** Render the whole picture of the scene that this number opened, and not a share of it. */
  | { type: "alone"; id: number }
  | { type: "stop" }
  | { type: "look"; id: number; files: SceneFiles; name: string; wanted: Wanted; explain: Explained }
  | { type: "aim"; id: number; files: SceneFiles; name: string; list: Uint8Array | string; query: Query }
  | { type: "explain"; id: number; wanted: Explained }
  | { type: "cast"; id: number; list: Uint8Array | string; query: Query }
  | { type: "math"; id: number; text: string; lang: "en" | "es"; json: boolean };

/** Which of how many bands of rows a worker renders. */
export interface Share {
  index: number;
  of: number;
}

export type FromWorker =
  | ({ type: "opened"; id: number } & Opening)
  | { type: "pass"; id: number; pass: Pass; pixels: ArrayBuffer }
  | { type: "answer"; id: number; text: string }
  | { type: "problem"; id: number; problem: Problem };
