// Lumbre as the book calls it: loaded when something is tried, one worker for what is asked and one for each picture.
import { Renderer } from "../src/renderer.js";
import { LumbreError, type Explained, type Pass, type Query, type Wanted } from "../src/types.js";
import { NotLoaded, module } from "../playground/loading.js";
import { Held } from "./files.js";
import { Failed, type Program, Unknown } from "./shell.js";
import { word } from "./words.js";

declare const WORKER: string;

/** What the parts of a page share. */
export class Engine {
  readonly held: Held;
  readonly playground: string;
  #module: Promise<WebAssembly.Module> | undefined;
  #asked: Promise<Renderer> | undefined;

  /** `root` is the folder of the book, with a slash at its end. */
  constructor(root: string) {
    this.held = new Held(`${root}live/`);
    this.playground = `${root}playground/`;
  }

  /** A worker that renders. */
  async renderer(onPass?: (pass: Pass, pixels: Uint8ClampedArray<ArrayBuffer>) => void, onProblem?: (problem: LumbreError) => void): Promise<Renderer> {
    const wasm = await (this.#module ??= module(this.playground));
    const worker = () => new Worker(URL.createObjectURL(new Blob([WORKER], { type: "text/javascript" })));
    return new Renderer({ wasm, worker, ...(onPass && { onPass }), ...(onProblem && { onProblem }) });
  }

  /** The worker that answers. */
  asked(): Promise<Renderer> {
    return (this.#asked ??= this.renderer());
  }

  /** What `lumbre explain` says of a scene of the book; `text` is in place of its own. */
  async explain(path: string, options: Record<string, unknown>, text?: string): Promise<string> {
    const { size, ...explain } = options;
    const wanted: Wanted = size ? { size: size as [number, number] } : {};
    const [asked, files] = await Promise.all([this.asked(), this.held.scene(path, text)]);
    if (!(path in files)) throw new Failed(word("no file", path));
    return asked.explainOf(files, path, wanted, explain as Explained);
  }

  /** The program of the examples. */
  readonly program: Program = {
    math: async (text, lang, json) => (await this.asked()).math(text, { lang: lang as "en" | "es", json }),
    explain: (path, options) => this.explain(path, options),
    cast: async (path, list, query) => {
      const [asked, files] = await Promise.all([this.asked(), this.held.scene(path)]);
      if (!(path in files)) throw new Failed(word("no file", path));
      return asked.castInto(files, path, list, query as Query);
    },
  };
}

/** What is wrong, as it is shown. */
export function said(error: unknown): string {
  if (error instanceof LumbreError) return `error: ${error.message}`;
  if (error instanceof Unknown) return word("unknown", error.message);
  if (error instanceof NotLoaded) return error.why === "script" ? word("no script") : word("no module", error.why);
  return error instanceof Error ? error.message : String(error);
}

type Child = Node | string;

/** An element with its properties, attributes where they are of ARIA, and children. */
export function make<K extends keyof HTMLElementTagNameMap>(name: K, properties: Record<string, unknown> = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key.includes("-") || key === "role") element.setAttribute(key, String(value));
    else (element as unknown as Record<string, unknown>)[key] = value;
  }
  element.append(...children);
  return element;
}

export function button(text: string, act: () => void, name = ""): HTMLButtonElement {
  const made = make("button", { type: "button", className: `live-button ${name}`, textContent: text });
  made.addEventListener("click", act);
  return made;
}

/** A function that works on the newest of what it is given, one at a time. */
export function latest<T>(work: (given: T) => Promise<void>): (given: T) => void {
  let [busy, waits] = [false, undefined as { given: T } | undefined];
  return (given) => {
    waits = { given };
    if (busy) return;
    busy = true;
    void (async () => {
      while (waits) {
        const next = waits;
        waits = undefined;
        await work(next.given);
      }
      busy = false;
    })();
  };
}
