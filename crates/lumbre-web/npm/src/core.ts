// Lumbre on the thread that calls it.
import { glue, type Glue, type Scene as Inner } from "lumbre-glue";
import { type Explained, LumbreError, type Pass, type Problem, type Query, type SceneFiles, type Wanted } from "./types.js";

/** The module, ready for calls. */
export class Lumbre {
  #glue: Glue;
  #crashed = false;

  private constructor(ready: Glue) {
    this.#glue = ready;
  }

  /** Takes the bytes of `lumbre.wasm`, or the module that they were compiled to. */
  static async load(wasm: BufferSource | WebAssembly.Module): Promise<Lumbre> {
    const module = wasm instanceof WebAssembly.Module ? wasm : await WebAssembly.compile(wasm);
    const ready = glue();
    await ready({ module_or_path: module });
    return new Lumbre(ready);
  }

  /**
   * Opens the scene of this name among the files.
   * @throws {LumbreError} with the place of what is wrong.
   */
  open(files: SceneFiles, name: string, wanted: Wanted = {}): Scene {
    return this.call(() => {
      const held = new this.#glue.Files();
      for (const [path, file] of Object.entries(files)) held.add(path, bytes(file));
      return new Scene(this, new this.#glue.Scene(held, name, JSON.stringify(wanted)));
    });
  }

  /**
   * What `lumbre math` prints for an expression, or for several on lines.
   * @throws {LumbreError} with the place of what is wrong.
   */
  math(text: string, { lang = "en", json = false }: { lang?: "en" | "es"; json?: boolean } = {}): string {
    return this.call(() => this.#glue.calculate(text, lang, json));
  }

  /** @internal */
  call<T>(work: () => T): T {
    if (this.#crashed) throw new LumbreError({ kind: "crash", message: "the module stopped: load it again" });
    try {
      return work();
    } catch (error) {
      if (typeof error === "string") throw new LumbreError(JSON.parse(error) as Problem);
      if (!(error instanceof WebAssembly.RuntimeError)) throw error;
      this.#crashed = true;
      const said = this.#glue.lastPanic();
      throw new LumbreError({ kind: "crash", message: said || `the module stopped: ${error.message}` });
    }
  }
}

/** A scene that is open, and its picture as far as it is rendered. */
export class Scene {
  #lumbre: Lumbre;
  #inner: Inner;
  /** Width of the picture in pixels. */
  readonly width: number;
  /** Height of the picture in pixels. */
  readonly height: number;
  /** What is rendered of it, if no rows are chosen: the first column and row, and those beyond the last. */
  readonly bounds: [number, number, number, number];
  /** What reading warned of, a line each. */
  readonly warnings: string[];

  /** @internal */
  constructor(lumbre: Lumbre, inner: Inner) {
    this.#lumbre = lumbre;
    this.#inner = inner;
    this.width = inner.width;
    this.height = inner.height;
    this.bounds = [...inner.bounds] as [number, number, number, number];
    this.warnings = inner.warnings;
  }

  /** Whether rows may be rendered apart: not where the picture is denoised, which has to be whole. */
  get isDivisible(): boolean {
    return this.#inner.isDivisible;
  }

  /**
   * Renders these rows alone, the first and that beyond the last, so that several modules share a picture. What was rendered is given up.
   * @throws {LumbreError} where there are no such rows.
   */
  limitRows(from: number, to: number): void {
    this.#lumbre.call(() => this.#inner.limitRows(from, to));
  }

  /** Renders on for about so many milliseconds. The finished picture does not depend on how the time is cut. */
  step(milliseconds: number): Pass {
    return this.#lumbre.call(() => JSON.parse(this.#inner.step(milliseconds)) as Pass);
  }

  /** What is rendered of the picture, the `bounds` of a pass: red, green, blue (sRGB) and alpha of each pixel, row by row from the top. */
  pixels(): Uint8Array {
    return this.#lumbre.call(() => this.#inner.pixels());
  }

  /** The same in linear light: red, green and blue of each pixel, as a PFM of the program has them. */
  light(): Float32Array {
    return this.#lumbre.call(() => this.#inner.light());
  }

  /**
   * What rays hit, or what is at points: what `lumbre cast` prints.
   * @param list CSV with a header, such as `ox,oy,oz,dx,dy,dz`, or the bytes of a `.npy`.
   */
  cast(list: Uint8Array | string, query: Query = "closest"): string {
    return this.#lumbre.call(() => this.#inner.cast(bytes(list), query));
  }

  /** What `lumbre explain` says of a pixel or a ray. */
  explain(wanted: Explained): string {
    return this.#lumbre.call(() => this.#inner.explain(JSON.stringify(wanted)));
  }

  /** Gives its memory back. The scene is not to be used after it. */
  close(): void {
    this.#inner.free();
  }
}

function bytes(file: Uint8Array | string): Uint8Array {
  return typeof file === "string" ? new TextEncoder().encode(file) : file;
}
