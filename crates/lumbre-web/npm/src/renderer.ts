// Lumbre in a worker, from the page's side.
import type { FromWorker, ToWorker } from "./protocol.js";
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
  /** Takes each picture: the bytes of its pixels, as `ImageData` has them. */
  onPass?: (pass: Pass, pixels: Uint8ClampedArray<ArrayBuffer>) => void;
  /** Takes what goes wrong while a scene that was opened is rendered. */
  onProblem?: (problem: LumbreError) => void;
}

type Message = ToWorker extends infer M ? (M extends { id: number } ? Omit<M, "id"> : never) : never;

/** Renders in a worker, and answers while it does. */
export class Renderer {
  #parts: Parts;
  #worker: Worker | undefined;
  #id = 0;
  #shown = 0;
  #waiting = new Map<number, { done: (answer: never) => void; failed: (error: LumbreError) => void }>();

  constructor(parts: Parts) {
    this.#parts = parts;
  }

  /** Opens a scene and begins to render it. The scene before stays if this one cannot be opened. */
  open(files: SceneFiles, name: string, wanted: Wanted = {}): Promise<Opened> {
    return this.#ask({ type: "open", files, name, wanted });
  }

  /** Stops rendering; the picture stays as it is. */
  stop(): void {
    this.#worker?.postMessage({ type: "stop" } satisfies ToWorker);
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

  /** Ends the worker. */
  close(): void {
    this.#worker?.terminate();
    this.#worker = undefined;
    this.#fail("the renderer was closed");
  }

  #ask<T>(message: Message): Promise<T> {
    const worker = (this.#worker ??= this.#start());
    const id = ++this.#id;
    return new Promise<T>((done, failed) => {
      this.#waiting.set(id, { done: done as (answer: never) => void, failed });
      worker.postMessage({ ...message, id } as ToWorker);
    });
  }

  #start(): Worker {
    const worker = this.#parts.worker();
    worker.postMessage({ type: "load", wasm: this.#parts.wasm } satisfies ToWorker);
    worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.#take(data);
    worker.onerror = (event) => this.#end(event.message || "the worker cannot be started");
    return worker;
  }

  #take(data: FromWorker) {
    if (data.type === "pass") {
      if (data.id === this.#shown) this.#parts.onPass?.(data.pass, new Uint8ClampedArray(data.pixels));
      return;
    }
    const waiting = this.#waiting.get(data.id);
    this.#waiting.delete(data.id);
    if (data.type === "problem") {
      const error = new LumbreError(data.problem);
      if (waiting) waiting.failed(error);
      else this.#parts.onProblem?.(error);
      if (data.problem.kind === "crash") this.#end(data.problem.message);
    } else if (data.type === "opened") {
      this.#shown = data.id;
      waiting?.done({ width: data.width, height: data.height, warnings: data.warnings } as never);
    } else {
      waiting?.done(data.text as never);
    }
  }

  /** The next question starts another worker. */
  #end(why: string) {
    this.#worker?.terminate();
    this.#worker = undefined;
    this.#fail(why);
  }

  #fail(why: string) {
    for (const { failed } of this.#waiting.values()) failed(new LumbreError({ kind: "crash", message: why }));
    this.#waiting.clear();
  }
}
