// What a page and its worker say to each other.
import type { Explained, Pass, Problem, Query, SceneFiles, Wanted } from "./types.js";

export type ToWorker =
  | { type: "load"; wasm: ArrayBuffer | WebAssembly.Module }
  | { type: "open"; id: number; files: SceneFiles; name: string; wanted: Wanted }
  | { type: "stop" }
  | { type: "look"; id: number; files: SceneFiles; name: string; wanted: Wanted; explain: Explained }
  | { type: "aim"; id: number; files: SceneFiles; name: string; list: Uint8Array | string; query: Query }
  | { type: "explain"; id: number; wanted: Explained }
  | { type: "cast"; id: number; list: Uint8Array | string; query: Query }
  | { type: "math"; id: number; text: string; lang: "en" | "es"; json: boolean };

export type FromWorker =
  | { type: "opened"; id: number; width: number; height: number; warnings: string[] }
  | { type: "pass"; id: number; pass: Pass; pixels: ArrayBuffer }
  | { type: "answer"; id: number; text: string }
  | { type: "problem"; id: number; problem: Problem };
