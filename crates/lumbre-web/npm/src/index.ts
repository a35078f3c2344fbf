/** Lumbre, an exact and reproducible ray tracer, as WebAssembly. */
export * from "./types.js";
export { Lumbre, Scene } from "./core.js";
export { type Opened, type Parts, Renderer } from "./renderer.js";
