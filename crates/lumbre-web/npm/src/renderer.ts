// Lumbre in workers, from the page's side: the first answers questions, and all share a picture.
import type { FromWorker, Opening } from "./protocol.js";
import { type Message, Thread } from "./thread.js";
import { type Explained, LumbreError, type Pass, type Query, type SceneFiles, type Wanted } from "./types.js";

/** A scene that was opened. */
export interface Opened {
  width: number;
  height: number;
  /** What reading warned of, a line each. */
  warnings: string[];
}

/** Where a renderer has its parts from. */
export interface Parts {
  /** The bytes of `lumbre.wasm`, or the module that they were compiled to. */
  wasm: ArrayBuffer | WebAssembly.Module;
  /** Makes a worker of `worker.js`. One that stopped is replaced by another. */
  worker: () => Worker;
  /** How many workers share a picture, at most: by default as many as the machine has threads, up to 8. The picture is the same. */
  threads?: number;
  /** Takes each picture: the pixels of its `bounds`, as `ImageData` has them. */
  onPass?: (pass: Pass, pixels: Uint8ClampedArray<ArrayBuffer>) => void;
  /** Takes what goes wrong while a scene that was opened is rendered. */
  onProblem?: (problem: LumbreError) => void;
}

const MOST_THREADS = 8;
/** Bytes of files that the workers may hold together: each reads the scene for itself. */
const HELD = 1 << 28;

/** A picture that several workers share: what each has rendered last. */
interface Picture {
  /** The number of the question that opened its scene. */
  id: number;
  bounds: Opening["bounds"];
  /** The pixels of the bounds. */
  pixels: Uint8ClampedArray;
  /** The last pass of each worker. */
  passes: (Pass | undefined)[];
}

/** Renders in workers, and answers while it does. */
export class Renderer {
  #parts: Parts;
  #main: Thread | undefined;
  #helpers: Thread[] = [];
  #picture: Picture | undefined;

  constructor(parts: Parts) {
    this.#parts = parts;
  }

  /** Opens a scene and begins to render it. The scene before stays if this one cannot be opened. */
  async open(files: SceneFiles, name: string, wanted: Wanted = {}): Promise<Opened> {
    const message = { type: "open", files, name, wanted } as const;
    const of = this.#threads(files);
    const { id, answer } = this.#answering().ask<Opening>({ ...message, share: { index: 0, of } });
    const { width, height, bounds, warnings, isDivisible } = await answer;
    this.#dismiss();
    const [x0, y0, x1, y1] = bounds;
    const shares = isDivisible ? Math.min(of, y1 - y0) : 1;
    const pixels = new Uint8ClampedArray(4 * (x1 - x0) * (y1 - y0));
    this.#picture = { id, bounds, pixels, passes: Array(shares).fill(undefined) };
    for (let index = 1; index < shares; index++) this.#help({ ...message, share: { index, of } }, this.#picture, index);
    return { width, height, warnings };
  }

  /** Stops rendering; the picture stays as it is. */
  stop(): void {
    this.#main?.tell({ type: "stop" });
    this.#dismiss();
  }

  /** What `lumbre explain` says of a pixel or a ray of the scene that is open. */
  explain(wanted: Explained): Promise<string> {
    return this.#ask({ type: "explain", wanted });
  }

  /** What `lumbre explain` says of a scene, which is opened for it and not rendered; its warnings come first. */
  explainOf(files: SceneFiles, name: string, wanted: Wanted, explain: Explained): Promise<string> {
    return this.#ask({ type: "look", files, name, wanted, explain });
  }

  /** What `lumbre cast` prints for a scene, which is opened for it and not rendered; its warnings come first. */
  castInto(files: SceneFiles, name: string, list: Uint8Array | string, query: Query = "closest"): Promise<string> {
    return this.#ask({ type: "aim", files, name, list, query });
  }

  /** What rays hit, or what is at points: what `lumbre cast` prints. */
  cast(list: Uint8Array | string, query: Query = "closest"): Promise<string> {
    return this.#ask({ type: "cast", list, query });
  }

  /** What `lumbre math` prints for an expression. */
  math(text: string, { lang = "en", json = false }: { lang?: "en" | "es"; json?: boolean } = {}): Promise<string> {
    return this.#ask({ type: "math", text, lang, json });
  }

  /** Ends the workers. */
  close(): void {
    this.#dismiss();
    this.#picture = undefined;
    this.#main?.end("the renderer was closed");
    this.#main = undefined;
  }

  /** How many workers may share the picture of a scene. */
  #threads(files: SceneFiles): number {
    const wanted = this.#parts.threads ?? Math.min(navigator.hardwareConcurrency ?? 1, MOST_THREADS);
    const held = Object.values(files).reduce((sum, file) => sum + file.length, 0);
    return Math.max(1, Math.min(wanted, Math.floor(HELD / Math.max(1, held))));
  }

  #ask(message: Message): Promise<string> {
    return this.#answering().ask<string>(message).answer;
  }

  /** The first worker; one that stopped is replaced. */
  #answering(): Thread {
    if (this.#main) return this.#main;
    const main = new Thread(this.#parts.worker(), this.#parts.wasm);
    main.onPass = (data) => this.#picture?.id === data.id && this.#take(this.#picture, 0, data);
    main.onProblem = (error) => this.#parts.onProblem?.(error);
    main.onCrash = () => {
      this.#dismiss();
      this.#picture = undefined;
      this.#main = undefined;
    };
    return (this.#main = main);
  }

  /** Has another worker render a share of a picture. Without it, the first renders all. */
  #help(message: Message, picture: Picture, index: number): void {
    const helper = new Thread(this.#parts.worker(), this.#parts.wasm);
    helper.onPass = (data) => this.#take(picture, index, data);
    const alone = () => {
      if (!this.#helpers.includes(helper)) return;
      this.#dismiss();
      picture.passes = [undefined];
      this.#main?.tell({ type: "alone", id: picture.id });
    };
    helper.onProblem = alone;
    helper.onCrash = alone;
    helper.ask<Opening>(message).answer.catch(alone);
    this.#helpers.push(helper);
  }

  /** Ends the workers that share a picture. */
  #dismiss(): void {
    const helpers = this.#helpers;
    this.#helpers = [];
    for (const helper of helpers) helper.end("the picture is rendered no longer");
  }

  /** Puts what a worker rendered into the picture. */
  #take(picture: Picture, index: number, { pass, pixels }: FromWorker & { type: "pass" }): void {
    if (picture !== this.#picture) return;
    const isWhole = pass.bounds.every((side, i) => side === picture.bounds[i]);
    const isShared = picture.passes.length > 1;
    // What comes late: a share of a picture that is shared no longer, or a coarse picture where others have finer shares.
    if (isShared ? isWhole && picture.passes.some((pass, i) => pass && i !== index) : !isWhole) return;
    const [x0, y0, x1] = picture.bounds;
    picture.pixels.set(new Uint8ClampedArray(pixels), 4 * (x1 - x0) * (pass.bounds[1] - y0));
    // The first worker begins with the whole picture, and may be done with it.
    if (isWhole && pass.done) {
      this.#dismiss();
      picture.passes = [pass];
    } else picture.passes[index] = pass;
    const known = picture.passes.filter((pass) => pass !== undefined);
    const isComplete = known.length === picture.passes.length;
    const combined: Pass = {
      size: pass.size,
      bounds: picture.bounds,
      spp: isComplete ? Math.min(...known.map((pass) => pass.spp)) : 0,
      target: pass.target,
      stride: Math.max(...known.map((pass) => pass.stride)),
      samples: known.reduce((sum, pass) => sum + pass.samples, 0),
      done: isComplete && known.every((pass) => pass.done),
    };
    if (combined.done) this.#dismiss();
    this.#parts.onPass?.(combined, picture.pixels.slice());
  }
}
